"use strict";
// Texts of the problem (names, labels) reach the page by textContent, and Plotly with "<" and "&" escaped.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const p = data.nodes.length;
const GREY = "#333333", FORCE = "#b3202c";
const COLOURS = { open: "#ffffff", stick: "#1f5fa8", "slip+": "#d9730d", "slip-": "#2a8a4a" };
const STATUS_DASH = { open: "solid", stick: "dash", "slip+": "dashdot", "slip-": "dot" };
const SYMBOLS = {
  transition: ["circle-open", "transition"], fold: ["square-open", "fold"], bifurcation: ["diamond-open", "bifurcation"],
  touch: ["triangle-down-open", "status met and left again"], point: ["x-thin-open", "single point"],
  family: ["line-ns-open", "continuum"], broken: ["x", "arc ends, something is missing"],
  unsettled: ["y-right-open", "not followed further"],
};
const CARDS = 12;
const arcs = new Map(data.arcs.map((arc) => [arc.number, arc]));
const branches = new Map(data.branches.map((branch) => [branch.number, branch]));
const state = { quantity: data.quantities[0], node: 0, branch: null, alpha: data.slider[0], page: 0 };
let plotted = null;

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

// -- quantities ---------------------------------------------------------------------------------------------------

function valueOf(f, w) {
  const item = state.quantity, tangential = item.name.endsWith("_t") ? p : 0;
  if (item.name === "norm") return Math.sqrt(f.reduce((sum, x) => sum + x * x, 0));
  const part = item.dimension === "length" ? w : f;
  if (item.by_node) return part[tangential + state.node];
  return part.slice(tangential, tangential + p).reduce((sum, x) => sum + x, 0);
}

function columnOf() {
  // the order in which the arcs that coincide were compared
  let column = 0;
  for (const item of data.quantities) {
    if (item.name === state.quantity.name) return String(column + (item.by_node ? state.node : 0));
    column += item.by_node ? p : 1;
  }
  return null;
}

function axisName() {
  const item = state.quantity;
  const unit = data.units ? ` [${data.units[item.dimension === "force" ? 0 : 1]}]` : "";
  return safe((item.by_node ? `${item.words} of node ${data.nodes[state.node]}` : item.words) + unit);
}

function runs(codes) {
  const parts = [];
  for (let k = 0, start = 0; k < p; k += 1) {
    if (k + 1 < p && codes[k + 1] === codes[k]) continue;
    parts.push(p > 1 ? `${k + 1 - start} ${status(codes, k)}` : status(codes, k));
    start = k + 1;
  }
  return parts.length > 12 ? `${parts.slice(0, 12).join(", ")}, \u2026` : parts.join(", ");
}

// -- the diagram --------------------------------------------------------------------------------------------------

function arcTrace(arc) {
  const values = arc.a.map((_, k) => valueOf(arc.f[k], arc.w[k]));
  const dash = state.quantity.by_node
    ? STATUS_DASH[status(arc.statuses, state.node)]
    : arc.index === 1 ? "solid" : arc.index === -1 ? "dash" : "dot";
  const chosen = state.branch === null || state.branch === arc.branch;
  const head = `branch ${arc.branch}, arc ${arc.number}, index ${signed(arc.index)}`;
  return {
    x: arc.a, y: values, customdata: values, mode: "lines", type: "scatter", meta: arc.number, showlegend: false,
    line: { color: branches.get(arc.branch).colour, dash, width: chosen && state.branch !== null ? 3 : 2 },
    opacity: chosen ? 1 : 0.2,
    hovertemplate: `${head}<br>alpha %{x:.8g}<br>${axisName()} %{customdata:.6g}<br>${runs(arc.statuses)}<extra></extra>`,
  };
}

