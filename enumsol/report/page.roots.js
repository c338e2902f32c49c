// All solutions at one alpha: a card for each root, with its body. Bodies in 3D are drawn by Plotly and can be turned.
const SYMBOLS_3D = { open: "circle", stick: "square", slip: "diamond" };
// a browser keeps about sixteen scenes alive
const CARDS = 6;
const solid = data.body !== null && "triangles" in data.body;
const tangents = data.roots.length && data.roots[0].f.length === 3 * p ? 2 : 1;
const state = { page: 0, camera: { eye: { x: 1.1, y: -1.7, z: 0.8 } } };
let scenes = [], ranges = null;

function drawCards() {
  const last = Math.max(0, Math.ceil(data.roots.length / CARDS) - 1);
  state.page = Math.min(Math.max(state.page, 0), last);
  const first = state.page * CARDS, shown = data.roots.slice(first, first + CARDS);
  byId("pages").hidden = last === 0;
  byId("range").textContent = `${first + 1} to ${first + shown.length} of ${data.roots.length}`;
  byId("fewer").disabled = state.page === 0;
  byId("more").disabled = state.page === last;
  scenes.forEach((scene) => Plotly.purge(scene));
  scenes = [];
  byId("cards").replaceChildren(...shown.map((item, k) => card(item, first + k)));
  drawScenes();
}

function card(item, number) {
  item.name = `Root ${number}`;
  item.key = number;
  const made = element("article", { className: "card", id: `root-${number}` }), heading = element("h3", {}, item.name);
  made.append(
    heading,
    element("p", {}, `index ${signed(item.index)}, ${item.regular ? "regular" : "not regular"}, margin ${short(item.margin)}${item.mirror ? `; ${item.mirror}` : ""}`),
    element("p", {}, runs(item.statuses)),
  );
  if (item.several.length) made.append(element("p", {}, `several statuses hold at: ${item.several.map((k) => data.nodes[k]).join(", ")}`));
  if (data.body !== null && item.u) {
    heading.append(enlarge(item, made, () => scenes.forEach((scene) => Plotly.Plots.resize(scene))));
    if (solid) {
      const scene = element("div", { className: "scene", role: "img", "aria-label": `${item.name}, deformed body; statuses of the contact nodes: ${runs(item.statuses)}` });
      scene.item = item;
      scenes.push(scene);
      made.append(scene);
      if (data.body.triangles) made.append(element("div", { className: "small" }, enlargementOf(item, drawScenes)));
    } else {
      made.append(bodyFigure(item, { force: data.largest, alpha: data.alpha }));
    }
  } else if (data.body === null && tangents === 1) {
    made.append(drawBars(item, bars()));
  }
  if (tangents === 1) made.append(strip(item));
  const details = element("details", {}, element("summary", {}, "values by nodes"));
  const fillIn = () => { if (details.childElementCount < 2) details.append(values(item)); };
  details.addEventListener("toggle", fillIn);
  if (data.body === null && tangents === 2) {
    fillIn();
    details.open = true;
  }
  made.append(details);
  return made;
}

