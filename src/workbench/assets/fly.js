// The pane of flights: a simulator flight with the model, or a recording of another program. Measured values are
// compared with predictions during the flight.

import { command, complain, draw, el, get, ink, line, show } from "./kit.js";

const WINDOW_S = 30;
const REDRAW_MS = 250;
const CHANNEL_UNITS = ["m/s²", "m/s²", "m/s²", "rad/s²", "rad/s²", "rad/s²"];
const STATES = [["phi", "φ (°)", "phi_target"], ["theta", "θ (°)", "theta_target"], ["V", "V (m/s)"], ["alpha", "α (°)"], ["beta", "β (°)"], ["h", "h (m)"]];
let bench = null;
let parts = null;
let flight = null;
let due = 0;

export function fly(of) {
  bench = of;
  const body = document.querySelector("#fly .body");
  const { fly: can } = bench.state;
  if (!parts) {
    parts = build(can);
    body.replaceChildren(parts.form, parts.watch, parts.status, parts.warnings, parts.plots, parts.past);
  }
  choices(parts.schedule, can.schedules.map((s) => [s.id, s.id.replaceAll("_", " "), s.description]));
  parts.start.disabled = !can.possible || can.on;
  parts.start.title = can.possible ? "" : "This program was built without the simulator";
  parts.stop.disabled = !can.on;
  past();
  // a page that was opened later or missed a part requests the whole flight
  if (can.number != null && flight?.number !== can.number) load();
  else if (flight && flight.on !== can.on) { flight.on = can.on; paint(); }
  status();
}

/** Sets the options of a select. They are kept if their number is the same. */
function choices(select, list) {
  if (select.childElementCount === list.length) return;
  const before = select.value;
  select.replaceChildren(...list.map(([id, name, title]) => el("option", { value: id, title }, name)));
  if (before) select.value = before;
}

function build(can) {
  const select = (label, list, id) => {
    const node = el("select", { id: `fly-${id}` });
    choices(node, list);
    return [el("label", {}, el("span", {}, label), node), node];
  };
  const made = {};
  const plain = (list) => list.map((v) => [v, v]);
  const [schedule, controller, aircraft, turbulence] = [
    select("Schedule", [], "schedule"), select("Controller", plain(can.controllers), "controller"), select("Aircraft", plain(can.aircraft), "aircraft"),
    select("Turbulence", [["", "none"], ["3", "light"], ["4", "moderate"], ["6", "severe"]], "turbulence")];
  Object.assign(made, { schedule: schedule[1], controller: controller[1], aircraft: aircraft[1], turbulence: turbulence[1] });
  if (can.controllers.includes("lqi")) made.controller.value = "lqi";
  made.hide = el("input", { type: "text", id: "fly-hide", placeholder: "drag_beta2=1.0", spellcheck: "false", autocomplete: "off" });
  made.seed = el("input", { type: "number", id: "fly-seed", value: "1", min: "0", step: "1" });
  made.start = el("button", { type: "button", class: "main", id: "fly-start", onclick: start }, "Fly");
  made.stop = el("button", { type: "button", id: "fly-stop", onclick: () => bench.act({ do: "stop_flight" }) }, "Stop");
  made.form = el("div", { class: "order" }, schedule[0], controller[0], aircraft[0],
    el("label", { title: "Effects that the simulator's aircraft has besides, ID=AMPLITUDE" }, el("span", {}, "Hidden effects"), made.hide), turbulence[0], el("label", {}, el("span", {}, "Seed"), made.seed),
    el("div", { class: "row" }, made.start, made.stop));
  made.folder = el("input", { type: "text", id: "fly-folder", placeholder: "flights/0001", spellcheck: "false", autocomplete: "off" });
  made.watch = el("details", {}, el("summary", {}, "Watch a flight of greylag fly"), el("div", { class: "order" }, el("label", {}, el("span", {}, "Folder of the recording"), made.folder),
    el("div", { class: "row" }, el("button", { type: "button", id: "fly-watch", onclick: () => bench.act({ do: "watch", folder: made.folder.value }) }, "Watch"))));
  made.status = el("p", { class: "note", id: "fly-status", "aria-live": "polite" });
  made.warnings = el("ul", { class: "warnings", id: "fly-warnings", "aria-live": "polite" });
  made.plots = el("div", { class: "live", hidden: true });
  made.past = el("div", { id: "flown" });
  return made;
}

