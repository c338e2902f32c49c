// All solutions over an interval: the diagram.
const STATUS_DASH = { open: "solid", stick: "dash", "slip+": "dashdot", "slip-": "dot", slip: "dashdot" };
const SYMBOLS = {
  transition: ["circle-open", "transition"], fold: ["square-open", "fold"], bifurcation: ["diamond-open", "bifurcation"],
  touch: ["triangle-down-open", "status met and left again"], point: ["x-thin-open", "single point"],
  family: ["line-ns-open", "continuum"], terminal: ["cross-open", "begins or ends alone"],
  bound: ["line-ew-open", "at the bound of rigid displacements"],
  broken: ["x", "degrees differ, something is missing"], unsettled: ["y-right-open", "not followed further"],
};
// a browser keeps about sixteen scenes alive
const CARDS = solid ? 6 : 12;
const arcs = new Map(data.arcs.map((arc) => [arc.number, arc]));
const branches = new Map(data.branches.map((branch) => [branch.number, branch]));
const state = { quantity: data.quantities[0], node: 0, branch: null, alpha: data.start, page: 0 };
let plotted = null;

// -- quantities ---------------------------------------------------------------------------------------------------

function valueOf(f, w) {
  const item = state.quantity;
  if (item.name === "norm") return Math.hypot(...f);
  const part = item.dimension === "length" ? w : f;
  // of a node, or sums over all; then normal ones, or all tangential ones
  const parts = item.by_node ? PARTS.map((_, j) => part[j * p + state.node]) : PARTS.map((_, j) => part.slice(j * p, j * p + p).reduce((sum, x) => sum + x, 0));
  return item.name.endsWith("_t") ? tangentialOf(parts, 0, 1) : parts[0];
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

// -- the diagram --------------------------------------------------------------------------------------------------

const VERDICT_DASH = { "does not run away": "solid", "runs away": "dash", undecided: "dot" };
const indexDash = (arc) => (arc.index === 1 ? "solid" : arc.index === -1 ? "dash" : "dot");

// an arc in pieces, each with one verdict, where verdicts are known and no node is shown
function arcTraces(arc) {
  const values = arc.a.map((_, k) => valueOf(arc.f[k], arc.w[k]));
  if (state.quantity.by_node) return [arcTrace(arc, arc.a, values, STATUS_DASH[status(arc.statuses, state.node)], "")];
  if (!arc.spans) return [arcTrace(arc, arc.a, values, indexDash(arc), "")];
  if (arc.spans.length === 1) return [arcTrace(arc, arc.a, values, VERDICT_DASH[arc.spans[0][2]], `, ${arc.spans[0][2]}`)];
  const at = (x) => {
    const k = Math.max(1, arc.a.findIndex((a) => a >= x)), low = arc.a[k - 1], width = arc.a[k] - low;
    return values[k - 1] + (width > 0 ? (x - low) / width : 0) * (values[k] - values[k - 1]);
  };
  return arc.spans.map(([from, to, verdict]) => {
    const low = Math.max(from, arc.a[0]), high = Math.min(to, arc.a[arc.a.length - 1]);
    const inside = arc.a.map((_, k) => k).filter((k) => low < arc.a[k] && arc.a[k] < high);
    const x = [low, ...inside.map((k) => arc.a[k]), high], y = [at(low), ...inside.map((k) => values[k]), at(high)];
    return arcTrace(arc, x, y, VERDICT_DASH[verdict], `, ${verdict}`);
  });
}

function arcTrace(arc, alphas, values, dash, verdict) {
  const chosen = state.branch === null || state.branch === arc.branch;
  const head = `branch ${arc.branch}, arc ${arc.number}, index ${signed(arc.index)}${verdict}`;
  return {
    x: alphas, y: values, customdata: values, mode: "lines", type: "scatter", meta: arc.number, showlegend: false,
    line: { color: onPage(branches.get(arc.branch).colour), dash, width: chosen && state.branch !== null ? 3 : 2 },
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
    marker: { symbol: SYMBOLS[kind][0], size: 8, color: ink("ink"), line: { width: 1.5, color: ink("ink") } },
    name: SYMBOLS[kind][1], hovertemplate: `${SYMBOLS[kind][1]}<br>alpha %{x:.12g}<br>${axisName()} %{y:.6g}<extra></extra>`,
  }));
  for (const v of data.vertices) {
    if (v.family === null) continue;
    const values = v.family.f.map((f, k) => valueOf(f, v.family.w[k]));
    traces.push({
      x: [v.alpha, v.alpha], y: [Math.min(...values), Math.max(...values)], mode: "lines", type: "scatter",
      line: { color: ink("ink"), width: 4 }, showlegend: false,
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
    { ...options, x, y, mode: "lines", line: { color: ink("ink"), width: 2 }, hovertemplate: `%{y} ${name}<br>alpha %{x:.8g}<extra></extra>` },
    {
      ...options, x: special.map((k) => alphas[k]), y: special.map((k) => at[k]), mode: "markers", marker: { color: ink("ink"), size: 6 },
      hovertemplate: `%{y} ${name}<br>exactly at alpha %{x:.12g}<extra></extra>`,
    },
  ];
}

function sheetShapes() {
  return data.arcs.filter((arc) => arc.dimension > 0).map((arc) => ({
    type: "rect", xref: "x", yref: "paper", x0: arc.lo, x1: arc.hi, y0: 0.3, y1: 1,
    fillcolor: ink("ink"), opacity: 0.15, line: { width: 0 }, layer: "below",
  }));
}

// where solutions may be missing, narrow ranges as a line
function openShapes() {
  return data.open_ranges.map(([low, high]) => ({
    type: "rect", xref: "x", yref: "paper", x0: low, x1: high, y0: 0, y1: 1,
    fillcolor: "rgba(194, 59, 75, 0.2)", line: { color: "#c23b4b", width: 0.8 }, layer: "below",
  }));
}

const cursor = () => ({
  type: "line", xref: "x", yref: "paper", x0: state.alpha, x1: state.alpha, y0: 0, y1: 1,
  line: { color: "#d9730d", width: 1.5, dash: "dot" },
});

const shapes = () => [...sheetShapes(), ...openShapes(), cursor()];

function drawDiagram() {
  const traces = [...data.arcs.filter((arc) => arc.a).flatMap(arcTraces), ...vertexTraces(), ...stepTraces()];
  const grid = { gridcolor: ink("grid"), linecolor: ink("line"), zeroline: false, automargin: true, exponentformat: "power" };
  const layout = {
    ...paperSize(690, 400), margin: { l: 50, r: 12, t: 8, b: 40 }, hovermode: "closest", showlegend: true, dragmode: "zoom", font: { size: 12, color: ink("fg") }, paper_bgcolor: "rgba(0,0,0,0)", modebar: { bgcolor: "rgba(0,0,0,0)", color: ink("dim"), activecolor: ink("fg") },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0, font: { size: 11 } }, plot_bgcolor: "rgba(0,0,0,0)",
    xaxis: { ...grid, title: { text: "alpha" }, range: data.interval, anchor: "y2" },
    yaxis: { ...grid, title: { text: axisName() }, domain: [0.3, 1] },
    yaxis2: { ...grid, title: { text: data.exact_counts ? "solutions" : "at least" }, domain: [0, 0.22], rangemode: "tozero", tickformat: "d", dtick: Math.max(1, Math.ceil(Math.max(0, ...data.steps.between, ...data.steps.at) / 4)) },
    shapes: shapes(),
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
      Plotly.relayout(target, { shapes: shapes() });
    }
    separate();
  });
  drawKey();
}

