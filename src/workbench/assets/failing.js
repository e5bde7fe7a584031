// The pane of errors: unexplained shares by channel and variable, the flight over time, free runs from any time.

import { SYMBOL, command, complain, dots, draw, el, ink, line, percent, post, shade, show, steps } from "./kit.js";

const VARIABLES = ["alpha", "beta", "airspeed", "throttle", "p", "q", "r", "aileron", "elevator", "aileron_rate", "elevator_rate", "altitude", "time"];
const STATES = { V: ["V", "m/s"], alpha: ["α", "°"], beta: ["β", "°"], p: ["p", "°/s"], q: ["q", "°/s"], r: ["r", "°/s"], phi: ["φ", "°"], theta: ["θ", "°"] };
const RUN_S = 5;
const pick = { base: "tuned", channel: null, variable: null, window: null, run: null, at: null, every: false };
const WORD = { given: "as given", tuned: "tuned" };
const narrow = matchMedia("(max-width: 640px)");
narrow.addEventListener("change", () => parts && bench?.failing && grid());
let parts = null;
let bench = null;

export function failing(of) {
  bench = of;
  const body = document.querySelector("#failing .body");
  const { failing: found, state } = bench;
  if (!found) {
    parts = null;
    const none = !state.flights.some((f) => f.role === "fit" || f.role === "hold_out");
    return body.replaceChildren(...(none ? welcome() : [el("p", { class: "empty" }, "Comparing the model with the flights …")]));
  }
  if (!parts) {
    parts = build();
    body.replaceChildren(parts.base, parts.grid, parts.finding, parts.where, parts.tools, parts.states, parts.command);
  }
  // a new diagnosis selects the cell of its first effect, whatever was selected before
  const key = bench.diagnosis && state.diagnosis.key;
  if (key && key !== pick.diagnosed) Object.assign(pick, { diagnosed: key, base: "tuned", by_hand: false });
  switcher();
  grid();
  parts.command.replaceChildren(...[command(state.commands.compare)].filter(Boolean));
}

/** Content for an empty session: the steps of the work, and how to get flights. */
function welcome() {
  const steps = [["1", "Drop flight logs", "the model is compared with them at once: in which channel, and where, it fails"],
    ["2", "Diagnose", "every effect of the catalogue against what the model leaves, beside what chance reaches"],
    ["3", "Tick a suspect", "the model is fitted with it; the error falls on a flight held out, tuning and effect apart"],
    ["4", "Judge, save, fly", "test flights stay unseen until then; the saved model is the command line's"]];
  return [el("ol", { class: "welcome" }, steps.map(([k, what, why]) => el("li", {}, el("b", {}, what), ` – ${why}`))),
    el("figure", {}, picture(), el("figcaption", {}, "What a diagnosis shows: dots are what the other terms of the fit leave of the drag, the line is the missing effect.")),
    el("p", { class: "note" }, "No log at hand? These two fly flights with a hidden effect, and open them with the model that lacks it: ", el("code", {}, "greylag mystery --seed 3 --out mystery && greylag workbench mystery/*.csv --model mystery/model.toml"))];
}
/** Picture of a diagnosis: a residual over a variable, and the curve of the effect. */
function picture() {
  const ns = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(ns, "svg");
  for (const [k, v] of Object.entries({ viewBox: "0 0 320 150", role: "img", class: "picture", "aria-label": "dots of what a model leaves over sideslip, and the curve of the effect through them" })) svg.setAttribute(k, v);
  const add = (tag, of) => { const n = document.createElementNS(ns, tag); for (const [k, v] of Object.entries(of)) n.setAttribute(k, v); svg.append(n); };
  for (let i = 0; i < 90; i++) {
    const x = (i - 44.5) / 45;
    // dots with deterministic noise
    const noise = Math.sin(i * 12.9898) * 43758.5453;
    add("circle", { cx: 160 + 150 * x, cy: 130 - 105 * x * x - 16 * (noise - Math.floor(noise) - 0.5), r: 2, class: "dot" });
  }
  add("path", { d: "M10 25 Q160 235 310 25", class: "curve" });
  for (const [x, y, anchor, words] of [[160, 147, "middle", "sideslip β"], [6, 10, "start", "drag that the model lacks, N"]]) {
    add("text", { x, y, "text-anchor": anchor });
    svg.lastChild.textContent = words;
  }
  return svg;
}