function vertexTraces() {
  const kinds = new Map();
  for (const v of data.vertices) {
    if (v.kind === "end" || !(v.kind in SYMBOLS)) continue;
    if (!kinds.has(v.kind)) kinds.set(v.kind, []);
    kinds.get(v.kind).push(v);
  }
  const traces = [...kinds].map(([kind, found]) => ({
    x: found.map((v) => v.alpha), y: found.map((v) => valueOf(v.f, v.w)), mode: "markers", type: "scatter",
    marker: { symbol: SYMBOLS[kind][0], size: 8, color: GREY, line: { width: 1.5, color: GREY } },
    name: SYMBOLS[kind][1], hovertemplate: `${SYMBOLS[kind][1]}<br>alpha %{x:.12g}<br>${axisName()} %{y:.6g}<extra></extra>`,
  }));
  for (const v of data.vertices) {
    if (v.family === null) continue;
    const values = v.family.f.map((f, k) => valueOf(f, v.family.w[k]));
    traces.push({
      x: [v.alpha, v.alpha], y: [Math.min(...values), Math.max(...values)], mode: "lines", type: "scatter",
      line: { color: GREY, width: 4 }, showlegend: false,
      hovertemplate: `continuum, dimension ${v.family.dimension}<br>alpha %{x:.12g}<extra></extra>`,
    });
  }
  return traces;
}

function stepTraces() {
  const { alphas, at, between } = data.steps, name = data.exact_counts ? "solutions" : "solutions, at least";
  const x = [], y = [];
  between.forEach((n, k) => { x.push(alphas[k], alphas[k + 1]); y.push(n, n); });
  const options = { xaxis: "x", yaxis: "y2", type: "scatter", showlegend: false };
  const special = alphas.map((_, k) => k).filter((k) => at[k] !== between[k] && at[k] !== between[k - 1]);
  return [
    { ...options, x, y, mode: "lines", line: { color: GREY, width: 2 }, hovertemplate: `%{y} ${name}<br>alpha %{x:.8g}<extra></extra>` },
    {
      ...options, x: special.map((k) => alphas[k]), y: special.map((k) => at[k]), mode: "markers", marker: { color: GREY, size: 6 },
      hovertemplate: `%{y} ${name}<br>exactly at alpha %{x:.12g}<extra></extra>`,
    },
  ];
}

function sheetShapes() {
  return data.arcs.filter((arc) => arc.dimension > 0).map((arc) => ({
    type: "rect", xref: "x", yref: "paper", x0: arc.lo, x1: arc.hi, y0: 0.3, y1: 1,
    fillcolor: GREY, opacity: 0.15, line: { width: 0 }, layer: "below",
  }));
}

const cursor = () => ({
  type: "line", xref: "x", yref: "paper", x0: state.alpha, x1: state.alpha, y0: 0, y1: 1,
  line: { color: "#d9730d", width: 1.5, dash: "dot" },
});

function drawDiagram() {
  const traces = [...data.arcs.filter((arc) => arc.a).map(arcTrace), ...vertexTraces(), ...stepTraces()];
  const grid = { gridcolor: "#e8ebee", zeroline: false, automargin: true, exponentformat: "power" };
  const layout = {
    margin: { l: 50, r: 12, t: 8, b: 40 }, hovermode: "closest", showlegend: true, dragmode: "zoom", font: { size: 12 },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 11 } }, plot_bgcolor: "#fff",
    xaxis: { ...grid, title: { text: "alpha" }, range: data.interval, anchor: "y2" },
    yaxis: { ...grid, title: { text: axisName() }, domain: [0.3, 1] },
    yaxis2: { ...grid, title: { text: data.exact_counts ? "solutions" : "at least" }, domain: [0, 0.22], rangemode: "tozero", tickformat: "d", dtick: Math.max(1, Math.ceil(Math.max(0, ...data.steps.between, ...data.steps.at) / 4)) },
    shapes: [...sheetShapes(), cursor()],
  };
  const config = { responsive: true, displaylogo: false, displayModeBar: window.innerWidth < 560 ? false : "hover", modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]] };
  const target = byId("diagram");
  Plotly.react(target, traces, layout, config).then(() => {
    if (plotted === null) {
      target.on("plotly_click", clicked);
      target.on("plotly_relayout", (change) => {
        if (Object.keys(change).some((key) => key.startsWith("yaxis") || key === "autosize")) separate();
      });
      plotted = target;
      Plotly.relayout(target, { shapes: [...sheetShapes(), cursor()] });
    }
    separate();
  });
  drawKey();
}

// arcs that coincide are moved by pixels, whatever the zoom; what pointing shows is not moved
function separate() {
  const beside = data.beside[columnOf()] || {};
  const layout = byId("diagram")._fullLayout, [low, high] = layout.yaxis.range;
  const unit = (high - low) / layout.yaxis._length;
  const moved = { y: [] }, numbers = [];
  byId("diagram").data.forEach((trace, k) => {
    if (trace.meta === undefined || !(trace.meta in beside)) return;
    const [rank, among] = beside[trace.meta];
    const away = (rank - (among - 1) / 2) * Math.min(3, 9 / (among - 1)) * unit;
    moved.y.push(trace.customdata.map((y) => y + away));
    numbers.push(k);
  });
  if (numbers.length) Plotly.restyle("diagram", moved, numbers);
  drawKey(numbers.length > 0);
}

