// Functions of all panes: elements, requests, numbers and plots.

const HARD = "\u00a0";
/** A number, a space, and a unit after which no letter or digit follows. */
const UNIT = /(\d|°) (?=(?:%|°\/s²?|°|m\/s²?|N m|[µm]?s|k?m|N|Hz|kg|dB)(?![\w°/²³]))/g;
/** The text without line breaks between numbers and their units. */
const unbroken = (text) => text.replace(UNIT, `$1${HARD}`).replace(/± (?=\d)/g, `±${HARD}`).replace(/N m\b/g, `N${HARD}m`);
const LITERAL = new Set(["code", "textarea", "option", "button"]);

/** Makes an element with properties and children. A child that is false or null is left out. */
export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (value == null || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (key === "class") node.className = value;
    else if (key === "vars") for (const [name, v] of Object.entries(value)) node.style.setProperty(name, v);
    else node.setAttribute(key, value === true ? "" : value);
  }
  const shown = children.flat().filter((c) => c != null && c !== false);
  node.append(...shown.map((c) => (typeof c === "string" && !LITERAL.has(tag) ? unbroken(c) : c)));
  return node;
}

const trouble = document.getElementById("trouble");
/** Shows an error message until the user closes it. */
export function complain(text) {
  trouble.replaceChildren(el("p", {}, el("span", {}, text), el("button", { type: "button", onclick: () => trouble.replaceChildren() }, "Close")));
}
export const hush = () => trouble.replaceChildren();

async function answer(response) {
  const body = await response.json().catch(() => ({ error: `the workbench answered ${response.status}` }));
  if (!response.ok) throw Object.assign(new Error(body.error ?? `the workbench answered ${response.status}`), { status: response.status });
  return body;
}
const gone = () => { throw new Error("the workbench does not answer: has the program ended? Start it again with the same --dir, and nothing is lost"); };
export const get = async (path) => answer(await fetch(path).catch(gone));
export const post = async (path, body) =>
  answer(await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) }).catch(gone));
export const send = async (path, file) => answer(await fetch(path, { method: "POST", body: file }).catch(gone));

// ---- numbers ----

export function show(v, digits = 3) {
  if (v == null || !isFinite(v)) return "–";
  if (v === 0) return "0";
  const a = Math.abs(v);
  const text = a < 1e-4 || a >= 1e6 ? v.toExponential(digits - 1) : v.toFixed(Math.max(0, Math.min(6, digits - 1 - Math.floor(Math.log10(a)))));
  return text.replace("-", "−");
}
export const percent = (v) => (v == null || !isFinite(v) ? "–" : `${(100 * v).toFixed(Math.abs(v) < 0.0995 ? 1 : 0).replace("-", "−")}${HARD}%`);

export const SYMBOL = {
  alpha: "α", beta: "β", airspeed: "V", throttle: "δt", p: "p", q: "q", r: "r", aileron: "δa", elevator: "δe",
  aileron_rate: "δ̇a", elevator_rate: "δ̇e", altitude: "h", time: "t", flight: "flight",
};
const CHANNEL = { D: "drag", L: "lift", Y: "side force", l: "rolling", m: "pitching", n: "yawing" };
/** The names of channels as a list in a sentence, such as "lift, pitching and rolling moment". */
export function channel_words(channels) {
  const moment = (c) => "lmn".includes(c);
  const all = [...channels.filter((c) => !moment(c)), ...channels.filter(moment)].map((c) => CHANNEL[c] ?? c);
  const listed = all.length > 1 ? `${all.slice(0, -1).join(", ")} and ${all[all.length - 1]}` : all.join("");
  return channels.some(moment) ? `${listed} moment` : listed;
}
/** The score at the longest horizon that runs reach, up to 5 s. */
const reached = (scores) => (scores ?? []).filter((s) => s.runs > 0 && s.horizon_s <= 5.001 && s.rmse_scaled != null).pop();
/** The error (NRMSE) at this horizon. */
export const judged = (scores) => reached(scores)?.rmse_scaled ?? null;
/** Text on this horizon. */
export const horizon = (scores) => (reached(scores) ? ` at ${show(reached(scores).horizon_s, 1)} s` : "");
/** Result of the fit with the most accepted effects. It is the valid one for all effects. */
export const verdicts = (state) => [...state.stack].reverse().find((s) => s.story)?.story ?? null;
/** Ids of the effects that a fit added to the model. */
export const joined = (story) => (story?.effects ?? []).filter((e) => e.joined).map((e) => e.id);
/** Result of the fit with the next asserted effect, which is not accepted yet; null if there is none, or if the fit refuses the effect. */
export const ahead = (state) => (joined(state.ahead?.story).includes(state.ahead?.id) ? state.ahead.story : null);
/** Errors (NRMSE) on the flights held out, each with its word: as given, tuned, with the accepted effects, with the next asserted effect. */
export function steps(state) {
  const [accepted, next] = [verdicts(state), ahead(state)];
  const first = accepted ?? next;
  if (!first) return [];
  const ids = joined(accepted);
  return [["as given", judged(first.given)], ["tuned", judged(first.before)], ids.length && [ids.join(" + "), judged(accepted.after)],
    next && [`${state.ahead.id}, not yet added`, judged(next.after)]].filter(Boolean);
}