function build() {
  const figure = (key, size = "") => {
    const plot = el("div", { class: `plot ${size}`, "data-plot": key });
    const caption = el("figcaption");
    return { figure: el("figure", {}, caption, plot), plot, caption };
  };
  const made = { base: el("div", { class: "tools", role: "group", "aria-label": "Model" }), grid: el("div", { class: "scroll" }), finding: el("p", { class: "finding" }), command: el("div"), map: el("figure", {}), time: figure("time", "tall"), residual: figure("residual"), variable: figure("variable"), bins: figure("bins", "square") };
  made.where = el("div", { class: "where" },
    el("div", {}, made.time.figure, made.residual.figure, made.variable.figure), el("div", {}, made.bins.figure, made.map));
  made.at = el("input", { type: "number", step: "0.1", "aria-label": "Start of the free run, s", onchange: () => fly(+made.at.value) });
  made.every = el("button", { type: "button", onclick: () => { pick.every = !pick.every; states(); } });
  made.reset = el("button", { type: "button", disabled: true, onclick: () => zoom(null) }, "Whole flight");
  made.tools = el("div", { class: "tools" }, el("b", {}, "Free run"), el("label", {}, "from ", made.at, " s"),
    el("span", { class: "muted" }, "or click a moment in any plot over time; drag to zoom"), made.reset, made.every);
  made.states = el("div", { class: "states" });
  return made;
}

// ---- which model ----

/** Free-run error (NRMSE) of a model at the horizon `seconds`; undefined if the flights are too short. */
const error_over = (seconds, model) => model?.free_run.find((h) => h.horizon_s === seconds)?.rmse_scaled;

/** The displayed model without effects: the tuned one if it is known and the user has not selected the given one. */
const way = (ways) => (ways.includes("tuned") && pick.base !== "given" ? "tuned" : "given");
/** From a list with one entry for each model: the entry of the displayed model, then of the amended model if there is one. */
const two = (list, ways) => [list[ways.indexOf(way(ways))], list[ways.indexOf("amended")]];
const models = () => two(bench.failing.models, bench.failing.ways).filter(Boolean);
const word = () => WORD[way(bench.failing.ways)];
const with_effects = () => `with ${bench.state.stack.map((s) => s.id).join(" + ") || "the effects"}`;
function switcher() {
  const { ways } = bench.failing;
  const now = way(ways);
  const inside = parts.base.contains(document.activeElement);
  const press = (to) => { pick.base = to; pick.by_hand = false; switcher(); pressed_cell(); };
  const why = { tuned: "its own coefficients fitted to free runs (output error): what is left is for a missing effect to explain", given: ways.includes("tuned") ? "what tuning takes away was wrong coefficients, no missing effect" : "as its file has it; Diagnose tunes it first" };
  const button = (to) => el("button", { type: "button", "data-base": to, "aria-pressed": to === now ? "true" : "false", disabled: !ways.includes(to), onclick: () => press(to) }, WORD[to]);
  const errors = ["given", "tuned"].map((to) => [error_over(RUN_S, bench.failing.models[ways.indexOf(to)]), WORD[to]]).filter(([error]) => error != null);
  // the header states the error on the flights held out once it is known
  const off = errors.length && !steps(bench.state).length ? [el("b", { class: "off", title: "root mean square over the eight states of free runs, each state over its characteristic value (NRMSE)" }, `error over ${RUN_S} s: ${errors.map(([error, word]) => `${show(error, 3)} ${word}`).join(" → ")}`)] : [];
  parts.base.replaceChildren(el("b", {}, "Model"), button("tuned"), button("given"), ...off, el("span", { class: "muted" }, why[now]));
  if (inside) parts.base.querySelector("[aria-pressed=true]").focus();
}

// ---- the grid ----