function drawKey(beside = false) {
  const dashes = { solid: "", dash: "7 4", dashdot: "7 3 2 3", dot: "2 3" };
  const used = state.quantity.by_node
    ? Object.entries(STATUS_DASH).filter(([name]) => data.arcs.some((arc) => status(arc.statuses, state.node) === name))
    : [["index +1", "solid"], ["index \u22121", "dash"], ["other index", "dot"]].filter(([, dash]) =>
      data.arcs.some((arc) => (arc.index === 1 ? "solid" : arc.index === -1 ? "dash" : "dot") === dash));
  const entries = used.map(([name, dash]) => {
    const line = svg("line", { x1: 0, y1: 5, x2: 34, y2: 5, stroke: GREY, "stroke-width": 2, "stroke-dasharray": dashes[dash] });
    return element("span", {}, svg("svg", { width: 34, height: 10 }, line), name);
  });
  if (beside) entries.push(element("span", {}, "branches that coincide are drawn side by side"));
  if (data.arcs.some((arc) => arc.dimension > 0)) entries.push(element("span", {}, "shaded: a sheet, a continuum over an interval"));
  byId("key").replaceChildren(...entries);
}

function clicked(event) {
  const point = event.points[0], number = point.data.meta;
  if (number !== undefined) selectBranch(arcs.get(number).branch);
  showAlpha(point.x);
}

function selectBranch(number) {
  state.branch = number;
  byId("branch").value = number === null ? "" : String(number);
  for (const row of document.querySelectorAll("tr[data-branch]")) {
    row.classList.toggle("chosen", row.dataset.branch === String(number));
  }
  drawDiagram();
  const place = byId("arcs");
  if (number === null) { place.replaceChildren(); return; }
  const rows = branches.get(number).arcs.map((k) => {
    const arc = arcs.get(k), kind = (v) => data.vertices[v].kind;
    return [arc.number, short(arc.lo), short(arc.hi), kind(arc.tail), kind(arc.head), signed(arc.index), runs(arc.statuses)];
  });
  place.replaceChildren(
    element("h3", {}, `Branch ${number}: ${rows.length} ${rows.length === 1 ? "arc" : "arcs"}`),
    table(["arc", "alpha from", "to", "begins", "ends", "index", "statuses, node by node"], rows),
  );
}

function table(heads, rows) {
  const line = (kind, cells) => element("tr", {}, ...cells.map((cell) => element(kind, {}, String(cell))));
  return element("div", { className: "scroll" }, element("table", {},
    element("thead", {}, line("th", heads)), element("tbody", {}, ...rows.map((row) => line("td", row)))));
}

// -- solutions at one alpha ---------------------------------------------------------------------------------------

function between(arc, alpha) {
  let k = arc.a.findIndex((a) => a >= alpha);
  if (k <= 0) k = 1;
  const low = arc.a[k - 1], share = arc.a[k] > low ? (alpha - low) / (arc.a[k] - low) : 0;
  const mix = (rows) => rows[k - 1].map((x, i) => x + share * (rows[k][i] - x));
  return { f: mix(arc.f), w: mix(arc.w) };
}

function solutionsAt(alpha) {
  const found = [];
  for (const arc of data.arcs) {
    if (!(data.vertices[arc.tail].alpha < alpha && alpha < data.vertices[arc.head].alpha)) continue;
    const name = `branch ${arc.branch}`, colour = branches.get(arc.branch).colour;
    if (arc.dimension > 0) found.push({ name, colour, words: `a sheet: a continuum of dimension ${arc.dimension}` });
    else found.push({ name, colour, words: `arc ${arc.number}, index ${signed(arc.index)}`, statuses: arc.statuses, several: [], ...between(arc, alpha) });
  }
  for (const v of data.vertices) {
    if (v.alpha !== alpha) continue;
    const arc = data.arcs.find((other) => other.tail === v.number || other.head === v.number);
    const words = v.family !== null ? `a continuum of dimension ${v.family.dimension}; one point of it is shown` : v.kind === "end" ? "at the end of the interval" : v.kind;
    found.push({
      name: arc ? `branch ${arc.branch}` : "no branch", colour: arc ? branches.get(arc.branch).colour : GREY,
      words, statuses: v.statuses, several: v.several, f: v.f, w: v.w,
    });
  }
  return found;
}

