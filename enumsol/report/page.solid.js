// Bodies in 3D, drawn by Plotly, or contact nodes at their coordinates: they can be turned, all together.
const SYMBOLS_3D = { open: "circle", stick: "square", slip: "diamond" };
const solid = data.body !== null && "triangles" in data.body;
let scenes = [], spare = [], ranges = null, reach = null, centre = null, scaled = null, compared = { items: [], share: 0 }, camera = null;
// part of a picture that bodies take at first, and how much the reader has zoomed
const FILLED = 0.9;
let zoom = 1;

const columns = (points) => ({ x: points.map((q) => q[0]), y: points.map((q) => q[1]), z: points.map((q) => q[2]) });
const plus = (a, b, t = 1) => a.map((x, k) => x + t * b[k]);
const quiet = { hoverinfo: "skip", showlegend: false, showscale: false };

function lines(points, pairs, look) {
  const path = pairs.flatMap(([a, b]) => [points[a], points[b], [null, null, null]]);
  return { ...quiet, type: "scatter3d", mode: "lines", ...columns(path), line: look };
}

function arrows(name, tails, tips, colour, head, width) {
  if (!tails.length) return [];
  const ways = tails.map((tail, k) => {
    const way = plus(tips[k], tail, -1), length = Math.hypot(...way);
    return way.map((x) => (length > 0 ? x / length : 0));
  });
  const shafts = tails.flatMap((tail, k) => [tail, plus(tips[k], ways[k], -0.5 * head), [null, null, null]]);
  const cones = columns(tips), [u, v, w] = [0, 1, 2].map((k) => ways.map((way) => way[k]));
  return [
    { ...quiet, name, type: "scatter3d", mode: "lines", ...columns(shafts), line: { color: colour, width } },
    { ...quiet, name, type: "cone", ...cones, u, v, w, anchor: "tip", sizemode: "raw", sizeref: head, colorscale: [[0, colour], [1, colour]] },
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

// what all bodies, their forces and loads take up: the ranges of the axes, and how far it reaches in the first view
function extent() {
  const points = [...data.body.points, ...loadArrows().map(([tail]) => tail)];
  for (const item of compared.items) {
    const moved = displaced(item);
    points.push(...moved, ...item.forces.map(([node, ...force]) => plus(moved[node], force, -compared.share)));
  }
  const ends = (of) => points.reduce(([low, high], point) => [Math.min(low, of(point)), Math.max(high, of(point))], [Infinity, -Infinity]);
  const box = [0, 1, 2].map((c) => ends((point) => point[c])), room = 0.05 * Math.max(...box.map(([low, high]) => high - low), 1e-300);
  const middle = box.map(([low, high]) => (low + high) / 2);
  reach = firstFrame().map((axis) => ends((point) => dot(axis, plus(point, middle, -1))));
  // the scale of the forces stands below, at the left
  const step = compared.force > 0 && !nodesOnly ? rounded(compared.force) : 0;
  if (step) reach[1][0] -= 2 * room;
  const at = (x, y) => firstFrame().reduce((sum, axis, c) => plus(sum, axis, [x, y][c]), middle);
  const tail = at(reach[0][0], reach[1][0] + 0.5 * room), tip = at(reach[0][0] + compared.share * step, reach[1][0] + 0.5 * room);
  scaled = step ? { step, tail, tip } : null;
  if (step) points.push(tail, tip);
  ranges = [0, 1, 2].map((c) => ends((point) => point[c])).map(([low, high]) => [low - room, high + room]);
  centre = at((reach[0][0] + reach[0][1]) / 2, (reach[1][0] + reach[1][1]) / 2);
}

const dot = (a, b) => a.reduce((sum, x, c) => sum + x * b[c], 0);
const firstWay = () => data.body.view ?? [0.51, -0.79, 0.34];

// right and up in the first view
function firstFrame() {
  const way = firstWay(), flat = Math.hypot(way[0], way[1]), right = [-way[1] / flat, way[0] / flat, 0];
  return [right, [-way[2] * right[1], way[2] * right[0], flat]];
}

// true proportions, so large that all fills a picture in the first view; zooming comes on top
function proportions(scene) {
  const [wide, high] = reach.map(([low, up]) => Math.max((up - low) / 2, 1e-300));
  const scale = zoom * FILLED * Math.min((scene.clientWidth || 420) / (scene.clientHeight || 380) / wide, 1 / high);
  const [x, y, z] = ranges.map(([low, up]) => scale * (up - low));
  return { x, y, z };
}

// first from the side of the contact, at the middle of all
function firstCamera(scene) {
  const { x, y, z } = proportions(scene), sides = [x, y, z], named = ([a, b, c]) => ({ x: a, y: b, z: c });
  const middle = centre.map((value, c) => sides[c] * ((value - ranges[c][0]) / (ranges[c][1] - ranges[c][0]) - 0.5));
  return { center: named(middle), eye: named(plus(middle, firstWay(), 2)), projection: { type: "orthographic" } };
}

// loads at alpha: tails and tips, and forces
function loadArrows() {
  if (!data.body.load) return [];
  const { loads, most } = loadsAt(compared.alpha);
  return loads.map(([place, vector]) => [plus(place, vector, (-0.11 * data.body.size) / most), place, vector]);
}

// what holds the body, at rest: supports as marks, springs as lines away from its middle
function holdsOf() {
  const { points, held, springs, size } = data.body, s = 0.016 * size, turns = [];
  const centre = [0, 1, 2].map((c) => points.reduce((sum, point) => sum + point[c] / points.length, 0));
  for (const node of springs ?? []) {
    const away = plus(points[node], centre, -1), n = Math.hypot(...away) || 1, out = away.map((x) => x / n), flat = Math.hypot(out[0], out[1]);
    const across = flat > 1e-6 ? [-out[1] / flat, out[0] / flat, 0] : [1, 0, 0];
    turns.push(...zigzag(s).map(([a, b]) => plus(plus(points[node], out, a), across, b)), [null, null, null]);
  }
  const made = [];
  if (turns.length) made.push({ ...quiet, name: "springs", type: "scatter3d", mode: "lines", ...columns(turns), line: { color: ink("held"), width: 3 } });
  if (held?.length) made.push({ ...quiet, name: "supports", type: "scatter3d", mode: "markers", ...columns(held.map(([node]) => points[node])), marker: { symbol: "square", size: 4, color: ink("held") } });
  return made;
}

function scaleOf({ step, tail, tip }) {
  return [
    ...arrows("scale", [tail], [tip], ink("force"), 0.045 * data.body.size, 5),
    { ...quiet, type: "scatter3d", mode: "text", ...columns([tip]), text: [safe(`  ${short(step)}${unit("force")}`)], textposition: "middle right", textfont: { size: 12, color: ink("fg") } },
  ];
}

// the stress of the cells at the surface: that of von Mises, or its mean
function surfaceStress(s, kind) {
  return Array.from({ length: s.length / 6 }, (_, k) => {
    const [x, y, z, yz, zx, xy] = s.slice(6 * k, 6 * k + 6);
    return kind === "pressure" ? (x + y + z) / 3 : Math.sqrt(((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) / 2 + 3 * (yz ** 2 + zx ** 2 + xy ** 2));
  });
}

// the surface, plain or coloured by displacement or stress
function skin(item) {
  if (look.colour === "none" || (look.colour !== "moved" && !item.s)) return { color: ink("body"), opacity: 0.35 };
  const { words, stops } = COLOURINGS[look.colour], moved = look.colour === "moved";
  const values = moved ? data.body.points.map((_, node) => lengthOf(item.u, node)) : surfaceStress(item.s, look.colour);
  // strains that are rounding of the displacements are none
  const largest = values.reduce((found, x) => Math.max(found, Math.abs(x)), 0), rounding = moved ? 0 : (1e-6 * data.body.mu * item.largest) / data.body.size;
  const most = largest > rounding ? largest : 0;
  const title = safe(`${words.replace("by ", "")}${unit(moved ? "length" : "stress")}`);
  const bar = { thickness: 10, len: 0.6, tickfont: { color: ink("dim"), size: 9 }, title: { text: title, font: { color: ink("dim"), size: 10 } } };
  const colours = stops.map((colour, k) => [k / (stops.length - 1), `rgb(${colour.join(",")})`]);
  // triangles come in turns, one of every facet
  const own = moved ? { intensity: values } : { intensity: data.body.triangles[0].map((_, k) => values[k % values.length]), intensitymode: "cell" };
  if (!most) own.intensity = own.intensity.map(() => 0);
  return { ...own, colorscale: colours, cmin: stops === DIVERGING ? -(most || 1) : 0, cmax: most || 1, opacity: 1, showscale: most > 0, colorbar: bar };
}

function drawScenes() {
  extent();
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
function newScenes(items, { force, alpha }, make) {
  compared = { items, force, alpha, share: force > 0 ? (0.16 * data.body.size) / force : 0 };
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
  traces.push(...arrows("force", pressed.map(([tail]) => tail), pressed.map(([, tip]) => tip), ink("force"), 0.045 * size, 5));
  const loads = loadArrows();
  traces.push(...arrows("load", loads.map(([tail]) => tail), loads.map(([, tip]) => tip), ink("load"), 0.035 * size, 4), ...holdsOf());
  if (scaled) traces.push(...scaleOf(scaled));
  const slid = slipsOf(item).map(([row, way]) => [at[row], plus(at[row], way, 0.12 * size)]);
  traces.push(...arrows("way of slip", slid.map(([tail]) => tail), slid.map(([, tip]) => tip), ink("slid"), 0.045 * size, 6));
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
  camera ??= firstCamera(scene);
  const layout = {
    ...paperSize(scenes.length > 1 ? 320 : 660, 340), margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", modebar: { bgcolor: "rgba(0,0,0,0)", color: ink("dim") },
    scene: { aspectmode: "manual", aspectratio: proportions(scene), camera, dragmode: "turntable", xaxis: axis("x", ranges[0]), yaxis: axis("y", ranges[1]), zaxis: axis("z", ranges[2]) },
  };
  Plotly.react(scene, traces, layout, { responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: [["toImage", "resetCameraDefault3d"]] }).then(() => {
    if (scene.dataset.drawn) return;
    scene.dataset.drawn = "yes";
    scene.on("plotly_relayout", (change) => {
      if (change["scene.camera"]) turnAll(scene, change["scene.camera"], change["scene.aspectratio"]);
    });
  });
}

// bodies that are compared are seen from the same side
function turnAll(turned, seen, sides) {
  const near = sides ? sides.x / proportions(turned).x : 1;
  if (JSON.stringify(seen) === JSON.stringify(camera) && Math.abs(near - 1) < 1e-6) return;
  camera = seen;
  zoom *= near;
  for (const scene of scenes) if (scene !== turned && scene.dataset.drawn) Plotly.relayout(scene, { "scene.camera": seen, "scene.aspectratio": proportions(scene) });
}

if (solid) repaints.push(drawScenes);
