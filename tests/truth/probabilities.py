"""Fits the weights of `src/sysid/diagnose/answer/probability.rs`, and shows how often probabilities of `greylag diagnose` are right.

    python tests/truth/probabilities.py --fit hide-and-find.jsonl [--judge official.jsonl]
    python tests/truth/probabilities.py --table official.jsonl

The first command reads records of `examples/hide_and_find` or of `score.py`, fits the weights by maximum likelihood and prints them
as Rust; with --judge it prints the table of other records with them. The second takes the probabilities that the program stated, and
fails if they are not those of this script with the program's weights.
"""

import argparse
import math
import re
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import scoring
from hidden import PARAMETERS
from score import wilson

SOURCE = Path(__file__).resolve().parents[2] / "src/sysid/diagnose/answer/probability.rs"
EVIDENCE = (-2.0, 6.0)
LEARNABLE = (1e-3, 1.0)
UNEXAMINED = 0.5
HELD_OUT = 0.1
SIZES = {"LEADING": 5, "OTHER": 5, "UNKNOWN": 5}
RIDGE = 5e-4
"""Weight of the squares of the weights in the fit: few cases have some of the features."""

PRIOR = {"nothing": 1 / 3, "unknown": 1 / 6}
"""Prior probabilities, to which the cases are weighted; the rest is for the effects of the catalogue."""


def reached(r):
    """The hidden amount as a multiple of what these flights would have shown."""
    if "reached" in r:
        return r["reached"]
    least, of_first = r.get("least", {}).get(r["hidden"]), next(iter(PARAMETERS.get(r["hidden"], {"": 1.0}).values()))
    if not least or r["hidden"] in ("lift_stall", "rate_limit"):
        return math.inf
    return abs(r["amount"] * of_first) / least


def case_of(r):
    """Features of a record, and which explanation is true."""
    truth = r["truth"] if isinstance(r["truth"], list) else [r["hidden"]] if r["hidden"] else []
    leading, judged = r["ranked"][0], r["judged"][0]
    alike = r.get("alike", {}).get(leading, [])
    evidence, threshold = r["evidence"][0]
    ratio = float(np.clip(math.log(max((evidence or 0.0) / threshold, 1e-9)), *EVIDENCE))
    unstable = 1.0 - (UNEXAMINED if judged["stable"] is None else judged["stable"])
    slight = judged["held_out"] is not None and judged["held_out"] < HELD_OUT
    asserted = judged["status"] in ("missing", "indistinguishable")
    small = judged["status"] == "small" or (judged["status"] == "refused" and slight)
    left = r["learnable"] if "learnable" in r else r["remainder"]
    left = math.log(float(np.clip(left or 0.0, *LEARNABLE)) / LEARNABLE[0])
    lacks = r.get("part") == "without" or bool(r.get("without"))
    if not truth:
        label = "nothing"
    elif leading in truth and not lacks:
        label = "leading"
    elif any(t in alike for t in truth) and not lacks:
        label = "alike"
    elif reached(r) < 1.0:
        label = "nothing"
    else:
        label = "unknown" if lacks else "other"
    checked = np.array([1.0, ratio, asserted, small, unstable])
    return checked, np.array([1.0, ratio, asserted, r["verdict"] == "unexplained", left]), len(alike), label


def logits(w, case):
    """Log odds against `nothing`: the leading candidate, each one that cannot be told from it, all others, what the catalogue lacks."""
    checked, of_unknown, _, _ = case
    leading = checked @ w[:5]
    return {"leading": leading, "alike": leading, "other": checked @ w[5:10], "unknown": of_unknown @ w[10:15], "nothing": 0.0}


def probabilities(w, case):
    """Probability of each explanation; of `alike` that of each member."""
    odds = {k: math.exp(v) for k, v in logits(w, case).items()}
    if not case[2]:
        odds["alike"] = 0.0
    total = sum(odds.values()) + max(case[2] - 1, 0) * odds["alike"]
    return {k: v / total for k, v in odds.items()}


def fitted(cases):
    """Weights of the greatest likelihood."""
    start = np.array([0.0, 1.0, 1.0, -1.0, -1.0, -1.0, 0.5, 0.0, 0.0, 1.0, -1.0, 0.5, 0.0, 1.0, 0.5])
    group = [c[3] if c[3] in PRIOR else "effect" for c in cases]
    prior = {**PRIOR, "effect": 1.0 - sum(PRIOR.values())}
    weights = [prior[g] / group.count(g) for g in group]

    def loss(w):
        likelihood = sum(of * math.log(max(probabilities(w, c)[c[3]], 1e-12)) for of, c in zip(weights, cases))
        return RIDGE * float((w - start) @ (w - start)) - likelihood

    return minimize(loss, start, method="L-BFGS-B").x


