// Deformed bodies: pictures in the plane that can be zoomed; enlargements and colours of these and of bodies in 3D.
const look = { same: false, factor: 1, colour: "none", common: 1 };
const given = new Map(), views = new Map(), large = new Set();
const SEQUENTIAL = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const DIVERGING = [[33, 102, 172], [146, 197, 222], [240, 240, 240], [244, 165, 130], [178, 24, 43]];
const COLOURINGS = {
  none: { words: "by nothing" },
  moved: { words: "by displacement", stops: SEQUENTIAL },
  shear: { words: "by largest shear stress in the plane", stops: SEQUENTIAL },
  mean: { words: "by mean stress in the plane", stops: DIVERGING },
  mises: { words: "by von Mises stress", stops: SEQUENTIAL },
  pressure: { words: "by mean stress", stops: DIVERGING },
};
const dimension = data.body ? data.body.points[0].length : 0;
const unit = (powers) => {
  if (!data.units) return "";
  const [force, length] = data.units;
  return ` ${powers === "force" ? force : powers === "length" ? length : `${force}/${length}\u00b2`}`;
};

// -- enlargements ---------------------------------------------------------------------------------------------------

// a number of the form 1, 2 or 5 times a power of ten, at most this
function rounded(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return Number((power * Math.max(...[1, 2, 5].filter((step) => step * power <= x * (1 + 1e-9)))).toPrecision(1));
}

const lengthOf = (u, node) => Math.hypot(...u.slice(dimension * node, dimension * node + dimension));

// the largest displacement of a body takes a twelfth of its size, unless the reader says otherwise
function prepare(items) {
  const moving = [];
  for (const item of items) {
    item.largest = data.body.points.reduce((most, _, node) => Math.max(most, lengthOf(item.u, node)), 0);
    if (item.largest > 0) moving.push(item);
  }
  for (const item of moving) item.own = rounded((0.08 * data.body.size) / item.largest);
  look.common = Math.min(...moving.map((item) => item.own), Infinity);
  if (look.common === Infinity) look.common = 1;
}

const enlargement = (item) => given.get(item.key) ?? Number(((look.same || !item.own ? look.common : item.own) * look.factor).toPrecision(3));

function lookControls(redraw) {
  if (!data.body || nodesOnly) return;
  const names = ["none", "moved"];
  if (dimension === 2 && data.body.cells && data.body.lame) names.push("shear", "mean");
  if (data.body.s0 || data.roots?.some((item) => item.s)) names.push("mises", "pressure");
  const option = ([value, text]) => element("option", { value }, text);
  const select = (words, entries, change) => {
    const made = element("select", {}, ...entries.map(option));
    made.addEventListener("change", () => { change(made.value); redraw(); });
    return element("label", {}, `${words} `, made);
  };
  const times = (text, words, factor) => {
    const made = element("button", { type: "button", "aria-label": words }, text);
    made.addEventListener("click", () => {
      for (const [key, value] of given) given.set(key, value * factor);
      look.factor *= factor;
      redraw();
    });
    return made;
  };
  const controls = [
    select("enlargement of displacements", [["own", "each body its own"], ["same", "the same for all"]], (value) => { look.same = value === "same"; look.factor = 1; given.clear(); }),
    element("span", {}, times("\u00f7 2", "halve the enlargement of all bodies", 0.5), times("\u00d7 2", "double the enlargement of all bodies", 2)),
    select("pictures", [["420px", "large"], ["270px", "small"], ["100%", "one in a row"]], (value) => byId("cards").style.setProperty("--card", value)),
  ];
  if (dimension === 3 ? data.body.triangles : data.body.cells) {
    controls.splice(2, 0, select("coloured", names.map((name) => [name, COLOURINGS[name].words]), (value) => { look.colour = value; }));
  }
  byId("looks").replaceChildren(...controls);
  byId("looks").hidden = false;
}

