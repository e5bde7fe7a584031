// The pane of flights: for each log its format, its role, the purposes that it suffices for, and a small plot.

import { command, el, ink, show } from "./kit.js";

const ROLES = { fit: "Fit", hold_out: "Hold out", test: "Test", unused: "Unused" };
const STRIP = [["alpha", "before", "α"], ["airspeed", "measured", "V"], ["elevator", "after", "δe"]];

export function flights(bench) {
  const body = document.querySelector("#flights .body");
  const kept = new Set([...body.querySelectorAll("details[open]")].map((d) => d.dataset.key));
  const input = el("input", { type: "file", multiple: true, onchange: () => bench.upload([...input.files]) });
  const drop = el("label", { class: "drop" }, "Drop flight logs here, or choose files", input,
    el("br"), el("span", { class: "note" }, "CSV, ULog, DataFlash .bin, .tlog, .mcap"));
  const left = bench.reading > 0 && el("p", { class: "note", role: "status" }, `${bench.reading} more ${bench.reading === 1 ? "is" : "are"} being read …`);
  const list = bench.state.flights.map((flight, place) => one(bench, flight, place, kept));
  body.replaceChildren(drop, ...list, ...[left].filter(Boolean), ...[command(bench.state.commands.flights)].filter(Boolean));
  for (const canvas of body.querySelectorAll("canvas")) strip(canvas, bench.state.flights[+canvas.dataset.flight], bench.lit.get(+canvas.dataset.flight) ?? []);
}

function one(bench, flight, place, kept) {
  const name = el("button", {
    type: "button", class: "name", disabled: flight.locked || !!flight.error, title: flight.path, onclick: () => { bench.by_hand = true; bench.choose(place); },
  }, flight.name);
  const remove = el("button", { type: "button", class: "quiet", title: "Take out of the session; the file stays", onclick: () => bench.act({ do: "remove", flight: place }) }, "Remove");
  const roles = el("fieldset", { class: "roles", "aria-label": `role of ${flight.name}` }, Object.entries(ROLES).map(([role, word]) => {
    const radio = el("input", { type: "radio", name: `role-${place}`, value: role, checked: flight.role === role, onchange: () => bench.act({ do: "role", flight: place, role }) });
    return el("label", {}, radio, word);
  }));
  const current = place === bench.chosen && !flight.locked && !flight.error;
  const node = el("article", { class: "flight", "aria-current": current ? "true" : "false" }, el("div", { class: "head" }, name, remove));
  if (flight.error) {
    node.append(el("p", { class: "bad note" }, flight.error));
    return node;
  }
  node.append(el("p", { class: "note" }, `${flight.format} · ${show(flight.rate_hz)} Hz · ${show(flight.flight_s)} s in flight`));
  node.append(flight.locked
    ? el("div", { class: "locked" }, "unseen until Judge")
    : el("canvas", { "data-flight": place, role: "img", "aria-label": "angle of attack (°), airspeed (m/s) and elevator (°) over time", title: "angle of attack α (°), airspeed V (m/s), elevator δe (°) over time" }));
  node.append(roles, ...about(bench, flight, place, kept));
  return node;
}

/** Findings about the log, the purposes that it suffices for, and the estimated sensor errors. */
function about(bench, flight, place, kept) {
  const details = (key, summary, lines, open) => {
    const id = `${flight.path}-${key}`;
    return lines.length ? el("details", { open: open || kept.has(id), "data-key": id }, el("summary", {}, summary), el("ul", {}, lines.map((l) => el("li", { class: l.class }, l.text, l.fix)))) : null;
  };
  const findings = flight.findings.map((f) => ({
    text: f.text, class: f.severity === "problem" ? "bad" : "",
    // a correction with a constant is made by hand, in a mapping file
    fix: f.cure && !f.cure.offset && !f.cure.exchanged_with && el("button", { type: "button", onclick: () => bench.act({ do: "map", flight: place, column: f.cure.column, scale: f.cure.scale }) }, `Read ${f.cure.column} × ${f.cure.scale}`),
  }));
  const serious = flight.findings.filter((f) => f.severity === "problem").length;
  const lacking = flight.purposes.filter((p) => p.missing.length).map((p) => ({ text: `${p.name}: lacks ${p.missing.join(", ")}`, class: "bad" }));
  const serves = flight.purposes.filter((p) => !p.missing.length).map((p) => ({ text: p.name + (p.instead.length ? ` (with ${p.instead.join(", ")})` : "") }));
  const sensors = flight.nuisances.map((n) => ({ text: `${n.name.replaceAll("_", " ")} ${show(n.value, 2)} ± ${show(1.96 * n.sd, 2)} ${n.unit}` }));
  const phases = flight.phases.map((p) => ({ text: `${p.kind} ${show(p.from_s)} to ${show(p.to_s)} s` }));
  return [
    details("findings", serious ? `${serious} problem${serious > 1 ? "s" : ""}` : `${findings.length} remark${findings.length > 1 ? "s" : ""}`, findings, serious > 0),
    details("serves", lacking.length ? `Serves for ${serves.length} of ${flight.purposes.length}` : "Serves for everything", [...lacking, ...serves, ...phases]),
    flight.locked ? null : details("sensors", "Sensor errors and wind (95 %)", sensors),
  ].filter(Boolean);
}

function strip(canvas, { strip: values, from_s, to_s }, lit) {
  const { width, height } = canvas.getBoundingClientRect();
  if (!values || !width) return;
  const ratio = devicePixelRatio;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const ctx = canvas.getContext("2d");
  ctx.scale(ratio, ratio);
  const across = (t) => 14 + ((width - 15) * (t - from_s)) / (to_s - from_s || 1);
  ctx.fillStyle = ink("lit");
  for (const [from, to] of lit) ctx.fillRect(across(from), 0, Math.max(1, across(to) - across(from)), height);
  const each = height / STRIP.length;
  STRIP.forEach(([name, tone, sign], k) => {
    const list = values[name];
    const [low, high] = [Math.min(...list), Math.max(...list)];
    ctx.strokeStyle = ink(tone);
    ctx.lineWidth = 1;
    ctx.beginPath();
    list.forEach((v, i) => ctx.lineTo(14 + (width - 15) * i / (list.length - 1), each * (k + 0.9) - (0.8 * each * (v - low)) / (high - low || 1)));
    ctx.stroke();
    ctx.fillStyle = ink("muted");
    ctx.font = `10px ${ink("sans")}`;
    ctx.fillText(sign, 0, each * (k + 0.75));
  });
}