const share = (channel) => (channel?.unexplained_fraction == null ? null : 1 - channel.unexplained_fraction);
function cells(channel) {
  return Object.fromEntries(channel.bins.map((b) => [b.variable, b]));
}
/** Whether a physically impossible estimate in the flights withholds all channels, as `compare` does. */
const withheld = () => !!bench.failing?.doubtful.length;
/** Those of the channels in which the flights suffice to judge the model; all of them if there is none. */
function judgeable(channels) {
  const open = channels.filter((c) => !c.abstained);
  return open.length ? open : channels;
}
function grid() {
  if (withheld()) {
    parts.grid.replaceChildren(...bench.failing.doubtful.map((said) => el("p", { class: "bad" }, said)));
    return parts.finding.replaceChildren();
  }
  const [before, after] = models();
  const channels = before.channels.filter((c) => "DLYlmn".includes(c.channel));
  const shown = channels.length ? channels : before.channels;
  const most = Math.max(...judgeable(shown).map((c) => Math.min(1, c.unexplained_fraction ?? 0)), 1e-9);
  if (!pick.by_hand || !shown.some((c) => c.channel === pick.channel)) start(shown);
  const size = (c) => Math.sqrt(Math.min(1, (c.unexplained_fraction ?? 0) / most));
  const fits = [["R²", `share of the channel's variance beyond noise that the model explains, ${word()}`, (c) => r2(share(c))],
    after && ["R² after", `the same ${with_effects()}`, (c) => r2(share(after.channels.find((x) => x.channel === c.channel)))]].filter(Boolean);
  const used = VARIABLES.filter((v) => shown.some((c) => cells(c)[v]));
  const one = (c, v) => el("td", {}, cells(c)[v] && cell(c, cells(c)[v], size(c)));
  const table = narrow.matches ? turned(shown, fits, used, one) : upright(shown, fits, one);
  const symbols = used.map((v) => `${SYMBOL[v]} ${name(shown, v)}`).join(", ");
  parts.grid.replaceChildren(table, el("p", { class: "note" }, `R²: what the model explains, ${word()}${after ? `; after: ${with_effects()}` : ""}. Numbers: how much of what is left goes with each variable, %. ${narrow.matches ? "" : `${symbols}.`}`), unjudged(shown) ?? "", late() ?? "");
  finding();
}
/** Caption on the channels in which the flights cannot judge the model, with the reasons; null if there is none. */
function unjudged(shown) {
  const reasons = [...new Set(shown.map((c) => c.abstained).filter(Boolean))];
  const names = (why) => shown.filter((c) => c.abstained === why).map((c) => c.name).join(" and ");
  const said = reasons.map((why) => `${names(why)}, for ${why}`);
  return said.length ? el("p", { class: "note" }, `${MARK} Withheld: ${said.join("; ")}.`) : null;
}
/** Caption on the columns of deflection rates in flights whose recorded deflections are late; null if there is none. */
function late() {
  const shown = bench.failing.flights.map((place) => bench.state.flights[place]);
  const noted = shown.filter((f) => f?.notes?.some((note) => note.startsWith("The recorded actuators seem")));
  const times = noted.flatMap((f) => f.nuisances.filter((n) => n.name === "skew_actuators").map((n) => Math.round(1000 * n.value)));
  if (!times.length) return null;
  const [low, high] = [Math.min(...times), Math.max(...times)];
  const range = low === high ? `${low}` : `${low} to ${high}`;
  return el("p", { class: "note" }, `Recorded actuators ${range} ms late: the columns of aileron and elevator movement show their clock, or a lag that the record does not show.`);
}
/** The table with one row for each channel. */
function upright(shown, fits, one) {
  const head = el("tr", {}, el("th", { scope: "col" }, "Channel"), fits.map(([sign, title]) => el("th", { scope: "col", class: "number", title }, sign)),
    VARIABLES.map((v) => el("th", { scope: "col", class: "number" }, el("abbr", { title: name(shown, v) }, SYMBOL[v]))));
  const rows = shown.map((c) => el("tr", {}, el("th", { scope: "row" }, titled(c)), fits.map(([, , of]) => el("td", { class: "fit" }, of(c))), VARIABLES.map((v) => one(c, v))));
  return el("table", { class: "grid" }, el("thead", {}, head), el("tbody", {}, rows));
}
/** The table with one column for each channel, for a screen that is too narrow for one column for each variable. */
function turned(shown, fits, used, one) {
  const head = el("tr", {}, el("td"), shown.map((c) => el("th", { scope: "col" }, titled(c))));
  const top = fits.map(([sign, title, of]) => el("tr", {}, el("th", { scope: "row", title }, sign), shown.map((c) => el("td", { class: "fit" }, of(c)))));
  const rows = used.map((v) => el("tr", {}, el("th", { scope: "row" }, name(shown, v)), shown.map((c) => one(c, v))));
  return el("table", { class: "grid turned" }, el("thead", {}, head), el("tbody", {}, top, rows));
}
/** Mark of a channel in which the flights cannot judge the model. */
const MARK = "†";
const titled = (c) => (c.abstained ? `${c.name} ${MARK}` : c.name);
const r2 = (v) => (v == null ? "–" : v > 0.9995 ? "1.000" : v < -9.995 ? "under −9" : show(v, v >= 0.995 ? 4 : 3));
const name = (channels, v) => channels.flatMap((c) => c.bins).find((b) => b.variable === v)?.name ?? v;
function cell(channel, bins, size) {
  const weight = channel.abstained ? 0 : bins.explained * size;
  const place = `${channel.name} over ${bins.name}`;
  const why = channel.abstained && `withheld, for ${channel.abstained}`;
  const pressed = pick.channel === channel.channel && pick.variable === bins.variable;
  return el("button", {
    type: "button", "aria-pressed": pressed ? "true" : "false", class: weight > 0.58 ? "strong" : "", vars: { "--weight": `${Math.round(100 * weight)}%` },
    "data-channel": channel.channel, "data-variable": bins.variable,
    "aria-label": `${place}: ${why ?? `${Math.round(100 * bins.explained)} % of the residual's variance`}`,
    title: why ? `${place}: ${why}` : `${percent(bins.explained)} of the variance of what ${channel.name} leaves goes with ${bins.name}`,
    onclick: () => { Object.assign(pick, { channel: channel.channel, variable: bins.variable, by_hand: true }); pressed_cell(); },
  }, !why && bins.explained >= 0.05 ? String(Math.round(100 * bins.explained)) : "");
}
/** Updates the pane after a cell was chosen: its times are highlighted, in another flight if this one has none. */
function pressed_cell() {
  grid();
  bench.light(lit);
  if (lit().length || !bench.choose_lit()) {
    time();
    states();
    brush();
  }
}
/** The cell in which an effect acts: of its channels that the flights can judge, the one that the model explains least; the variable
 *  of its curve, else the one that explains most there. Null if there is none. */