// the line below a picture with the enlargement of its body
function enlargementOf(item, redraw) {
  const input = element("input", { type: "number", min: 0, step: "any", value: String(enlargement(item)) });
  input.addEventListener("change", () => {
    const value = Number(input.value);
    if (input.value !== "" && value >= 0) given.set(item.key, value);
    else given.delete(item.key);
    input.value = String(enlargement(item));
    redraw();
  });
  return element("label", {}, "displacements \u00d7 ", input);
}

function enlarge(item, made, redraw = () => {}) {
  const button = element("button", { type: "button" });
  const show = () => {
    made.classList.toggle("large", large.has(item.key));
    button.textContent = large.has(item.key) ? "smaller" : "larger";
    button.setAttribute("aria-label", `${button.textContent} picture of ${item.name}`);
  };
  button.addEventListener("click", () => { if (!large.delete(item.key)) large.add(item.key); show(); redraw(); });
  show();
  return button;
}

// -- colours --------------------------------------------------------------------------------------------------------

function shade(stops, share) {
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
  return `rgb(${stops[k].map((x, c) => Math.round(x + (at - k) * (stops[k + 1][c] - x))).join(",")})`;
}

// mean gradient of u over a cell by the theorem of Gauss; along an edge with a node between, all is a parabola
function gradient(cell, u) {
  const { points } = data.body, quadratic = cell.length > 4, step = quadratic ? 2 : 1;
  let area = 0;
  const sum = [[0, 0], [0, 0]];
  for (let i = 0; i < cell.length; i += step) {
    const a = cell[i], b = cell[(i + step) % cell.length];
    const along = (value) => { const [x, y] = [value(a), value(b)]; return [x, quadratic ? value(cell[i + 1]) : (x + y) / 2, y]; };
    const integral = (v, w) => (v[0] * (4 * w[1] - 3 * w[0] - w[2]) + 4 * v[1] * (w[2] - w[0]) + v[2] * (w[0] - 4 * w[1] + 3 * w[2])) / 6;
    const [x, y] = [0, 1].map((c) => along((node) => points[node][c]));
    area += integral(x, y);
    [0, 1].forEach((c) => {
      const moved = along((node) => u[2 * node + c]);
      sum[c][0] += integral(moved, y);
      sum[c][1] -= integral(moved, x);
    });
  }
  return sum.map((row) => row.map((value) => value / area));
}

// mean stress in the plane and the largest shear stress in it, of one cell
function stress(cell, k, u) {
  const { lame } = data.body, [lambda, mu] = lame[lame.length > 1 ? k : 0], [[xx, xy], [yx, yy]] = gradient(cell, u);
  return { mean: (lambda + mu) * (xx + yy), shear: mu * Math.hypot(xx - yy, xy + yx) };
}

function cellValues(item) {
  return data.body.cells.map((cell, k) => (look.colour === "moved"
    ? cell.reduce((sum, node) => sum + lengthOf(item.u, node), 0) / cell.length : stress(cell, k, item.u)[look.colour]));
}

// the bar of colours with its ends, and the range
function legend(values, item) {
  const { stops } = COLOURINGS[look.colour], largest = values.reduce((found, x) => Math.max(found, Math.abs(x)), 0);
  // strains that are rounding of the displacements are none
  const rounding = look.colour === "moved" ? 0 : (1e-6 * data.body.lame[0][1] * item.largest) / data.body.size;
  const most = largest > rounding ? largest : 0, from = stops === DIVERGING ? -most : 0;
  const bar = element("span", { className: "ramp" }), powers = look.colour === "moved" ? "length" : "stress";
  bar.style.background = `linear-gradient(90deg, ${stops.map((colour) => `rgb(${colour.join(",")})`).join(",")})`;
  const words = element("div", { className: "small" }, short(from), bar, `${short(most)}${unit(powers)}`);
  return { words, colour: (x) => shade(stops, most > 0 ? (x - from) / (most - from) : stops === DIVERGING ? 0.5 : 0) };
}

// -- pictures in the plane --------------------------------------------------------------------------------------------

