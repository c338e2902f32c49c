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
    const name = `branch ${arc.branch}`, colour = onPage(branches.get(arc.branch).colour);
    if (arc.dimension > 0) found.push({ name, colour, words: `a sheet: a continuum of dimension ${arc.dimension}` });
    else found.push({ name, key: `arc ${arc.number}`, colour, words: `arc ${arc.number}, index ${signed(arc.index)}`, statuses: arc.statuses, several: [], ...between(arc, alpha) });
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
    + ` at alpha = ${short(state.alpha)}` + (special ? ", a critical alpha (rounded)" : "");
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
  const made = element("article", { className: "card" }), heading = element("h3", {}, dot, item.name);
  made.append(heading, element("p", {}, item.words));
  if (!item.f) return made;
  made.append(element("p", {}, runs(item.statuses)));
  if (item.several.length) made.append(element("p", {}, `several statuses hold at: ${item.several.map((k) => data.nodes[k]).join(", ")}`));
  if (data.body) heading.append(enlarge(item, made));
  made.append(data.body ? bodyFigure(item, scales) : drawBars(item, scales), strip(item));
  const details = element("details", {}, element("summary", {}, "values by nodes"));
  details.addEventListener("toggle", () => {
    if (details.childElementCount > 1) return;
    const rows = data.nodes.map((label, k) => [label, status(item.statuses, k), ...[item.f, item.w].flatMap((v) => [short(v[k]), short(v[p + k])])]);
    details.append(table(`Contact nodes, ${item.name}`, ["node", "status", "lambda_n", "lambda_t", "u_n", "u_t"], rows));
  });
  made.append(details);
  return made;
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
  return [...forces].map(([node, sum]) => [node, ...sum]);
}

function bodyScales(solutions) {
  let force = 0;
  for (const item of solutions) {
    item.u = moves(item.f);
    item.forces = nodalForces(item.f);
    for (const [, x, y] of item.forces) force = Math.max(force, Math.hypot(x, y));
  }
  prepare(solutions);
  return { force, alpha: state.alpha, words: `Arrows are contact forces on the body; the longest is ${short(force)}${unit("force")}` };
}

// -- where the body cannot be drawn: forces and displacements of the nodes -------------------------------------------

function barScales(solutions) {
  const largest = (key) => Math.max(1e-300, ...solutions.flatMap((item) => item[key].map(Math.abs)));
  return {
    f: largest("f"), w: largest("w"),
    words: `${data.no_body}. Upper bars are forces (largest ${short(largest("f"))}${unit("force")}), lower bars displacements (largest ${short(largest("w"))}${unit("length")}); left of a node normal, right tangential`,
  };
}
