// -- solutions at one alpha ---------------------------------------------------------------------------------------

function between(arc, alpha) {
  let k = arc.a.findIndex((a) => a >= alpha);
  if (k <= 0) k = 1;
  const low = arc.a[k - 1], share = arc.a[k] > low ? (alpha - low) / (arc.a[k] - low) : 0;
  const mix = (rows) => rows[k - 1].map((x, i) => x + share * (rows[k][i] - x));
  return { f: mix(arc.f), w: mix(arc.w) };
}

function verdictAt(arc, alpha) {
  const span = (arc.spans || []).find(([low, high]) => low <= alpha && alpha <= high);
  return span ? `, ${span[2]}` : "";
}

function solutionsAt(alpha) {
  const found = [];
  for (const arc of data.arcs) {
    // beside what was left open an arc may end before its vertex, or beyond it
    const low = Math.max(arc.lo, data.vertices[arc.tail].alpha), high = Math.min(arc.hi, data.vertices[arc.head].alpha);
    if (!(low < alpha && alpha < high)) continue;
    const name = `branch ${arc.branch}`, colour = onPage(branches.get(arc.branch).colour);
    if (arc.dimension > 0) found.push({ name, colour, words: `a sheet: a continuum of dimension ${arc.dimension}` });
    else found.push({ name, key: `arc ${arc.number}`, colour, words: `arc ${arc.number}, index ${signed(arc.index)}${verdictAt(arc, alpha)}`, statuses: arc.statuses, several: [], ...between(arc, alpha) });
  }
  for (const v of data.vertices) {
    if (v.alpha !== alpha) continue;
    const arc = data.arcs.find((other) => other.tail === v.number || other.head === v.number);
    const words = v.family !== null ? `a continuum of dimension ${v.family.dimension}; one point of it is shown` : v.kind === "end" ? "at the end of the interval" : v.kind;
    found.push({
      name: arc ? `branch ${arc.branch}` : "no branch", colour: arc ? onPage(branches.get(arc.branch).colour) : "var(--ink)",
      key: `vertex ${v.number}`, words, statuses: v.statuses, several: v.several, f: v.f, w: v.w,
    });
  }
  return found;
}

// whether nothing is missing there, in a graph that has gaps elsewhere
function isKnown(alpha) {
  const room = 1e-12 * (data.interval[1] - data.interval[0]);
  return data.open_ranges.length > 0 && !data.open_ranges.some(([low, high]) => low - room <= alpha && alpha <= high + room);
}

// how many solutions there are at least; ends of arcs that were not followed further may be one and the same
function leastAt(alpha, found) {
  const { alphas, at, between } = data.steps, k = alphas.findIndex((x) => x >= alpha);
  const apart = found.filter((item) => item.words !== "unsettled").length;
  return Math.max(apart, k < 0 ? 0 : alphas[k] === alpha ? at[k] : between[k - 1] ?? 0);
}

function showAlpha(alpha) {
  const last = data.slider.length - 1;
  state.alpha = Math.min(Math.max(alpha, data.interval[0]), data.interval[1]);
  state.page = 0;
  let nearest = 0;
  data.slider.forEach((x, k) => { if (Math.abs(x - state.alpha) < Math.abs(data.slider[nearest] - state.alpha)) nearest = k; });
  byId("slider").value = String(Math.min(nearest, last));
  byId("alpha").value = String(state.alpha);
  if (plotted !== null) Plotly.relayout("diagram", { shapes: shapes() });
  drawCards();
}

function drawCards() {
  const found = solutionsAt(state.alpha), solved = found.filter((item) => item.f);
  const special = data.vertices.some((v) => v.alpha === state.alpha && v.kind !== "end");
  const number = `${found.length} ${found.length === 1 ? "solution" : "solutions"}`, least = leastAt(state.alpha, found);
  byId("count").textContent = (data.complete || isKnown(state.alpha) ? number : data.exact_counts ? `${number} found, not proven` : `${number} found, at least ${least} ${least === 1 ? "exists" : "exist"}`)
    + ` at alpha = ${short(state.alpha)}` + (special ? ", a critical alpha (rounded)" : "");
  if (data.body) moveBodies(solved);
  const scales = scalesOf(solved, state.alpha), share = Number((100 * data.tolerance).toPrecision(3));
  byId("scale").textContent = scaleWords(scales) + (solved.length ? ` Values between points of an arc are interpolated, to ${share} % of what the arcs span.` : "");
  showCards(found, scales);
}

// -- deformed bodies ----------------------------------------------------------------------------------------------

function moves(f) {
  const body = data.body, free = along([], body.u0, body.u1, body.c), u = along(f, body.u0, body.u1, body.c);
  // of a body at rest, the seven digits of these numbers leave rounding
  const largest = (values) => values.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
  return largest(u) > 5e-7 * largest(free) ? u : u.map(() => 0);
}

// what is linear in alpha and in the contact forces
function along(f, constant, slope, columns) {
  const sum = constant.map((x, i) => x + state.alpha * slope[i]);
  f.forEach((force, k) => { if (force !== 0) columns[k].forEach((x, i) => { sum[i] -= force * x; }); });
  return sum;
}

function nodalForces(f) {
  const forces = new Map();
  f.forEach((force, k) => data.body.acts[k].forEach(([node, ...acts]) => {
    const sum = forces.get(node);
    forces.set(node, acts.map((x, c) => force * x + (sum ? sum[c] : 0)));
  }));
  // what is far below the largest is rounding
  const length = ([, sum]) => Math.hypot(...sum), most = [...forces].reduce((found, entry) => Math.max(found, length(entry)), 0);
  return [...forces].filter((entry) => length(entry) > 1e-9 * most).map(([node, sum]) => [node, ...sum]);
}

function moveBodies(solutions) {
  for (const item of solutions) {
    item.u = moves(item.f);
    item.forces = nodalForces(item.f);
    if (data.body.s0) item.s = along(item.f, data.body.s0, data.body.s1, data.body.s);
  }
  prepare(solutions);
}
