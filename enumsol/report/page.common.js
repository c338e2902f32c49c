"use strict";
// Texts of the problem (names, labels) reach the page by textContent, and Plotly with "<" and "&" escaped.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const p = data.nodes.length;
const GREY = "#333333", FORCE = "#b3202c";
const COLOURS = { open: "#ffffff", stick: "#1f5fa8", "slip+": "#d9730d", "slip-": "#2a8a4a", slip: "#c23b4b" };

const safe = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const short = (x) => (x === null || x === undefined ? "?" : Number(x.toPrecision(6)).toString().replace("-", "\u2212"));
const signed = (k) => (k === null ? "unknown" : k > 0 ? `+${k}` : String(k).replace("-", "\u2212"));
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

function table(heads, rows) {
  const line = (kind, cells) => element("tr", {}, ...cells.map((cell) => element(kind, {}, String(cell))));
  return element("div", { className: "scroll" }, element("table", {},
    element("thead", {}, line("th", heads)), element("tbody", {}, ...rows.map((row) => line("td", row)))));
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
  const look = { fill: COLOURS[name], stroke: "#111", "stroke-width": size / 6 };
  const h = size, corner = (...points) => svg("polygon", { ...look, points: points.map(([a, b]) => `${x + a * h},${y + b * h}`).join(" ") }, tip(text));
  if (name === "open") return svg("circle", { ...look, cx: x, cy: y, r: 0.85 * h }, tip(text));
  if (name === "stick") return corner([-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]);
  if (name === "slip") return corner([0, -1.1], [1.1, 0], [0, 1.1], [-1.1, 0]);
  return name === "slip+" ? corner([0, -1.1], [1, 0.8], [-1, 0.8]) : corner([0, 1.1], [1, -0.8], [-1, -0.8]);
}

function drawBody(item, { scale, arrow, least }) {
  const { points, cells, lines, size, rows } = data.body;
  const at = points.map(([x, y], k) => [x + scale * item.u[2 * k], -(y + scale * item.u[2 * k + 1])]);
  const bounds = (k, pick) => pick(...points.map((point) => (k ? -point[1] : point[0])));
  const room = 0.2 * size, x0 = bounds(0, Math.min) - room, y0 = bounds(1, Math.min) - room;
  const width = bounds(0, Math.max) + room - x0, height = bounds(1, Math.max) + room - y0, stroke = size / 250;
  const round = (x) => Number(x.toPrecision(6));
  const path = (groups, close) => groups.map((nodes) => `M${nodes.map((k) => `${round(at[k][0])} ${round(at[k][1])}`).join("L")}${close}`).join("");
  const picture = svg("svg", { viewBox: `${x0} ${y0} ${width} ${height}`, role: "img", class: "body" });
  const before = (groups, close) => groups.map((nodes) => `M${nodes.map((k) => `${points[k][0]} ${-points[k][1]}`).join("L")}${close}`).join("");
  picture.append(svg("path", { d: cells ? before(cells, "Z") : before(lines, ""), stroke: "#dcdcdc", "stroke-width": stroke, fill: "none" }));
  const look = { stroke: "#8796a8", "stroke-width": stroke, fill: cells ? "#dfe6ee" : "none" };
  picture.append(svg("path", { ...look, d: cells ? path(cells, "Z") : path(lines, "") }));
  for (const [node, [fx, fy]] of item.forces) {
    const length = Math.hypot(fx, fy);
    if (length <= least) continue;
    const [x, y] = at[node], dx = arrow * fx, dy = -arrow * fy, head = Math.min(0.03 * size, 0.5 * Math.hypot(dx, dy)), n = Math.hypot(dx, dy);
    const ux = dx / n, uy = dy / n, tipped = [[0, 0], [-ux - 0.4 * uy, -uy + 0.4 * ux], [-ux + 0.4 * uy, -uy - 0.4 * ux]];
    picture.append(
      svg("line", { x1: x - dx, y1: y - dy, x2: x - 0.8 * head * ux, y2: y - 0.8 * head * uy, stroke: FORCE, "stroke-width": 2.2 * stroke }),
      svg("polygon", { fill: FORCE, class: "arrow", points: tipped.map(([a, b]) => `${x + head * a},${y + head * b}`).join(" ") }, tip(`force ${short(length)}`)),
    );
  }
  rows.forEach((row, k) => {
    const [x, y] = row.reduce(([a, b], [node, weight]) => [a + weight * at[node][0], b + weight * at[node][1]], [0, 0]);
    const name = status(item.statuses, k);
    picture.append(marker(name, x, y, 0.016 * size, `node ${data.nodes[k]}: ${name}, lambda_n ${short(item.f[k])}, lambda_t ${short(item.f[p + k])}`));
  });
  return picture;
}

function drawBars(item, scales) {
  const step = Math.max(8, 280 / p), width = step * p, half = 55, height = 4 * half + 34;
  const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", class: "bars" });
  [["f", half + 4], ["w", 3 * half + 26]].forEach(([key, zero]) => {
    picture.append(svg("line", { x1: 0, x2: width, y1: zero, y2: zero, stroke: "#8796a8", "stroke-width": 0.7 }));
    for (let k = 0; k < 2 * p; k += 1) {
      const tangential = k >= p, node = k % p, value = item[key][k], size = (half - 3) * Math.abs(value) / scales[key];
      const name = `${key === "f" ? "lambda" : "u"}_${tangential ? "t" : "n"}`;
      picture.append(svg("rect", {
        x: step * (node + (tangential ? 0.52 : 0.14)), width: 0.34 * step, y: value > 0 ? zero - size : zero, height: size,
        fill: tangential ? "#d9730d" : "#1f5fa8",
      }, tip(`node ${data.nodes[node]}: ${name} ${short(value)}`)));
    }
  });
  for (let k = 0; k < p; k += 1) {
    const name = status(item.statuses, k);
    picture.append(marker(name, step * (k + 0.5), 2 * half + 15, Math.min(5, 0.4 * step), `node ${data.nodes[k]}: ${name}`));
  }
  return picture;
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