function cell_of(effect, channels) {
  const own = judgeable(channels.filter((c) => effect.channels.includes(c.channel)));
  const channel = own.sort((a, b) => (b.unexplained_fraction ?? 0) - (a.unexplained_fraction ?? 0))[0];
  const usable = channel?.bins.filter((b) => VARIABLES.includes(b.variable)) ?? [];
  const drawn = effect.curve?.channel === channel?.channel ? usable.find((b) => effect.curve?.variable.startsWith(b.name)) : null;
  const variable = drawn ?? usable.sort((a, b) => b.explained - a.explained)[0];
  return variable ? { channel: channel.channel, variable: variable.variable } : null;
}
/** Chooses the cell in which an effect acts, so that the plots show the accepted effect. */
export function follow(effect) {
  const channels = bench?.failing && models()[0].channels;
  const cell = effect && channels && cell_of(effect, channels);
  if (cell) Object.assign(pick, { ...cell, by_hand: true });
}
/** Initial choice: the cell in which an asserted effect acts, else the cell that explains most of the residual. */
function start(channels) {
  const found = way(bench.failing.ways) === "tuned" ? bench.diagnosis?.effects.find((e) => e.asserted && e.channels.length) : null;
  const cell = found && cell_of(found, channels);
  if (cell) {
    Object.assign(pick, cell);
    return;
  }
  let best = -1;
  for (const c of judgeable(channels))
    for (const b of c.bins.filter((b) => VARIABLES.includes(b.variable))) {
      const weight = b.explained * Math.min(1, c.unexplained_fraction ?? 0);
      if (weight > best) [best, pick.channel, pick.variable] = [weight, c.channel, b.variable];
    }
}
const chosen = (model) => model?.channels.find((c) => c.channel === pick.channel);
const over = (channel) => channel?.bins.find((b) => b.variable === pick.variable);
/** The bin with the largest mean residual of the model without effects. Null if the channel is withheld. */
function worst() {
  const channel = bench.failing && chosen(models()[0]);
  if (withheld() || channel?.abstained) return null;
  const bins = over(channel)?.bins ?? [];
  const supported = bins.filter((b) => b.supported);
  return (supported.length ? supported : bins).reduce((a, b) => (a && Math.abs(a.mean) >= Math.abs(b.mean) ? a : b), null);
}
function finding() {
  const channel = chosen(models()[0]);
  const found = bench.diagnosis?.effects.filter((e) => e.asserted && e.channels.includes(channel?.channel)).map((e) => e.id) ?? [];
  const left = channel?.unexplained_fraction;
  const small = found.length > 0 && left != null && left < 0.001;
  const said = small ? `${capital(channel.name)}: little is left (${show(Math.max(0, 100 * left), 2)} %), and an effect explains it: ${found.join(" or ")}`
    : capital(of_cell(channel, over(channel), worst()) ?? channel?.worst_regime ?? "");
  parts.finding.replaceChildren(el("span", {}, said));
}
/** Sentences on the chosen cell: the share of the residual's variance, and the bin with the largest mean residual. Null if the flights
 *  cannot judge the channel, or if there are no bins. */
