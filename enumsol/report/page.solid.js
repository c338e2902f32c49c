// Bodies in 3D, drawn by Plotly, or contact nodes at their coordinates: they can be turned, all together.
const SYMBOLS_3D = { open: "circle", stick: "square", slip: "diamond" };
const solid = data.body !== null && "triangles" in data.body;
let scenes = [], spare = [], ranges = null, compared = { items: [], share: 0 };
let camera = { eye: { x: 1.1, y: -1.7, z: 0.8 } };

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

// directions of slip: nodes and unit vectors
function slipsOf(item) {
  const { tangents } = data.body, slipping = data.nodes.map((_, k) => k).filter((k) => tangents && status(item.statuses, k) === "slip");
  return slipping.map((k) => {
    const [one, other] = tangents[k], way = one.map((x, c) => x * item.w[p + k] + other[c] * item.w[2 * p + k]), length = Math.hypot(...way);
    return [k, way.map((x) => x / length), length];
  }).filter(([, , length]) => length > 0);
}

// what all bodies and their forces take up, for one view of all
function extent() {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const see = (point) => point.forEach((x, c) => { low[c] = Math.min(low[c], x); high[c] = Math.max(high[c], x); });
  data.body.points.forEach(see);
  for (const item of compared.items) {
    const moved = displaced(item);
    moved.forEach(see);
    item.forces.forEach(([node, ...force]) => see(plus(moved[node], force, -compared.share)));
  }
  const room = 0.05 * Math.max(...high.map((x, c) => x - low[c]), 1e-300);
  return low.map((x, c) => [x - room, high[c] + room]);
}

// true proportions, so large that neither flat bodies nor cubes reach beyond the picture
function proportions() {
  const sides = ranges.map(([low, high]) => high - low), scale = Math.min(1.3 / Math.max(...sides), 1.85 / Math.hypot(...sides));
  const [x, y, z] = sides.map((side) => scale * side);
  return { x, y, z };
}

// the surface, plain or coloured by displacement
function skin(item) {
  if (look.colour !== "moved") return { color: ink("body"), opacity: 0.35 };
  const bar = { thickness: 10, len: 0.6, tickfont: { color: ink("dim"), size: 9 }, title: { text: safe(`displacement${unit("length")}`), font: { color: ink("dim"), size: 10 } } };
  return { intensity: data.body.points.map((_, node) => lengthOf(item.u, node)), colorscale: "Viridis", cmin: 0, cmax: item.largest || 1, opacity: 1, showscale: true, colorbar: bar };
}

function drawScenes() {
  ranges = extent();
  scenes.forEach(drawScene);
}

// a place for the body of a solution; those on the page before are taken again, for a browser makes few of them
function sceneOf(item) {
  const scene = spare.shift() ?? element("div", { className: "scene", role: "img" });
  scene.item = item;
  scene.setAttribute("aria-label", `${item.name}, deformed body; statuses of the contact nodes: ${runs(item.statuses)}`);
  scenes.push(scene);
  return scene;
}

// the scenes of a page: make() asks sceneOf for each; bodies of all items are compared, with the largest of their forces
function newScenes(items, force, make) {
  compared = { items, share: force > 0 ? (0.16 * data.body.size) / force : 0 };
  [spare, scenes] = [scenes, []];
  make();
  spare.forEach((scene) => Plotly.purge(scene));
  drawScenes();
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
  const pressed = item.forces.map(([node, ...force]) => [plus(moved[node], force, -compared.share), moved[node]]);
  traces.push(...arrows(pressed.map(([tail]) => tail), pressed.map(([, tip]) => tip), ink("force"), 0.045 * size, 5));
  const slid = slipsOf(item).map(([row, way]) => [at[row], plus(at[row], way, 0.12 * size)]);
  traces.push(...arrows(slid.map(([tail]) => tail), slid.map(([, tip]) => tip), ink("load"), 0.045 * size, 6));
  for (const [name, symbol] of Object.entries(SYMBOLS_3D)) {
    const nodes = data.nodes.map((_, k) => k).filter((k) => status(item.statuses, k) === name);
    if (!nodes.length) continue;
    const text = nodes.map((k) => safe(`node ${data.nodes[k]}: ${name}, lambda_n ${short(item.f[k])}, lambda_t ${short(tangentialOf(item.f, k))}`));
    traces.push({
      type: "scatter3d", mode: "markers", ...columns(nodes.map((k) => at[k])), text, hovertemplate: "%{text}<extra></extra>", name, showlegend: false,
      marker: { symbol, size: 5, color: COLOURS[name], line: { color: "#111111", width: 1 } },
    });
  }
  const axis = (title, range) => ({ title: { text: title, font: { size: 11 } }, range, tickfont: { size: 9 }, nticks: 4, showspikes: false, backgroundcolor: "rgba(0,0,0,0)", gridcolor: ink("grid"), color: ink("dim") });
  const layout = {
    ...paperSize(scenes.length > 1 ? 320 : 660, 340), margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", modebar: { bgcolor: "rgba(0,0,0,0)", color: ink("dim") },
    scene: { aspectmode: "manual", aspectratio: proportions(), camera, dragmode: "turntable", xaxis: axis("x", ranges[0]), yaxis: axis("y", ranges[1]), zaxis: axis("z", ranges[2]) },
  };
  Plotly.react(scene, traces, layout, { responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: [["toImage", "resetCameraDefault3d"]] }).then(() => {
    if (scene.dataset.drawn) return;
    scene.dataset.drawn = "yes";
    scene.on("plotly_relayout", (change) => { if (change["scene.camera"]) turnAll(scene, change["scene.camera"]); });
  });
}

// bodies that are compared are seen from the same side
function turnAll(turned, seen) {
  if (JSON.stringify(seen) === JSON.stringify(camera)) return;
  camera = seen;
  for (const scene of scenes) if (scene !== turned && scene.dataset.drawn) Plotly.relayout(scene, { "scene.camera": seen });
}

if (solid) repaints.push(drawScenes);