function start() {
  const { schedule, controller, aircraft, hide, turbulence, seed } = parts;
  bench.act({ do: "fly", schedule: schedule.value, controller: controller.value, aircraft: aircraft.value, hide: hide.value, turbulence: turbulence.value ? +turbulence.value : null, seed: +seed.value });
}
/** Selects a schedule in this pane. */
export function offer(schedule) {
  parts.schedule.value = schedule;
  parts.start.focus();
}

/** Requests the whole flight from the server. */
async function load() {
  try {
    const whole = await get("/api/flying");
    if (!whole) return;
    flight = whole;
    setup();
    paint();
  } catch (error) {
    complain(error.message);
  }
}
/** Appends a new part of the flight. If parts are missing, the whole flight is requested. */
export function part(news) {
  if (!bench) return;
  if (flight?.number !== news.number || news.from !== flight.from + flight.live.time_s.length) return void load();
  const { live } = flight;
  const join = (a, b) => a.push(...b);
  join(live.time_s, news.live.time_s);
  for (const [name, column] of Object.entries(news.live.states)) join((live.states[name] ??= []), column);
  live.measured.forEach((c, k) => join(c, news.live.measured[k]));
  if (!live.models.length) live.models = news.live.models;
  else live.models.forEach((m, i) => ["predicted", "band", "share"].forEach((what) => m[what].forEach((c, k) => join(c, news.live.models[i][what][k]))));
  join(live.warnings, news.live.warnings);
  if (!due) due = setTimeout(() => { due = 0; paint(); }, REDRAW_MS);
}

const TONES = ["before", "after"];
/** Draws the monitor's band around the prediction of each model in channel `k`. */
function bands(u, k) {
  const { time_s, models } = flight.live;
  models.forEach((model, m) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = ink(m ? "band" : "lit");
    const at = (i, sign) => [u.valToPos(time_s[i], "x", true), u.valToPos(model.predicted[k][i] + sign * model.band[k][i], "y", true)];
    const known = time_s.map((_, i) => i).filter((i) => model.predicted[k][i] != null && model.band[k][i] != null && time_s[i] >= u.scales.x.min - 1);
    ctx.beginPath();
    for (const i of known) ctx.lineTo(...at(i, 1));
    for (const i of known.toReversed()) ctx.lineTo(...at(i, -1));
    ctx.fill();
    ctx.restore();
  });
}
const keys = (models) => [el("span", { class: "key measured" }, el("i"), "measured"), ...models.map((m, i) => el("span", { class: `key ${TONES[i]}` }, el("i"), `${m.model}, predicted with its band`))];

/** Makes one plot for each channel and each state. */
function setup() {
  const { models } = flight.live;
  const x = { time: false, range: (u, low, high) => (flight.on ? [Math.max(low, high - WINDOW_S), Math.max(high, low + WINDOW_S)] : [low, high]) };
  const cursor = { sync: { key: "live", setSeries: false }, drag: { x: true, y: false } };
  parts.drawn = [];
  const figure = (caption, options, data) => {
    const plot = el("div", { class: "plot" });
    const title = el("figcaption", {}, el("b", {}, caption));
    parts.plots.append(el("figure", {}, title, plot));
    draw(plot, { scales: { x }, cursor, ...options }, data());
    parts.drawn.push({ plot: plot.plot, data, title });
  };
  parts.plots.replaceChildren(el("div", { class: "legend" }, keys(models)));
  bench.state.fly.channels.forEach(([id, word], k) => figure(`${capital(word)} (${CHANNEL_UNITS[k]})`,
    { series: [{}, ...models.map((_, i) => line(TONES[i], 1.6)), line("measured", 1.2)], hooks: { drawAxes: [(u) => bands(u, k)] } },
    () => [flight.live.time_s, ...flight.live.models.map((m) => m.predicted[k]), flight.live.measured[k]]));
  for (const [name, caption, target] of STATES)
    figure(`${caption}${target ? ", dashed: commanded" : ""}`, { series: [{}, ...(target ? [line("muted", 1.2, { dash: [4, 3] })] : []), line("measured", 1.4)] },
      () => [flight.live.time_s, ...(target ? [flight.live.states[target] ?? blank()] : []), flight.live.states[name] ?? blank()]);
}
const blank = () => flight.live.time_s.map(() => null);
const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