const tidy = (x) => Number(x.toPrecision(6));
const outline = (groups, at, close) => groups.map((nodes) => `M${nodes.map((k) => `${tidy(at[k][0])} ${tidy(at[k][1])}`).join("L")}${close}`).join("");

function arrow(kind, [x, y], dx, dy, most, text) {
  const n = Math.hypot(dx, dy), head = Math.min(most, 0.5 * n), ux = dx / n, uy = dy / n;
  const corners = [[0, 0], [-ux - 0.4 * uy, -uy + 0.4 * ux], [-ux + 0.4 * uy, -uy - 0.4 * ux]];
  const line = svg("line", { class: kind, x1: x - dx, y1: y - dy, x2: x - 0.8 * head * ux, y2: y - 0.8 * head * uy });
  line.head = [x, y, 0.8 * head * ux, 0.8 * head * uy];
  const points = corners.map(([a, b]) => `${x + head * a},${y + head * b}`).join(" ");
  return [line, svg("polygon", { class: kind === "force" ? "force arrow" : kind, points, style: `transform-origin: ${x}px ${y}px` }, tip(text))];
}

// places and forces; what is far below the largest is rounding
function loadsAt(alpha) {
  const d = dimension, force = (row, c) => row[d + c] + alpha * row[2 * d + c];
  const loads = data.body.load.map((row) => [row.slice(0, d), row.slice(0, d).map((_, c) => force(row, c))]);
  const most = loads.reduce((found, [, vector]) => Math.max(found, Math.hypot(...vector)), 0);
  return { loads: loads.filter(([, vector]) => Math.hypot(...vector) > 1e-9 * most), most };
}

const loadWords = (vector) => `load ${short(Math.hypot(...vector))}${unit("force")}${data.body.summed ? ", the sum over nodes near it" : ""}`;

// a spring of length 4 s: points along it and across
const zigzag = (s) => Array.from({ length: 9 }, (_, k) => [k * 0.5 * s, k === 0 || k === 8 ? 0 : (k % 2 ? 0.8 : -0.8) * s]);

// springs and supports: what holds the body, at rest
function holds(centre) {
  const { points, held, springs, size } = data.body, s = 0.016 * size, made = [];
  for (const [node, nx, ny] of held) {
    const x = points[node][0], y = -points[node][1];
    if (nx === 0 && ny === 0) made.push(svg("rect", { class: "held", x: x - 0.7 * s, y: y - 0.7 * s, width: 1.4 * s, height: 1.4 * s }, tip("held in all directions")));
    else made.push(svg("line", { class: "wall", x1: x - 1.4 * s * ny, y1: y - 1.4 * s * nx, x2: x + 1.4 * s * ny, y2: y + 1.4 * s * nx }, tip("held across this line")));
  }
  for (const node of springs) {
    const x = points[node][0], y = -points[node][1], n = Math.hypot(x - centre[0], y - centre[1]) || 1, ux = (x - centre[0]) / n, uy = (y - centre[1]) / n;
    made.push(svg("polyline", { class: "wall", points: zigzag(s).map(([a, b]) => `${x + a * ux - b * uy},${y + a * uy + b * ux}`).join(" ") }, tip("spring to the ground")));
  }
  return made;
}

// the rigid foundation near each contact node, where it would be met: gaps are enlarged as displacements are
function walls(scale) {
  const { rows, points, size } = data.body;
  return data.body.walls.filter(([, , , gap]) => Math.abs(scale * gap) < 0.3 * size).map(([k, nx, ny, gap]) => {
    const [x, y] = rows[k].reduce(([a, b], [node, weight]) => [a + weight * points[node][0], b + weight * points[node][1]], [scale * gap * nx, scale * gap * ny]);
    const h = 0.02 * size;
    return svg("line", { class: "wall", x1: x - h * ny, y1: -(y + h * nx), x2: x + h * ny, y2: -(y - h * nx) }, tip(`foundation of node ${data.nodes[k]}, gap ${short(gap)}${unit("length")}`));
  });
}

