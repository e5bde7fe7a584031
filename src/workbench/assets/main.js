// The workbench page: a session in several panes, which show the state of the program.

import { ahead, complain, el, get, horizon, hush, percent, post, redraw, send, show, steps, verdicts } from "./kit.js";
import { flights } from "./flights.js";
import { failing, follow, freshFailing, repaint } from "./failing.js";
import { fly, offer, part } from "./fly.js";
import { suspects } from "./suspects.js";
import { text } from "./text.js";
import { model } from "./model.js";

const root = document.documentElement;
const dark = matchMedia("(prefers-color-scheme: dark)");
/** Sets the theme and redraws everything in its colours. */
function wear(theme) {
  root.dataset.theme = theme;
  redraw();
  if (bench.state) flights(bench);
  repaint();
}

/** State and functions that the panes share. */
const bench = {
  state: null, failing: null, diagnosis: null, proposal: null, waited_for: null, show: show_middle, flight: null, chosen: 0, chosen_path: null, data: new Map(), lit: new Map(), act, upload, choose, light, choose_lit, by_hand: false,
};

root.dataset.theme = dark.matches ? "dark" : "light";
dark.addEventListener("change", () => wear(dark.matches ? "dark" : "light"));
document.getElementById("theme").addEventListener("click", () => wear(root.dataset.theme === "dark" ? "light" : "dark"));

let fresh = 0;
/** Requests the state and the results again and shows them. Late answers to an older request are ignored. */
async function refresh(state) {
  const own = ++fresh;
  try {
    bench.state = state ?? (await get("/api/state"));
    if (own !== fresh) return;
    show_all();
    const usable = bench.state.flights.some((f) => !f.error && (f.role === "fit" || f.role === "hold_out"));
    const [failing_now, diagnosis, proposal] = await Promise.all([
      usable ? get("/api/failing") : null,
      bench.state.diagnosis.there ? get("/api/diagnosis") : null,
      bench.state.proposal.there ? get("/api/proposal") : null,
    ]);
    if (own !== fresh) return;
    Object.assign(bench, { failing: failing_now, diagnosis, proposal });
    show_all();
    await load_flight(own);
    root.dataset.ready = "yes";
  } catch (error) {
    if (own === fresh) complain(error.message);
  }
}
async function load_flight(own = fresh) {
  const all = bench.state.flights;
  const open = (f) => f && !f.error && !f.locked;
  // the flight is found by its path, because indices shift when a flight is removed
  bench.chosen = all.findIndex((f) => f.path === bench.chosen_path);
  if (!open(all[bench.chosen])) bench.chosen = Math.max(0, all.findIndex(open));
  bench.chosen_path = all[bench.chosen]?.path ?? null;
  bench.data.clear();
  bench.flight = open(all[bench.chosen]) ? await data(bench.chosen) : null;
  if (own !== fresh) return;
  freshFailing(bench);
  // the other flights are loaded afterwards, because the chosen cell highlights times in them too
  for (const place of all.keys()) if (open(all[place]) && own === fresh) await data(place);
  if (own !== fresh) return;
  light();
  const key = bench.diagnosis && bench.state.diagnosis.key;
  const fresh_diagnosis = !!key && key !== bench.diagnosed;
  bench.diagnosed = key ?? bench.diagnosed;
  if (!bench.by_hand && bench.flight) choose_lit(fresh_diagnosis);
}
/** Data of a flight over time; requested only once. */
async function data(place) {
  if (!bench.data.has(place)) bench.data.set(place, await get(`/api/flight/${place}`));
  return bench.data.get(place);
}
let lights = () => [];
/** Highlights the times of the chosen cell in all flights. */
function light(by = lights) {
  lights = by;
  bench.lit = new Map([...bench.data].map(([place, flight]) => [place, lights(flight)]));
  flights(bench);
}
const seconds = (spans) => (spans ?? []).reduce((sum, [from, to]) => sum + to - from, 0);
/** If the chosen flight has no highlighted time, or `always`, chooses the flight with most of it. Returns whether it did. */
function choose_lit(always = false) {
  if (!always && seconds(bench.lit.get(bench.chosen)) > 0) return false;
  const [place] = [...bench.lit].sort((a, b) => seconds(b[1]) - seconds(a[1]))[0] ?? [];
  if (place == null || place === bench.chosen || !seconds(bench.lit.get(place))) return false;
  choose(place);
  return true;
}
function show_all() {
  document.querySelector("main").classList.toggle("diagnosed", !!bench.diagnosis);
  document.getElementById("to-failsafes").hidden = !bench.state.fly.possible;
  answer();
  job();
  flights(bench);
  failing(bench);
  suspects(bench);
  text(bench);
  fly(bench);
  model(bench);
}
/** Shows one of the two middle panes if there is room for only one. Also selects `schedule` for a flight. */
function show_middle(pane, schedule) {
  document.querySelector(".middle").dataset.shown = pane;
  for (const name of ["failing", "fly"]) document.getElementById(`show-${name}`).setAttribute("aria-pressed", name === pane ? "true" : "false");
  document.getElementById(pane).scrollIntoView({ block: "nearest" });
  if (pane === "failing") repaint();
  if (schedule) offer(schedule);
}
for (const name of ["failing", "fly"]) document.getElementById(`show-${name}`).addEventListener("click", () => show_middle(name));