function paint() {
  if (!flight || !parts) return;
  const { live } = flight;
  parts.plots.hidden = !live.time_s.length;
  if (live.time_s.length && (parts.models !== live.models.length || !parts.drawn)) {
    parts.models = live.models.length;
    setup();
  }
  for (const { plot, data } of parts.drawn ?? []) plot.setData(data());
  // marks the channels in which the residual of the last model is outside its band
  const model = live.models[live.models.length - 1];
  parts.drawn?.slice(0, 6).forEach(({ title }, k) => {
    const share = model?.share[k].findLast((v) => v != null);
    title.classList.toggle("outside", flight.on && Math.abs(share) > 1);
  });
  document.documentElement.dataset.livePoints = live.time_s.length;
  status();
}

function status() {
  const { fly: can, flown } = bench.state;
  const now = can.place == null ? null : flown[can.place];
  parts.start.textContent = flown.length ? "Fly again" : "Fly";
  if (!now) return parts.status.replaceChildren(can.possible
    ? "Flies the simulator's aircraft in real time with a controller designed from the model, and shows what the models predict against what is measured."
    : "This program was built without the simulator; a flight of greylag fly can be watched.");
  const live = flight?.number === can.number ? flight.live : null;
  const time = live?.time_s.length ? live.time_s[live.time_s.length - 1] - live.time_s[0] : now.seconds;
  const what = now.schedule ? `${now.schedule.replaceAll("_", " ")} with ${now.model}` : `Watching ${now.folder} with ${now.model}`;
  const how = can.on ? (live?.time_s.length ? `flying, ${show(time, 3)} s` : "starting") : OUTCOMES[now.outcome];
  parts.status.replaceChildren(el("b", {}, `${capital(what)}: ${how}. `), can.on ? "" : now.said);
  const warnings = live?.warnings ?? [];
  parts.warnings.replaceChildren(...warnings.map((w) => el("li", {}, `${show(w.time_s - (live.time_s[0] ?? 0))} s, `, el("span", { class: `key ${TONES[w.model]}` }, el("i"), live.models[w.model]?.model ?? ""), `: ${w.text}`)));
}
const OUTCOMES = { flying: "flying", flown: "flown to its end", stopped: "stopped", failed: "failed", cut_off: "cut off, for the workbench ended" };

/** Lists the finished flights of this session. */
function past() {
  const { flown } = bench.state;
  const list = flown.map((f, k) => [f, k]).filter(([f]) => f.outcome !== "flying").reverse();
  const one = ([f, k]) => el("article", { class: "step" }, el("h3", {}, `${f.schedule ? f.schedule.replaceAll("_", " ") : f.folder} `, el("span", { class: f.outcome === "failed" ? "tag bad" : "tag" }, OUTCOMES[f.outcome])),
    el("p", { class: "note" }, `${new Date(1000 * f.unix_s).toISOString().slice(0, 16).replace("T", " ")} UTC, ${f.model}, ${show(f.seconds)} s. ${f.said}`),
    ...f.warnings.map((w) => el("p", { class: "note bad" }, w)),
    el("div", { class: "row" }, el("button", { type: "button", "data-flown": k, disabled: !(f.seconds > 0) && f.outcome !== "cut_off", onclick: () => bench.act({ do: "take_flight", flown: k }) }, "Take as a log")),
    command(f.command, "The same flight"));
  parts.past.replaceChildren(...(list.length ? [el("h3", {}, "Flights of this session"), ...list.map(one)] : []));
}