function drawBody(item, { force, alpha }) {
  const { points, cells, lines, size, rows } = data.body, scale = enlargement(item), share = force > 0 ? (0.16 * size) / force : 0;
  const still = points.map(([x, y]) => [x, -y]), at = points.map(([x, y], k) => [x + scale * item.u[2 * k], -(y + scale * item.u[2 * k + 1])]);
  const groups = cells ?? lines, close = cells ? "Z" : "";
  const inside = [], seen = [...still, ...at];
  let words = null;
  if (look.colour !== "none" && cells) {
    const values = cellValues(item), ramp = legend(values, item);
    words = ramp.words;
    cells.forEach((cell, k) => {
      const path = svg("path", { class: "after", d: outline([cell], at, close) }, tip(`${short(values[k])}${unit(look.colour === "moved" ? "length" : "stress")}`));
      path.style.fill = ramp.colour(values[k]);
      path.style.setProperty("--own", path.style.fill);
      inside.push(path);
    });
  } else inside.push(svg("path", { class: cells ? "after" : "after empty", d: outline(groups, at, close) }));
  if (cells) inside.push(svg("path", { class: "rim", d: outline(data.body.rim, at, "") }));
  inside.push(svg("path", { class: "before", d: outline(data.body.rim, still, "") }));
  const centre = still.reduce(([a, b], [x, y]) => [a + x / still.length, b + y / still.length], [0, 0]);
  inside.push(...walls(scale), ...holds(centre));
  const { loads, most } = loadsAt(alpha);
  for (const [[x, y], vector] of loads) {
    const [dx, dy] = vector.map((value, c) => ((c ? -1 : 1) * 0.11 * size * value) / most);
    inside.push(...arrow("load", [x, -y], dx, dy, 0.022 * size, loadWords(vector)));
    seen.push([x - dx, -y - dy]);
  }
  for (const [node, fx, fy] of item.forces) {
    const length = Math.hypot(fx, fy);
    if (!(length > 1e-9 * force)) continue;
    inside.push(...arrow("force", at[node], share * fx, -share * fy, 0.03 * size, `contact force ${short(length)}${unit("force")}`));
    seen.push([at[node][0] - share * fx, at[node][1] + share * fy]);
  }
  const places = rows.map((row) => row.reduce(([a, b], [node, weight]) => [a + weight * at[node][0], b + weight * at[node][1]], [0, 0]));
  const along = places.slice(1).map(([x, y], k) => Math.hypot(x - places[k][0], y - places[k][1])).sort((a, b) => a - b);
  const mark = Math.min(0.013, 0.6 * (along[along.length >> 1] || size) / size) * size;
  places.forEach(([x, y], k) => {
    inside.push(marker(status(item.statuses, k), x, y, mark, `node ${data.nodes[k]}: ${status(item.statuses, k)}, lambda_n ${short(item.f[k])}${unit("force")}, lambda_t ${short(item.f[p + k])}${unit("force")}`));
  });
  const ends = (c, pick) => seen.reduce((found, point) => pick(found, point[c]), pick === Math.min ? Infinity : -Infinity);
  const room = 0.03 * size, box = [ends(0, Math.min) - room, ends(1, Math.min) - room, 0, 0];
  box[2] = Math.max(ends(0, Math.max) + room - box[0], 0.3 * size);
  box[3] = ends(1, Math.max) + room - box[1];
  if (force > 0) {
    const step = rounded(force), x = box[0] + room, y = box[1] + box[3] + 0.03 * size;
    box[3] += 0.06 * size;
    inside.push(...arrow("force", [x + share * step, y], share * step, 0, 0.03 * size, "scale of the contact forces").map((part) => { part.classList.remove("arrow"); return part; }));
    const text = svg("text", { x: x + share * step + 0.015 * size, y: y + 0.012 * size, "font-size": 0.034 * size });
    text.textContent = `${short(step)}${unit("force")}`;
    inside.push(text);
  }
  const label = `${item.name}, deformed body, displacements times ${short(scale)}; statuses along the boundary: ${runs(item.statuses)}`;
  const picture = svg("svg", { viewBox: box.join(" "), role: "img", class: "body", tabindex: 0, "aria-label": label }, ...inside);
  const touching = places.filter((_, k) => status(item.statuses, k) !== "open"), near = frameOf(touching.length ? touching : places, 0.06 * size);
  const [, , width, height] = frameOf(still, 0);
  return { picture, box, words, near, cell: cells ? Math.sqrt((width * height) / cells.length) : Infinity };
}