function of_cell(channel, variable, bin) {
  if (!channel || channel.abstained || !variable || bin?.mean == null) return null;
  const [low, high] = (bin.interval ?? []).map((end) => end ?? NaN);
  // half width of the 95 % interval on the side of zero
  const half = bin.mean > 0 ? bin.mean - low : high - bin.mean;
  const error = `${show(Math.abs(bin.mean))}${half > 0 ? ` ± ${show(half, 2)}` : ""} ${channel.unit} ${bin.mean < 0 ? "below" : "above"} the model on average`;
  const beyond = variable.bins.some((b) => !b.supported && Math.abs(b.mean) > Math.abs(bin.mean));
  const unclear = low <= 0 && high >= 0 ? ", not clearly different from zero" : "";
  return `${channel.name} over ${variable.name}: ${percent(variable.explained)} of the residual's variance goes with it. `
    + `Largest ${bin.supported && beyond ? "well-sampled " : ""}error at ${variable.name} ${range(bin, variable.unit)}: measured ${error}${unclear}${bin.supported ? "" : ", from few samples"}.`;
}
/** The range of a bin with its unit, such as "8 to 11°" or "above 0.6". An end that is null is open. */
function range(bin, unit) {
  const edge = (x) => String(+x.toPrecision(4)).replace("-", "−");
  const words = bin.low == null ? (bin.high == null ? "of all values" : `below ${edge(bin.high)}`) : bin.high == null ? `above ${edge(bin.low)}` : `${edge(bin.low)} to ${edge(bin.high)}`;
  return unit && (bin.low != null || bin.high != null) ? `${words}${unit === "°" ? "" : " "}${unit}` : words;
}

// ---- over time ----

/** The time intervals (s) of a flight in which the variable lies in the worst bin. */
export function lit(flight = bench.flight) {
  const bin = worst();
  if (!flight || !bin) return [];
  const [values, times] = [flight.regimes[pick.variable] ?? [], flight.window_s];
  const half = 0.5 * (times[1] - times[0]) || 0.1;
  const spans = [];
  values.forEach((v, i) => {
    if (v == null || times[i] == null || v < (bin.low ?? -Infinity) || v > (bin.high ?? Infinity)) return;
    const [from, to] = [times[i] - half, times[i] + half];
    const last = spans[spans.length - 1];
    if (last && from <= last[1] + 1e-3) last[1] = to;
    else spans.push([from, to]);
  });
  return spans;
}
function quality(measured, predicted, inside) {
  let [n, sum, square, rest] = [0, 0, 0, 0];
  measured.forEach((m, i) => {
    if (m == null || predicted[i] == null || !inside(i)) return;
    n += 1; sum += m; square += m * m; rest += (m - predicted[i]) ** 2;
  });
  const variance = square / n - (sum / n) ** 2;
  return n > 2 && variance > 0 ? `R² ${r2(1 - rest / n / variance)} · NRMSE ${show(Math.sqrt(rest / n / variance))}` : "";
}
const key = (tone, word, more) => el("span", { class: `key ${tone}` }, el("i"), el("span", {}, word, more ? ` ${more}` : ""));

