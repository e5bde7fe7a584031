"""Puts cases of make_cases.py that hide a formula to `greylag propose` and counts what it finds.

    python tests/truth/score_formulas.py --greylag target/release/greylag --cases cases --jsonl results.jsonl
    python tests/truth/score_formulas.py --table results/second-truth-formulas.jsonl

The first term of the formula that was found is held against the hidden one. A formula is *found* if the search has
taken it, and *proposed* if the flights that were held out do not refuse it either.
"""

import ast
import json
import statistics
import subprocess
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np

import aircraft as x8
import scoring
from formulas import FACTORS, VARIABLES
from score import wilson

REQUIRED = {
    "channel": ("channel", "95 %"), "variables": ("variables", "80 %"), "trend": ("parity and monotony", "65 %"),
    "form": ("form, constants to 20 %", "40 %"),
}  # fmt: skip
"""What can be right of a formula: in words, and how often it must be."""
NEAR = 0.2
"""Share by which a constant may be off in a form that is right."""
SAME = 1e-6
"""Largest difference, as a share, of two forms that are one, written in two ways."""
ALONG = np.array((0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0))
"""Places along a variable at which its trend is tried, as shares of what it reaches."""
REACH = 3.0
"""What a variable reaches, in sizes of `formulas.VARIABLES`; the throttle reaches one."""
RATES = {"p": ("p_hat", x8.SPAN), "q": ("q_hat", x8.CHORD), "r": ("r_hat", x8.SPAN)}


def deadband(x, w):
    """What `x` exceeds the band ±w by, with its sign."""
    return x - np.clip(x, -w, w)


FUNCTIONS = {
    "abs": np.abs, "max": np.maximum, "min": np.minimum, "exp": np.exp, "sin": np.sin, "cos": np.cos, "tanh": np.tanh,
    "sqrt": np.sqrt, "sign": np.sign, "deadband": deadband, "lag": lambda x, _: x,
}  # fmt: skip
"""The functions of the program's formulas, a lag in its steady state."""


def divided(term):
    """Channel, factor and shape of a term `channel = k*factor*shape`."""
    channel, right = term.split(" = ", 1)
    right = right.removeprefix("k*")
    factor = next((f for f in sorted(FACTORS.values(), key=len, reverse=True) if right.startswith(f + "*")), "1")
    return channel, factor, right if factor == "1" else right.removeprefix(factor + "*")


def names(shape):
    """The variables of a shape, a rate the same whatever it is divided by."""
    tree = ast.parse(shape.replace("^", "**"), mode="eval")
    words = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)} - set(FUNCTIONS)
    return sorted(RATES[w][0] if w in RATES else w for w in words)


def value(shape, at):
    """A shape at the variables `at` (arrays by name)."""
    at = dict(at)
    for name, (hat, length) in RATES.items():
        at[name] = at[hat] * 2.0 * at["airspeed"] / length
    return eval(shape.replace("^", "**"), {"__builtins__": {}}, {**FUNCTIONS, **at}) + 0.0 * at["airspeed"]


def pressed(factor, at):
    """What a factor makes of it, up to a number: dynamic pressure or nothing."""
    return 1.0 if factor == "1" else at["airspeed"] ** 2


def cloud():
    """Random points of flight."""
    random = np.random.default_rng(1)
    at = {v: random.uniform(-2.0, 2.0, 2000) * size for v, size in VARIABLES.items()}
    return {**at, "throttle": random.uniform(0.0, 1.0, 2000), "airspeed": random.uniform(13.0, 27.0, 2000)}


def same(factor, shape, hidden):
    """Whether a form is the hidden one up to a number, however it is written; a lag says so by its form alone."""
    if "lag(" in shape + hidden["shape"]:
        return False
    at = cloud()
    ours, truth = pressed(factor, at) * value(shape, at), pressed(hidden["factor"], at) * value(hidden["shape"], at)
    scale = (ours @ truth) / (truth @ truth)
    return bool(np.abs(ours - scale * truth).max() <= SAME * np.abs(ours).max())