/** The equivalent command, with a button that copies it. */
export function command(text, what = "The same") {
  if (!text) return null;
  // the command breaks only at its spaces
  const words = text.split(" ").flatMap((word, k) => [k ? " " : null, el("span", { class: "word" }, word)]);
  const copy = el("button", { type: "button", onclick: async () => {
    await navigator.clipboard?.writeText(text);
    copy.textContent = "Copied";
  } }, "Copy");
  return el("details", { class: "command" }, el("summary", {}, `${what} on the command line`), el("code", {}, words), copy);
}

// ---- plots ----

const root = document.documentElement;
export const ink = (name) => getComputedStyle(root).getPropertyValue(`--${name}`).trim();
const plots = new Set();
const sizes = new ResizeObserver((entries) => {
  for (const { target, contentRect: r } of entries) {
    const u = target.plot;
    if (u && r.width > 0 && (u.width !== Math.floor(r.width) || u.height !== Math.floor(r.height)))
      u.setSize({ width: Math.floor(r.width), height: Math.floor(r.height) });
  }
});

const axis = (extra) => ({
  stroke: () => ink("muted"), font: `11px ${ink("sans")}`, grid: { stroke: () => ink("grid"), width: 1 }, ticks: { show: false }, gap: 3, ...extra,
});
const ticks = (u, values) => values.map((v) => (v == null ? "" : String(+v.toPrecision(6)).replace("-", "−")));

/** Draws `data` with the uPlot options `options` in `holder`. A previous plot there is removed. */
export function draw(holder, options, data) {
  holder.plot?.destroy();
  plots.delete(holder.plot);
  const { width, height } = holder.getBoundingClientRect();
  const plot = new uPlot({
    width: Math.max(80, Math.floor(width)), height: Math.max(60, Math.floor(height)), legend: { show: false }, padding: [6, 8, 0, 0],
    axes: [axis({ size: 22, space: 60, values: ticks }), axis({ size: 46, space: 26, values: ticks })], ...options,
  }, data, holder);
  holder.plot = plot;
  holder.dataset.drawn = "yes";
  plots.add(plot);
  sizes.observe(holder);
  return plot;
}
export const line = (tone, width = 1.6, extra = {}) => ({ stroke: () => ink(tone), width, points: { show: false }, ...extra });
/** Series options for dots without a line. */
export const dots = (tone, size = 3) => ({ stroke: () => ink(tone), paths: () => null, points: { show: true, size, width: 0, fill: () => ink(tone) } });
export function redraw() {
  for (const plot of plots) if (plot.root.isConnected) plot.redraw(false, true); else plots.delete(plot);
}
/** Shades the plot over the x ranges `spans`. */
export function shade(u, spans, tone) {
  const { ctx, bbox } = u;
  ctx.save();
  ctx.fillStyle = ink(tone);
  for (const [from, to] of spans) {
    const [a, b] = [from, to].map((x) => Math.min(bbox.left + bbox.width, Math.max(bbox.left, u.valToPos(x, "x", true))));
    if (b > a) ctx.fillRect(a, bbox.top, Math.max(1, b - a), bbox.height);
  }
  ctx.restore();
}