const sync = { key: "flight", setSeries: false };
/** Options of all plots over time: cursor, zoom, highlighted times, and a click that starts a free run. */
function clock(series, spans) {
  let down = null;
  return {
    scales: { x: { time: false, range: (u, low, high) => pick.window ?? [low, high] } },
    cursor: { sync, drag: { x: true, y: false, setScale: false }, points: { size: 5 } },
    series,
    hooks: {
      drawClear: [(u) => shade(u, spans, "lit")],
      setSelect: [(u) => {
        if (u.select.width < 6) return;
        zoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]);
        u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      }],
      ready: [(u) => {
        u.over.addEventListener("mousedown", (e) => { down = e.clientX; });
        u.over.addEventListener("click", (e) => {
          if (down != null && Math.abs(e.clientX - down) < 6) fly(u.posToVal(e.clientX - u.over.getBoundingClientRect().left, "x"));
        });
        u.over.addEventListener("dblclick", () => zoom(null));
      }],
    },
  };
}
function zoom(window) {
  pick.window = window;
  parts.reset.disabled = !window;
  time();
  states();
  brush();
}
/** Marks the cells whose worst bin is frequent in the zoomed window. */
function brush() {
  const { flight } = bench;
  for (const button of parts.grid.querySelectorAll("button")) {
    let [inside, all] = [0, 0];
    const channel = models()[0].channels.find((c) => c.channel === button.dataset.channel);
    const values = flight?.regimes[button.dataset.variable];
    const bins = channel?.abstained ? [] : channel?.bins.find((b) => b.variable === button.dataset.variable)?.bins.filter((b) => b.supported) ?? [];
    const bin = bins.reduce((a, b) => (a && Math.abs(a.mean) >= Math.abs(b.mean) ? a : b), null);
    if (pick.window && values && bin)
      values.forEach((v, i) => {
        const t = flight.window_s[i];
        if (v == null || t == null || t < pick.window[0] || t > pick.window[1]) return;
        all += 1;
        if (v >= (bin.low ?? -Infinity) && v <= (bin.high ?? Infinity)) inside += 1;
      });
    button.classList.toggle("brushed", all > 0 && inside > 0.3 * all);
  }
}

/** Draws all plots over time again, for a new flight or new models. */
export function freshFailing(of) {
  bench = of;
  if (!parts) return;
  if (!bench.flight) {
    parts.where.hidden = parts.tools.hidden = parts.states.hidden = true;
    return;
  }
  parts.tools.hidden = parts.states.hidden = false;
  parts.where.hidden = withheld();
  if (pick.flight !== bench.chosen_path) Object.assign(pick, { window: null, run: null, at: null, flight: bench.chosen_path });
  bench.light(lit);
  time();
  const times = bench.flight.time_s.filter((t) => t != null);
  const spans = lit();
  const most = spans.reduce((a, b) => (a && a[1] - a[0] >= b[1] - b[0] ? a : b), null);
  fly(pick.at ?? Math.max(times[0], Math.min((most?.[0] ?? times[0]) - 0.5, times[times.length - 1] - RUN_S)));
}