def canonical(node):
    """The structure of an expression, the order of sums and products aside, and its numbers."""
    if isinstance(node, ast.Constant):
        return "#", [float(node.value)]
    if isinstance(node, ast.Name):
        return node.id, []
    if isinstance(node, ast.UnaryOp):
        text, numbers = canonical(node.operand)
        return f"-({text})", numbers
    if isinstance(node, ast.Call):
        parts = [canonical(a) for a in node.args]
        return f"{node.func.id}({','.join(p[0] for p in parts)})", sum((p[1] for p in parts), [])
    if isinstance(node.op, ast.Pow):
        text, numbers = canonical(node.left)
        return f"({text})^{ast.unparse(node.right)}", numbers
    parts = [canonical(node.left), canonical(node.right)]
    if isinstance(node.op, (ast.Add, ast.Mult)):
        parts.sort()
    return f"({type(node.op).__name__} {' '.join(p[0] for p in parts)})", sum((p[1] for p in parts), [])


def same_form(factor, shape, hidden):
    """Whether a form is the hidden one, its constants within a fifth."""
    trees = (ast.parse(s.replace("^", "**"), mode="eval").body for s in (shape, hidden["shape"]))
    (a, ours), (b, truth) = map(canonical, trees)
    near = all(abs(x - y) <= NEAR * abs(y) for x, y in zip(ours, truth))
    return factor == hidden["factor"] and a == b and len(ours) == len(truth) and near


def trend(shape):
    """Parity and monotony of a shape by variable, in the words of `formulas.FORMS`; `turning` if it is not monotone."""
    out = {}
    for name in names(shape):
        if name not in VARIABLES:
            continue
        at = {v: np.full(len(ALONG), 0.7 * REACH * size) for v, size in VARIABLES.items()}
        at |= {"throttle": np.full(len(ALONG), 0.7), "airspeed": np.full(len(ALONG), 18.0)}
        reach = 1.0 if name == "throttle" else REACH * VARIABLES[name]
        up, down = value(shape, {**at, name: reach * ALONG}), value(shape, {**at, name: -reach * ALONG})
        size = max(np.abs(up).max(), np.abs(down).max())

        def near(x, size=size):
            return bool((np.abs(x) <= 1e-9 * size).all())

        def runs(x, size=size):
            return bool((np.diff(x) >= -1e-9 * size).all() or (np.diff(x) <= 1e-9 * size).all())

        if name == "throttle":
            out[name] = "grows" if runs(up) else "turning"
            continue
        parity = "odd" if near(up + down) else "even" if near(up - down) else "neither"
        if parity == "neither" and (near(up) or near(down)):
            parity = "one-sided"
        out[name] = parity if runs(up) and runs(down) else f"turning {parity}"
    return out


def flown(case):
    """The variables in the flights that were searched, from their logs."""
    logs = [np.genfromtxt(p, delimiter=",", names=True) for p in sorted(case.glob("train-*.csv"))]
    log = {n: np.concatenate([x[n] for x in logs]) for n in logs[0].dtype.names}
    speed = log["airspeed_mps"]
    at = {hat: log[f"{name}_radps"] * length / (2.0 * speed) for name, (hat, length) in RATES.items()}
    at |= {n: log[f"{n}_rad"] for n in ("alpha", "beta", "aileron", "elevator")}
    return {**at, "throttle": log["throttle"], "airspeed": speed}


def likeness(case, factor, shape, hidden):
    """Correlation of a form with the hidden one over the flights that were searched, as their logs have them."""
    at = flown(case)
    ours, truth = pressed(factor, at) * value(shape, at), pressed(hidden["factor"], at) * value(hidden["shape"], at)
    with np.errstate(all="ignore"):
        return float(np.corrcoef(ours, truth)[0, 1])