function values(item) {
  const names = (name) => (tangents === 1 ? [`${name}_t`] : [`${name}_t1`, `${name}_t2`]);
  const heads = ["node", "status", "lambda_n", ...names("lambda"), "u_n", ...names("u"), ...(item.angles ? ["angle of F u_t"] : [])];
  const parts = (v, k) => Array.from({ length: tangents + 1 }, (_, j) => short(v[j * p + k]));
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

function bars() {
  const largest = (key) => Math.max(1e-300, ...data.roots.flatMap((item) => item[key].map(Math.abs)));
  return { f: largest("f"), w: largest("w") };
}

// -- bodies in 3D -------------------------------------------------------------------------------------------------

const columns = (points) => ({ x: points.map((q) => q[0]), y: points.map((q) => q[1]), z: points.map((q) => q[2]) });
const plus = (a, b, t = 1) => a.map((x, k) => x + t * b[k]);
const quiet = { hoverinfo: "skip", showlegend: false, showscale: false };

function lines(points, pairs, look) {
  const path = pairs.flatMap(([a, b]) => [points[a], points[b], [null, null, null]]);
  return { ...quiet, type: "scatter3d", mode: "lines", ...columns(path), line: look };
}

function arrows(tails, tips, colour, head, width) {
  if (!tails.length) return [];
  const ways = tails.map((tail, k) => {
    const way = plus(tips[k], tail, -1), length = Math.hypot(...way);
    return way.map((x) => (length > 0 ? x / length : 0));
  });
  const shafts = tails.flatMap((tail, k) => [tail, plus(tips[k], ways[k], -0.5 * head), [null, null, null]]);
  const cones = columns(tips), [u, v, w] = [0, 1, 2].map((k) => ways.map((way) => way[k]));
  return [
    { ...quiet, type: "scatter3d", mode: "lines", ...columns(shafts), line: { color: colour, width } },
    { ...quiet, type: "cone", ...cones, u, v, w, anchor: "tip", sizemode: "raw", sizeref: head, colorscale: [[0, colour], [1, colour]] },
  ];
}

const displaced = (item) => data.body.points.map((point, k) => point.map((x, c) => x + enlargement(item) * item.u[3 * k + c]));

// what all bodies and their forces take up, for one view of all
function extent() {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const see = (point) => point.forEach((x, c) => { low[c] = Math.min(low[c], x); high[c] = Math.max(high[c], x); });
  data.body.points.forEach(see);
  for (const item of data.roots.filter((root) => root.u)) {
    const moved = displaced(item);
    moved.forEach(see);
    item.forces.forEach(([node, ...force]) => see(plus(moved[node], force, -data.arrow)));
  }
  const room = 0.05 * Math.max(...high.map((x, c) => x - low[c]), 1e-300);
  return low.map((x, c) => [x - room, high[c] + room]);
}

// true proportions; the longest side has one size, so that flat bodies fit too
function proportions() {
  const sides = ranges.map(([low, high]) => high - low), longest = Math.max(...sides);
  const [x, y, z] = sides.map((side) => (1.3 * side) / longest);
  return { x, y, z };
}

// the surface, plain or coloured by displacement
function skin(item) {
  if (look.colour !== "moved") return { color: ink("body"), opacity: 0.35 };
  const bar = { thickness: 10, len: 0.6, tickfont: { color: ink("dim"), size: 9 }, title: { text: safe(`displacement${unit("length")}`), font: { color: ink("dim"), size: 10 } } };
  return { intensity: data.body.points.map((_, node) => lengthOf(item.u, node)), colorscale: "Viridis", cmin: 0, cmax: item.largest || 1, opacity: 1, showscale: true, colorbar: bar };
}

function drawScenes() {
  if (solid) ranges = extent();
  scenes.forEach(drawScene);
}

function drawScene(scene) {
  const item = scene.item, { points, triangles, edges, outline, rows, size } = data.body, moved = displaced(item);
  const at = rows.map((row) => row.reduce((sum, [node, weight]) => plus(sum, moved[node], weight), [0, 0, 0]));
  const traces = [];
  if (triangles) {
    const [i, j, k] = triangles;
    traces.push(
      { ...quiet, type: "mesh3d", ...columns(moved), i, j, k, ...skin(item), flatshading: true, lighting: { ambient: 0.85, diffuse: 0.3, specular: 0 } },
      lines(moved, edges, { color: ink("edge"), width: 1.5 }),
      lines(points, outline, { color: ink("before"), width: 2.5, dash: "dot" }),
    );
  }
  const pressed = item.forces.map(([node, ...force]) => [plus(moved[node], force, -data.arrow), moved[node]]);
  traces.push(...arrows(pressed.map(([tail]) => tail), pressed.map(([, tip]) => tip), ink("force"), 0.045 * size, 5));
  const slid = item.slips.map(([row, ...way]) => [at[row], plus(at[row], way, data.slip)]);
  traces.push(...arrows(slid.map(([tail]) => tail), slid.map(([, tip]) => tip), ink("load"), 0.045 * size, 6));
  for (const [name, symbol] of Object.entries(SYMBOLS_3D)) {
    const nodes = data.nodes.map((_, k) => k).filter((k) => status(item.statuses, k) === name);
    if (!nodes.length) continue;
    const text = nodes.map((k) => safe(`node ${data.nodes[k]}: ${name}, lambda_n ${short(item.f[k])}, lambda_t ${short(Math.hypot(item.f[p + k], item.f[2 * p + k]))}`));
    traces.push({
      type: "scatter3d", mode: "markers", ...columns(nodes.map((k) => at[k])), text, hovertemplate: "%{text}<extra></extra>", name, showlegend: false,
      marker: { symbol, size: 5, color: COLOURS[name], line: { color: "#111111", width: 1 } },
    });
  }
  const axis = (title, range) => ({ title: { text: title, font: { size: 11 } }, range, tickfont: { size: 9 }, nticks: 4, showspikes: false, backgroundcolor: "rgba(0,0,0,0)", gridcolor: ink("grid"), color: ink("dim") });
  const layout = {
    ...paperSize(scenes.length > 1 ? 320 : 660, 340), margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", modebar: { bgcolor: "rgba(0,0,0,0)", color: ink("dim") },
    scene: { aspectmode: "manual", aspectratio: proportions(), camera: state.camera, dragmode: "turntable", xaxis: axis("x", ranges[0]), yaxis: axis("y", ranges[1]), zaxis: axis("z", ranges[2]) },
  };
  Plotly.newPlot(scene, traces, layout, { responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: [["toImage", "resetCameraDefault3d"]] }).then(() => {
    scene.dataset.drawn = "yes";
    scene.on("plotly_relayout", (change) => { if (change["scene.camera"]) turnAll(scene, change["scene.camera"]); });
  });
}

// bodies that are compared are seen from the same side
function turnAll(turned, camera) {
  if (JSON.stringify(camera) === JSON.stringify(state.camera)) return;
  state.camera = camera;
  for (const scene of scenes) if (scene !== turned && scene.dataset.drawn) Plotly.relayout(scene, { "scene.camera": camera });
}

// -- start --------------------------------------------------------------------------------------------------------

function drawKeys() {
  const keys = bodyKeys(data.roots), drawn = data.roots.filter((item) => item.u);
  if (solid && drawn.some((item) => item.forces.length)) keys.push(keyEntry("force", "contact force on the body"));
  if (drawn.some((item) => item.slips.length)) keys.push(keyEntry("load", "direction of slip"));
  if (solid && data.body.triangles) keys.push(keyEntry("before", "undeformed body"));
  byId("marks").append(...keys);
}

function words() {
  const said = [];
  if (data.arrow) said.push(`Arrows: contact forces on the body, the longest is ${short(data.largest)}${unit("force")}.`);
  if (solid) said.push("Drag a body to turn it; all turn with it.");
  if (data.no_body) said.push(`${data.no_body}.`);
  if (data.body === null && tangents === 1 && data.roots.length) said.push(`Upper bars are forces (largest ${short(bars().f)}${unit("force")}), lower bars displacements (largest ${short(bars().w)}${unit("length")}); left of a node normal, right tangential.`);
  if (data.roots.length < data.all) said.push(`The first ${data.roots.length} of ${data.all} roots have a card: the page holds no more. enumsol roots --json writes all.`);
  byId("scale").textContent = said.join(" ");
}

function startRoots() {
  byId("bodies").hidden = data.roots.length === 0;
  byId("fewer").addEventListener("click", () => { state.page -= 1; drawCards(); });
  byId("more").addEventListener("click", () => { state.page += 1; drawCards(); });
  for (const row of document.querySelectorAll("tr[data-root]")) {
    const act = () => {
      const number = Number(row.dataset.root);
      if (number >= data.roots.length) return;
      if (Math.floor(number / CARDS) !== state.page) { state.page = Math.floor(number / CARDS); drawCards(); }
      byId(`root-${number}`).scrollIntoView({ block: "center" });
    };
    row.addEventListener("click", act);
    row.addEventListener("keydown", (event) => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); act(); } });
  }
  if (data.body) {
    prepare(data.roots.filter((item) => item.u));
    data.roots.forEach((item, k) => { item.key = k; });
    if (!solid || data.body.triangles) lookControls(drawCards);
  }
  if (solid) repaints.push(drawScenes);
  drawKeys();
  words();
  drawCards();
  document.body.dataset.ready = "yes";
}

if (byId("plotly").textContent) load(startRoots).catch(failed);
else startRoots();
