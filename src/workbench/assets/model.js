// The model pane: the accepted effects, the error after each of them, and buttons to judge, undo and save.

import { ahead, command, el, horizon, joined, judged, percent, show, steps, verdicts } from "./kit.js";

export function model(bench) {
  const body = document.querySelector("#model .body");
  const { state } = bench;
  const { stack, model: about } = state;
  const outside = about.changed_outside && el("div", { class: "step" }, el("p", { class: "bad" }, `${about.path} changed on disk since it was read: what is shown is not about it.`),
    el("div", { class: "row" }, el("button", { type: "button", class: "main", onclick: () => bench.act({ do: "reload_model" }) }, "Reload the model")));
  const base = el("p", { class: "note" }, el("b", {}, about.name), `, ${about.path}`);
  const tests = state.flights.filter((f) => f.role === "test" && !f.error);
  const current = key(state);
  if (saved.key !== current) saved = { key: current, note: null };
  const unfitted = stack.some((s) => s.status === "unfitted" || s.status === "failed");
  const buttons = el("div", { class: "row" },
    el("button", { type: "button", disabled: !stack.length, onclick: () => bench.act({ do: "undo" }) }, "Undo"),
    el("button", { type: "button", disabled: !state.redo, onclick: () => bench.act({ do: "redo" }) }, state.redo ? `Redo ${state.redo}` : "Redo"),
    unfitted && el("button", { type: "button", class: "main", onclick: () => bench.act({ do: "fit" }) }, "Fit"),
    el("button", { type: "button", id: "judge", disabled: !tests.length || !stack.length || unfitted || state.jobs.length > 0, title: stack.length ? "Opens the test flights; each opening is counted and recorded" : "Accept an effect first: each opening of the test flights is counted and recorded", onclick: () => bench.act({ do: "judge" }) }, "Judge"),
    el("button", { type: "button", id: "save", class: stack.length && !unfitted ? "main" : "", disabled: !stack.length || unfitted || state.jobs.length > 0, onclick: () => save(bench) }, "Save"),
    el("button", { type: "button", id: "fly-it", onclick: () => bench.show("fly") }, "Fly it"));
  body.replaceChildren(...[outside, base, box(state), errors(state), ...stack.map((s) => step(bench, s)), next(state) ?? (!stack.length && el("p", { class: "empty" }, nothing(bench.diagnosis))),
    then(state, tests), buttons, saved.note, opened(state), command(state.commands.amend, "Model and Save"), command(state.commands.judge, "Judge")].filter(Boolean));
}

/** Text in place of the accepted effects. */
function nothing(diagnosis) {
  return diagnosis && !diagnosis.effects.some((e) => e.asserted) ? "No suspect is strong enough to accept." : "No effect is accepted yet: tick a suspect to see by how much the error falls.";
}

/** By how much the error falls with the next asserted effect, before the user accepts it; null if the diagnosis asserts no further effect,
 *  or if the fit with it is neither made nor running. */
function next(state) {
  const { id, status, story } = state.ahead ?? {};
  if (status === "fitting") return el("p", { class: "empty", id: "ahead" }, `By how much the error falls with ${id} is being computed …`);
  if (status !== "fitted") return null;
  if (!ahead(state)) {
    const why = story.effects.find((e) => e.id === id)?.refused ?? [];
    return el("p", { class: "empty", id: "ahead" }, `The fit refuses ${id} (not yet added): ${why.join("; ")}.`);
  }
  const all = steps(state);
  const [[, from], [, to]] = all.slice(-2);
  const fall = (a, b) => `${show(a)} → ${show(b)} (${percent(b / a - 1)})`;
  const tuning = all.length === 3 && `tuning alone ${fall(all[0][1], all[1][1])}; `;
  return el("p", { id: "ahead" }, `Error${horizon(story.after)} held out: ${tuning || ""}with ${id} (not yet added) ${fall(from, to)}. Tick it to add it.`);
}

/** The next step with a fitted model: what Judge and Save do. Null before the fit, if the fit refuses an effect, and after Save. */
function then(state, tests) {
  const ids = joined(verdicts(state));
  if (!ids.length || saved.note || state.jobs.length || state.stack.some((s) => !s.story || !ids.includes(s.id))) return null;
  const last = state.openings.filter((o) => o.occasion === "judged").pop();
  const judge = tests.length > 0 && last?.effects.join() !== ids.join();
  return el("p", { id: "then" }, `Next: ${judge ? "Judge measures the error on the test flights, which no fit has used; then " : ""}Save writes the model to a file.`);
}

/** The answer in the words of the command `amend`. */
function box(state) {
  const told = verdicts(state)?.answer;
  return told && el("div", { class: "verdict effect", id: "box" }, [told.error, told.effect, told.acts, told.left].filter(Boolean).map((line) => el("p", {}, line)));
}