// arcs that coincide are moved by pixels, whatever the zoom; what pointing shows is not moved
function separate() {
  const beside = data.beside[columnOf()] || {};
  const axis = byId("diagram")._fullLayout.yaxis;
  if (!axis) return; // nothing was found, and nothing is drawn
  const [low, high] = axis.range, unit = (high - low) / axis._length;
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
    : data.arcs.some((arc) => arc.spans)
      ? Object.entries(VERDICT_DASH).filter(([name]) => data.arcs.some((arc) => arc.a && arc.spans.some((span) => span[2] === name)))
      : [["index +1", "solid"], ["index \u22121", "dash"], ["other index", "dot"]].filter(([, dash]) =>
        data.arcs.some((arc) => indexDash(arc) === dash));
  const entries = used.map(([name, dash]) => {
    const line = svg("line", { x1: 0, y1: 5, x2: 34, y2: 5, stroke: "var(--ink)", "stroke-width": 2, "stroke-dasharray": dashes[dash] });
    return element("span", {}, svg("svg", { width: 34, height: 10 }, line), name);
  });
  if (beside) entries.push(element("span", {}, "branches that coincide are drawn side by side"));
  if (data.arcs.some((arc) => arc.dimension > 0)) entries.push(element("span", {}, "shaded: a sheet, a continuum over an interval"));
  if (data.open_ranges.length) entries.push(element("span", {}, "red: ranges of alpha in which solutions may be missing"));
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
  const told = data.arcs.some((arc) => arc.spans);
  const rows = branches.get(number).arcs.map((k) => {
    const arc = arcs.get(k), kind = (v) => data.vertices[v].kind;
    const verdicts = told ? [arc.spans.map((span) => span[2]).join(", then ")] : [];
    return [arc.number, short(arc.lo), short(arc.hi), kind(arc.tail), kind(arc.head), signed(arc.index), ...verdicts, runs(arc.statuses)];
  });
  place.replaceChildren(
    element("h3", {}, `Branch ${number}: ${rows.length} ${rows.length === 1 ? "arc" : "arcs"}`),
    table(`Arcs of branch ${number}`, ["arc", "alpha from", "to", "begins", "ends", "index", ...(told ? ["stability"] : []), "statuses, node by node"], rows),
  );
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
  pageButtons(drawCards);
  for (const row of document.querySelectorAll("tr[tabindex]")) {
    const act = () => (row.dataset.branch === undefined ? showAlpha(Number(row.dataset.alpha)) : selectBranch(Number(row.dataset.branch)));
    row.addEventListener("click", act);
    row.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); act(); } });
  }
  byId("marks").append(...bodyKeys([...data.arcs, ...data.vertices]));
  lookControls(drawCards);
  repaints.push(drawDiagram);
  drawDiagram();
  showAlpha(data.start);
  document.body.dataset.ready = "yes";
}

load(start).catch(failed);
