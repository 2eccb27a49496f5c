// The page that computes: a robot at rest, whose platform and carriers are dragged. DATA is that of live_page.py.
"use strict";

const STATUSES = ["optimal", "infeasible", "singular", "inaccurate", "invalid"];
// The record of robot_at_rest.c: names and sizes in its order.
const RECORD = [["pose", 6], ["carriers", 48], ["t_min", 32], ["t_max", 32], ["length", 1], ["tensions", 32],
  ["direction", 6], ["shortfall", 1], ["support", 1], ["margin", 1], ["anchors", 96], ["exits", 96],
  ["attachments", 96], ["lengths", 32], ["A", 192], ["w", 6], ["kept", 32]];
const COINCIDENT = 1e-9; // [m]: a shorter cable has no direction
const NEGLIGIBLE = 1e-9; // of a column's length: a smaller pull is rounding
const FINEST = 0.01; // of t_max, as in figures/tension_colours.py
const ARROW = 0.3, SHORTEST = 0.25, FORCELESS = 0.05; // as in viewer/snapshot.py
const FIELD = 0.75; // [rad], of view
const GRIP = 28; // [px] from a body, within which the pointer takes it
const PARTS = 10; // of a cable, so that bodies hide what is behind them only
const VIEWS = { top: [-Math.PI / 2, Math.PI / 2 - 1e-3], front: [-Math.PI / 2, 0], side: [0, 0], oblique: DATA.view };
const FIRST = DATA.flat ? VIEWS.front : DATA.view;

const $ = (id) => document.getElementById(id);
const add = (a, b) => a.map((x, i) => x + b[i]);
const less = (a, b) => a.map((x, i) => x - b[i]);
const times = (k, a) => a.map((x) => k * x);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.sqrt(dot(a, a));
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const triple = (numbers, i) => Array.from(numbers.slice(3 * i, 3 * i + 3));
const PREFIXES = [["G", 1e9], ["M", 1e6], ["m", 1e-3], ["u", 1e-6], ["n", 1e-9]];
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

// Four digits, or two of a very small number, no exponent, as base/text.py writes numbers.
function quantity(value, unit) {
  if (!Number.isFinite(value)) return "-";
  const size = Math.abs(value), small = size > 0 && size < 1e-3;
  const [prefix, scale] = small || size >= 1e7 ? PREFIXES.find(([, one]) => size >= (small ? 0.1 : 1) * one) || ["", Infinity] : ["", 1];
  const [whole, part] = String(Number((value / scale).toPrecision(small ? 2 : 4))).split(".");
  const grouped = whole.replace(/^-?\d{5,}$/, (all) => all.replace(/\B(?=(\d{3})+$)/g, "\u00a0"));
  return `${grouped}${part ? "." + part : ""} ${prefix}${unit}`;
}

// Where a body's frame at a pose has its points, R = Rz(yaw) Ry(pitch) Rx(roll).
function placed(pose, points) {
  const [cr, cp, cy] = pose.slice(3, 6).map(Math.cos), [sr, sp, sy] = pose.slice(3, 6).map(Math.sin);
  const R = [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
    [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], [-sp, cp * sr, cp * cr]];
  return points.map((point) => R.map((row, i) => pose[i] + dot(row, point)));
}

// Where a tension is between its limits, from 0 to 1.
function place(tension, low, high) {
  const step = FINEST * high, span = Math.log((high + step) / (low + step));
  if (Number.isNaN(tension)) return NaN;
  return span > 0 ? Math.log((clamp(tension, low, high) + step) / (low + step)) / span : 1;
}

function shade(at) {
  return Number.isNaN(at) ? DATA.noTension : DATA.shades[Math.round(at * (DATA.shades.length - 1))];
}