// x, y, width and height of what points take up, with room around it
function frameOf(points, room) {
  const [x, y] = [0, 1].map((c) => points.reduce(([low, high], point) => [Math.min(low, point[c]), Math.max(high, point[c])], [Infinity, -Infinity]));
  return [x[0] - room, y[0] - room, x[1] - x[0] + 2 * room, y[1] - y[0] + 2 * room];
}

// lines of the mesh are thin where cells are small on the screen, and gone where they are tiny
function thin(picture, cell) {
  const frame = picture.getBoundingClientRect(), view = picture.viewBox.baseVal, pixels = cell * Math.min(frame.width / view.width, frame.height / view.height);
  picture.classList.toggle("fine", pixels < 5);
  picture.style.setProperty("--mesh", Math.min(1, pixels / 16).toFixed(2));
}

// the part of a picture that is seen: by buttons, by keys, by dragging, and by the wheel where the picture has the focus
function zoomable(picture, whole, key, near, cell) {
  let seen = views.get(key) ?? [0, 0, 1, 1];
  const show = () => {
    const [x, y, w, h] = whole;
    picture.setAttribute("viewBox", [x + seen[0] * w, y + seen[1] * h, seen[2] * w, seen[3] * h].join(" "));
    // marks and heads of arrows keep about their size on the screen
    const shrunk = seen[2] ** 0.8;
    picture.style.setProperty("--shrunk", shrunk);
    for (const line of picture.querySelectorAll("line")) {
      if (!line.head) continue;
      const [tipX, tipY, backX, backY] = line.head;
      line.setAttribute("x2", tipX - shrunk * backX);
      line.setAttribute("y2", tipY - shrunk * backY);
    }
    if (seen[2] < 1) views.set(key, seen);
    else views.delete(key);
    picture.style.cursor = seen[2] < 1 ? "grab" : "";
    thin(picture, cell);
  };
  const see = (x, y, part) => { seen = [Math.min(Math.max(x, 0), 1 - part), Math.min(Math.max(y, 0), 1 - part), part, part]; show(); };
  const zoom = (by, cx = 0.5, cy = 0.5) => {
    const part = Math.min(Math.max(seen[2] / by, 0.02), 1);
    see(seen[0] + cx * (seen[2] - part), seen[1] + cy * (seen[3] - part), part);
  };
  const part = Math.min(Math.max(near[2] / whole[2], near[3] / whole[3], 0.02), 1), corner = [0, 1].map((c) => (near[c] + near[c + 2] / 2 - whole[c]) / whole[c + 2] - part / 2);
  const contact = () => { const before = seen; see(...corner, part); if (String(before) === String(seen)) see(0, 0, 1); };
  const move = (x, y) => see(seen[0] + x * seen[2], seen[1] + y * seen[3], seen[2]);
  const keys = { "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5), 0: () => see(0, 0, 1), ArrowLeft: () => move(-0.1, 0), ArrowRight: () => move(0.1, 0), ArrowUp: () => move(0, -0.1), ArrowDown: () => move(0, 0.1) };
  picture.addEventListener("keydown", (event) => {
    if (!(event.key in keys) || event.ctrlKey || event.metaKey || (event.key.startsWith("Arrow") && seen[2] === 1)) return;
    event.preventDefault();
    keys[event.key]();
  });
  picture.addEventListener("wheel", (event) => {
    if (document.activeElement !== picture) return;
    event.preventDefault();
    const frame = picture.getBoundingClientRect();
    zoom(event.deltaY < 0 ? 1.2 : 1 / 1.2, (event.clientX - frame.left) / frame.width, (event.clientY - frame.top) / frame.height);
  }, { passive: false });
  picture.addEventListener("pointermove", (event) => {
    if (event.buttons !== 1 || seen[2] === 1) return;
    const frame = picture.getBoundingClientRect();
    move(-event.movementX / frame.width, -event.movementY / frame.height);
  });
  picture.addEventListener("dblclick", () => see(0, 0, 1));
  show();
  new ResizeObserver(() => thin(picture, cell)).observe(picture);
  const button = (text, words, act) => { const made = element("button", { type: "button", "aria-label": words }, text); made.addEventListener("click", act); return made; };
  return element("span", { className: "end" }, button("\u2212", "zoom out", keys["-"]), button("+", "zoom in", keys["+"]), button("contact", "zoom to the contact, and back", contact), button("all", "see all of the body", keys[0]));
}

function bodyFigure(item, scales) {
  const holder = element("figure");
  const redraw = () => {
    const { picture, box, words, near, cell } = drawBody(item, scales);
    const below = element("div", { className: "small" }, enlargementOf(item, redraw), zoomable(picture, box, item.key, near, cell));
    const focused = holder.contains(document.activeElement) && document.activeElement.tagName === "INPUT";
    holder.replaceChildren(picture, ...(words ? [words] : []), below);
    if (focused) below.querySelector("input").focus();
  };
  redraw();
  return holder;
}

// -- statuses along the boundary, and what the marks mean ------------------------------------------------------------

const GLYPHS = { open: "\u25cb", stick: "\u25a0", "slip+": "\u25b2", "slip-": "\u25bc", slip: "\u25c6" };

function strip(item) {
  const cells = data.nodes.map((label, k) => {
    const name = status(item.statuses, k), cell = element("span", { title: `node ${label}: ${name}` }, GLYPHS[name]);
    cell.style.background = name === "open" ? "var(--bg)" : COLOURS[name];
    if (name === "open") cell.style.color = "var(--fg)";
    return cell;
  });
  const words = p > 1 ? `from node ${data.nodes[0]} to node ${data.nodes[p - 1]}` : `node ${data.nodes[0]}`;
  return element("div", { className: p > 40 ? "strip dense" : "strip", role: "img", title: words, "aria-label": `statuses ${words}: ${runs(item.statuses)}` }, ...cells);
}

const keyEntry = (kind, text) =>
  element("span", {}, svg("svg", { width: 30, height: 10 }, svg("line", { class: kind, x1: 0, y1: 5, x2: 30, y2: 5 })), text);

function bodyKeys(items) {
  const used = data.statuses.filter((_, code) => items.some((item) => item.statuses.includes(String(code))));
  const keys = used.map((name) => element("span", {}, svg("svg", { width: 14, height: 14 }, marker(name, 7, 7, 5, name)), name));
  if (!data.body || nodesOnly || !items.length) return keys;
  keys.push(keyEntry("force", "contact force on the body"), keyEntry("before", "undeformed body"));
  if (dimension === 3 && used.includes("slip")) keys.push(keyEntry("slid", "direction of slip"));
  const { load, summed } = data.body;
  if (load.length) keys.push(keyEntry("load", !summed ? "load" : load.length === 1 ? "load, the resultant" : "load (each arrow is a sum over nodes near it)"));
  if (dimension === 2 && data.body.walls.length) keys.push(keyEntry("wall", "foundation (gaps are enlarged as displacements are)"));
  if (data.body.held.length) keys.push(element("span", {}, svg("svg", { width: 12, height: 12 }, svg("rect", { class: "held", x: 2, y: 2, width: 8, height: 8 })), "support"));
  if (data.body.springs.length) keys.push(element("span", {}, svg("svg", { width: 30, height: 12 }, svg("polyline", { class: "wall", points: "0,6 4,1 10,11 16,1 22,11 26,6 30,6" })), "spring"));
  return keys;
}
