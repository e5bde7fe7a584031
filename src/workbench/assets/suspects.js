// The pane of suspects: candidate effects in the order of their evidence, and the probabilities of the explanations. A tick accepts an effect.

import { channel_words, command, draw, el, ink, line, percent, show } from "./kit.js";

/** What the kinds of explanations are called that are no effects, as in the report. */
const EXPLAINED = { nothing: "nothing is missing that these flights could show", other_effect: "another effect of the catalogue", unknown: "something that the catalogue lacks" };
const PROBABLE = "The probability that this is what the model lacks above all: in simulated flights in which that is known, statements with 90 % were right in about 90 % (docs/validation/probabilities.md).";
/** Smallest probability that is shown. */
const LISTED = 0.005;
const open = new Set();
let before = "";

export function suspects(bench) {
  const body = document.querySelector("#suspects .list");
  const { state, diagnosis } = bench;
  const running = state.jobs.find((j) => j.work === "diagnosis");
  const ready = state.flights.some((f) => f.role === "fit" && !f.error);
  const ask = el("button", { type: "button", class: state.diagnosis.there ? "" : "main", id: "diagnose", disabled: !ready || !!running, onclick: () => bench.act({ do: "diagnose" }) },
    state.diagnosis.there ? "Diagnose again" : "Diagnose: what is missing?");
  const behind = state.diagnosis.behind && el("p", { class: "note" }, "The effects as text were changed since this diagnosis: Diagnose again ranks them too.");
  const end = [command(state.commands.diagnose)].filter(Boolean);
  if (running || !diagnosis) {
    before = "";
    const said = state.diagnosis.error && el("p", { class: "bad" }, state.diagnosis.error);
    const hint = !running && !said && el("p", { class: "note" }, ready ? "Fits every effect of the catalogue to what the model leaves, and compares each with what chance reaches." : "Needs a flight to fit to.");
    return body.replaceChildren(el("div", { class: "row" }, ask), ...[said, hint, running && first(running)].filter(Boolean), ...end);
  }
  // an unchanged list is not rebuilt, so that plots and keyboard focus are kept
  const now = JSON.stringify([state.diagnosis.key, state.diagnosis.behind, state.stack.map((s) => [s.id, s.status]), tested(state), state.commands.diagnose, state.jobs.length > 0]);
  if (now === before) return;
  before = now;
  const pane = document.querySelector("#suspects .body");
  const kept = pane.scrollTop;
  const passing = diagnosis.effects.filter((e) => e.asserted || e.evidence > e.threshold || ticked(bench, e.id));
  const others = diagnosis.effects.filter((e) => !passing.includes(e));
  const most = Math.max(...diagnosis.effects.map((e) => e.evidence), 1);
  // the probabilities concern the leading suspect, whose curve stays in sight above them
  const [leading, ...following] = passing.map((e) => suspect(bench, e, most));
  body.replaceChildren(verdict(bench, diagnosis), leading ?? "", probabilities(diagnosis), ...following,
    more(`${others.length} others stay under what chance reaches`, others.map((e) => suspect(bench, e, most))),
    notes(bench, diagnosis), behind || "", el("div", { class: "row" }, ask), ...end);
  pane.scrollTop = kept;
  curves(body, diagnosis);
}

/** The first ranking, shown while the checks still run. */
function first(job) {
  const best = job.ranking.slice(0, 5).filter((c) => c.evidence > 0);
  if (!best.length) return el("p", { class: "note" }, `${job.doing} …`);
  return el("div", {}, el("p", { class: "note" }, "First ranking; the checks are running:"), el("ol", { class: "first" }, best.map((c) =>
    el("li", {}, `${c.id}: evidence ${show(c.evidence)}, chance reaches ${show(c.threshold)}`))));
}
function verdict(bench, diagnosis) {
  const found = diagnosis.effects.find((e) => e.asserted && !ticked(bench, e.id));
  const said = found ? [missing(found, fitted(bench).length), ...diagnosis.sentences] : diagnosis.sentences;
  const [lead, ...rest] = said;
  const then = found ? null : next(bench, diagnosis);
  return el("div", { class: `verdict ${diagnosis.verdict}` }, el("p", {}, lead ?? diagnosis.verdict), then && el("p", { class: "next" }, then), rest.length ? more("More", rest.map((s) => el("p", {}, s)), "sentences") : null);
}
/** The first asserted effect that is not accepted, where it acts in the `count` fitted flights, and the next step. Flights name only the
 *  channels that they move. */