function start(core) {
  core._initialize();
  const record = bytes(DATA.record), view = {};
  new Uint8Array(core.memory.buffer, core.robot(), record.length).set(record);
  let from = core.numbers();
  for (const [name, size] of RECORD) {
    view[name] = new Float64Array(core.memory.buffer, from, size);
    from += 8 * size;
  }
  view.t_min.set(DATA.t_min), view.t_max.set(DATA.t_max), view.length[0] = DATA.length;

  // The robot at rest at a pose: null where a cable has no line.
  function at(pose, carriers) {
    view.pose.set(pose), view.carriers.set(carriers.flat());
    const m = DATA.t_min.length, status = STATUSES[core.solve()];
    const points = (name) => DATA.t_min.map((_, i) => triple(view[name], i));
    if (![...view.lengths.slice(0, m)].every((length) => length > COINCIDENT)) return null;
    return {
      status, pose, carriers, margin: view.margin[0], anchors: points("anchors"), exits: points("exits"),
      attachments: points("attachments"), lengths: Array.from(view.lengths.slice(0, m)), com: placed(pose, [DATA.com])[0],
      tensions: Array.from(view.tensions.slice(0, m), (t) => (status === "optimal" ? t : NaN)),
      certificate: status === "infeasible" || status === "singular" ? certificate(m) : null,
    };
  }

  function certificate(m) {
    const direction = Array.from(view.direction), atMax = [], atMin = [];
    for (let c = 0; c < m; c++) {
      const a = direction.map((_, i) => view.A[i * m + c]), pull = dot(direction, a);
      const size = norm(a.map((x, i) => (i < 3 ? x : x / DATA.length)));
      if (pull > NEGLIGIBLE * size) atMax.push(c + 1);
      else if (pull < -NEGLIGIBLE * size) atMin.push(c + 1);
    }
    return { direction, shortfall: view.shortfall[0], support: view.support[0], demand: dot(direction, view.w), atMax, atMin };
  }

  // The pose near this one at which the platform rests on cables of these lengths, or null.
  function rest(pose, carriers, lengths) {
    view.pose.set(pose), view.carriers.set(carriers.flat()), view.kept.set(lengths);
    return core.hang() ? Array.from(view.pose) : null;
  }

  run({ at, rest });
}

// A certificate in two sentences.
function described(proof) {
  const vector = (v) => `(${v.map((x) => (Math.round(100 * x) / 100 + 0).toFixed(2)).join(", ")})`;
  const force = proof.direction.slice(0, 3), moment = proof.direction.slice(3).map((x) => x * DATA.length);
  const along = [];
  if (norm(force) >= FORCELESS) along.push(`force ${vector(force)}`);
  if (norm(moment) >= FORCELESS) along.push(`moment ${vector(moment)} (divided by the characteristic length, ${quantity(DATA.length, "m")})`);
  const cables = (list, name) => (list.length ? `${name} of cable${list.length > 1 ? "s" : ""} ${list.join(", ")}` : "");
  const limits = [cables(proof.atMin, "t_min"), cables(proof.atMax, "t_max")].filter(Boolean).join("; ");
  return `Along ${along.join(", ")}: needed ${quantity(proof.demand, "N")}, available at most ` +
    `${quantity(proof.support, "N")}. Limits: ${limits || "no cable pulls along this direction, however large its tension"}.`;
}

