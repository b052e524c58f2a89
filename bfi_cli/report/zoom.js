"use strict";
(() => {
const page = JSON.parse(document.getElementById("data").textContent);
const NS = "http://www.w3.org/2000/svg", LEFT = 92, RIGHT = 14, INK = "#1a1a1a", LINE = "#dddddd";
const MIN_SAMPLES = 4, ROW = 18;
const [FIRST, LAST] = page.limits;
let view = [FIRST, LAST], width = 800, pending = false, cursor = null;

const make = (name, attributes, parent, text) => {
  const node = document.createElementNS(NS, name);
  for (const key in attributes) node.setAttribute(key, attributes[key]);
  if (text !== undefined) node.textContent = text;
  if (parent) parent.appendChild(node);
  return node;
};
const clock = (t) => {
  const whole = Math.round(Math.abs(t)), two = (n) => String(n).padStart(2, "0");
  const h = Math.floor(whole / 3600), m = Math.floor(whole / 60) % 60;
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
  const by = CLOCK_STEPS.find((one) => (high - low) / one <= most) || step(high - low, most), places = [];
  for (let i = Math.ceil(low / by); i * by <= high; i++) places.push(i * by);
  return places;
};
const number = (value, by) => value.toFixed(Math.min(8, Math.max(0, Math.ceil(-Math.log10(by) - 1e-9)))).replace("-", "−");
const at = (t) => LEFT + (t - view[0]) / (view[1] - view[0]) * (width - LEFT - RIGHT);
// The first sample at or after a time.
const find = (x, t) => {
  let low = 0, high = x.length;
  while (low < high) { const mid = (low + high) >> 1; if (x[mid] < t) low = mid + 1; else high = mid; }
  return low;
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
const drawCurves = (panel, svg, height) => {
  const shown = panel.curves.map(visible);
  let low = Infinity, high = -Infinity;
  panel.curves.forEach((curve, c) => {
    for (const i of shown[c]) {
      if (curve.y[i] === null || curve.x[i] < view[0] || curve.x[i] > view[1]) continue;
      low = Math.min(low, curve.y[i]); high = Math.max(high, curve.y[i]);
    }
  });
  if (!(high >= low)) { low = 0; high = 1; }
  const pad = high > low ? 0.06 * (high - low) : 0.5 * Math.max(Math.abs(high), 1e-9);
  low -= pad; high += pad;
  const y = (value) => (high - value) / (high - low) * height;
  const places = ticks(low, high, Math.max(2, height / 32));
  for (const place of places) {
    make("line", { x1: LEFT, x2: width - RIGHT, y1: y(place), y2: y(place), stroke: LINE }, svg);
    make("text", { x: LEFT - 6, y: y(place) + 4, "text-anchor": "end", fill: INK }, svg, number(place, step(high - low, Math.max(2, height / 32))));
  }
  panel.curves.forEach((curve, c) => {
    let path = "", open = false;
    for (const i of shown[c]) {
      if (curve.y[i] === null) { open = false; continue; }
      path += (open ? "L" : "M") + at(curve.x[i]).toFixed(1) + " " + y(curve.y[i]).toFixed(1);
      open = true;
    }
    make("path", { d: path, fill: "none", stroke: curve.colour, "stroke-width": 1.1, "clip-path": "url(#inside)" }, svg);
  });
  const [name, unit] = panel.label;
  const label = make("text", { transform: "translate(13," + height / 2 + ") rotate(-90)", "text-anchor": "middle", fill: INK, class: "name" }, svg);
  make("tspan", { x: 0 }, label, name);
  make("tspan", { x: 0, dy: 13 }, label, unit);
};

const drawings = page.panels.map((panel) => {
  const svg = make("svg", { role: "img" }, null);
  make("title", {}, svg, panel.label.join(" ") || "phases");
  document.getElementById("panels").appendChild(svg);
  return svg;
});
const draw = () => {
  pending = false;
  width = Math.max(320, document.getElementById("panels").clientWidth);
  page.panels.forEach((panel, p) => {
    const svg = drawings[p], last = p === page.panels.length - 1, lanes = panel.lanes.length;
    const top = lanes ? 20 : 0, height = lanes ? top + ROW * lanes + 4 : panel.height, whole = height + (last ? 36 : 8);
    const title = svg.firstChild;
    svg.replaceChildren(title);
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
    const hair = make("line", { class: "hair", y1: top, y2: height, stroke: "#555", visibility: "hidden" }, svg);
    hair.setAttribute("pointer-events", "none");
    make("text", { class: "value", x: width - RIGHT - 5, y: top + 12, "text-anchor": "end", fill: INK, "pointer-events": "none" }, svg);
  });
  document.getElementById("view").textContent = number(view[0], 0.1) + " s to " + number(view[1], 0.1) + " s";
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

// The values under the pointer.
const point = () => {
  const said = document.getElementById("cursor");
  said.textContent = cursor === null ? "" : number(cursor, 0.01) + " s (" + clock(cursor) + ")";
  page.panels.forEach((panel, p) => {
    const hair = drawings[p].querySelector(".hair"), value = drawings[p].querySelector(".value");
    if (!hair) return;
    hair.setAttribute("visibility", cursor === null ? "hidden" : "visible");
    if (cursor === null) { value.textContent = ""; return; }
    hair.setAttribute("x1", at(cursor)); hair.setAttribute("x2", at(cursor));
    value.textContent = panel.curves.map((curve) => {
      const i = Math.min(curve.x.length - 1, find(curve.x, cursor));
      return i < 0 || curve.y[i] === null ? "–" : String(Number(curve.y[i].toPrecision(5))).replace("-", "−");
    }).join("   ");
  });
};
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
panels.addEventListener("pointerdown", (event) => { held = time(event); panels.setPointerCapture(event.pointerId); });
panels.addEventListener("pointermove", (event) => {
  const t = time(event);
  if (held !== null) show(view[0] + held - t, view[1] + held - t);
  cursor = t >= view[0] && t <= view[1] ? t : null;
  point();
});
panels.addEventListener("pointerup", () => { held = null; });
panels.addEventListener("pointercancel", () => { held = null; });
panels.addEventListener("pointerleave", () => { cursor = null; point(); });
panels.addEventListener("dblclick", () => show(FIRST, LAST));
const acts = { in: () => zoom(0.5), out: () => zoom(2), left: () => pan(-0.25), right: () => pan(0.25), all: () => show(FIRST, LAST) };
for (const button of document.querySelectorAll("button")) button.addEventListener("click", acts[button.value]);
const keys = { "+": "in", "=": "in", "-": "out", ArrowLeft: "left", ArrowRight: "right", Home: "all", "0": "all" };
document.addEventListener("keydown", (event) => {
  if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  acts[keys[event.key]]();
});
window.addEventListener("resize", redraw);
draw();
})();
