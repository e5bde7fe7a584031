// Formats numbers, makes axes, and draws what uPlot does not draw: bands, levels and marks.

const root = document.documentElement;
const figures = JSON.parse(document.getElementById("figures").textContent);
const style = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
const rem = () => parseFloat(getComputedStyle(root).fontSize);
const font = (size) => `${Math.round(size * rem())}px ${style("sans")}`;
const MINUS = "−";

// ---- numbers ----

const signed = (text) => text.replace("-", MINUS);
/** A value as text, with decimals according to its magnitude. */
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
/** A value as text with at most three significant digits, such as 0.5 or 10. */
const showChosen = (v) => signed(String(+v.toPrecision(3)));
/** A power of ten as a decimal number: 0.01, 1, 1000. */
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
/** Ticks at powers of ten; also at 2 and 5 times these if the range is below 3.5 decades. */
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

// ---- bands, levels and marks ----

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
