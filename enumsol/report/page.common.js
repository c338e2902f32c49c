// Texts of the problem (names, labels) reach the page by textContent, and Plotly with "<" and "&" escaped.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const p = data.nodes.length, { tangents } = data;
const COLOURS = { open: "#ffffff", stick: "#1f5fa8", "slip+": "#d9730d", "slip-": "#2a8a4a", slip: "#c23b4b" };

const safe = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const short = (x) => {
  if (x === null || x === undefined) return "?";
  const near = Number(x.toPrecision(6));
  // 1.53e-6, as in the tables, not 0.00000153
  return (near !== 0 && Math.abs(near) < 1e-4 ? near.toExponential() : near.toString()).replace(/-/g, "\u2212");
};
const signed = (k) => (k === null ? "unknown" : k > 0 ? `+${k}` : String(k).replace("-", "\u2212"));
// of node k among n, in 3D the length of a vector
const tangentialOf = (v, k, n = p) => (tangents === 1 ? v[n + k] : Math.hypot(v[n + k], v[2 * n + k]));
const status = (codes, k) => data.statuses[Number(codes[k])];

function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made) made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

// -- texts and tables ---------------------------------------------------------------------------------------------

function runs(codes) {
  const parts = [];
  for (let k = 0, start = 0; k < p; k += 1) {
    if (k + 1 < p && codes[k + 1] === codes[k]) continue;
    parts.push(p > 1 ? `${k + 1 - start} ${status(codes, k)}` : status(codes, k));
    start = k + 1;
  }
  return parts.length > 12 ? `${parts.slice(0, 12).join(", ")}, \u2026` : parts.join(", ");
}

function table(caption, heads, rows) {
  const head = heads.map((name) => element("th", { scope: "col" }, name));
  const line = ([first, ...cells]) => element("tr", {}, element("th", { scope: "row" }, String(first)), ...cells.map((cell) => element("td", {}, String(cell))));
  return element("div", { className: "scroll", tabIndex: 0, role: "region", "aria-label": caption }, element("table", {},
    element("caption", {}, caption), element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows.map(line))));
}

// -- pictures -----------------------------------------------------------------------------------------------------

function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const tip = (text) => { const made = svg("title"); made.textContent = text; return made; };

function marker(name, x, y, size, text) {
  const place = { "stroke-width": size / 6, style: `transform-origin: ${x}px ${y}px` };
  const look = name === "open" ? { class: "stands stands-open", ...place } : { fill: COLOURS[name], class: "stands", ...place };
  const h = size, corner = (...points) => svg("polygon", { ...look, points: points.map(([a, b]) => `${x + a * h},${y + b * h}`).join(" ") }, tip(text));
  if (name === "open") return svg("circle", { ...look, cx: x, cy: y, r: 0.85 * h }, tip(text));
  if (name === "stick") return corner([-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]);
  if (name === "slip") return corner([0, -1.1], [1.1, 0], [0, 1.1], [-1.1, 0]);
  return name === "slip+" ? corner([0, -1.1], [1, 0.8], [-1, 0.8]) : corner([0, 1.1], [1, -0.8], [-1, -0.8]);
}

// -- start --------------------------------------------------------------------------------------------------------

async function load(start) {
  const bytes = Uint8Array.from(atob(byId("plotly").textContent), (c) => c.charCodeAt(0));
  const text = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.head.append(element("script", { textContent: text }));
  start();
}

function failed(error) {
  byId("failed").hidden = false;
  byId("failed").textContent = `The pictures cannot be drawn by this browser (${error.message}); the tables below are complete.`;
  console.error(error);
}