function run({ at, rest }) {
  const canvas = document.querySelector("canvas"), ink = canvas.getContext("2d");
  const home = { pose: DATA.pose, carriers: DATA.carriers };
  const state = { pose: [...home.pose], carriers: home.carriers.map((row) => [...row]) };
  const camera = { turn: FIRST[0], rise: FIRST[1], distance: DATA.distance, target: [...DATA.centre] };
  let instant = null, last = null, lengths = null, projection = null, drawing = false;

  const hangs = () => $("hang").checked;
  const owner = (slider) => (slider.carrier === null ? state.pose : state.carriers[slider.carrier]);

  // ---- panel ----
  const strongest = Math.max(...DATA.t_max);
  const [prefix, newton] = strongest < 1 || strongest >= 1e7 ? PREFIXES.find(([, one]) => strongest >= one) || ["", 1] : ["", 1];
  $("limits").textContent = `limits [${prefix}N]`;
  const rows = DATA.t_min.map((low, i) => {
    const row = $("cables").insertRow();
    row.innerHTML = `<td>${i + 1}</td><td></td><td><div class="track"><div class="bar"></div></div></td>` +
      `<td>${Number((low / newton).toPrecision(4))} to ${Number((DATA.t_max[i] / newton).toPrecision(4))}</td>`;
    return { text: row.cells[1], bar: row.querySelector(".bar") };
  });
  const sliders = DATA.sliders.map((slider, i) => {
    if (i === 0 || DATA.sliders[i - 1].carrier !== slider.carrier) {
      const heading = document.createElement("h2");
      heading.textContent = slider.carrier === null ? "Platform" : `Carrier ${DATA.bodies[1 + slider.carrier].name}`;
      $("sliders").append(heading);
    }
    const label = document.createElement("label"), input = document.createElement("input"), shown = document.createElement("output");
    Object.assign(input, { type: "range", min: slider.low, max: slider.high, step: slider.step });
    input.setAttribute("aria-label", slider.label);
    input.oninput = () => { owner(slider)[slider.coordinate] = Number(input.value); update(slider.carrier === null); };
    label.append(slider.label.split(" ")[0], input, shown);
    $("sliders").append(label);
    return { slider, input, shown };
  });
  $("ramp").style.background = `linear-gradient(to right, ${DATA.shades.join(", ")})`;

  function verdict() {
    if (instant === null) {
      return ["bad", hangs() ? "The platform comes to rest nowhere near this pose with cables of these lengths."
        : "The ends of a cable coincide here, or one is inside its pulley."];
    }
    if (instant.certificate) {
      return ["bad", `No tensions inside the limits hold the platform here: short by ${quantity(instant.certificate.shortfall, "N")}.`];
    }
    return instant.status === "optimal" ? ["good", "Tensions inside the limits hold the platform here."]
      : ["bad", `The tensions could not be computed here (${instant.status}).`];
  }

  function tell() {
    [$("verdict").className, $("verdict").textContent] = verdict();
    const tensions = instant ? instant.tensions : DATA.t_min.map(() => NaN);
    const spare = tensions.map((t, i) => Math.min(t - DATA.t_min[i], DATA.t_max[i] - t)), nearest = spare.indexOf(Math.min(...spare));
    const facts = [];
    if (nearest >= 0) facts.push(`tension margin ${quantity(spare[nearest], "N")} (cable ${nearest + 1})`);
    if (instant && Number.isFinite(instant.margin)) facts.push(`capacity margin ${quantity(instant.margin, "N")}`);
    $("margins").textContent = facts.join("; ");
    $("proof").textContent = instant && instant.certificate ? described(instant.certificate) : "";
    tensions.forEach((t, i) => {
      const there = place(t, DATA.t_min[i], DATA.t_max[i]);
      rows[i].text.textContent = Number.isNaN(t) ? "none" : `${(t / newton).toFixed(2)} ${prefix}N`;
      rows[i].bar.style.width = `${Number.isNaN(t) ? 0 : 100 * there}%`;
      rows[i].bar.style.background = shade(there);
    });
    for (const { slider, input, shown } of sliders) {
      const value = owner(slider)[slider.coordinate];
      if (document.activeElement !== input || Number(input.value) !== value) input.value = value;
      const digits = Math.max(3, -Math.round(Math.log10(slider.step)));
      shown.textContent = `${(Number(value.toFixed(digits)) + 0).toFixed(digits)} ${slider.coordinate < 3 ? "m" : "rad"}`;
    }
  }

  // ---- the scene on the canvas ----
  function look() {
    const width = canvas.clientWidth, height = canvas.clientHeight, { turn, rise, distance, target } = camera;
    const back = [Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn), Math.sin(rise)];
    const right = [-Math.sin(turn), Math.cos(turn), 0], up = cross(back, right);
    const eye = add(target, times(distance, back)), scale = Math.min(width, height * 1.4) / 2 / Math.tan(FIELD / 2) / 1.2;
    const to = (point) => {
      const ray = less(point, eye), depth = Math.max(-dot(ray, back), 1e-3 * distance);
      return [width / 2 + scale * dot(ray, right) / depth, height / 2 - scale * dot(ray, up) / depth, depth];
    };
    return { to, eye, right, up, scale, width, height };
  }

  function draw(ratio = window.devicePixelRatio || 1) {
    drawing = false;
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    if (canvas.width !== Math.round(canvas.clientWidth * ratio) || canvas.height !== Math.round(canvas.clientHeight * ratio)) {
      canvas.width = Math.round(canvas.clientWidth * ratio), canvas.height = Math.round(canvas.clientHeight * ratio);
    }
    projection = look();
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    ink.fillStyle = colour("paper");
    ink.fillRect(0, 0, projection.width, projection.height);
    const line = (points, hue, width) => {
      ink.strokeStyle = hue, ink.lineWidth = width, ink.lineCap = "round";
      ink.beginPath();
      points.forEach((point, i) => (i ? ink.lineTo(...projection.to(point)) : ink.moveTo(...projection.to(point))));
      ink.stroke();
    };
    DATA.grid.forEach((ends) => line(ends, colour("grid"), 1));
    DATA.posts.forEach((ends) => line(ends, colour("part"), 1.5));
    DATA.boxes.forEach((ends) => line(ends, DATA.reach, 1));
    DATA.cloud.forEach(([point, hue]) => {
      const [x, y] = projection.to(point);
      ink.fillStyle = hue, ink.fillRect(x - 1, y - 1, 2, 2);
    });
    const shown = instant || last;
    if (!shown) return;
    // What is farther is drawn first.
    const pieces = [];
    const depth = (points) => points.reduce((sum, point) => sum + projection.to(point)[2], 0) / points.length;
    const strokes = (points, hue, width) => pieces.push({ depth: depth(points), paint: () => line(points, hue, width) });
    shown.anchors.forEach((anchor, i) => {
      const hue = instant ? shade(place(instant.tensions[i], DATA.t_min[i], DATA.t_max[i])) : DATA.noTension;
      const exit = shown.exits[i].every(Number.isFinite) ? shown.exits[i] : anchor, end = shown.attachments[i];
      strokes([anchor, exit], hue, 3);
      for (let k = 0; k < PARTS; k++) {
        strokes([k, k + 1].map((j) => add(exit, times(j / PARTS, less(end, exit)))), hue, 3);
      }
    });
    DATA.bodies.forEach((body, i) => {
      const pose = i ? shown.carriers[i - 1] : shown.pose, corners = placed(pose, body.corners);
      body.faces.forEach((face) => {
        const points = face.map((corner) => corners[corner]);
        pieces.push({ depth: depth(points), paint: () => polygon(points, body.colour) });
      });
      body.lines.forEach((points) => strokes(placed(pose, points), colour("ink"), 1.5));
    });
    pieces.sort((a, b) => b.depth - a.depth).forEach((piece) => piece.paint());
    dots(shown, colour);
    if (instant && instant.certificate) arrow(instant, colour("bad"));
    write(shown, colour("ink"), colour("paper"));

    function polygon(points, hue) {
      const n = cross(less(points[1], points[0]), less(points[2], points[0]));
      const light = 0.72 + 0.28 * Math.abs(n[2] + 0.5 * n[0]) / (1.2 * norm(n) || 1);
      ink.beginPath();
      points.forEach((point, i) => (i ? ink.lineTo(...projection.to(point)) : ink.moveTo(...projection.to(point))));
      ink.closePath();
      ink.globalAlpha = 0.82, ink.fillStyle = `rgb(${hue.map((part) => Math.round(part * Math.min(light, 1))).join(",")})`;
      ink.fill();
      ink.globalAlpha = 1, ink.strokeStyle = "#00000055", ink.lineWidth = 1, ink.stroke();
    }
  }

  function dots(shown, colour) {
    ink.fillStyle = colour("ink");
    [...shown.anchors, ...shown.attachments].forEach((point) => {
      const [x, y] = projection.to(point);
      ink.beginPath(), ink.arc(x, y, 2.5, 0, 2 * Math.PI), ink.fill();
    });
  }

  function arrow(shown, hue) {
    const force = shown.certificate.direction.slice(0, 3), { shortfall } = shown.certificate;
    if (norm(force) < FORCELESS) return;
    const grown = SHORTEST + (1 - SHORTEST) * shortfall / (shortfall + DATA.typical);
    const tip = add(shown.com, times(ARROW * DATA.size * grown, force));
    const [x0, y0] = projection.to(shown.com), [x1, y1] = projection.to(tip), heading = Math.atan2(y1 - y0, x1 - x0);
    ink.strokeStyle = ink.fillStyle = hue, ink.lineWidth = 4;
    ink.beginPath(), ink.moveTo(x0, y0), ink.lineTo(x1, y1), ink.stroke();
    ink.beginPath(), ink.moveTo(x1 + 8 * Math.cos(heading), y1 + 8 * Math.sin(heading));
    [2.5, -2.5].forEach((side) => ink.lineTo(x1 + 9 * Math.cos(heading + side), y1 + 9 * Math.sin(heading + side)));
    ink.fill();
  }

  // Number and tension beside each cable.
  function write(shown, hue, paper) {
    ink.font = "12px system-ui, sans-serif", ink.textAlign = "center", ink.textBaseline = "middle";
    ink.lineWidth = 3, ink.strokeStyle = paper, ink.fillStyle = hue;
    const boxes = [];
    shown.anchors.forEach((anchor, i) => {
      const t = instant ? instant.tensions[i] : NaN, text = `${i + 1}${Number.isNaN(t) ? "" : ": " + quantity(t, "N")}`;
      let [x, y] = projection.to(add(anchor, times(0.4, less(shown.attachments[i], anchor))));
      const width = ink.measureText(text).width, covers = ([a, b, w]) => Math.abs(a - x) < (w + width) / 2 + 4 && Math.abs(b - y) < 14;
      while (boxes.some(covers)) y += 14;
      boxes.push([x, y, width]);
      ink.strokeText(text, x, y), ink.fillText(text, x, y);
    });
  }

  // Moving the platform gives the cables the lengths of its pose; on these it hangs.
  function update(lengthen) {
    const here = instant = at(state.pose, state.carriers);
    if (lengthen && here) lengths = here.lengths;
    if (hangs() && lengths) {
      const pose = rest(state.pose, state.carriers, lengths);
      state.pose = pose || state.pose;
      instant = pose && at(pose, state.carriers);
    }
    last = instant || here || last;
    tell();
    history.replaceState(null, "", `#${[state.pose, ...state.carriers].flat().map((x) => Number(x.toFixed(5))).join(",")}`);
    redraw();
  }

  function redraw() {
    if (!drawing) drawing = true, requestAnimationFrame(() => draw());
  }

  // ---- pointer ----
  // Bodies that can move along some coordinate, by their number: 0 the platform.
  const movable = DATA.bodies.map((_, i) => DATA.sliders.filter((it) => it.coordinate < 3 && it.carrier === (i ? i - 1 : null)));

  function grabbed(x, y) {
    let best = null, least = Infinity;
    DATA.bodies.forEach((body, i) => {
      if (!movable[i].length) return;
      const pose = i ? state.carriers[i - 1] : state.pose;
      const corners = placed(pose, [[0, 0, 0], ...body.corners]).map(projection.to);
      const [xs, ys] = [0, 1].map((k) => corners.map((corner) => corner[k]));
      const outside = (value, values) => Math.max(Math.min(...values) - value, value - Math.max(...values), 0);
      const distance = Math.hypot(outside(x, xs), outside(y, ys));
      if (distance < GRIP && distance <= least) best = i, least = distance;
    });
    return best;
  }

  // Move a body so that it follows the pointer: the shortest displacement along its free axes that does.
  function drag(i, dx, dy) {
    const pose = i ? state.carriers[i - 1] : state.pose, [x, y] = projection.to(pose.slice(0, 3)), step = 1e-4 * DATA.size;
    const J = movable[i].map(({ coordinate }) => {
      const moved = pose.slice(0, 3);
      moved[coordinate] += step;
      const [mx, my] = projection.to(moved);
      return [(mx - x) / step, (my - y) / step];
    });
    const sum = (a, b) => J.reduce((all, row) => all + row[a] * row[b], 0);
    const damping = 1e-3 * (sum(0, 0) + sum(1, 1)) + 1e-12, xx = sum(0, 0) + damping, yy = sum(1, 1) + damping, xy = sum(0, 1);
    const det = xx * yy - xy * xy, px = (yy * dx - xy * dy) / det, py = (xx * dy - xy * dx) / det;
    movable[i].forEach((slider, k) => {
      const moved = pose[slider.coordinate] + J[k][0] * px + J[k][1] * py;
      pose[slider.coordinate] = clamp(moved, slider.low, slider.high);
    });
    update(i === 0);
  }

  const pointers = new Map();
  let held = null;
  const inside = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.onpointerdown = (event) => {
    const spot = inside(event);
    pointers.set(event.pointerId, spot);
    canvas.setPointerCapture(event.pointerId);
    held = pointers.size === 1 && event.button === 0 && !event.shiftKey ? grabbed(...spot) : null;
  };
  canvas.onpointermove = (event) => {
    const before = pointers.get(event.pointerId), spot = inside(event);
    if (!before) {
      canvas.style.cursor = projection && grabbed(...spot) !== null ? "move" : "grab";
      return;
    }
    const [dx, dy] = less(spot, before);
    if (pointers.size === 2) {
      const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
      zoom(norm(less(before, other)) / Math.max(norm(less(spot, other)), 1));
    } else if (held !== null) drag(held, dx, dy);
    else if (event.shiftKey || event.buttons === 2) {
      const scale = camera.distance / projection.scale;
      camera.target = add(camera.target, add(times(-dx * scale, projection.right), times(dy * scale, projection.up)));
    } else {
      camera.turn -= 0.006 * dx;
      camera.rise = clamp(camera.rise + 0.006 * dy, -Math.PI / 2 + 1e-3, Math.PI / 2 - 1e-3);
    }
    pointers.set(event.pointerId, spot);
    redraw();
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => {
    pointers.delete(event.pointerId);
    held = null;
  };
  canvas.oncontextmenu = (event) => event.preventDefault();
  const zoom = (factor) => {
    camera.distance = clamp(camera.distance * factor, 0.05 * DATA.size, 20 * DATA.size);
    redraw();
  };
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(0.001 * event.deltaY)); }, { passive: false });

  // ---- buttons ----
  document.querySelectorAll("[data-view]").forEach((button) => {
    button.onclick = () => {
      [camera.turn, camera.rise] = VIEWS[button.dataset.view];
      camera.target = [...DATA.centre], camera.distance = DATA.distance;
      redraw();
    };
  });
  const go = (pose, carriers) => {
    state.pose = [...pose], state.carriers = carriers.map((row) => [...row]);
    update(true);
  };
  $("hang").parentElement.hidden = !DATA.weight;
  $("hang").checked = DATA.few && DATA.weight;
  $("hang").onchange = () => update(false);
  $("home").onclick = () => go(home.pose, home.carriers);
  // Twice as fine as the screen, with the verdict and the scale of the colours.
  $("save").onclick = () => {
    draw(2);
    const { height } = projection;
    ink.textAlign = "left", ink.fillText(`${DATA.name}: ${$("verdict").textContent} ${$("margins").textContent}`, 12, 16);
    DATA.shades.forEach((hue, i) => { ink.fillStyle = hue, ink.fillRect(12 + 3 * i, height - 34, 3, 10); });
    ink.fillStyle = getComputedStyle(document.body).color;
    ink.fillText("t_min", 12, height - 12), ink.fillText("t_max", 12 + 3 * DATA.shades.length - 30, height - 12);
    const link = document.createElement("a");
    link.href = canvas.toDataURL("image/png"), link.download = `${DATA.name}.png`;
    link.click();
    redraw();
  };
  new ResizeObserver(redraw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

  // A link keeps the pose; a pose that is not one of this robot is left out.
  const kept = location.hash.slice(1).split(",").map(Number);
  if (kept.length === 6 + 6 * home.carriers.length && kept.every(Number.isFinite)) {
    state.pose = kept.slice(0, 6), state.carriers = home.carriers.map((_, i) => kept.slice(6 + 6 * i, 12 + 6 * i));
  }
  update(true);
  draw();
  window.towline = { at, rest, go, state, seen: (point) => projection.to(point).slice(0, 2) };
}

WebAssembly.instantiate(bytes(DATA.core)).then(({ instance }) => start(instance.exports));