def rust(w):
    """The weights as the source has them."""
    at, lines = 0, []
    for name, size in SIZES.items():
        values = ", ".join(f"{x:.2f}" for x in w[at : at + size])
        lines.append(f"const {name}: [f64; {size}] = [{values}];")
        at += size
    return "\n".join(lines)


def of_source():
    """The weights of the program."""
    lists = dict(re.findall(r"^const ([A-Z]+): \[f64; \d+\] = \[(.*)\];$", SOURCE.read_text(), re.MULTILINE))
    return np.array([float(x) for name in SIZES for x in lists[name].split(",")])


def differs(records):
    """Largest difference between a probability that the program stated and that of this script with the program's weights."""
    w, most = of_source(), 0.0
    for r in records:
        own = probabilities(w, case_of(r))
        names = {r["ranked"][0]: "leading", "other_effect": "other"}
        most = max([most, *(abs(p - own[names.get(name, name if name in own else "alike")]) for name, p in r["explanations"].items())])
    return most


def stated(r):
    """Pairs of a record: probability that the program stated, and whether that explanation is true."""
    *_, label = case_of(r)
    said, leading = r["explanations"], r["ranked"][0]
    alike = r.get("alike", {}).get(leading, [])
    truth = r["truth"] if isinstance(r["truth"], list) else [r["hidden"]]
    for name, p in said.items():
        key = "leading" if name == leading else "alike" if name in alike else "other" if name == "other_effect" else name
        yield p, key == label and (key != "alike" or name in truth)


def by_model(w, case):
    """The same with weights of this script."""
    for key, p in probabilities(w, case).items():
        for member in range(case[2] if key == "alike" else 1):
            yield p, key == case[3] and member == 0


def table(pairs):
    """Share of true explanations by stated probability, as Markdown."""
    pairs = np.array([(p, float(true)) for p, true in pairs])
    rows = ["| stated probability | explanations | mean stated | true | 95 % |", "|---|---|---|---|---|"]
    for low in np.arange(10) / 10:
        own = pairs[(pairs[:, 0] >= low) & (pairs[:, 0] < low + 0.1 + (low > 0.85))]
        if len(own):
            bounds = wilson(own[:, 1].sum(), len(own))
            rows.append(f"| {low:.1f} to {low + 0.1:.1f} | {len(own)} | {own[:, 0].mean():.3f} | {own[:, 1].mean():.3f} | {max(bounds[0], 0):.2f} to {bounds[1]:.2f} |")
    brier = float(np.mean((pairs[:, 0] - pairs[:, 1]) ** 2))
    return "\n".join([*rows, "", f"Mean square of stated probability minus truth: {brier:.3f}."])


def usable(path):
    """The records of a file that hold one hidden effect at most and a verdict."""
    records = [r for p in path for r in scoring.recorded(p)]
    one = lambda r: not isinstance(r["truth"], list) or len(r["truth"]) < 2  # noqa: E731
    return [r for r in records if r.get("judged") and one(r) and r["verdict"] not in ("unknown", "failed") and r.get("part") not in ("probes", "pairs")]


def main():
    """Fits and prints."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--fit", type=Path, nargs="+", help="records to which the weights are fitted")
    p.add_argument("--judge", type=Path, nargs="+", default=[], help="other records, judged with these weights")
    p.add_argument("--check", action="store_true", help="fail unless the source has the fitted weights")
    p.add_argument("--table", type=Path, nargs="+", help="records with probabilities that the program stated")
    a = p.parse_args()
    if a.table:
        records = [r for r in usable(a.table) if r.get("explanations")]
        if not records:
            sys.exit("no record there has probabilities of the program")
        most = differs(records)
        print(f"{len(records)} cases; largest difference from this script: {most:.1e}\n\n" + table([pair for r in records for pair in stated(r)]))
        if most > 1e-9:
            sys.exit("the program and this script compute different probabilities")
        return
    if not a.fit:
        p.error("name records with --fit or --table")
    cases = [case_of(r) for r in usable(a.fit)]
    w = fitted(cases)
    print(rust(w) + "\n")
    if a.check and rust(w) not in "\n".join(x for x in SOURCE.read_text().splitlines() if x.startswith("const ")):
        sys.exit(f"{SOURCE} has other weights")
    for name, of in (("fitted", cases), ("judged", [case_of(r) for r in usable(a.judge)])):
        if of:
            labels = {k: sum(c[3] == k for c in of) for k in ("leading", "alike", "other", "unknown", "nothing")}
            print(f"{name}: {len(of)} cases, {labels}\n\n" + table([pair for c in of for pair in by_model(w, c)]) + "\n")


if __name__ == "__main__":
    main()