function time() {
  const { flight } = bench;
  if (!flight || withheld()) return;
  const list = flight.channels[symbol(pick.channel)];
  const channel = chosen(models()[0]);
  if (!list || !channel) return;
  const [measured, ...predicted] = list;
  const [before, after] = two(predicted, flight.ways);
  const spans = lit();
  const inside = (i) => !pick.window || (flight.window_s[i] >= pick.window[0] && flight.window_s[i] <= pick.window[1]);
  const x = flight.window_s;
  parts.time.caption.replaceChildren(el("b", {}, `${capital(channel.name)} (${channel.unit}), ${flight.name}`), key("measured", "measured"),
    key("before", word(), quality(measured, before, inside)), ...(after ? [key("after", with_effects(), quality(measured, after, inside))] : []));
  const lines = [{}, line("before", 1.6), ...(after ? [line("after", 1.6)] : []), line("measured", 1.1)];
  draw(parts.time.plot, clock(lines, spans), [x, before, ...(after ? [after] : []), measured]);
  const rest = (model) => measured.map((m, i) => (m == null || model[i] == null ? null : m - model[i]));
  const bin = worst();
  const variable = over(channel);
  const lit_range = bin ? `${SYMBOL[pick.variable]} ${range(bin, variable.unit)}` : "";
  parts.residual.caption.replaceChildren(el("b", {}, `Residual: measured − model (${channel.unit})`), ...(bin ? [key("lit", `${lit_range}: ${show(bin.mean)} ${channel.unit} on average`)] : []));
  draw(parts.residual.plot, clock([{}, line("before", 1.4), ...(after ? [line("after", 1.4)] : [])], spans), [x, rest(before), ...(after ? [rest(after)] : [])]);
  parts.variable.caption.replaceChildren(el("b", {}, variable ? `${capital(variable.name)}${variable.unit ? ` (${variable.unit})` : ""}` : ""));
  draw(parts.variable.plot, clock([{}, line("measured", 1.2)], spans), [x, flight.regimes[pick.variable] ?? x.map(() => null)]);
  bins(channel, variable);
  maps();
}

/** Maps of the mean residual over α and β, one for each model, on one colour scale. */
function maps() {
  const all = models().map((m) => chosen(m)?.map).filter((m) => m?.cells.length);
  if (!all.length || chosen(models()[0]).abstained) return parts.map.replaceChildren();
  const unit = chosen(models()[0]).unit;
  const sizes = (only) => all.flatMap((m) => m.cells).filter((c) => c.supported || !only).map((c) => Math.abs(c.mean));
  const limit = Math.max(...sizes(true), 0) || Math.max(...sizes(false), 1e-12);
  const one = (map, k) => {
    const canvas = el("canvas", { role: "img", "aria-label": `mean residual over α and β, ${k ? with_effects() : word()}` });
    return [el("div", {}, canvas, k ? with_effects() : word()), () => paint(canvas, map, limit)];
  };
  const made = all.map(one);
  parts.map.replaceChildren(el("figcaption", {}, el("b", {}, `Residual over α (across) and β (up), to ±${show(limit)} ${unit}`)), el("div", { class: "map" }, made.map(([node]) => node)));
  parts.map.paint = () => made.forEach(([, draw_map]) => draw_map());
  parts.map.paint();
}
function paint(canvas, map, limit) {
  const { width, height } = canvas.getBoundingClientRect();
  if (!width) return;
  const ratio = devicePixelRatio;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const ctx = canvas.getContext("2d");
  ctx.scale(ratio, ratio);
  const places = (edges, k) => String(+edges[k].toPrecision(2)).replace("-", "−");
  ctx.font = `10px ${ink("sans")}`;
  const beta = [`${places(map.beta_deg, map.beta_deg.length - 1)}°`, places(map.beta_deg, 0)];
  const [left, bottom] = [Math.ceil(Math.max(...beta.map((text) => ctx.measureText(text).width))) + 5, 16];
  const [columns, rows] = [map.alpha_deg.length - 1, map.beta_deg.length - 1];
  const [w, h] = [(width - left) / columns, (height - bottom) / rows];
  for (const cell of map.cells) {
    const share = Math.min(1, Math.abs(cell.mean) / limit);
    ctx.globalAlpha = 1;
    ctx.fillStyle = ink("grid");
    const at = [left + cell.alpha * w, (rows - 1 - cell.beta) * h, w - 1, h - 1];
    ctx.fillRect(...at);
    ctx.globalAlpha = share * (cell.supported ? 1 : 0.45);
    ctx.fillStyle = ink(cell.mean > 0 ? "before" : "after");
    ctx.fillRect(...at);
  }
  ctx.globalAlpha = 1;
  ctx.fillStyle = ink("muted");
  ctx.fillText(places(map.alpha_deg, 0), left, height - 3);
  ctx.textAlign = "right";
  ctx.fillText(`${places(map.alpha_deg, columns)}°`, width, height - 3);
  ctx.fillText(beta[0], left - 3, 10);
  ctx.fillText(beta[1], left - 3, rows * h);
}
export const repaint = () => parts?.map.paint?.();
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const symbol = (channel) => ({ V: "V̇", alpha: "α̇", beta: "β̇" })[channel] ?? channel;

