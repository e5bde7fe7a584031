// Draws the figures of the page with uPlot, and links the time figures' zoom and cursor.
(() => {
"use strict";
const root = document.documentElement;
const figures = JSON.parse(document.getElementById("figures").textContent);
const style = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
const rem = () => parseFloat(getComputedStyle(root).fontSize);
const font = (size) => `${Math.round(size * rem())}px ${style("sans")}`;
const MINUS = "−";

// ---- numbers ----

const signed = (text) => text.replace("-", MINUS);
/** A value with digits enough for its size. */
function show(v) {
  if (v == null || !isFinite(v)) return "";
  const a = Math.abs(v);
  return signed(v.toFixed(a === 0 ? 0 : a < 0.01 ? 4 : a < 1 ? 3 : a < 100 ? 2 : 1));
}
/** Ticks with as many decimals as their step needs. */
function showTicks(u, splits) {
  const step = splits.length > 1 ? Math.abs(splits[1] - splits[0]) : 1;
  let digits = 0;
  while (digits < 6 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits++;
  return splits.map((v) => (v == null ? "" : signed(v.toFixed(digits))));
}
/** A value as it was chosen: 0.5, 10. */
const showChosen = (v) => signed(String(+v.toPrecision(3)));
/** A decade as it is spoken: 0.01, 1, 1000. */
const showDecade = (v) => (v >= 1 ? String(Math.round(v)) : v.toFixed(Math.max(0, Math.round(-Math.log10(v)))));

// ---- scales and axes ----

function padded(low, high) {
  if (!isFinite(low) || !isFinite(high)) return [-1, 1];
  const pad = (high - low) * 0.08 || Math.abs(high) * 0.05 || 1;
  return [low - pad, high + pad];
}
function decades(u, axis, low, high) {
  const found = [];
  for (let k = Math.ceil(Math.log10(low) - 1e-9); k <= Math.log10(high) + 1e-9; k++) found.push(10 ** k);
  return found;
}
/** Decades, with 2 and 5 between them while there are few. */
function decadesFine(u, axis, low, high) {
  const found = [];
  for (let k = Math.floor(Math.log10(low)); k <= Math.log10(high); k++)
    for (const m of Math.log10(high / low) < 3.5 ? [1, 2, 5] : [1]) found.push(m * 10 ** k);
  return found.filter((v) => v >= low * 0.999 && v <= high * 1.001);
}
const showFine = (u, splits) => splits.map((v) => (v == null ? "" : showChosen(v)));

function axis(extra) {
  return {
    stroke: style("muted"), font: font(0.78), labelFont: font(0.82), gap: 4,
    grid: { stroke: style("grid"), width: 1 }, ticks: { show: false },
    ...extra,
  };
}
const sideWidth = () => Math.round(3.6 * rem());
const sideAxis = (extra) => axis({ size: sideWidth(), space: 1.9 * rem(), values: showTicks, ...extra });

// ---- drawing beside the lines ----

const px = () => devicePixelRatio;
function clipped(u, draw) {
  const { ctx, bbox } = u;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  draw(ctx, bbox);
  ctx.restore();
}
function drawBand(u, band) {
  const [xs, ys] = [u.data[0], u.data[band.around + 1]];
  clipped(u, (ctx) => {
    ctx.fillStyle = style("band");
    let run = [];
    const close = () => {
      if (run.length > 1) {
        ctx.beginPath();
        for (const [x, y] of run) ctx.lineTo(x, u.valToPos(y + band.half_width, "y", true));
        for (const [x, y] of run.reverse()) ctx.lineTo(x, u.valToPos(y - band.half_width, "y", true));
        ctx.fill();
      }
      run = [];
    };
    const [from, to] = [u.valToIdx(u.scales.x.min), u.valToIdx(u.scales.x.max)];
    for (let i = Math.max(0, from - 1); i <= Math.min(xs.length - 1, to + 1); i++) {
      if (ys[i] == null || !u.series[band.around + 1].show) close();
      else run.push([u.valToPos(xs[i], "x", true), ys[i]]);
    }
    close();
  });
}
function halo(ctx, text, x, y, ink) {
  ctx.lineWidth = 4 * px();
  ctx.lineJoin = "round";
  ctx.strokeStyle = style("paper");
  ctx.strokeText(text, x, y);
  ctx.fillStyle = ink;
  ctx.fillText(text, x, y);
}
const canvasFont = (size) => `${Math.round(size * rem() * px())}px ${style("sans")}`;
function stroke(ctx, ink, dash, points) {
  ctx.strokeStyle = ink;
  ctx.lineWidth = px();
  ctx.setLineDash(dash.map((d) => d * px()));
  ctx.beginPath();
  for (const [x, y] of points) ctx.lineTo(x, y);
  ctx.stroke();
  ctx.setLineDash([]);
}
function drawLevel(u, rule) {
  const y = Math.round(u.valToPos(rule.value, "y", true));
  clipped(u, (ctx, b) => {
    stroke(ctx, style("command"), [6, 3], [[b.left, y], [b.left + b.width, y]]);
    ctx.font = canvasFont(0.76);
    ctx.textAlign = "right";
    const above = y - b.top > 1.4 * rem() * px();
    ctx.textBaseline = above ? "bottom" : "top";
    halo(ctx, rule.label, b.left + b.width - 4 * px(), y + (above ? -3 : 3) * px(), style("command"));
  });
}
function drawUprights(u, rules) {
  clipped(u, (ctx, b) => {
    ctx.font = canvasFont(0.76);
    ctx.textBaseline = "top";
    rules.forEach((rule, i) => {
      const x = Math.round(u.valToPos(rule.value, "x", true));
      const ink = rule.label === "budget" ? style("command") : style("ink");
      stroke(ctx, ink, rule.label === "budget" ? [6, 3] : [2, 2], [[x, b.top], [x, b.top + b.height]]);
      const text = `${rule.label} ${showChosen(rule.value)}`;
      const left = x + ctx.measureText(text).width + 8 * px() > b.left + b.width;
      ctx.textAlign = left ? "right" : "left";
      halo(ctx, text, x + (left ? -4 : 4) * px(), b.top + (4 + i * 1.25 * rem()) * px(), ink);
    });
  });
}
function drawMarks(u, marks) {
  const { ctx, bbox: b } = u;
  ctx.save();
  ctx.font = canvasFont(0.7);
  ctx.textAlign = "center";
  ctx.textBaseline = "bottom";
  let free = -Infinity;
  for (const mark of marks) {
    if (mark.time_s < u.scales.x.min || mark.time_s > u.scales.x.max) continue;
    const x = Math.round(u.valToPos(mark.time_s, "x", true));
    stroke(ctx, style("mark"), [1, 3], [[x, b.top], [x, b.top + b.height]]);
    const half = ctx.measureText(mark.label).width / 2 + 3 * px();
    if (x - half < free) continue;
    free = x + half;
    ctx.fillStyle = style("muted");
    ctx.fillText(mark.label, x, b.top - 2 * px());
  }
  ctx.restore();
}

// ---- legends ----

const DASH = { command: [6, 3] };
function sample(kind, shape) {
  const ink = `var(--${kind})`;
  const line = `<line x1="0" x2="26" y1="6" y2="6" stroke="${ink}" stroke-width="2"${kind === "command" ? ' stroke-dasharray="6 3"' : ""}/>`;
  const drawn = {
    circles: `<circle cx="13" cy="6" r="4.5" fill="none" stroke="${ink}" stroke-width="2"/>`,
    crosses: `<path d="M9 2l8 8m0-8l-8 8" stroke="${ink}" stroke-width="2"/>`,
    band: '<rect width="26" height="12" style="fill:var(--band)"/>',
  }[shape] || line;
  return `<svg viewBox="0 0 26 12" aria-hidden="true">${drawn}</svg>`;
}
/** Adds a legend to the figure of `host`; `onToggle(index)` says whether the line is shown now. */
function legend(host, entries, onToggle) {
  const caption = host.parentElement.querySelector("figcaption");
  caption.querySelector(".legend")?.remove();
  const box = document.createElement("div");
  box.className = "legend";
  const outputs = entries.map((entry, i) => {
    const item = document.createElement(entry.fixed ? "span" : "button");
    item.innerHTML = sample(entry.style, entry.shape);
    item.append(entry.label);
    if (entry.fixed) item.className = "entry";
    else {
      item.type = "button";
      item.title = "Show or hide";
      item.setAttribute("aria-pressed", "true");
      item.onclick = () => item.setAttribute("aria-pressed", String(onToggle(i)));
    }
    const output = document.createElement("output");
    output.setAttribute("aria-live", "off");
    item.append(output);
    box.append(item);
    return output;
  });
  caption.append(box);
  return outputs;
}

// ---- the shared clock ----

let charts = [];
let timeCharts = [];
let whole = [Infinity, -Infinity];
for (const f of figures.filter((f) => f.kind === "time"))
  for (const { time_s: t } of f.data.tracks) {
    if (!t.length) continue;
    whole = [Math.min(whole[0], t[0]), Math.max(whole[1], t[t.length - 1])];
  }
if (whole[0] === whole[1]) whole = [whole[0] - 0.5, whole[1] + 0.5];
let view = whole;
const sync = uPlot.sync("clock");
const readout = document.getElementById("window");
const reset = document.getElementById("reset");
let spreading = false;

/** Shows the times from `low` to `high` (s) in every time figure. */
function look(low, high) {
  const least = (whole[1] - whole[0]) * 1e-5;
  if (!(high - low > least)) return;
  view = [Math.max(low, whole[0]), Math.min(high, whole[1])];
  if (!(view[1] > view[0])) view = whole;
  spreading = true;
  for (const u of timeCharts) u.setScale("x", { min: view[0], max: view[1] });
  spreading = false;
  tell();
}
const lookAtAll = () => look(whole[0], whole[1]);
function tell() {
  const zoomed = view[0] > whole[0] || view[1] < whole[1];
  reset.disabled = !zoomed;
  const digits = view[1] - view[0] < 1 ? 3 : view[1] - view[0] < 10 ? 2 : 1;
  readout.textContent = isFinite(view[0]) ? `${view[0].toFixed(digits)} to ${view[1].toFixed(digits)} s` : "";
}
function zoomAbout(time, factor) {
  look(time - (time - view[0]) * factor, time + (view[1] - time) * factor);
}
function shift(seconds) {
  const by = Math.max(whole[0] - view[0], Math.min(whole[1] - view[1], seconds));
  look(view[0] + by, view[1] + by);
}

// ---- hands ----

function keys(host, u) {
  const at = () => (u.cursor.left >= 0 ? u.cursor.left : u.over.clientWidth / 2);
  const move = (dx) =>
    u.setCursor({ left: Math.max(0, Math.min(u.over.clientWidth - 1, at() + dx)), top: u.over.clientHeight / 2 }, true, true);
  const span = () => view[1] - view[0];
  const actions = {
    ArrowLeft: (e) => (e.shiftKey ? shift(-span() / 5) : move(-4)),
    ArrowRight: (e) => (e.shiftKey ? shift(span() / 5) : move(4)),
    "+": () => zoomAbout(u.posToVal(at(), "x"), 0.6),
    "=": () => zoomAbout(u.posToVal(at(), "x"), 0.6),
    "-": () => zoomAbout(u.posToVal(at(), "x"), 1 / 0.6),
    0: lookAtAll,
    Escape: lookAtAll,
  };
  host.onkeydown = (e) => {
    const action = e.ctrlKey || e.metaKey || e.altKey ? null : actions[e.key];
    if (!action) return;
    e.preventDefault();
    action(e);
  };
}
function wheel(u) {
  u.over.addEventListener("wheel", (e) => {
    if (!e.ctrlKey && !e.metaKey) return;
    e.preventDefault();
    zoomAbout(u.posToVal(e.clientX - u.over.getBoundingClientRect().left, "x"), Math.exp(e.deltaY * 0.004));
  }, { passive: false });
}
function touch(u) {
  const fingers = new Map();
  let held = null;
  let lastTap = { time: -Infinity, x: 0 };
  const left = (x) => x - u.over.getBoundingClientRect().left;
  const times = () => [...fingers.values()].map((x) => u.posToVal(left(x), "x"));
  const put = (e) => {
    if (e.pointerType !== "touch" || (e.type === "pointermove" && !fingers.has(e.pointerId))) return;
    fingers.set(e.pointerId, e.clientX);
    if (e.type === "pointerdown") held = fingers.size === 2 ? times() : null;
    if (fingers.size === 1) u.setCursor({ left: left(e.clientX), top: u.over.clientHeight / 2 }, true, true);
    if (fingers.size === 2 && held) pinch();
  };
  const pinch = () => {
    // The two instants that were touched stay under the fingers.
    const width = u.over.clientWidth;
    const [a, b] = [...fingers.values()].map((x) => left(x) / width);
    if (Math.abs(a - b) < 0.02) return;
    const span = (held[0] - held[1]) / (a - b);
    if (span > 0) look(held[0] - a * span, held[0] + (1 - a) * span);
  };
  const lift = (e) => {
    if (e.pointerType !== "touch") return;
    fingers.delete(e.pointerId);
    held = null;
    if (e.type !== "pointerup") return;
    const twice = e.timeStamp - lastTap.time < 320 && Math.abs(e.clientX - lastTap.x) < 24;
    lastTap = { time: e.timeStamp, x: e.clientX };
    if (twice) lookAtAll();
  };
  u.over.addEventListener("pointerdown", put);
  u.over.addEventListener("pointermove", put);
  for (const end of ["pointerup", "pointercancel"]) u.over.addEventListener(end, lift);
}

// ---- figures ----

function size(host) {
  return { width: Math.max(120, host.clientWidth), height: Math.max(80, host.clientHeight) };
}

/** Samples between two gaps, which a line alone would not show. */
function lonePoints(u, k) {
  const ys = u.data[k];
  const lone = [];
  for (let i = 0; i < ys.length; i++)
    if (ys[i] != null && ys[i - 1] == null && ys[i + 1] == null) lone.push(i);
  return lone;
}

function timeChart(host, figure, track, panel, last) {
  const log = typeof panel.scale === "object" ? panel.scale.log : null;
  const level = panel.rules.map((r) => r.value);
  const values = panel.series.map((s) =>
    log ? s.values.map((v) => (v == null ? null : Math.max(v, log.floor))) : s.values);
  const range = (u, low, high) => {
    // Half a decade of room, so that the highest tick stays clear of the marks.
    if (log) return [log.floor, 3 * Math.max(high || log.floor, log.floor * 10, ...level)];
    return padded(Math.min(low ?? Infinity, ...level), Math.max(high ?? -Infinity, ...level));
  };
  const outputs = legend(host, [
    ...panel.series.map((s) => ({ label: s.label, style: s.style })),
    ...panel.bands.map((b) => ({ label: `${b.label} ±${showChosen(b.half_width)}`, shape: "band", fixed: true })),
  ], (i) => {
    u.setSeries(i + 1, { show: !u.series[i + 1].show });
    return u.series[i + 1].show;
  });
  const options = {
    ...size(host),
    padding: [figure.marks.length ? 1.1 * rem() : 0.5 * rem(), 0.6 * rem(), 0, 0],
    legend: { show: false },
    cursor: {
      y: false, sync: { key: sync.key, scales: ["x", null] },
      drag: { x: true, y: false, setScale: true, dist: 4 },
      points: { size: 6 },
      bind: { dblclick: () => () => { lookAtAll(); return null; } },
    },
    scales: {
      x: { time: false, range: (u, low, high) => [low, high] },
      y: { distr: log ? 3 : 1, log: 10, range },
    },
    axes: [
      axis({
        size: (last ? 1.6 : 0.5) * rem(), values: last ? showTicks : () => [], space: 4.5 * rem(),
        label: last ? "Time (s)" : undefined, labelSize: last ? 1.3 * rem() : 0, labelGap: 0,
      }),
      sideAxis(log ? { splits: decades, values: (u, s) => s.map(showDecade), filter: (u, s) => s } : {}),
    ],
    series: [{}, ...panel.series.map((s) => ({
      label: s.label, stroke: style(s.style), dash: DASH[s.style], width: Math.max(1.5, 0.1 * rem()),
      points: { size: 3, show: true, filter: lonePoints }, spanGaps: false, pxAlign: 0,
    }))],
    hooks: {
      drawAxes: [(u) => { panel.bands.forEach((b) => drawBand(u, b)); drawMarks(u, figure.marks); }],
      draw: [(u) => panel.rules.forEach((r) => drawLevel(u, r))],
      setScale: [(u, key) => { if (key === "x" && !spreading && u.status) look(u.scales.x.min, u.scales.x.max); }],
      setCursor: [(u) => panel.series.forEach((s, i) => {
        const k = u.cursor.left >= 0 ? u.cursor.idx : null;
        outputs[i].textContent = k == null ? "" : show(s.values[k]) || "no data";
      })],
    },
  };
  const u = new uPlot(options, [track.time_s, ...values], host);
  spreading = true;
  u.setScale("x", { min: view[0], max: view[1] });
  spreading = false;
  keys(host, u);
  wheel(u);
  touch(u);
  timeCharts.push(u);
  return u;
}

function histogramChart(host, data) {
  const { edges, counts } = data;
  const note = host.parentElement.querySelector(".readout");
  const bars = (u) => clipped(u, (ctx, b) => {
    ctx.fillStyle = style("actual");
    const at = (v) => Math.round(u.valToPos(v, "x", true));
    counts.forEach((n, i) => {
      if (!n) return;
      const top = Math.round(u.valToPos(n, "y", true));
      ctx.fillRect(at(edges[i]), top, Math.max(px(), at(edges[i + 1]) - at(edges[i]) - px()), b.top + b.height - top);
    });
  });
  return new uPlot({
    ...size(host), padding: [0.5 * rem(), 0.6 * rem(), 0, 0], legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false }, points: { show: false } },
    scales: {
      x: { time: false, distr: 3, log: 10, range: () => [edges[0], edges[edges.length - 1]] },
      y: { distr: 3, log: 10, range: () => [0.7, Math.max(1, ...counts) * 12] },
    },
    axes: [
      axis({ size: 1.7 * rem(), splits: decadesFine, values: showFine, space: 3 * rem(), filter: (u, s) => s, label: data.x_label, labelSize: 1.4 * rem(), labelGap: 0 }),
      sideAxis({ splits: decades, values: (u, s) => s.map(showDecade), filter: (u, s) => s }),
    ],
    series: [{}, { stroke: style("actual"), paths: () => null, points: { show: false } }],
    hooks: {
      drawAxes: [bars],
      draw: [(u) => drawUprights(u, data.rules)],
      setCursor: [(u) => {
        const v = u.posToVal(u.cursor.left, "x");
        const i = u.cursor.left < 0 ? -1 : edges.findIndex((e, k) => v >= e && v < edges[k + 1]);
        note.textContent = i < 0 ? "" : `${show(edges[i])} to ${show(edges[i + 1])}: ${counts[i]} ${data.counted}`;
      }],
    },
  }, [edges.slice(0, -1), counts.map((n) => n || null)], host);
}

const SHAPES = {
  path(ctx, points) {
    ctx.lineWidth = 1.2 * px();
    ctx.globalAlpha = 0.75;
    ctx.beginPath();
    let pen = false;
    for (const p of points) {
      if (p) pen ? ctx.lineTo(...p) : ctx.moveTo(...p);
      pen = p != null;
    }
    ctx.stroke();
  },
  circles(ctx, points) {
    ctx.lineWidth = 2 * px();
    for (const p of points.filter(Boolean)) {
      ctx.beginPath();
      ctx.arc(...p, 5 * px(), 0, 7);
      ctx.stroke();
    }
  },
  crosses(ctx, points) {
    ctx.lineWidth = 2 * px();
    const r = 5 * px();
    for (const [x, y] of points.filter(Boolean)) {
      ctx.beginPath();
      ctx.moveTo(x - r, y - r); ctx.lineTo(x + r, y + r);
      ctx.moveTo(x - r, y + r); ctx.lineTo(x + r, y - r);
      ctx.stroke();
    }
  },
};
function extent(lists) {
  let [low, high] = [Infinity, -Infinity];
  for (const list of lists) for (const v of list) if (v != null) { low = Math.min(low, v); high = Math.max(high, v); }
  return padded(low, high);
}
function xyChart(host, data) {
  const shown = data.series.map(() => true);
  const [xr, yr] = [extent(data.series.map((s) => s.x)), extent(data.series.map((s) => s.y))];
  const draw = (u) => clipped(u, (ctx) => data.series.forEach((s, k) => {
    if (!shown[k]) return;
    ctx.save();
    ctx.strokeStyle = style(s.style);
    SHAPES[s.mark](ctx, s.x.map((x, i) =>
      x == null || s.y[i] == null ? null : [u.valToPos(x, "x", true), u.valToPos(s.y[i], "y", true)]));
    ctx.restore();
  }));
  legend(host, data.series.map((s) => ({ label: s.label, style: s.style, shape: s.mark })), (i) => {
    shown[i] = !shown[i];
    u.redraw();
    return shown[i];
  });
  const u = new uPlot({
    ...size(host), padding: [0.5 * rem(), 0.6 * rem(), 0, 0], legend: { show: false },
    cursor: { drag: { x: true, y: true, dist: 4 }, points: { show: false } },
    scales: {
      x: { time: false, range: (u, a, b) => (a === xr[0] && b === xr[1] ? xr : [a, b]) },
      y: { range: (u, a, b) => [a, b] },
    },
    axes: [
      axis({ size: 1.7 * rem(), values: showTicks, space: 3.5 * rem(), label: data.x_label, labelSize: 1.4 * rem(), labelGap: 0 }),
      sideAxis({ label: data.y_label, labelSize: 1.4 * rem(), labelGap: 0 }),
    ],
    series: [{}, { paths: () => null, points: { show: false } }],
    hooks: { draw: [draw] },
    // uPlot scales to two invisible corners; the figure itself is drawn above.
  }, [xr, yr], host);
  return u;
}

// ---- the page ----

function columns(host) {
  return getComputedStyle(host.closest(".panels")).gridTemplateColumns.split(" ").length;
}
function build() {
  for (const u of charts) u.destroy();
  charts = [];
  timeCharts = [];
  for (const host of document.querySelectorAll(".plot")) {
    const { kind, data } = figures[host.dataset.figure];
    if (kind === "time") {
      const track = data.tracks[host.dataset.track];
      const all = [...host.closest(".panels").querySelectorAll(".plot")];
      // Only the lowest panel of each column carries the time axis.
      const last = all.indexOf(host) >= all.length - columns(host);
      host.style.height = last ? `calc(var(--plot-height) + 2.2rem)` : "";
      charts.push(timeChart(host, data, track, track.panels[host.dataset.panel], last));
    } else charts.push((kind === "xy" ? xyChart : histogramChart)(host, data));
  }
  tell();
  root.dataset.charts = charts.length;
}

document.getElementById("theme").onclick = () => {
  root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  build();
};
reset.onclick = lookAtAll;
for (const button of document.querySelectorAll("button.zoom")) {
  button.onclick = () => {
    const [from, to] = [Number(button.dataset.from), Number(button.dataset.to)];
    look(from, to);
    document.querySelector(".panels")?.scrollIntoView({ block: "start" });
  };
}
let drawnWidth = innerWidth;
let waiting = 0;
addEventListener("resize", () => {
  // A phone's address bar changes the height alone, which changes nothing here.
  if (innerWidth === drawnWidth) return;
  drawnWidth = innerWidth;
  clearTimeout(waiting);
  waiting = setTimeout(build, 120);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (e) => {
  root.dataset.theme = e.matches ? "dark" : "light";
  build();
});
let screenTheme = null;
addEventListener("beforeprint", () => { screenTheme = root.dataset.theme; root.dataset.theme = "light"; build(); });
addEventListener("afterprint", () => { root.dataset.theme = screenTheme; build(); });
build();
root.dataset.ready = "yes";
})();
