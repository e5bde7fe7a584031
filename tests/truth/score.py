"""Puts cases of make_cases.py to `greylag diagnose` and counts what it finds.

    python tests/truth/score.py --greylag target/release/greylag --cases cases --jobs 2 --jsonl results.jsonl
    python tests/truth/score.py --table results/second-truth.jsonl
"""

import json
import math
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import installed
import scoring
from hidden import PARAMETERS


@cache
def build_of(greylag):
    """Version and commit of the program; records hold no path of a machine."""
    return subprocess.run([greylag, "--version"], capture_output=True, text=True, check=True).stdout.strip()


def diagnose(greylag, case, nulls, without=False):
    """What greylag says of a case, as one record beside the truth; `without`: the hidden effect is taken out of the catalogue."""
    truth = json.loads((case / "truth.json").read_text())
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "diagnosis.json"
        command = [greylag, "diagnose", "--model", case / "model.toml", "--json", out]
        command += ["--log", *sorted(case.glob("train-*.csv"))]
        if nulls is not None:
            command += ["--nulls", nulls]
        if without and truth["hidden"]:
            command += ["--without", truth["hidden"]]
        done = subprocess.run([str(x) for x in command], capture_output=True, text=True)
        said = json.loads(out.read_text()) if out.exists() else None
    record = {"greylag": build_of(str(greylag)), "folder": f"{case.parent.name}/{case.name}"}
    record |= {"case": truth["case"], "truth": truth["truth"], "seed": truth["seed"], "hidden": truth["hidden"]}
    record.update(amount=truth["amount"], sensors=truth["sensors"], exit=done.returncode)
    record |= {k: truth[k] for k in ("strength",) if k in truth} | ({"without": truth["hidden"]} if without else {})
    if "installed" in truth:
        record["installed"] = truth["installed"]
    if said is None:
        return {**record, "verdict": "failed", "why": done.stderr[-600:], "asserted": [], "ranked": []}
    return {**record, **digest(said)}


def digest(said):
    """The part of a diagnosis that is kept."""
    effects = said["effects"]
    asserted = [e for e in effects if e["asserted"]]
    return {
        "verdict": said["verdict"],
        "asserted": [e["id"] for e in asserted],
        "values": {e["id"]: {p["name"]: [p["value"], *p["ci95"]] for p in e["parameters"]} for e in asserted},
        "ranked": [e["id"] for e in effects[:5]],
        "evidence": [[e["evidence"], e["threshold"]] for e in effects[:5]],
        "judged": [{"status": e["status"], "stable": e["selected_in_bootstraps"], "held_out": e["heldout_error_reduction"]} for e in effects[:5]],
        "least": {e["id"]: e["minimum_detectable"] for e in effects if e["minimum_detectable"]},
        "explanations": {e["id"]: e["probability"] for e in said.get("explanations", [])},
        "alike": {e["id"]: e["indistinguishable_from"] for e in effects[:5] if e["indistinguishable_from"]},
        "measured": sorted({m["id"] for m in said["measurement"] if m["asserted"]}),
        "errors": sorted({m["id"] for m in said["measurement"] if m["asserted"] and of_installation(m)}),
        "first": said["sentences"][0] if said["sentences"] else "",
        "free_runs": [[s["way"], s["error"]] for s in said["answer"]["numbers"]["steps"]],
        "remainder": said.get("learnable_remainder"),
        "version": said.get("version"),
        "settings": said.get("settings"),
    }


def of_installation(m):
    """Whether a constant of a flight is an error of installation: of delays those beyond two samples."""
    return m["id"] in installed.NAMED.values() and (m["id"] != "clock_skew" or abs(m["value"]) > installed.LATE)


def line(r):
    """One line a case."""
    first = r["ranked"][0] if r["ranked"] else "-"
    evidence = "{:.1f} / {:.1f}".format(*r["evidence"][0]) if r.get("evidence") else r.get("why", "")
    return f"{r['case']:42} {r['hidden'] or 'none':24} first {first:24} asserted {','.join(r['asserted']) or '-':36} {r['verdict']:12} {evidence}"


def erring(r):
    """What greylag calls the errors of installation of a case, those without a name left out."""
    names = (installed.name_of(kind, error) for kind, error in (r.get("installed") or {}).items())
    return {name for name in names if name}