function showAlpha(alpha) {
  const last = data.slider.length - 1;
  state.alpha = Math.min(Math.max(alpha, data.interval[0]), data.interval[1]);
  state.page = 0;
  let nearest = 0;
  data.slider.forEach((x, k) => { if (Math.abs(x - state.alpha) < Math.abs(data.slider[nearest] - state.alpha)) nearest = k; });
  byId("slider").value = String(Math.min(nearest, last));
  byId("alpha").value = String(state.alpha);
  if (plotted !== null) Plotly.relayout("diagram", { shapes: [...sheetShapes(), cursor()] });
  drawCards();
}

function drawCards() {
  const found = solutionsAt(state.alpha), shown = found.slice(state.page * CARDS, (state.page + 1) * CARDS);
  const special = data.vertices.some((v) => v.alpha === state.alpha && v.kind !== "end");
  const number = `${found.length} ${found.length === 1 ? "solution" : "solutions"}`;
  byId("count").textContent = (data.complete ? number : data.exact_counts ? `${number} found, not proven` : `${number} found; there may be more`)
    + (special ? ", at a critical alpha (rounded)" : "");
  byId("pages").hidden = found.length <= CARDS;
  byId("range").textContent = `${state.page * CARDS + 1} to ${state.page * CARDS + shown.length} of ${found.length}`;
  const solved = found.filter((item) => item.f);
  const scales = data.body ? bodyScales(solved) : barScales(solved);
  byId("scale").textContent = scales.words + (solved.length ? `. Values between points of an arc are interpolated, to ${Number((100 * data.tolerance).toPrecision(3))} % of what the arcs span.` : "");
  byId("cards").replaceChildren(...shown.map((item) => card(item, scales)));
}

function card(item, scales) {
  const dot = element("span", { className: "dot" });
  dot.style.background = item.colour;
  const made = element("article", { className: "card" }, element("h3", {}, dot, item.name), element("p", {}, item.words));
  if (!item.f) return made;
  made.append(element("p", {}, runs(item.statuses)));
  if (item.several.length) made.append(element("p", {}, `several statuses hold at: ${item.several.map((k) => data.nodes[k]).join(", ")}`));
  made.append(data.body ? drawBody(item, scales) : drawBars(item, scales));
  const details = element("details", {}, element("summary", {}, "values by nodes"));
  details.addEventListener("toggle", () => {
    if (details.childElementCount > 1) return;
    const rows = data.nodes.map((label, k) => [label, status(item.statuses, k), ...[item.f, item.w].flatMap((v) => [short(v[k]), short(v[p + k])])]);
    details.append(table(["node", "status", "lambda_n", "lambda_t", "u_n", "u_t"], rows));
  });
  made.append(details);
  return made;
}

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
  return name === "slip+" ? corner([0, -1.1], [1, 0.8], [-1, 0.8]) : corner([0, 1.1], [1, -0.8], [-1, -0.8]);
}

// -- deformed bodies ----------------------------------------------------------------------------------------------

function moves(f) {
  const body = data.body, u = body.u0.map((x, i) => x + state.alpha * body.u1[i]);
  f.forEach((force, k) => { if (force !== 0) body.c[k].forEach((x, i) => { u[i] -= force * x; }); });
  return u;
}

function nodalForces(f) {
  const forces = new Map();
  f.forEach((force, k) => data.body.acts[k].forEach(([node, x, y]) => {
    const sum = forces.get(node) || [0, 0];
    forces.set(node, [sum[0] + force * x, sum[1] + force * y]);
  }));
  return forces;
}