function missing(found, count) {
  const share = (x) => (x > 9.995 ? `${show(x)} times its variance` : `${show(100 * x)} %`);
  const one = (a) => `${a.name} (unexplained: ${share(a.tuned)} tuned by equation error, ${share(a.after)} with it)`;
  const acts = found.acts?.length ? found.acts.map(one).join(" and in ") : channel_words(found.channels);
  const few = count < 3 ? "; flights that move other axes may add channels" : "";
  const where = found.channels.length ? `, in ${acts}, on ${count === 1 ? "the flight" : `the ${count} flights`} fitted${few}` : "";
  const other = found.indistinguishable_from.length ? ` (or ${found.indistinguishable_from.join(", ")})` : "";
  return `Missing: ${found.id}${other}${where}. Next: tick it.`;
}
const fitted = (bench) => bench.state.flights.filter((f) => f.role === "fit" && !f.error);
/** The next step if no effect is left to accept; null if there is none. */
function next(bench, diagnosis) {
  if (bench.state.stack.length) return `Next, in the pane Model: ${tested(bench.state) ? "judge it on the test flights, then save it" : "save it, then fly it or compare it on further logs"}.`;
  const alone = diagnosis.verdict === "unknown" && fitted(bench).length === 1;
  return alone ? "Next: drop more flights into the pane Flights, then Diagnose again." : null;
}
/** Bars of the probabilities of the explanations; empty if the diagnosis states none. */
function probabilities(diagnosis) {
  const listed = (diagnosis.explanations ?? []).filter((e) => e.probability >= LISTED);
  if (!listed.length) return "";
  const row = (e) => [el("dt", {}, EXPLAINED[e.kind] ?? e.id),
    el("dd", { title: "probability" }, el("div", { class: "meter", "aria-hidden": "true" }, el("i", { vars: { width: `${100 * e.probability}%` } })), el("span", {}, `${Math.round(100 * e.probability)} %`))];
  return el("figure", { class: "probable" }, el("figcaption", {}, el("b", {}, "How probable each explanation is"), el("span", { class: "muted" }, PROBABLE)), el("dl", {}, listed.flatMap(row)));
}
function more(summary, children, id = summary) {
  if (!children.length) return "";
  return el("details", { open: open.has(id), ontoggle: (e) => { e.target.open ? open.add(id) : open.delete(id); } }, el("summary", {}, summary), children);
}
/** Whether there are test flights to judge the model on. */
const tested = (state) => state.flights.some((f) => f.role === "test" && !f.error);
/** Why an effect above chance is neither asserted nor refused: only the strongest suspect of each round is checked. */
function unchecked(diagnosis) {
  const found = diagnosis.effects.filter((e) => e.asserted).map((e) => e.id);
  return `Above chance, but not asserted: ${found.length ? `with ${found.join(" and ")} in the model, ` : ""}it was not the strongest suspect left, and only that one is checked.`;
}
const ticked = (bench, id) => bench.state.stack.some((s) => s.id === id);

