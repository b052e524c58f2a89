"use strict";
(() => {
const page = JSON.parse(document.getElementById("data").textContent);
const NS = "http://www.w3.org/2000/svg", LEFT = 92, RIGHT = 14, INK = "#1a1a1a", LINE = "#dddddd";
const MIN_SAMPLES = 4, ROW = 18;
const [FIRST, LAST] = page.limits;
const hidden = new Set(), off = new Set();  // panels, and looks of curves, that are not shown
let view = [FIRST, LAST], width = 800, pending = false, cursor = null, pinned = null;

const make = (name, attributes, parent, text) => {
  const node = document.createElementNS(NS, name);
  for (const key in attributes) node.setAttribute(key, attributes[key]);
  if (text !== undefined) node.textContent = text;
  if (parent) parent.appendChild(node);
  return node;
};
const clock = (t) => {
  const two = (n) => String(n).padStart(2, "0"), day = 86400;
  const whole = page.midnight !== null ? (Math.round(t - page.midnight) % day + day) % day : Math.round(Math.abs(t));
  const h = Math.floor(whole / 3600), m = Math.floor(whole / 60) % 60;
  if (page.midnight !== null) return [h, m, whole % 60].map(two).join(":");
  return (t <= -0.5 ? "−" : "") + (h ? h + ":" + two(m) : m) + ":" + two(whole % 60);
};
const step = (span, most) => {
  const raw = span / most, ten = Math.pow(10, Math.floor(Math.log10(raw)));
  return ten * [1, 2, 5, 10].find((n) => n * ten >= raw);
};
const ticks = (low, high, most) => {
  if (!(high > low)) return [];
  const by = step(high - low, most), places = [];
  for (let i = Math.ceil(low / by); i * by <= high + 1e-9 * by; i++) places.push(i * by);
  return places;
};
const CLOCK_STEPS = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 43200, 86400];
const clockTicks = (low, high, most) => {
  const by = CLOCK_STEPS.find((step_s) => (high - low) / step_s <= most) || step(high - low, most), places = [];
  const zero = page.midnight || 0;
  for (let i = Math.ceil((low - zero) / by); zero + i * by <= high; i++) places.push(zero + i * by);
  return places;
};
const readable = (value) => value === null ? "–" : String(Number(value.toPrecision(5))).replace("-", "−");
const number = (value, by) => value.toFixed(Math.min(8, Math.max(0, Math.ceil(-Math.log10(by) - 1e-9)))).replace("-", "−");
const at = (t) => LEFT + (t - view[0]) / (view[1] - view[0]) * (width - LEFT - RIGHT);
// The first sample at or after a time.
const find = (x, t) => {
  let low = 0, high = x.length;
  while (low < high) { const mid = (low + high) >> 1; if (x[mid] < t) low = mid + 1; else high = mid; }
  return low;
};

// The value of a curve at a time, between samples in a straight line; null beside a gap.
const value = (curve, t) => {
  const i = find(curve.x, t), x = curve.x, y = curve.y;
  if (i === x.length || (i === 0 && x[0] !== t)) return null;
  if (x[i] === t || y[i] === null || y[i - 1] === null) return x[i] === t ? y[i] : null;
  return y[i - 1] + (t - x[i - 1]) / (x[i] - x[i - 1]) * (y[i] - y[i - 1]);
};

// The points of a curve in view: of many, the least and the greatest of each pixel, so that no spike is lost.
const visible = (curve) => {
  const from = Math.max(0, find(curve.x, view[0]) - 1), to = Math.min(curve.x.length, find(curve.x, view[1]) + 1);
  if (to - from <= 3 * width) return Array.from({ length: to - from }, (_, i) => from + i);
  const kept = [];
  let pixel = null, least = -1, greatest = -1;
  const close = () => {
    if (least < 0) return;
    kept.push(Math.min(least, greatest));
    if (least !== greatest) kept.push(Math.max(least, greatest));
  };
  for (let i = from; i < to; i++) {
    const now = Math.floor(at(curve.x[i]));
    if (now !== pixel || curve.y[i] === null) {
      close();
      pixel = now; least = greatest = -1;
      if (curve.y[i] === null) { kept.push(i); continue; }
    }
    if (least < 0 || curve.y[i] < curve.y[least]) least = i;
    if (greatest < 0 || curve.y[i] > curve.y[greatest]) greatest = i;
  }
  close();
  return kept;
};

const drawBands = (panel, svg, height) => {
  for (const [label, low, high, shade] of panel.bands) {
    if (high < view[0] || low > view[1]) continue;
    const [face, edge] = page.shades[shade], a = Math.max(LEFT, at(low)), b = Math.min(width - RIGHT, at(high));
    if (high > low) make("rect", { x: a, y: 0, width: Math.max(0, b - a), height, fill: face, opacity: 0.45 }, svg);
    else make("line", { x1: a, x2: a, y1: 0, y2: height, stroke: edge, "stroke-width": 1.3, "stroke-dasharray": "5 3" }, svg);
  }
};
const drawLanes = (panel, svg, top) => {
  panel.lanes.forEach((lane, row) => {
    const y = top + row * ROW;
    make("text", { x: LEFT - 8, y: y + 12, "text-anchor": "end", fill: INK }, svg, lane.label);
    lane.blocks.forEach(([label, low, high, shade], i) => {
      if (high < view[0] || low > view[1]) return;
      const [face, edge] = page.shades[shade], loud = shade === "fault" || shade === "suspect";
      const a = Math.max(LEFT, at(low)), b = Math.min(width - RIGHT, at(high));
      const box = make("rect", { x: a, y: y + 1, width: Math.max(loud ? 2.5 : 0.5, b - a), height: ROW - 4, fill: face, stroke: edge }, svg);
      Object.assign(box.dataset, { low, high });
      make("title", {}, box, (label || lane.label) + ": " + low + " s" + (high > low ? " to " + high + " s" : ""));
      const room = 6.2 * label.length + 8;
      if (loud) {
        const right = b + room < width - RIGHT;
        make("text", { x: right ? b + 5 : a - 5, y: y + 12, "text-anchor": right ? "start" : "end", fill: INK }, svg, label);
      } else if (room < b - a) {
        const dark = shade === "blue" || shade === "black";
        make("text", { x: (a + b) / 2, y: y + 12, "text-anchor": "middle", fill: dark ? "#fff" : INK, "pointer-events": "none" }, svg, label);
      } else if (shade === "outline") {
        const free = i + 1 < lane.blocks.length ? at(lane.blocks[i + 1][1]) : width - RIGHT;
        if (b + room < free) make("text", { x: b + 4, y: y + 12, fill: INK }, svg, label);
      }
    });
  });
};
// Ends of an axis about values.
const padded = (values) => {
  let low = Infinity, high = -Infinity;
  for (const reading of values) { low = Math.min(low, reading); high = Math.max(high, reading); }
  if (!(high >= low)) return [0, 1];
  const pad = high > low ? 0.06 * (high - low) : 0.5 * Math.max(Math.abs(high), 1e-9);
  return [low - pad, high + pad];
};
// A line through points [x, y]; null lifts the pen.
const line = (points) => points.map((point, i) => point ? (i && points[i - 1] ? "L" : "M") + point[0].toFixed(1) + " " + point[1].toFixed(1) : "").join("");
const drawCurves = (panel, svg, height) => {
  const scaled = (reading) => reading === null || !panel.log ? reading : reading > 0 ? Math.log10(reading) : null;
  const curves = panel.curves.filter((curve) => !off.has(curve.look)), shown = curves.map(visible), inside = [];
  curves.forEach((curve, c) => {
    for (const i of shown[c]) {
      if (curve.x[i] < view[0] || curve.x[i] > view[1]) continue;
      for (const reading of [curve.y[i], ...curve.band.map((end) => end[i])]) if (scaled(reading) !== null) inside.push(scaled(reading));
    }
  });
  const [low, high] = padded(inside), y = (reading) => (high - scaled(reading)) / (high - low) * height, most = Math.max(2, height / 32);
  panel.y = y;
  for (const place of ticks(low, high, most)) {
    const real = panel.log ? Math.pow(10, place) : place, text = panel.log ? real.toPrecision(2) : number(place, step(high - low, most));
    make("line", { x1: LEFT, x2: width - RIGHT, y1: y(real), y2: y(real), stroke: LINE }, svg);
    make("text", { x: LEFT - 6, y: y(real) + 4, "text-anchor": "end", fill: INK }, svg, text);
  }
  for (const [name, place] of panel.levels) {
    if (!(scaled(place) > low && scaled(place) < high)) continue;
    make("line", { class: "level", x1: LEFT, x2: width - RIGHT, y1: y(place), y2: y(place), stroke: "#000", "stroke-dasharray": "7 4" }, svg);
    make("text", { x: LEFT + 5, y: y(place) < 14 ? y(place) + 12 : y(place) - 3, fill: INK, class: "value" }, svg, name);
  }
  curves.forEach((curve, c) => {
    const points = (ends) => shown[c].map((i) => scaled(ends[i]) === null ? null : [at(curve.x[i]), y(ends[i])]);
    if (curve.band.length) {
      const outline = [...points(curve.band[0]), ...points(curve.band[1]).reverse()].filter((point) => point);
      make("path", { d: line(outline), fill: curve.colour, opacity: 0.18, "clip-path": "url(#inside)" }, svg);
    }
    make("path", { class: "curve", d: line(points(curve.y)), fill: "none", stroke: curve.colour, "stroke-width": 1.1, "clip-path": "url(#inside)" }, svg);
  });
  const [name, unit] = panel.label;
  const label = make("text", { transform: "translate(13," + height / 2 + ") rotate(-90)", "text-anchor": "middle", fill: INK, class: "name" }, svg);
  make("tspan", { x: 0 }, label, name);
  make("tspan", { x: 0, dy: 13 }, label, unit);
};

const drawings = page.panels.map((panel) => {
  const svg = make("svg", { role: "img" });
  make("title", {}, svg, panel.label.join(" ") || "phases");
  document.getElementById("panels").appendChild(svg);
  return svg;
});
const draw = () => {
  pending = false;
  width = Math.max(320, document.getElementById("panels").clientWidth);
  const lowest = page.panels.map((_, p) => p).filter((p) => !hidden.has(p)).pop();
  page.panels.forEach((panel, p) => {
    const svg = drawings[p], last = p === lowest, lanes = panel.lanes.length;
    const top = lanes ? 20 : 0, height = lanes ? top + ROW * lanes + 4 : panel.height, whole = height + (last ? 36 : 8);
    svg.style.display = hidden.has(p) ? "none" : "";
    svg.replaceChildren(svg.firstChild);
    if (hidden.has(p)) return;
    svg.setAttribute("viewBox", "0 0 " + width + " " + whole);
    svg.setAttribute("height", whole);
    const clip = make("clipPath", { id: "inside" }, make("defs", {}, svg));
    make("rect", { x: LEFT, y: -5, width: width - LEFT - RIGHT, height: 5000 }, clip);
    const by = step(view[1] - view[0], Math.max(2, width / 110));
    if (!lanes) drawBands(panel, svg, height);
    for (const t of ticks(view[0], view[1], Math.max(2, width / 110))) {
      make("line", { x1: at(t), x2: at(t), y1: top, y2: height, stroke: LINE }, svg);
      if (last) make("text", { x: at(t), y: height + 15, "text-anchor": "middle", fill: INK }, svg, number(t, by));
    }
    for (const t of lanes ? clockTicks(view[0], view[1], Math.max(2, width / 90)) : [])
      make("text", { x: at(t), y: 13, "text-anchor": "middle", fill: INK }, svg, clock(t));
    if (last) make("text", { x: (LEFT + width - RIGHT) / 2, y: height + 31, "text-anchor": "middle", fill: INK }, svg, "time [s]");
    if (lanes) drawLanes(panel, svg, top); else drawCurves(panel, svg, height);
    make("rect", { x: LEFT, y: top, width: width - LEFT - RIGHT, height: height - top, fill: "none", stroke: "#888" }, svg);
    for (const [name, dash] of [["pin", "2 3"], ["hair", ""]])
      make("line", { class: name, y1: top, y2: height, stroke: "#555", "stroke-dasharray": dash, visibility: "hidden", "pointer-events": "none" }, svg);
    make("g", { class: "dots", "pointer-events": "none" }, svg);
    make("text", { class: "value now", x: width - RIGHT - 5, y: top + 12, "text-anchor": "end", fill: INK, "pointer-events": "none" }, svg);
  });
  document.getElementById("view").textContent = number(view[0], 0.1) + " s to " + number(view[1], 0.1) + " s";
  drawXY();
  point();
};
const redraw = () => { if (!pending) { pending = true; requestAnimationFrame(draw); } };
const show = (low, high) => {
  const least = Math.min(page.step * MIN_SAMPLES, LAST - FIRST), span = Math.min(LAST - FIRST, Math.max(least, high - low));
  const middle = (low + high) / 2, start = Math.min(Math.max(FIRST, middle - span / 2), LAST - span);
  view = [start, start + span];
  redraw();
};
const zoom = (factor, around) => {
  const centre = around === undefined ? (view[0] + view[1]) / 2 : around;
  show(centre + (view[0] - centre) * factor, centre + (view[1] - centre) * factor);
};
const pan = (share) => { const by = share * (view[1] - view[0]); show(view[0] + by, view[1] + by); };

// The values at the time line, in every panel and in the XY view; with a second line that a click set, their change.
const point = () => {
  const since = pinned === null || cursor === null ? "" : ", " + number(cursor - pinned, 0.01) + " s after " + number(pinned, 0.01) + " s";
  document.getElementById("cursor").textContent = cursor === null ? "" : number(cursor, 0.01) + " s (" + clock(cursor) + ")" + since;
  page.panels.forEach((panel, p) => {
    const svg = drawings[p], text = svg.querySelector(".now");
    if (hidden.has(p)) return;
    for (const [name, t] of [["hair", cursor], ["pin", pinned]]) {
      const line = svg.querySelector("." + name), seen = t !== null && t >= view[0] && t <= view[1];
      line.setAttribute("visibility", seen ? "visible" : "hidden");
      if (seen) { line.setAttribute("x1", at(t)); line.setAttribute("x2", at(t)); }
    }
    const dots = svg.querySelector(".dots");
    text.replaceChildren(); dots.replaceChildren();
    if (cursor === null) return;
    for (const curve of panel.curves.filter((curve) => !off.has(curve.look))) {
      const now = value(curve, cursor), then = pinned === null ? null : value(curve, pinned);
      const change = now === null || then === null ? "" : " (" + (now < then ? "" : "+") + readable(now - then) + ")";
      make("tspan", { fill: curve.colour, dx: text.firstChild ? 12 : 0 }, text, readable(now) + change);
      if (now !== null) make("circle", { cx: at(cursor), cy: panel.y(now), r: 2.6, fill: curve.colour }, dots);
    }
  });
  pointXY();
};

// Two channels against each other over the time in view.
const all = page.panels.flatMap((panel) => panel.curves), xy = document.getElementById("xy"), TALL = 380, BELOW = 36;
const across = document.getElementById("across"), up = document.getElementById("up");
let seenXY = [], toXY = null;
[across, up].forEach((select, s) => {
  for (const name of [s ? "" : "off", ...all.map((curve) => curve.name)]) select.appendChild(document.createElement("option")).textContent = name;
  select.addEventListener("change", () => {
    if (across.selectedIndex && !up.selectedIndex) up.selectedIndex = across.selectedIndex % all.length + 1;
    redraw();
  });
});
const drawXY = () => {
  const a = all[across.selectedIndex - 1], b = all[up.selectedIndex - 1];
  xy.toggleAttribute("hidden", !a || !b);
  xy.style.display = a && b ? "" : "none";
  xy.replaceChildren();
  toXY = null;
  if (!a || !b) return;
  xy.setAttribute("viewBox", "0 0 " + width + " " + TALL);
  const from = find(a.x, view[0]), to = find(a.x, view[1] + 1e-9);
  const values = a.x.slice(from, to).map((t, i) => [a.y[from + i], value(b, t), t]).map((point) => point[0] === null || point[1] === null ? null : point);
  const known = values.filter((point) => point), foot = TALL - BELOW;
  const [left, right] = padded(known.map((point) => point[0])), [low, high] = padded(known.map((point) => point[1]));
  toXY = (point) => [LEFT + (point[0] - left) / (right - left) * (width - LEFT - RIGHT), (high - point[1]) / (high - low) * foot];
  seenXY = known.map((point) => [...toXY(point), point[2]]);
  for (const place of ticks(left, right, width / 110)) {
    const x = toXY([place, low])[0];
    make("line", { x1: x, x2: x, y1: 0, y2: foot, stroke: LINE }, xy);
    make("text", { x, y: foot + 15, "text-anchor": "middle", fill: INK }, xy, number(place, step(right - left, width / 110)));
  }
  for (const place of ticks(low, high, 10)) {
    const y = toXY([left, place])[1];
    make("line", { x1: LEFT, x2: width - RIGHT, y1: y, y2: y, stroke: LINE }, xy);
    make("text", { x: LEFT - 6, y: y + 4, "text-anchor": "end", fill: INK }, xy, number(place, step(high - low, 10)));
  }
  make("text", { x: (LEFT + width - RIGHT) / 2, y: foot + 31, "text-anchor": "middle", fill: INK }, xy, a.name);
  make("text", { transform: "translate(13," + foot / 2 + ") rotate(-90)", "text-anchor": "middle", fill: INK }, xy, b.name);
  make("path", { class: "curve", d: line(values.map((point) => point && toXY(point))), fill: "none", stroke: b.colour, "stroke-width": 1 }, xy);
  make("rect", { x: LEFT, y: 0, width: width - LEFT - RIGHT, height: foot, fill: "none", stroke: "#888" }, xy);
  make("g", { class: "dots", "pointer-events": "none" }, xy);
};
const pointXY = () => {
  const a = all[across.selectedIndex - 1], b = all[up.selectedIndex - 1], dots = xy.querySelector(".dots");
  if (!toXY || !dots) return;
  dots.replaceChildren();
  for (const [t, fill] of [[pinned, "#fff"], [cursor, INK]]) {
    if (t === null || value(a, t) === null || value(b, t) === null) continue;
    const [cx, cy] = toXY([value(a, t), value(b, t)]);
    make("circle", { cx, cy, r: 4.5, fill, stroke: INK }, dots);
  }
};
xy.addEventListener("pointermove", (event) => {
  const box = xy.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
  let best = Infinity;
  for (const [px, py, t] of seenXY) if (Math.hypot(px - x, py - y) < best) { best = Math.hypot(px - x, py - y); cursor = t; }
  point();
});

// A button for each panel, and one for each label of curves, shows or hides.
const toggle = (button, set, key) => button.addEventListener("click", () => {
  if (!set.delete(key)) set.add(key);
  button.setAttribute("aria-pressed", String(!set.has(key)));
  redraw();
});
page.panels.forEach((panel, p) => {
  const button = document.getElementById("channels").appendChild(document.createElement("button"));
  button.textContent = panel.label.join(" ").replace(/ ?\[[^\]]*\] ?$/, "").trim() || "phases";
  button.setAttribute("aria-pressed", "true");
  toggle(button, hidden, p);
});
for (const button of document.querySelectorAll("[data-look]")) toggle(button, off, Number(button.dataset.look));