/** Identity of the saved model. It changes with the accepted effects and with the given model. */
const key = (state) => JSON.stringify([state.model, state.diagnosis.key, state.stack.map((s) => [s.id, s.anyway, s.status])]);
let saved = { key: null, note: null };
async function save(bench) {
  saved.note = null;
  if (await bench.act({ do: "save" })) {
    saved.note = el("p", { class: "good", id: "saved" }, `Saved ${bench.state.folder}/model/model.toml, the same file as the command writes.`);
    model(bench);
  }
}

/** Table of the NRMSE on fit, held-out and test flights: as given, tuned, and after each effect. */
function errors(state) {
  const rows = [];
  const fitted = state.stack.filter((s) => s.story);
  if (fitted.length) {
    const { story, on_fit } = fitted[0];
    rows.push(["as given", "given", judged(on_fit.given), judged(story.given)], ["tuned", "tuned", null, judged(story.before)]);
  }
  const story = verdicts(state);
  const refused = (id) => (story?.effects.find((e) => e.id === id)?.joined === false ? ", refused" : "");
  for (const s of state.stack) {
    if (s.story) rows.push([`+ ${s.id}${refused(s.id)}`, "amended", judged(s.on_fit.amended), judged(s.story.after)]);
    else if (s.estimated) rows.push([`+ ${s.id}, equation error`, "estimated", null, judged(s.estimated)]);
  }
  if (!rows.length) return null;
  const last = state.openings.filter((o) => o.occasion === "judged").pop();
  // the last row is the amended model if its fit is complete
  const about = last && state.stack.every((s) => s.story) && last.effects.join() === joined(story).join();
  const test = (k) => (last && k === 0 ? last.given : about && k === rows.length - 1 ? last.amended : null);
  const all = rows.map((r, k) => [...r, test(k)]);
  const most = Math.max(...all.flatMap((r) => r.slice(2)).filter((v) => v != null));
  const bar = (tone, v) => el("td", {}, v != null && el("div", { class: `bars ${tone}` }, el("span", {}, show(v)), el("i", { vars: { width: `${100 * v / most}%` } })));
  const head = [`Error (NRMSE)${horizon(story?.after ?? state.stack.find((s) => s.estimated)?.estimated)}`, "Fit", "Held out", last && "Test"].filter(Boolean);
  return el("table", { class: "errors" }, el("thead", {}, el("tr", {}, head.map((h) => el("th", { scope: "col" }, h)))),
    el("tbody", {}, all.map(([name, tone, ...values]) => el("tr", {}, el("th", { scope: "row" }, name), values.slice(0, head.length - 1).map((v) => bar(tone, v))))));
}

function step(bench, s) {
  const story = s.story && verdicts(bench.state);
  const own = story?.effects.find((e) => e.id === s.id);
  const refused = own?.refused ?? [];
  const last = bench.state.stack[bench.state.stack.length - 1].id === s.id;
  const values = (story?.parameters ?? []).filter((p) => p.added && p.name.startsWith(`${s.id}.`));
  const tag = { fitting: "fitting …", failed: "failed", unfitted: "not fitted" }[s.status];
  return el("article", { class: "step" }, el("h3", {}, s.id, " ", tag && el("span", { class: "tag" }, tag), refused.length > 0 && el("span", { class: "tag bad" }, own.joined ? "kept though refused" : "refused, not in the model")),
    ...values.map((p) => el("p", { class: "note" }, `${p.name.split(".")[1]} = ${show(p.value, 4)} (95 %: ${show(p.ci95[0])} to ${show(p.ci95[1])})`)),
    s.error && el("p", { class: "bad note" }, s.error), ...refused.map((why) => el("p", { class: "bad note" }, why)),
    refused.length > 0 && !own.joined && last && el("div", { class: "row" }, el("button", { type: "button", onclick: () => bench.act({ do: "keep" }) }, "Keep it anyway"), el("button", { type: "button", onclick: () => bench.act({ do: "undo" }) }, "Take it back")));
}

/** Records of the openings of the test flights. */
function opened(state) {
  const count = state.openings.length;
  const tests = state.flights.filter((f) => f.role === "test");
  if (!count) return tests.length ? el("p", { class: "note" }, `Judge opens ${tests.map((f) => f.name).join(", ")}. Each opening is counted and recorded.`) : null;
  const found = (o) => (o.occasion === "judged" ? `${o.effects.join(" + ") || "no effect"}: NRMSE at ${show(o.horizon_s)} s ${show(o.given)} → ${show(o.amended)}` : `${o.flights.join(", ")} took another role`);
  const list = state.openings.map((o) => el("li", {}, `${new Date(1000 * o.unix_s).toISOString().slice(0, 16).replace("T", " ")} UTC, ${found(o)}`));
  return el("div", { id: "opened" }, el("p", {}, `The test flights were opened ${count === 1 ? "once" : `${count} times`}.`), el("ul", { class: "note" }, list));
}
