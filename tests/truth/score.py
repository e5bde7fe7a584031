"""Puts cases of make_cases.py to `greylag diagnose` and counts what it finds.

    python tests/truth/score.py --greylag target/release/greylag --cases cases --jobs 2 --jsonl results.jsonl
"""

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def diagnose(greylag, case, nulls):
    """What greylag says of a case, as one record beside the truth."""
    truth = json.loads((case / "truth.json").read_text())
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "diagnosis.json"
        command = [greylag, "diagnose", "--model", case / "model.toml", "--json", out]
        command += ["--log", *sorted(case.glob("train-*.csv"))]
        if nulls is not None:
            command += ["--nulls", nulls]
        done = subprocess.run([str(x) for x in command], capture_output=True, text=True)
        said = json.loads(out.read_text()) if out.exists() else None
    record = {"greylag": str(greylag), "folder": str(case)}
    record |= {"case": truth["case"], "truth": truth["truth"], "seed": truth["seed"], "hidden": truth["hidden"]}
    record.update(amount=truth["amount"], sensors=truth["sensors"], exit=done.returncode)
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
        "alike": {e["id"]: e["indistinguishable_from"] for e in effects[:5] if e["indistinguishable_from"]},
        "measured": sorted({m["id"] for m in said["measurement"] if m["asserted"]}),
        "remainder": said.get("learnable_remainder"),
        "version": said.get("version"),
        "settings": said.get("settings"),
    }


def line(r):
    """One line a case."""
    first = r["ranked"][0] if r["ranked"] else "-"
    evidence = "{:.1f} / {:.1f}".format(*r["evidence"][0]) if r.get("evidence") else r.get("why", "")
    return f"{r['case']:42} {r['hidden'] or 'none':24} first {first:24} asserted {','.join(r['asserted']) or '-':36} {r['verdict']:12} {evidence}"


def wrong(r):
    """Ids asserted that the aircraft does not lack."""
    return [x for x in r["asserted"] if x != r["hidden"]]


def table(records):
    """The counts by truth, as Markdown."""
    rows = [
        "| truth | effects | truth first | asserted right | cases with a wrong assertion | nulls | nulls with an assertion | nulls called adequate | failed |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in sorted({r["truth"] for r in records}):
        of = [r for r in records if r["truth"] == kind]
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
        rows.append(f"| {kind} | " + " | ".join(map(str, counts)) + " |")
    return "\n".join(rows)


def answered(path, greylag):
    """The records that an earlier run left of this program, by folder."""
    if not (path and path.exists()):
        return {}
    records = [json.loads(text) for text in path.read_text().splitlines()]
    return {r["folder"]: r for r in records if r["greylag"] == str(greylag)}


def score(cases, a):
    """The records of all cases, each printed and kept as soon as it is there."""
    before, records = answered(a.jsonl, a.greylag) if a.resume else {}, []

    def one(case):
        return before.get(str(case)) or diagnose(a.greylag, case, a.nulls)

    with ThreadPoolExecutor(a.jobs) as pool:
        for record in pool.map(one, cases):
            records.append(record)
            print(line(record), flush=True)
            if a.jsonl and record["folder"] not in before:
                a.jsonl.parent.mkdir(parents=True, exist_ok=True)
                with a.jsonl.open("a") as file:
                    file.write(json.dumps(record) + "\n")
    return records


def main():
    """Scores the cases of the command line."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--greylag", required=True, help="the program")
    p.add_argument("--cases", type=Path, nargs="+", required=True, help="cases, or folders of cases")
    p.add_argument("--jobs", type=int, default=2)
    p.add_argument("--nulls", type=int, help="simulated nulls of each diagnosis; the program's default without")
    p.add_argument("--jsonl", type=Path, help="append a record a case to this file")
    p.add_argument("--resume", action="store_true", help="keep what the JSONL file has of the same program and case")
    p.add_argument("--strict", action="store_true", help="exit with 1 if anything wrong is asserted or a case fails")
    a = p.parse_args()
    cases = [case.parent for folder in a.cases for case in folder.rglob("truth.json")]
    # nulls first: a false alarm shows soonest
    cases.sort(key=lambda case: ("-null-" not in case.name, case.name.removeprefix("official-adams").split("-", 1)[1], case))
    if not cases:
        sys.exit("no cases there; make some with make_cases.py")
    records = score(cases, a)
    print("\n" + table(records))
    if a.strict and any(wrong(r) or r["verdict"] == "failed" for r in records):
        sys.exit(1)


if __name__ == "__main__":
    main()
