"""What the scripts that score cases of make_cases.py have in common: their command line, the cases, the records."""

import argparse
import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def arguments(doc, jobs=1):
    """A parser with what every script takes; `doc` is the script's own text."""
    p = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--greylag", help="the program")
    p.add_argument("--cases", type=Path, nargs="+", default=[], help="cases, or folders of cases")
    p.add_argument("--table", type=Path, help="only print the tables of the records in this file")
    p.add_argument("--jobs", type=int, default=jobs)
    p.add_argument("--jsonl", type=Path, help="append a record a case to this file")
    return p


def recorded(path):
    """The records of a file."""
    return [json.loads(text) for text in path.read_text().splitlines()]


def folders(p, a):
    """The folders of the cases of the command line, those with nothing hidden first: a false alarm shows soonest."""
    if not a.greylag:
        p.error("name the program with --greylag, or a file of records with --table")
    cases = [case.parent for folder in a.cases for case in folder.rglob("truth.json")]
    if not cases:
        sys.exit("no cases there; make some with make_cases.py")
    return sorted(cases, key=lambda case: ("-null-" not in case.name, case))


def score(cases, a, judge, line, kept=()):
    """What `judge` says of each case, printed by `line` and kept in `a.jsonl` as soon as it is there.

    `kept`: folders, as text, of cases that the file has already.
    """
    records = []
    with ThreadPoolExecutor(a.jobs) as pool:
        for case, record in zip(cases, pool.map(judge, cases)):
            records.append(record)
            print(line(record), flush=True)
            if a.jsonl and str(case) not in kept:
                a.jsonl.parent.mkdir(parents=True, exist_ok=True)
                with a.jsonl.open("a") as file:
                    file.write(json.dumps(record) + "\n")
    return records