function bodyScales(solutions) {
  let moved = 0, force = 0;
  for (const item of solutions) {
    item.u = moves(item.f);
    for (let i = 0; i < item.u.length; i += 2) moved = Math.max(moved, Math.hypot(item.u[i], item.u[i + 1]));
    item.forces = nodalForces(item.f);
    for (const [x, y] of item.forces.values()) force = Math.max(force, Math.hypot(x, y));
  }
  const size = data.body.size, wanted = moved > 0 ? 0.08 * size / moved : 1, power = 10 ** Math.floor(Math.log10(wanted));
  const scale = moved > 0 ? power * Math.max(...[1, 2, 5].filter((step) => step * power <= wanted * (1 + 1e-9))) : 1;
  const words = `Displacements times ${Number(scale.toPrecision(1))}; arrows: contact forces on the body, the longest is ${short(force)}${data.units ? ` ${data.units[0]}` : ""}`;
  return { scale, arrow: force > 0 ? 0.16 * size / force : 0, least: 1e-9 * force, words };
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

// -- without a mesh: forces and displacements of the nodes ----------------------------------------------------------

function barScales(solutions) {
  const largest = (key) => Math.max(1e-300, ...solutions.flatMap((item) => item[key].map(Math.abs)));
  const unit = (k) => (data.units ? ` ${data.units[k]}` : "");
  return {
    f: largest("f"), w: largest("w"),
    words: `The problem has no mesh: upper bars are forces (largest ${short(largest("f"))}${unit(0)}), lower bars displacements (largest ${short(largest("w"))}${unit(1)}); left of a node normal, right tangential`,
  };
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

function fill(select, entries) {
  select.append(...entries.map(([value, text]) => element("option", { value }, text)));
}

function start() {
  fill(byId("quantity"), data.quantities.map((item) => [item.name, item.by_node ? `${item.words} of a node` : item.words]));
  fill(byId("node"), data.nodes.map((label, k) => [String(k), label]));
  fill(byId("branch"), data.branches.map((branch) => [String(branch.number), String(branch.number)]));
  const changed = () => {
    state.quantity = data.quantities.find((item) => item.name === byId("quantity").value);
    state.node = Number(byId("node").value);
    byId("node-label").hidden = !state.quantity.by_node;
    drawDiagram();
  };
  byId("quantity").addEventListener("change", changed);
  byId("node").addEventListener("change", changed);
  byId("branch").addEventListener("change", (event) => selectBranch(event.target.value === "" ? null : Number(event.target.value)));
  const slider = byId("slider");
  slider.max = String(data.slider.length - 1);
  slider.addEventListener("input", () => showAlpha(data.slider[Number(slider.value)]));
  const turn = (by) => showAlpha(data.slider[Math.min(Math.max(Number(slider.value) + by, 0), data.slider.length - 1)]);
  byId("previous").addEventListener("click", () => turn(-1));
  byId("next").addEventListener("click", () => turn(1));
  byId("alpha").addEventListener("change", (event) => { const x = Number(event.target.value); showAlpha(Number.isFinite(x) && event.target.value.trim() ? x : state.alpha); });
  const page = (by) => { state.page = Math.max(0, Math.min(state.page + by, Math.ceil(solutionsAt(state.alpha).length / CARDS) - 1)); drawCards(); };
  byId("fewer").addEventListener("click", () => page(-1));
  byId("more").addEventListener("click", () => page(1));
  for (const row of document.querySelectorAll("tr[tabindex]")) {
    const act = () => (row.dataset.branch === undefined ? showAlpha(Number(row.dataset.alpha)) : selectBranch(Number(row.dataset.branch)));
    row.addEventListener("click", act);
    row.addEventListener("keydown", (event) => { if (event.key === "Enter") act(); });
  }
  byId("marks").append(...data.statuses.filter((_, code) => [...data.arcs, ...data.vertices].some((item) => item.statuses.includes(String(code)))).map((name) =>
    element("span", {}, svg("svg", { width: 14, height: 14 }, marker(name, 7, 7, 5, name)), name)));
  drawDiagram();
  // where most solutions are
  const most = data.steps.between.reduce((best, n, k) => (n > data.steps.between[best] ? k : best), 0);
  const { alphas } = data.steps;
  showAlpha(alphas.length > 1 ? (alphas[most] + alphas[most + 1]) / 2 : data.interval[0]);
  document.body.dataset.ready = "yes";
}

async function load() {
  const bytes = Uint8Array.from(atob(byId("plotly").textContent), (c) => c.charCodeAt(0));
  const text = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.head.append(element("script", { textContent: text }));
  start();
}

load().catch((error) => {
  byId("failed").hidden = false;
  byId("failed").textContent = `The diagram cannot be drawn by this browser (${error.message}); the tables below are complete.`;
  console.error(error);
});