def judged(case, hidden, term, values):
    """What the first term says of the hidden formula."""
    channel, factor, shape = divided(term)
    one = channel == hidden["channel"] and same(factor, shape, hidden)
    variables = one or names(shape) == sorted(hidden["variables"])
    right = {
        "channel": channel == hidden["channel"],
        "variables": variables,
        "trend": one or variables and trend(shape) == hidden["trend"],
        "form": one or channel == hidden["channel"] and same_form(factor, shape, hidden),
    }
    out = {"right": right, "trend": trend(shape), "correlation": round(likeness(case, factor, shape, hidden), 4)}
    if values and right["form"] and factor == hidden["factor"]:
        out["coefficient"] = [values["k1"], hidden["amount"]]
    return out


def propose(greylag, case):
    """What greylag says of a case, as one record beside the truth."""
    truth = json.loads((case / "truth.json").read_text())
    hidden = truth.get("formula")
    kept = ("case", "truth", "seed", "sensors", "wrong", "duration_s")
    record = {k: truth[k] for k in kept} | {"hidden": truth["hidden"], "formula": hidden}
    record |= {"strength": truth.get("strength", 1.0), "not_flown": truth.get("not_flown", [])}
    record["scales"] = [f["scale"] for f in truth["flights"].values()]
    with tempfile.TemporaryDirectory() as folder:
        out, begin = Path(folder) / "proposal.json", time.monotonic()
        command = [greylag, "propose", "--model", case / "model.toml", "--log", *sorted(case.glob("train-*.csv"))]
        command += ["--hold-out", *sorted(case.glob("test-*.csv")), "--json", out]
        done = subprocess.run([str(x) for x in command], capture_output=True, text=True)
        record.update(exit=done.returncode, seconds=round(time.monotonic() - begin, 1))
        said = json.loads(out.read_text()) if out.exists() else None
    if said is None:
        return {**record, "verdict": "failed", "why": done.stderr[-600:].replace(str(case), "."), "proposed": False}
    return {**record, **digest(case, hidden, said)}


def digest(case, hidden, said):
    """The part of a proposal that is kept."""
    front, free, held = said["front"], said["free"], said["held_out"]
    chosen = next((r for r in front if r["chosen"]), None)
    out = {"verdict": said["verdict"], "proposed": said["effect"] is not None, "found": chosen and chosen["formula"]}
    out |= {"refused": said["refused"], "grades": said["grades"], "front": [round_of(r) for r in front]}
    out |= {"alike": [a["formula"] for a in said["alike"]][:5], "tried": said["tried"]}
    out["free"] = free and {"why": free["why"], "tried": free["tried"], "chosen": free["chosen"]}
    if free:
        out["free"]["front"] = [round_of(r) for r in free["front"]]
    parameters = tomllib.loads(said["effect"])["parameters"] if said["effect"] else {}
    out["values"] = {name: parameter["value"] for name, parameter in parameters.items()}
    out["held_out"] = held and {k: held[k] for k in ("removed", "fall", "threshold")}
    out["sentences"] = [s.replace(f"{case}/", "") for s in said["sentences"]]
    begin = "The catalogue explains it ("
    asserted = [s.removeprefix(begin).split(")")[0] for s in said["sentences"] if s.startswith(begin)]
    out["asserted"] = asserted[0].split(", ") if asserted else []
    out |= {"version": said["version"], "settings": said["settings"]}
    if hidden and chosen:
        out |= judged(case, hidden, front[0]["formula"], out["values"])
    return out


def round_of(rung):
    """A formula with what it takes and what chance reaches."""
    return [rung["formula"], round(rung["removed"], 4), round(rung["evidence"], 1), round(rung["threshold"], 1)]


def line(r):
    """One line a case."""
    right = "".join(n[0] if ok else "-" for n, ok in r.get("right", {}).items()) or "    "
    said = r.get("found") or ", ".join(r.get("asserted", [])) or r.get("why", "")
    removed = "{:5.1f} %".format(100.0 * r["held_out"]["removed"]) if r.get("held_out") else 7 * " "
    state = "proposed" if r["proposed"] else "refused" if r.get("found") else r["verdict"]
    return f"{r['case']:24} {r['hidden'] or 'none':52} {state:12} {right} {removed} {r['seconds']:5.1f} s {said}"