const panels = document.getElementById("panels");
const time = (event) => {
  const box = panels.getBoundingClientRect();
  return view[0] + (event.clientX - box.left - LEFT) / (width - LEFT - RIGHT) * (view[1] - view[0]);
};
let held = null;
panels.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (event.shiftKey) pan(Math.sign(event.deltaY || event.deltaX) * 0.1);
  else zoom(Math.pow(1.0015, event.deltaY), time(event));
}, { passive: false });
panels.addEventListener("pointerdown", (event) => { held = { t: time(event), x: event.clientX, moved: false }; });
panels.addEventListener("pointermove", (event) => {
  const t = time(event);
  if (!event.buttons) held = null;  // released outside
  if (held && !held.moved && Math.abs(event.clientX - held.x) > 3) {
    held.moved = true;
    panels.setPointerCapture(event.pointerId);
  }
  if (held && held.moved) show(view[0] + held.t - t, view[1] + held.t - t);
  cursor = t >= view[0] && t <= view[1] ? t : null;
  point();
});
panels.addEventListener("pointerup", (event) => {
  const box = event.target.dataset, t = time(event), click = held && !held.moved;
  held = null;
  if (!click) return;
  if (box.low !== undefined) {
    const low = Number(box.low), high = Number(box.high), more = Math.max(0.5 * (high - low), 0.02 * (LAST - FIRST));
    show(low - more, high + more);
  } else if (t >= view[0] && t <= view[1]) {
    pinned = pinned !== null && Math.abs(at(pinned) - at(t)) < 5 ? null : t;
    point();
  }
});
panels.addEventListener("pointercancel", () => { held = null; });
panels.addEventListener("pointerleave", () => { cursor = null; point(); });
panels.addEventListener("dblclick", () => { pinned = null; show(FIRST, LAST); });
const acts = { in: () => zoom(0.5), out: () => zoom(2), left: () => pan(-0.25), right: () => pan(0.25), all: () => show(FIRST, LAST) };
for (const button of document.querySelectorAll("button[value]")) button.addEventListener("click", acts[button.value]);
const keys = { "+": "in", "=": "in", "-": "out", ArrowLeft: "left", ArrowRight: "right", Home: "all", "0": "all" };
document.addEventListener("keydown", (event) => {
  if (!keys[event.key] || event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  acts[keys[event.key]]();
});
window.addEventListener("resize", redraw);
draw();
})();