/** Plot of the mean residual over the variable, with its interval. */
function bins(channel, variable) {
  parts.bins.figure.hidden = !!channel.abstained;
  if (!variable || channel.abstained) return;
  const both = models().map((m) => over(chosen(m))?.bins ?? []);
  parts.bins.caption.replaceChildren(el("b", {}, `Residual (${channel.unit}) over ${variable.name}${variable.unit ? ` (${variable.unit})` : ""}`));
  const tables = both.map((list) => [list.map((b) => b.center), list.map((b) => b.mean)]);
  const joined = tables.length > 1 ? uPlot.join(tables) : tables[0];
  const whiskers = (u) => both.forEach((list, k) => {
    const { ctx } = u;
    ctx.save();
    ctx.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue(k ? "--after" : "--before");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    for (const b of list) {
      const at = u.valToPos(b.center, "x", true);
      ctx.globalAlpha = b.supported ? 1 : 0.4;
      ctx.beginPath();
      ctx.moveTo(at, u.valToPos(b.interval[0], "y", true));
      ctx.lineTo(at, u.valToPos(b.interval[1], "y", true));
      ctx.stroke();
    }
    ctx.restore();
  });
  const ends = both.flat().flatMap((b) => b.interval).filter((v) => v != null).concat(0);
  const [low, high] = [Math.min(...ends), Math.max(...ends)];
  const pad = 0.06 * (high - low) || 1;
  draw(parts.bins.plot, {
    scales: { x: { time: false }, y: { range: [low - pad, high + pad] } }, cursor: { drag: { x: false, y: false } },
    series: [{}, ...both.map((_, k) => dots(k ? "after" : "before", 6))], hooks: { draw: [whiskers] },
  }, joined);
}

// ---- free runs ----

let asked = 0;
async function fly(at) {
  const own = ++asked;
  try {
    const begun = performance.now();
    const { runs } = await post("/api/free-run", { flight: bench.chosen, time_s: at, seconds: RUN_S });
    if (own !== asked) return;
    Object.assign(pick, { run: runs, at: runs[0].time_s[0] });
    states();
    document.documentElement.dataset.freeRunMs = (performance.now() - begun).toFixed(1);
  } catch (error) {
    if (own === asked) { states(); complain(error.message); }
  }
}
function states() {
  const { flight } = bench;
  if (!flight) return;
  parts.at.value = pick.at == null ? "" : pick.at.toFixed(1);
  parts.every.textContent = pick.every ? "Four states" : "All eight states";
  const names = Object.keys(STATES).slice(0, pick.every ? 8 : 4);
  if (parts.states.childElementCount !== names.length) {
    parts.states.replaceChildren(...names.map((n) => el("figure", {}, el("figcaption"), el("div", { class: "plot", "data-plot": n }))));
  }
  // a window around the free run is shown, because the run would be invisible in the whole flight
  const around = pick.window ?? (pick.at == null ? null : [pick.at - 3, pick.at + RUN_S + 3]);
  const spans = lit();
  const flown = pick.run ? two(pick.run, pick.run.map((r) => r.way)).filter(Boolean) : [];
  names.forEach((n, k) => {
    const [caption, plot] = parts.states.children[k].children;
    const [sign, unit] = STATES[n];
    const tables = [[flight.time_s.map((t, i) => t ?? between(flight.time_s, i)), flight.states[n]], ...flown.map((r) => [r.time_s, r.states[n]])];
    const data = tables.length > 1 ? uPlot.join(tables) : tables[0];
    const [x, measured, ...models] = data;
    const lines = models.map((_, i) => line(i ? "after" : "before", 2));
    caption.replaceChildren(el("b", {}, `${sign} (${unit})`), ...(k === 0 && flown.length ? [key("measured", "measured"), key("before", word()), ...(flown.length > 1 ? [key("after", with_effects())] : [])] : []));
    const options = clock([{}, ...lines, line("measured", 1.2)], spans);
    options.scales.x.range = (u, low, high) => around ?? [low, high];
    draw(plot, options, [x, ...models, measured]);
  });
}
/** A time for a row without values, which interrupts the line. */
function between(times, i) {
  const before = times[i - 1] ?? 0;
  return before + 1e-3;
}