def wrong(r):
    """Ids asserted that the aircraft does not lack and that are no error of its servos."""
    return [x for x in r["asserted"] if x != r["hidden"] and x not in erring(r)]


def told(r):
    """Whether every error of installation that has a name is named."""
    return erring(r) <= {*r["errors"], *r["asserted"]}


def ranked_first(r):
    """Whether the hidden effect is the best of what is ranked, but for errors of its servos."""
    others = [x for x in r["ranked"] if x == r["hidden"] or x not in erring(r)]
    return others[:1] == [r["hidden"]]


def both_named(r):
    """Whether the hidden effect is asserted and every error beside it named."""
    return told(r) and r["hidden"] in r["asserted"]


def table(records):
    """The counts by truth, as Markdown."""
    rows = [
        "| truth | rate, Hz | effects | true effect ranked first | true effect asserted | cases with a false assertion | cases without a hidden effect | false alarms in them | model judged adequate in them | failed |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for kind, rate in sorted({(r["truth"], r["sensors"]["rate"]) for r in records}):
        of = [r for r in records if (r["truth"], r["sensors"]["rate"]) == (kind, rate)]
        effects, nulls = [r for r in of if r["hidden"]], [r for r in of if not r["hidden"]]
        counts = (
            len(effects),
            sum(r["ranked"][:1] == [r["hidden"]] for r in effects),
            sum(r["hidden"] in r["asserted"] for r in effects),
            sum(bool(wrong(r)) for r in effects),
            len(nulls),
            sum(bool(r["asserted"]) for r in nulls),
            sum(r["verdict"] == "adequate" for r in nulls),
            sum(r["verdict"] == "failed" for r in of),
        )
        rows.append(f"| {kind} | {rate:g} | " + " | ".join(map(str, counts)) + " |")
    return "\n".join(rows)


def of(some, all_of):
    """A count with its share and interval."""
    n = len(all_of)
    if not n:
        return "-"
    low, high = wilson(len(some), n)
    return f"{len(some)} of {n} ({100 * len(some) / n:.0f} %, {100 * max(low, 0.0):.0f} to {100 * high:.0f})"


def wrongly_installed(records):
    """What is said of cases with errors of installation, as Markdown."""
    rows = [
        "| truth | errors at once | no effect: an effect asserted | no effect: something is missing | error named | effect and error: both named | effect ranked first | something wrong asserted |",
        "|---|---|---|---|---|---|---|---|",
    ]
    own = [r for r in records if r.get("installed")]
    for kind, count in sorted({(r["truth"], len(r["installed"])) for r in own}):
        some = [r for r in own if (r["truth"], len(r["installed"])) == (kind, count)]
        nulls, effects = [r for r in some if not r["hidden"]], [r for r in some if r["hidden"]]
        nameable = [r for r in some if erring(r)]
        both = [r for r in nameable if r["hidden"]]
        cells = (
            of([r for r in nulls if wrong(r)], nulls),
            of([r for r in nulls if wrong(r) or r["verdict"] == "unexplained"], nulls),
            of([r for r in nameable if told(r)], nameable),
            of([r for r in both if both_named(r)], both),
            of([r for r in effects if ranked_first(r)], effects),
            of([r for r in effects if wrong(r)], effects),
        )
        rows.append(f"| {kind} | {count} | " + " | ".join(cells) + " |")
    return "\n".join([*rows, "", *by_error(own)]) if own else ""


def by_error(own):
    """What is said of cases with one error of installation, a row an error."""
    rows = ["| error | cases | named | an effect asserted wrongly | verdicts without an effect | effect beside it ranked first | both named |", "|---|---|---|---|---|---|---|"]
    for kind in installed.KINDS:
        some = [r for r in own if list(r["installed"]) == [kind]]
        verdicts = [r["verdict"] for r in some if not r["hidden"]]
        counts = ", ".join(f"{v} {verdicts.count(v)}" for v in sorted(set(verdicts)))
        effects, has_name = [r for r in some if r["hidden"]], any(erring(r) for r in some)
        cells = (
            str(sum(told(r) for r in some)) if has_name else "no name" if some else "-",
            str(sum(bool(wrong(r)) for r in some)),
            counts or "-",
            f"{sum(ranked_first(r) for r in effects)} of {len(effects)}",
            f"{sum(both_named(r) for r in effects)} of {len(effects)}" if has_name else "-",
        )
        rows.append(f"| {kind} | {len(some)} | " + " | ".join(cells) + " |")
    return rows


def tables(records):
    """All tables of the records: of sensors as they should be, and of wrong ones."""
    records = [r for r in records if "without" not in r]  # those are for probabilities.py
    clean = [r for r in records if not r.get("installed")]
    parts = [table(clean), coverage(clean)] if clean else []
    return "\n\n".join([*parts, wrongly_installed(records)]).strip()


def intervals(records):
    """Every parameter of an effect that was asserted rightly: case, name, truth, value, interval."""
    for r in records:
        if not r["hidden"] or r["hidden"] not in r["asserted"]:
            continue
        if r["hidden"] == "lift_stall" and r["truth"] != "continuous":
            continue
        for name, factor in PARAMETERS.get(r["hidden"], {}).items():
            if name in r["values"][r["hidden"]]:
                yield r, name, factor * r["amount"], r["values"][r["hidden"]][name]


def coverage(records):
    """How many 95 % intervals of rightly asserted effects hold the truth, as Markdown."""
    rows = ["| truth | rate, Hz | intervals | hold the truth | share, % | 95 % interval of the share, % | outside, relative error |", "|---|---|---|---|---|---|---|"]
    all_of = list(intervals(records))
    for kind, rate in sorted({(r["truth"], r["sensors"]["rate"]) for r, *_ in all_of}):
        of = [x for x in all_of if (x[0]["truth"], x[0]["sensors"]["rate"]) == (kind, rate)]
        outside = [x for x in of if not x[3][1] <= x[2] <= x[3][2]]
        held, n = len(of) - len(outside), len(of)
        low, high = wilson(held, n)
        named = (f"{r['hidden']}.{name} {100 * abs(got[0] / true - 1):.1f} %" if true else f"{r['hidden']}.{name}" for r, name, true, got in outside)
        rows.append(f"| {kind} | {rate:g} | {n} | {held} | {100 * held / n:.0f} | {100 * low:.0f} to {100 * high:.0f} | {', '.join(named) or 'none'} |")
    return "\n".join(rows)


def wilson(held, n, z=1.96):
    """Wilson's interval of a share (Wilson 1927)."""
    share, weight = held / n, 1.0 + z * z / n
    half = z * math.sqrt(share * (1.0 - share) / n + z * z / (4.0 * n * n)) / weight
    middle = (share + z * z / (2.0 * n)) / weight
    return middle - half, middle + half


def answered(path, greylag, without):
    """The records that an earlier run left of this program and this catalogue, by folder."""
    if not (path and path.exists()):
        return {}
    return {r["folder"]: r for r in scoring.recorded(path) if r["greylag"] == str(greylag) and ("without" in r) == without}


def hides(case):
    """Whether a case has a hidden effect."""
    return json.loads((case / "truth.json").read_text())["hidden"] is not None


def main():
    """Scores the cases of the command line."""
    p = scoring.arguments(__doc__, jobs=2)
    p.add_argument("--nulls", type=int, help="simulated nulls of each diagnosis; the program's default without")
    p.add_argument("--without-hidden", action="store_true", help="score the cases with a hidden effect, which is taken out of the catalogue; not counted in the tables")
    p.add_argument("--resume", action="store_true", help="keep what the JSONL file has of the same program and case")
    p.add_argument("--strict", action="store_true", help="exit with 1 if anything wrong is asserted or a case fails")
    a = p.parse_args()
    if a.table:
        records = scoring.recorded(a.table)
        print(tables(records))
        return
    cases = scoring.folders(p, a)
    if a.without_hidden:
        cases = [case for case in cases if hides(case)] or sys.exit("no case there has a hidden effect")
    before = answered(a.jsonl, a.greylag, a.without_hidden) if a.resume else {}
    judge = lambda case: before.get(str(case)) or diagnose(a.greylag, case, a.nulls, a.without_hidden)  # noqa: E731
    records = scoring.score(cases, a, judge, line, before)
    print("\n" + tables(records))
    if a.strict and any(wrong(r) or r["verdict"] == "failed" for r in records):
        sys.exit(1)


if __name__ == "__main__":
    main()