def share(count, of):
    """A count with its share and the 95 % interval of that."""
    low, high = wilson(count, of)
    return f"{count} of {of} ({100.0 * count / of:.0f} %; {100 * max(low, 0.0):.0f} to {100 * min(high, 1.0):.0f})"


def tables(records):
    """The counts of each strength, as Markdown."""
    by_strength = {}
    for r in records:
        by_strength.setdefault(r.get("strength", 1.0), []).append(r)
    return "\n\n".join(f"Amounts times {s:g}:\n\n{table(of)}" for s, of in by_strength.items())


def table(records):
    """The counts of the cases with a formula, then of those without, as Markdown."""
    hidden, nulls = [r for r in records if r["hidden"]], [r for r in records if not r["hidden"]]
    parts = [with_formula(hidden)] if hidden else []
    return "\n\n".join(parts + [without(nulls)] if nulls else parts)


def took(of):
    """How long the cases took, as a line below their table."""
    seconds = [r["seconds"] for r in of]
    return f"\nSeconds a case: median {statistics.median(seconds):.0f}, largest {max(seconds):.0f}."


def with_formula(hidden):
    """The counts of the cases with a formula, as Markdown."""
    found, proposed = [r for r in hidden if r.get("found")], [r for r in hidden if r["proposed"]]
    rows = ["| | found | found and proposed | required |", "|---|---|---|---|"]
    rows.append(f"| a formula | {share(len(found), len(hidden))} | {share(len(proposed), len(hidden))} | |")
    for name, (words, required) in REQUIRED.items():
        counts = (share(sum(r["right"][name] for r in of), len(hidden)) for of in (found, proposed))
        rows.append(f"| right {words} | {' | '.join(counts)} | {required} |")
    removed = [100.0 * statistics.median([r["held_out"]["removed"] for r in of] or [0.0]) for of in (found, proposed)]
    rows.append(f"| share of the held-out error removed, median | {removed[0]:.1f} % | {removed[1]:.1f} % | 70 % |")
    off = [abs(k / amount - 1.0) for k, amount in (r["coefficient"] for r in proposed if "coefficient" in r)]
    if off:
        most = f"{100 * statistics.median(off):.1f} % ({100 * max(off):.1f} %)"
        rows.append(f"| coefficient of a right form off by, median (largest) of {len(off)} | | {most} | |")
    for name, (words, _) in REQUIRED.items():
        sure = [[r for r in of if r["grades"] and r["grades"][name]] for of in (found, proposed)]
        counts = (f"{sum(not r['right'][name] for r in s)} of {len(s)}" for s in sure)
        rows.append(f"| {words} called sure, and wrong | {' | '.join(counts)} | |")
    for verdict, words in (
        ("effect", "an effect of the catalogue asserted in its place"),
        ("adequate", "nothing missed: the model called adequate"),
        ("failed", "failed"),
    ):
        rows.append(f"| {words} | {share(sum(r['verdict'] == verdict for r in hidden), len(hidden))} | | |")
    return "\n".join([*rows, took(hidden)])


def without(nulls):
    """The counts of the cases in which nothing is hidden, as Markdown."""
    rows = ["| nothing is hidden | | required |", "|---|---|---|"]
    rows.append(f"| a formula is proposed | {share(sum(r['proposed'] for r in nulls), len(nulls))} | at most 5 % |")
    for verdict, words in (
        ("unexplained", "a formula is searched for (verdict unexplained)"),
        ("adequate", "the model is called adequate"),
        ("effect", "an effect of the catalogue is asserted"),
    ):
        rows.append(f"| {words} | {sum(r['verdict'] == verdict for r in nulls)} of {len(nulls)} | |")
    return "\n".join([*rows, took(nulls)])


def main():
    """Scores the cases of the command line."""
    p = scoring.arguments(__doc__)
    a = p.parse_args()
    if a.table:
        records = scoring.recorded(a.table)
        print("\n".join(line(r) for r in records) + "\n\n" + tables(records))
        return
    records = scoring.score(scoring.folders(p, a), a, lambda case: propose(a.greylag, case), line)
    print("\n" + tables(records))


if __name__ == "__main__":
    main()
