// Effects as text: the editor with its checks, the list of the user's effects, and proposed formulas.

import { command, complain, el, get, post, show } from "./kit.js";
import { curve } from "./suspects.js";

const CHECK_MS = 400;
let bench = null;
let parts = null;
let later = 0;
let asked = 0;
/** Key of the proposal that was put into the editor. */
let taken = null;
const curves = new Map();

export function text(of) {
  bench = of;
  if (!parts) {
    parts = build();
    document.querySelector("#suspects .text").replaceChildren(parts.own, parts.proposal, parts.designed, parts.editor);
  }
  own();
  designed();
  proposal();
}

function build() {
  const made = { own: el("div", { id: "own" }), designed: el("div"), proposal: el("div", { id: "proposal" }) };
  made.area = el("textarea", { id: "effect-text", rows: "16", spellcheck: "false", autocomplete: "off", "aria-label": "Effect file", "aria-describedby": "effect-said", oninput: () => { clearTimeout(later); later = setTimeout(check, CHECK_MS); } });
  made.said = el("p", { class: "note", id: "effect-said", "aria-live": "polite" }, "A formula in TOML is an effect like those of the catalogue.");
  made.keep = el("button", { type: "button", id: "effect-keep", disabled: true, onclick: () => keep(false) }, "Keep");
  made.use = el("button", { type: "button", class: "main", id: "effect-try", disabled: true, onclick: () => keep(true) }, "Keep and try");
  made.help = el("div", { class: "names" });
  const help = el("details", { ontoggle: names }, el("summary", {}, "What a formula may name"), made.help);
  made.editor = el("details", { id: "editor", ontoggle: begin }, el("summary", {}, "Write an effect as text"), made.area, made.said,
    el("div", { class: "row" }, made.use, made.keep, el("button", { type: "button", onclick: () => example() }, "Example")), help);
  return made;
}

let grammar = null;
const language = async () => (grammar ??= await get("/api/grammar"));
async function names() {
  try {
    const { variables, functions } = await language();
    const list = (rows) => el("dl", {}, rows.flatMap((row) => [el("dt", {}, row.slice(0, -1).filter(Boolean).join(", ")), el("dd", {}, row[row.length - 1])]));
    parts.help.replaceChildren(list(variables), list([...functions, ["clamp(x, low, high)", "x within bounds"], ["table(x; x1:y1, x2:y2, …)", "linear between, constant beyond"]]));
  } catch (error) { complain(error.message); }
}
async function example() {
  try {
    put((await language()).example);
  } catch (error) { complain(error.message); }
}
function begin() {
  if (parts.editor.open && !parts.area.value) example();
}
/** Puts a text into the editor. */
function put(content) {
  parts.editor.open = true;
  parts.area.value = content;
  check();
}

/** Checks the text and shows the parser's answer. */
async function check() {
  const own_turn = ++asked;
  try {
    const found = await post("/api/check", { text: parts.area.value });
    if (own_turn !== asked) return;
    parts.keep.disabled = parts.use.disabled = !!found.error;
    parts.area.setAttribute("aria-invalid", found.error ? "true" : "false");
    parts.said.className = found.error ? "bad" : "good";
    const known = bench.state.own.some((e) => e.id === found.id);
    parts.said.textContent = found.error ?? `${found.id}: ${found.formula}${known ? "; takes the place of the one of that name" : ""}${found.status === "proposed" ? "; a model with it does not fly before its status is accepted" : ""}`;
    mark(found.error);
  } catch (error) { complain(error.message); }
}
/** Adds a button that goes to the line of the parser's error. */
function mark(error) {
  const line = +(/line (\d+)/.exec(error ?? "")?.[1] ?? 0);
  if (line) parts.said.append(" ", el("button", { type: "button", onclick: () => go_to(line) }, `Go to line ${line}`));
}
function go_to(line) {
  const lines = parts.area.value.split("\n");
  const start = lines.slice(0, line - 1).reduce((sum, l) => sum + l.length + 1, 0);
  parts.area.focus();
  parts.area.setSelectionRange(start, start + (lines[line - 1] ?? "").length);
}
async function keep(and_try) {
  const found = await post("/api/check", { text: parts.area.value }).catch((error) => ({ error: error.message }));
  if (found.error) return check();
  if (!(await bench.act({ do: "write", text: parts.area.value }))) return;
  if (and_try && !ticked(found.id)) await bench.act({ do: "tick", effect: found.id });
  check();
}

