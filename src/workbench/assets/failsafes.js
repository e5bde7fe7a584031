// Page of failsafes. Each change of the form flies the scenario at once. Fields that do not apply are hidden.

const root = document.documentElement;
const dark = matchMedia("(prefers-color-scheme: dark)");
const wear = (theme) => { root.dataset.theme = theme; };
wear(dark.matches ? "dark" : "light");
dark.addEventListener("change", () => wear(dark.matches ? "dark" : "light"));
document.getElementById("theme").addEventListener("click", () => wear(root.dataset.theme === "dark" ? "light" : "dark"));

const form = document.getElementById("choices");
const flown = document.getElementById("flown");
const field = (name) => form.elements[name];

/** Shows or hides a field with its label. A hidden field is not sent. */
function offer(name, there) {
  const place = form.querySelector(`[data-field="${name}"]`);
  if (place) place.hidden = place.disabled = !there;
  else {
    field(name).closest("label").hidden = !there;
    field(name).disabled = !there;
  }
}
function suit() {
  const counterpart = field("counterpart").value;
  const fault = field("fault").selectedOptions[0];
  document.getElementById("fault-note").textContent = fault.dataset.note ?? "";
  offer("radio", counterpart.startsWith("ardupilot"));
  offer("from_s", fault.value !== "none");
  offer("for_s", "length" in fault.dataset);
  offer("strength", "strength" in fault.dataset);
  offer("at_s", field("request").value !== "none");
  const station = [...field("request").options].find((o) => o.value === "take-over");
  station.disabled = counterpart === "sitl";
  if (station.disabled && station.selected) field("request").value = "none";
}

/** Marks the example that is flown. */
function name_example() {
  for (const a of document.querySelectorAll(".examples a")) {
    if (a.href === location.href || (!location.search && a.search === "")) a.setAttribute("aria-current", "true");
    else a.removeAttribute("aria-current");
  }
}

/** Adds buttons that copy the command and the scenario file. */
function copies() {
  for (const id of ["command", "scenario"]) {
    const text = document.getElementById(id);
    if (!text) continue;
    const copy = document.createElement("button");
    copy.type = "button";
    copy.textContent = id === "command" ? "Copy the command" : "Copy the scenario";
    copy.addEventListener("click", async () => {
      await navigator.clipboard?.writeText(text.textContent);
      copy.textContent = "Copied";
    });
    text.after(copy);
  }
}

let asked = null;
/** Requests the page at `address` and takes the result of the flight from it. */
async function fly(address, { push, take_choices }) {
  asked?.abort();
  const own = (asked = new AbortController());
  flown.setAttribute("aria-busy", "true");
  try {
    const answer = await fetch(address, { signal: own.signal });
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    const shown = page.getElementById("flown");
    if (!shown) throw new Error(`the workbench answered ${answer.status}: open the address that it printed`);
    flown.querySelector(".body").replaceChildren(...shown.querySelector(".body").childNodes);
    if (push) history.pushState(null, "", address);
    if (take_choices) form.replaceChildren(...page.getElementById("choices").childNodes);
    const wrong = document.getElementById("wrong")?.dataset.field;
    for (const input of form.querySelectorAll("input, select")) {
      if (input.name && input.name === wrong) input.setAttribute("aria-invalid", "true");
      else input.removeAttribute("aria-invalid");
    }
    suit();
    copies();
    name_example();
    // a screen reader reads only the verdict, not the page
    document.getElementById("heard").textContent = flown.querySelector(".verdict")?.textContent ?? "";
    root.dataset.flown = address;
  } catch (error) {
    if (error.name === "AbortError") return;
    const said = document.createElement("p");
    said.className = "bad";
    said.setAttribute("role", "alert");
    said.textContent = error instanceof TypeError ? "the workbench does not answer: has the program ended? Start it again" : error.message;
    flown.querySelector(".body").replaceChildren(said);
  }
  if (own === asked) flown.removeAttribute("aria-busy");
}
const address = () => `/failsafes?${new URLSearchParams(new FormData(form))}`;

form.addEventListener("change", () => {
  suit();
  fly(address(), { push: true });
});
form.addEventListener("submit", (event) => {
  event.preventDefault();
  fly(address(), { push: true }).then(() => {
    // on a narrow page the result is below the form
    if (flown.getBoundingClientRect().top > innerHeight / 2) flown.scrollIntoView({ block: "start" });
  });
});
document.querySelector(".examples").addEventListener("click", (event) => {
  const link = event.target.closest("a");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  fly(link.href, { push: true, take_choices: true });
});
addEventListener("popstate", () => fly(location.href, { take_choices: true }));

suit();
copies();
name_example();
root.dataset.ready = "yes";