function suspect(bench, e, most) {
  const stack = bench.state.stack;
  const on = ticked(bench, e.id);
  // only the effect that was accepted last can be removed
  const fixed = on && stack[stack.length - 1].id !== e.id;
  const box = el("input", { type: "checkbox", checked: on, disabled: fixed, "data-effect": e.id, title: fixed ? "Take back the effects accepted after it first" : "",
    onchange: () => bench.act(on ? { do: "undo" } : { do: "tick", effect: e.id }).then((done) => { if (!done) box.checked = on; }) });
  const above = e.evidence > e.threshold;
  const untold = above && !e.asserted && !e.refused.length && !on;
  const tag = e.asserted ? el("span", { class: "tag" }, "asserted") : above && e.refused.length ? el("span", { class: "tag bad" }, "refused") : untold ? el("span", { class: "tag" }, "not asserted") : null;
  const log = (v) => 100 * Math.log10(1 + Math.max(0, v)) / Math.log10(1 + most);
  const facts = [decisive(e)];
  if (e.heldout_error_reduction != null) facts.push(`explains ${percent(e.heldout_error_reduction)} of what tuning by equation error leaves there (squares, on segments not fitted)`);
  if (e.selected_in_bootstraps != null) facts.push(`best in ${percent(e.selected_in_bootstraps)} of bootstraps`);
  if (e.channels.length) facts.push(`acts in ${channel_words(e.channels)}`);
  return el("article", { class: `suspect ${e.asserted ? "asserted" : ""}` },
    el("label", {}, box, el("span", {}, e.id, " ", tag)),
    el("p", { class: "muted" }, e.description),
    // the numbers come before the curve, which a low window cuts off
    el("p", {}, `Evidence ${show(e.evidence)}; chance reaches ${show(e.threshold)}. `, facts.filter(Boolean).join("; "), "."),
    e.curve && above ? el("figure", {}, el("figcaption", {}, el("b", {}, `${e.curve.channel} (${e.curve.unit}) over ${e.curve.variable}`), el("span", { class: "muted" }, "dots: partial residuals (measured less all other terms of the fit with the effect); line: the effect")), el("div", { class: "plot", "data-curve": e.id })) : "",
    el("div", { class: "meter", role: "img", "aria-label": `evidence ${show(e.evidence)}, chance reaches ${show(e.threshold)}`, title: `evidence ${show(e.evidence)}; chance reaches ${show(e.threshold)} (log scale)` },
      el("i", { vars: { width: `${log(e.evidence)}%` } }), el("b", { vars: { left: `${log(e.threshold)}%` } })),
    ...e.refused.map((why) => el("p", { class: "bad" }, why)),
    untold && el("p", {}, unchecked(bench.diagnosis)),
    e.indistinguishable_from.length ? el("p", {}, "These flights cannot tell it from ", el("b", {}, e.indistinguishable_from.join(", ")), ".") : "",
    e.indistinguishable_from.length ? el("div", { class: "row" }, e.indistinguishable_from.map((other) => apart(bench, [e.id, other]))) : "",
    more("Do the flights agree?", agreement(e), `agree-${e.id}`));
}
/** Estimates of each coefficient by flight. The coefficient on which the flights differ most, in standard deviations, comes first. */
function agreement(e) {
  const alone = e.parameters.filter((p) => p.by_flight?.length > 1).sort((a, b) => spread(b) - spread(a));
  const one = (f) => el("li", {}, `${f.flight}: ${show(f.value)} ± ${show(1.96 * f.sd, 2)}`);
  const title = (p) => el("p", {}, el("b", {}, p.name), `${p.unit ? ` ${p.unit}` : ""}, 95 %`);
  return alone.flatMap((p) => [title(p), el("ul", {}, p.by_flight.map(one))]);
}
function spread(p) {
  const known = p.by_flight.filter((f) => f.value != null && f.sd > 0);
  if (known.length < 2) return 0;
  const weight = known.reduce((sum, f) => sum + f.sd ** -2, 0);
  const mean = known.reduce((sum, f) => sum + f.value * f.sd ** -2, 0) / weight;
  return Math.sqrt(known.reduce((sum, f) => sum + ((f.value - mean) / f.sd) ** 2, 0) / (known.length - 1));
}
/** Text on the coefficient with the narrowest 95 % interval relative to its value. */
function decisive(e) {
  const clear = (p) => Math.abs(p.value) / (p.ci95[1] - p.ci95[0] || Infinity);
  const p = [...e.parameters].sort((a, b) => clear(b) - clear(a))[0];
  return p && `${p.name} = ${show(p.value)} (95 %: ${show(p.ci95[0])} to ${show(p.ci95[1])})${p.unit ? ` ${p.unit}` : ""}`;
}
/** A button that starts the design of a schedule that distinguishes two effects. */
function apart(bench, between) {
  return el("button", { type: "button", "data-between": between.join(" "), onclick: () => bench.act({ do: "design", between }) }, `Make a schedule that tells it from ${between[1]}`);
}
function notes(bench, diagnosis) {
  const fly = diagnosis.advice.map((a) => el("p", {}, el("b", {}, a.manoeuvre), `: ${a.why} `, a.between && el("button", { type: "button", "data-between": a.between.join(" "), onclick: () => bench.act({ do: "design", between: a.between }) }, `Make a schedule between ${a.between.join(" and ")}`)));
  return el("div", {}, more("What to fly next", fly, "fly"), more("Notes", diagnosis.notes.map((n) => el("p", {}, n)), "notes"));
}

/** Draws, for each effect shown, the residual over a variable and the effect's contribution. */
function curves(body, diagnosis) {
  for (const holder of body.querySelectorAll("[data-curve]")) {
    curve(holder, diagnosis.effects.find((e) => e.id === holder.dataset.curve).curve);
  }
}
/** Draws the contribution of an effect with its interval, over the residual of the model without it. */
export function curve(holder, { x, residual, at, contribution }) {
  const order = x.map((_, i) => i).sort((a, b) => x[a] - x[b]);
  const band = (u) => {
    const { ctx } = u;
    const place = (k, i) => [u.valToPos(at[i], "x", true), u.valToPos(contribution[i][k], "y", true)];
    ctx.save();
    ctx.fillStyle = ink("band");
    ctx.beginPath();
    at.forEach((_, i) => ctx.lineTo(...place(1, i)));
    for (let i = at.length - 1; i >= 0; i--) ctx.lineTo(...place(2, i));
    ctx.fill();
    ctx.restore();
  };
  const data = uPlot.join([[order.map((i) => x[i]), order.map((i) => residual[i])], [at, contribution.map((c) => c[0])]]);
  draw(holder, {
    scales: { x: { time: false } }, cursor: { drag: { x: false, y: false } }, hooks: { drawSeries: [(u, k) => k === 1 && band(u)] },
    series: [{}, { stroke: () => ink("before"), paths: () => null, points: { show: true, size: 2.5, width: 0, fill: () => ink("before") } }, line("after", 2.5)],
  }, data);
}