const ticked = (id) => bench.state.stack.find((s) => s.id === id);
let before = "";
/** Lists the user's effects, each with a checkbox and, if it is accepted, its curve. */
function own() {
  const { state } = bench;
  const now = JSON.stringify([state.own, state.stack.map((s) => [s.id, s.status, !!s.estimated])]);
  if (now === before) return;
  before = now;
  parts.own.replaceChildren(...(state.own.length ? [el("h3", {}, "Effects as text"), ...state.own.map(one)] : []));
}
function one(e) {
  const { stack } = bench.state;
  const step = ticked(e.id);
  const fixed = step && stack[stack.length - 1].id !== e.id;
  const box = el("input", { type: "checkbox", checked: !!step, disabled: fixed, "data-effect": e.id, title: fixed ? "Take back the effects accepted after it first" : "",
    onchange: () => bench.act(step ? { do: "undo" } : { do: "tick", effect: e.id }).then((done) => { if (!done) box.checked = !!step; }) });
  const figure = el("figure", { "data-own": e.id });
  if (step && (step.story || step.estimated)) shape(e.id, figure, step);
  return el("article", { class: "suspect" }, el("label", {}, box, el("span", {}, e.id, " ", e.status === "proposed" && el("span", { class: "tag" }, "proposed"))),
    el("p", { class: "muted" }, e.description), el("p", {}, el("code", {}, e.formula)), figure,
    el("div", { class: "row" }, el("button", { type: "button", onclick: () => put(e.text) }, "Edit"), el("button", { type: "button", disabled: !!step, onclick: () => bench.act({ do: "forget", effect: e.id }) }, "Remove")));
}
/** Draws the curve of an accepted effect. */
async function shape(id, figure, step) {
  const key = `${id} ${step.story ? "fit" : "estimate"} ${bench.state.revision}`;
  try {
    if (!curves.has(key)) curves.set(key, await get(`/api/curve/${id}`));
    if (!figure.isConnected) return;
    // a fit that refuses the effect gives no curve of it, so the curve of the estimate stays
    const refused = step.story && !curves.get(key);
    const found = refused ? [...curves].findLast(([k, c]) => c && k.startsWith(`${id} estimate `))?.[1] : curves.get(key);
    const way = refused ? "equation error; the fit by output error refuses it" : step.story ? "output error" : "equation error";
    const plot = el("div", { class: "plot", "data-shape": id });
    if (!found && !refused) return;
    figure.replaceChildren(el("figcaption", {}, el("b", {}, found ? `${found.channel} (${found.unit}) over ${found.variable}, by ${way}` : "The fit by output error refuses it")));
    if (!found) return;
    figure.append(plot);
    curve(plot, found);
  } catch (error) { complain(error.message); }
}

/** Shows the result of the search for a formula and its test. */
function proposal() {
  const { state, proposal: found } = bench;
  const running = state.jobs.some((j) => j.work === "proposal");
  const can = !!state.commands.propose;
  const ask = el("button", { type: "button", id: "propose", disabled: !can || running, title: can ? "Takes minutes; can be cancelled" : "Needs a flight to search in and another one to test on", onclick: () => bench.act({ do: "propose" }) }, found ? "Propose again" : "Propose a formula where nothing fits");
  const said = state.proposal.error && el("p", { class: "bad" }, state.proposal.error);
  const list = [el("div", { class: "row" }, ask), said];
  if (found) {
    const { effect, refused, sentences, front, free } = found;
    // the sentences state the result of the test and its reliability
    list.push(el("div", { class: `verdict ${effect ? "effect" : "unexplained"}` }, sentences.map((s) => el("p", {}, s)), refused.filter((s) => !sentences.includes(s)).map((s) => el("p", { class: "bad" }, s))));
    if (front.length) list.push(el("details", {}, el("summary", {}, "Formulas by size"), el("ul", {}, front.map((r) => el("li", {}, `${r.formula}: removes ${show(100 * r.removed)} %, evidence of its last term ${show(r.evidence)}, chance reaches ${show(r.threshold)}${r.chosen ? " (chosen)" : ""}`)))));
    if (free && free.front.length) list.push(el("details", {}, el("summary", {}, `Free forms, the best of each size (${free.tried} were tried)`), el("ul", {}, free.front.map((r) => el("li", {}, `${r.formula}: removes ${show(100 * r.removed)} %, evidence ${show(r.evidence)}, chance reaches ${show(r.threshold)}${r.chosen ? " (chosen)" : ""}`)))));
    if (effect) list.push(el("div", { class: "row" }, el("button", { type: "button", id: "proposal-edit", onclick: () => put(effect) }, "Open it as text")));
    // a result of this page's own search goes into the editor once
    if (effect && taken !== state.proposal.key && bench.waited_for === "proposal") { taken = state.proposal.key; put(effect); }
  }
  list.push(command(state.commands.propose, "Propose"));
  parts.proposal.replaceChildren(...list.filter(Boolean));
}

/** Lists the schedules that distinguish two effects. */
function designed() {
  const { state } = bench;
  const said = state.schedule.error && el("p", { class: "bad" }, state.schedule.error);
  const one = (d) => el("article", { class: "step" }, el("h3", {}, `${d.between.join(" or ")}: ${d.manoeuvre}`),
    el("p", { class: "note" }, `${d.description} ${show(d.seconds)} s of it suffice; the schedule flies it ${d.times} times, on opposite headings. File: ${d.file}`),
    el("div", { class: "row" }, el("button", { type: "button", onclick: () => bench.show("fly", d.name) }, "Fly it")), command(d.command, "The same schedule"));
  parts.designed.replaceChildren(...[said, ...(state.designed.length ? [el("h3", {}, "Schedules that tell two effects apart"), ...state.designed.map(one)] : [])].filter(Boolean));
}
