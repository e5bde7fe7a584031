// Legends, and the time axis that all time figures share: zoom, cursor, mouse, keys, touch.

// ---- legends ----

const DASH = { command: [6, 3], third: [8, 3], fourth: [2, 2] };
function sample(kind, shape) {
  const ink = `var(--${kind})`;
  const line = `<line x1="0" x2="26" y1="6" y2="6" stroke="${ink}" stroke-width="${kind === "measured" ? 5 : 2}"${DASH[kind] ? ` stroke-dasharray="${DASH[kind].join(" ")}"` : ""}/>`;
  const drawn = {
    circles: `<circle cx="13" cy="6" r="4.5" fill="none" stroke="${ink}" stroke-width="2"/>`,
    dots: `<circle cx="7" cy="7" r="2" fill="${ink}"/><circle cx="14" cy="4" r="2" fill="${ink}"/><circle cx="20" cy="8" r="2" fill="${ink}"/>`,
    crosses: `<path d="M9 2l8 8m0-8l-8 8" stroke="${ink}" stroke-width="2"/>`,
    band: '<rect width="26" height="12" style="fill:var(--band)"/>',
  }[shape] || line;
  return `<svg viewBox="0 0 26 12" aria-hidden="true">${drawn}</svg>`;
}
/** Adds a legend to the figure of `host`; `onToggle(index)` switches a line and returns whether it is now visible. */
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

// ---- the shared time axis ----

let charts = [];
let timeCharts = [];
let whole = [Infinity, -Infinity];
let view = whole;
/** Sets the time axis to the span of the visible time figures. The zoom is kept if the span is unchanged. */
function newClock(seen) {
  let [low, high] = [Infinity, -Infinity];
  for (const f of seen) for (const { time_s: t } of f.data.tracks) {
    if (t.length) [low, high] = [Math.min(low, t[0]), Math.max(high, t[t.length - 1])];
  }
  if (low === high) [low, high] = [low - 0.5, high + 0.5];
  if (low === whole[0] && high === whole[1]) return;
  view = whole = [low, high];
}
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

// ---- keyboard, mouse and touch ----

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
    // The two touched times stay under the fingers.
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
