// Cards of solutions, several to a page: statuses, the body or bars of forces and displacements, values by nodes.
const PARTS = tangents === 1 ? ["n", "t"] : ["n", "t1", "t2"];
const PART_COLOURS = ["#1f5fa8", "#d9730d", "#2a9aa0"];
const nodesOnly = data.body !== null && data.body.triangles === null;

// what the body does, and what its nodes do
function stance(codes) {
  const counts = data.statuses.map((name, code) => [name, [...codes].filter((other) => Number(other) === code).length]).filter(([, count]) => count);
  const has = (name) => counts.some(([other]) => other === name), word = has("stick") ? "held" : counts.every(([name]) => name === "open") ? "free" : "sliding";
  return p === 1 || word === "free" ? word : `${word} (${counts.map(([name, count]) => `${count} ${name}`).join(", ")})`;
}

// no two cards have the same title
function entitle(items) {
  for (const item of items) item.title = item.statuses ? `${item.name}: ${stance(item.statuses)}` : item.name;
  const titles = items.map((item) => item.title);
  items.forEach((item, k) => { if (titles.indexOf(titles[k]) !== titles.lastIndexOf(titles[k])) item.title += `, ${item.words.split(",")[0]}`; });
}

function card(item, scales) {
  const made = element("article", { className: "card", id: item.id ?? "" }), heading = element("h3", {}, item.title);
  made.append(heading, element("p", {}, item.words));
  if (item.colour) {
    const dot = element("span", { className: "dot" });
    dot.style.background = item.colour;
    heading.prepend(dot);
  }
  if (!item.f) return made;
  made.append(element("p", {}, runs(item.statuses)));
  if (item.several.length) made.append(element("p", {}, `several statuses hold at: ${item.several.map((k) => data.nodes[k]).join(", ")}`));
  if (data.body && item.u) {
    heading.append(enlarge(item, made, () => scenes.forEach((scene) => Plotly.Plots.resize(scene))));
    made.append(solid ? sceneOf(item) : bodyFigure(item, scales));
    if (solid && !nodesOnly) made.append(element("div", { className: "small" }, enlargementOf(item, drawScenes)));
  }
  if (!data.body || nodesOnly) made.append(drawBars(item, scales));
  if (tangents === 1) made.append(strip(item));
  const details = element("details", {}, element("summary", {}, "values by nodes"));
  details.addEventListener("toggle", () => { if (details.childElementCount < 2) details.append(values(item)); });
  made.append(details);
  return made;
}

function values(item) {
  const names = (name) => PARTS.map((part) => `${name}_${part}`);
  const heads = ["node", "status", ...names("lambda"), ...names("u"), ...(item.angles ? ["angle of F u_t"] : [])];
  const parts = (v, k) => PARTS.map((_, j) => short(v[j * p + k]));
  const rows = data.nodes.map((label, k) => [
    label, status(item.statuses, k), ...parts(item.f, k), ...parts(item.w, k),
    ...(item.angles ? [angle(item.angles[k])] : []),
  ]);
  return table(`Contact nodes, ${item.name}`, heads, rows);
}

function angle(bounds) {
  if (bounds === null) return "";
  const ends = bounds.map((x) => short(Number(x.toPrecision(6))));
  return ends[0] === ends[1] ? ends[0] : `${ends[0]} to ${ends[1]}`;
}

// -- what pictures are measured by ------------------------------------------------------------------------------------

// the largest nodal force, component of a contact force and component of a displacement of all solutions
function scalesOf(items, alpha) {
  const largest = (key) => Math.max(1e-300, ...items.flatMap((item) => item[key].map(Math.abs)));
  const pressed = items.flatMap((item) => (item.forces ?? []).map(([, ...force]) => Math.hypot(...force)));
  return { force: pressed.reduce((most, x) => Math.max(most, x), 0), f: largest("f"), w: largest("w"), alpha, bodies: items.some((item) => item.u) };
}

function scaleWords(scales) {
  const said = [];
  if (scales.force > 0) said.push(`Arrows are contact forces on the body; the longest is ${short(scales.force)}${unit("force")}.`);
  if (solid && scales.bodies) said.push("Drag a body to turn it; all turn with it.");
  if (data.no_body) said.push(`${data.no_body}.`);
  if (!data.body || nodesOnly) {
    const order = tangents === 1 ? "left of a node normal, right tangential" : "of a node from left to right normal and along both tangents";
    said.push(`Upper bars are forces (largest ${short(scales.f)}${unit("force")}), lower bars displacements (largest ${short(scales.w)}${unit("length")}); ${order}.`);
  }
  return said.join(" ");
}

// -- where there is no body: forces and displacements of the nodes ------------------------------------------------------

function drawBars(item, scales) {
  const step = Math.max(8, 280 / p), width = step * p, half = 55, height = 4 * half + 34, slot = 0.76 / PARTS.length;
  const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", class: "bars", "aria-label": `forces and displacements of the contact nodes, statuses ${runs(item.statuses)}` });
  [["f", "lambda", half + 4], ["w", "u", 3 * half + 26]].forEach(([key, name, zero]) => {
    picture.append(svg("line", { x1: 0, x2: width, y1: zero, y2: zero, class: "axis" }));
    item[key].forEach((value, k) => {
      const part = Math.floor(k / p), node = k % p, size = (half - 3) * Math.abs(value) / scales[key];
      picture.append(svg("rect", {
        x: step * (node + 0.14 + slot * part), width: (slot - 0.04) * step, y: value > 0 ? zero - size : zero, height: size, fill: PART_COLOURS[part],
      }, tip(`node ${data.nodes[node]}: ${name}_${PARTS[part]} ${short(value)}`)));
    });
  });
  for (let k = 0; k < p; k += 1) {
    const name = status(item.statuses, k);
    picture.append(marker(name, step * (k + 0.5), 2 * half + 15, Math.min(5, 0.4 * step), `node ${data.nodes[k]}: ${name}`));
  }
  return picture;
}

// -- pages of cards -----------------------------------------------------------------------------------------------------

// the cards of the page of items that is shown, with what all items are measured by
function showCards(items, scales) {
  const last = Math.max(0, Math.ceil(items.length / CARDS) - 1);
  state.page = Math.min(Math.max(state.page, 0), last);
  const first = state.page * CARDS, shown = items.slice(first, first + CARDS);
  byId("pages").hidden = last === 0;
  byId("range").textContent = `${first + 1} to ${first + shown.length} of ${items.length}`;
  byId("fewer").disabled = state.page === 0;
  byId("more").disabled = state.page === last;
  entitle(items);
  const make = () => byId("cards").replaceChildren(...shown.map((item) => card(item, scales)));
  if (solid) newScenes(items.filter((item) => item.u), scales, make);
  else make();
}

function pageButtons(redraw) {
  byId("fewer").addEventListener("click", () => { state.page -= 1; redraw(); });
  byId("more").addEventListener("click", () => { state.page += 1; redraw(); });
}