/** Shows the session's answer in one line: the error before and after the effects, the next asserted one included. */
function answer() {
  const { state } = bench;
  const place = document.getElementById("answer");
  const story = verdicts(state) ?? ahead(state);
  const name = el("b", {}, state.model.name);
  if (!story) return place.replaceChildren(name);
  // the reductions of the error by tuning and by the effects are shown separately
  const all = steps(state);
  const parts = all.flatMap(([word, error], k) => {
    const before = k && all[k - 1][1];
    const fall = before && error != null ? `, ${percent(error / before - 1)}` : "";
    return [k ? " → " : "", el("b", {}, show(error)), ` (${word}${fall})`];
  });
  place.replaceChildren(name, `: error${horizon(story.after)} held out `, ...parts);
}
function job() {
  const place = document.getElementById("job");
  const jobs = bench.state.jobs;
  if (!jobs.length) return place.replaceChildren();
  place.replaceChildren(...jobs.map((now) => el("div", { class: "one" },
    el("span", {}, now.doing), el("progress", { max: 1, value: now.fraction, "aria-label": WORK[now.work] }),
    el("button", { type: "button", "aria-label": `Cancel the ${WORK[now.work]}`, onclick: () => act({ do: "cancel", job: now.id }) }, "Cancel"))));
}
const WORK = { diagnosis: "diagnosis", fit: "fit", proposal: "search for a formula", schedule: "search for a schedule" };

/** Requests a change of the session and shows the new state or the error. Returns whether it succeeded. */
async function act(what) {
  hush();
  if (what.do === "propose") bench.waited_for = "proposal";
  // the large plot changes to the channel in which the effect acts
  if (what.do === "tick") follow(bench.diagnosis?.effects.find((e) => e.id === what.effect));
  try {
    await refresh(await post("/api/act", { revision: bench.state.revision, act: what }));
    return true;
  } catch (error) {
    if (error.status === 409) await refresh();
    complain(error.message);
    return false;
  }
}
async function take(file) {
  const query = new URLSearchParams({ name: file.name, revision: bench.state.revision });
  bench.state = await send(`/api/logs?${query}`, file);
}
async function upload(files) {
  hush();
  const said = [];
  for (const [k, file] of files.entries()) {
    bench.reading = files.length - k;
    flights(bench);
    try {
      await take(file).catch(async (error) => {
        // the session has changed meanwhile, for example because a flight ended; the upload is still valid
        if (error.status !== 409) throw error;
        bench.state = await get("/api/state");
        await take(file);
      });
      flights(bench);
    } catch (error) {
      said.push(error.message);
    }
  }
  bench.reading = 0;
  await refresh();
  if (said.length) complain(said.join("; "));
}
async function choose(place) {
  bench.chosen = place;
  bench.chosen_path = bench.state.flights[place]?.path ?? null;
  flights(bench);
  try {
    bench.flight = await data(place);
    freshFailing(bench);
  } catch (error) {
    complain(error.message);
  }
}

// ---- events of the server and dropped files ----

let later = 0;
const events = new EventSource("/api/events");
events.addEventListener("message", (message) => {
  const news = JSON.parse(message.data);
  if (news.event === "progress" && bench.state) {
    const known = bench.state.jobs.findIndex((j) => j.id === news.job.id);
    if (known < 0) return;
    const first = news.job.ranking.length !== bench.state.jobs[known].ranking.length;
    bench.state.jobs[known] = news.job;
    job();
    if (first) suspects(bench);
  } else if (news.event === "flight") {
    part(news.part);
  } else if (news.event === "changed") {
    clearTimeout(later);
    later = setTimeout(() => refresh(), 30);
  }
});

// files may be dropped anywhere on the page
addEventListener("dragover", (event) => { event.preventDefault(); document.querySelector(".drop")?.classList.add("over"); });
addEventListener("dragleave", () => document.querySelector(".drop")?.classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  document.querySelector(".drop")?.classList.remove("over");
  if (event.dataTransfer.files.length) upload([...event.dataTransfer.files]);
});
refresh();
