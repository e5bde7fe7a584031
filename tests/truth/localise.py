"""Scores where `greylag compare` says that a model fails: channels and regime cells, against the truth.

    python tests/truth/make_cases.py --truth continuous --wrong 0 --seed 52751 --effects all --nulls 10 --out cases
    python tests/truth/localise.py --greylag target/release/greylag --cases cases --jsonl results/localisation.jsonl
    python tests/truth/localise.py --table results/localisation.jsonl

The model of a case is the truth but for the hidden effect (`--wrong 0`), so what is wrong with each channel is known
at every instant: the force or moment that the truth has and the model has not. A cell is one channel in one bin of
one regime variable, as `compare` cuts them. It **fails** if the mean of what is wrong in it is at least 2 % of the
channel's standard deviation; it is **named** if its q-value is at most 0.05 (Benjamini and Hochberg over all cells
of the model) and its mean residual is as large. Between 1 and 4 % it counts either way.
"""

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import aircraft as x8
import continuous
import make_cases
import manoeuvres
import scoring

STEP, KERNEL_S = 0.01, 0.37
MATERIAL, DOUBTFUL = 0.02, (0.01, 0.04)
"""Share of the channel's standard deviation from which a cell fails, and what may be called either way."""
NAMED = 0.05
CHANNELS = ("D", "L", "Y", "l", "m", "n")
VARIABLES = ("alpha", "beta", "airspeed", "throttle", "p", "q", "r", "aileron", "elevator")
PLACES = {"p": 3, "q": 4, "r": 5, "airspeed": 6, "alpha": 7, "beta": 8, "aileron": 16, "elevator": 17, "throttle": 18}
DEGREES = ("alpha", "beta", "p", "q", "r", "aileron", "elevator")


def figures(effect):
    """The figures of the model that lacks `effect`: the vector that the truth's equations take."""
    e = dict(zip(continuous.NAMES, continuous.vector()))
    if effect == "drag_beta2":
        e["drag_beta2"] = -continuous.CDB2
    elif effect == "drag_elevator_abs":
        e["drag_elevator_abs"] = -continuous.CDDE
    elif effect == "lift_stall":
        e.update(stall=1.0, stall_alpha=3.0, stall_sharpness=50.0)  # never stalls
    return tuple(e.values())


def body(row):
    """The state of the equations at a row of the truth."""
    roll, pitch, yaw = row[:3] / 2.0
    c, s = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    v, alpha, beta = row[6:9]
    return (
        v * math.cos(alpha) * math.cos(beta), v * math.sin(beta), v * math.sin(alpha) * math.cos(beta), *row[3:6],
        c[0] * c[1] * c[2] + s[0] * s[1] * s[2], s[0] * c[1] * c[2] - c[0] * s[1] * s[2],
        c[0] * s[1] * c[2] + s[0] * c[1] * s[2], c[0] * c[1] * s[2] - s[0] * s[1] * c[2], row[15],
    )  # fmt: skip


def wind_axes(force, alpha, beta):
    """D, L, Y (N) of a force in body axes."""
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    along = force[:, 0] * ca + force[:, 2] * sa
    lift = force[:, 0] * sa - force[:, 2] * ca
    return np.stack((-along * cb - force[:, 1] * sb, lift, force[:, 1] * cb - along * sb), axis=1)


def channels(rows, effect):
    """Measured, and what the model lacks: six channels at every row."""
    e, rate = figures(effect), rows[:, 3:6]
    predicted = np.array([continuous.wrench(body(row), (*row[16:19], 0.0), e)[:6] for row in rows])
    if effect == "drag_beta2":  # the model has none of its two coefficients
        qs = 0.5 * np.array([continuous.density(h) for h in rows[:, 15]]) * rows[:, 6] ** 2 * x8.AREA
        extra = -continuous.CDB * np.abs(rows[:, 8]) * qs
        predicted[:, 0] -= extra * np.cos(rows[:, 7]) * np.cos(rows[:, 8])
        predicted[:, 1] -= extra * np.sin(rows[:, 8])
        predicted[:, 2] -= extra * np.sin(rows[:, 7]) * np.cos(rows[:, 8])
    inertia = np.array([[x8.JX, 0.0, -x8.JXZ], [0.0, x8.JY, 0.0], [-x8.JXZ, 0.0, x8.JZ]])
    turning = np.gradient(rate, STEP, axis=0)
    moment = turning @ inertia + np.cross(rate, rate @ inertia)
    force = wind_axes(x8.MASS * rows[:, 9:12], rows[:, 7], rows[:, 8])
    measured = np.hstack((force, moment))
    return measured, measured - np.hstack((wind_axes(predicted[:, :3], rows[:, 7], rows[:, 8]), predicted[:, 3:]))


def smoothed(values):
    """Means over a Hann window of `KERNEL_S`, half a window apart."""
    n = round(KERNEL_S / STEP)
    kernel = 1.0 - np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n)
    kernel /= kernel.sum()
    starts = range(0, len(values) - n, (n + 1) // 2)
    return np.array([kernel @ values[k : k + n] for k in starts])


def windows(case, truth):
    """Windows of all flights: place in the regimes, measured, lacking."""
    fly, step = make_cases.truth_of(truth["truth"])
    every, parts = round(STEP / step), []
    for flight in truth["flights"]:
        rows, _, _ = make_cases.fly_within_bounds(
            fly, truth["case"], truth["seed"], flight, truth["hidden"], truth["amount"], truth["duration_s"]
        )
        rows = rows[round(manoeuvres.SETTLE / step) :: every]
        measured, lacking = channels(rows, truth["hidden"])
        regime = np.stack([rows[:, PLACES[v]] * (180.0 / np.pi if v in DEGREES else 1.0) for v in VARIABLES], axis=1)
        parts.append([smoothed(x) for x in (regime, measured, lacking)])
    return [np.vstack(x) for x in zip(*parts)]


def cells(case, truth, said):
    """Every supported cell of a comparison: channel, variable, whether it fails (None: doubtful), whether named."""
    regime, measured, lacking = windows(case, truth)
    for channel in said["channels"]:
        if channel["channel"] not in CHANNELS:
            continue
        c = CHANNELS.index(channel["channel"])
        size = measured[:, c].std()
        for bins in channel["bins"]:
            if bins["variable"] not in VARIABLES:
                continue
            place = regime[:, VARIABLES.index(bins["variable"])]
            for cell in bins["bins"]:
                low, high = (-math.inf if cell["low"] is None else cell["low"]), (math.inf if cell["high"] is None else cell["high"])
                inside = (place >= low) & (place < high)
                if not cell["supported"] or not inside.any():
                    continue
                share = abs(lacking[inside, c].mean()) / size
                fails = None if DOUBTFUL[0] <= share < DOUBTFUL[1] else share >= MATERIAL
                named = cell["q_value"] is not None and cell["q_value"] <= NAMED and abs(cell["mean"]) >= MATERIAL * size
                alone = (cell["interval"][0] > 0.0 or cell["interval"][1] < 0.0) if cell["interval"][0] is not None else False
                yield channel["channel"], bins["variable"], fails, named, alone and abs(cell["mean"]) >= MATERIAL * size


def counts(found, which):
    """True and false discoveries, misses."""
    known = [x for x in found if x[2] is not None]
    pairs = [(bool(x[2]), bool(x[which])) for x in known]
    return {"hits": pairs.count((True, True)), "false": pairs.count((False, True)), "missed": pairs.count((True, False))}


def score(greylag, case):
    """The record of a case."""
    truth = json.loads((case / "truth.json").read_text())
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "comparison.json"
        command = [greylag, "compare", "--model", case / "model.toml", "--json", out]
        command += ["--log", *sorted(case.glob("t*-*.csv"))]
        done = subprocess.run([str(x) for x in command], capture_output=True, text=True)
        if not out.exists():
            sys.exit(f"{case}: {done.stderr[-600:]}")
        said = json.loads(out.read_text())
    found = list(cells(case, truth, said["models"][0]))
    record = {k: truth[k] for k in ("case", "truth", "seed", "hidden", "amount", "sensors", "wrong")}
    record["cells"], record["doubtful"] = len(found), sum(x[2] is None for x in found)
    record["controlled"], record["alone"] = counts(found, 3), counts(found, 4)
    wrong = {x[0] for x in found if x[2]}
    named = {x[0] for x in found if x[3]}
    record["channels"] = {"wrong": sorted(wrong), "named": sorted(named)}
    return record


def measures(records, which):
    """Precision, recall, F1 over the cells of all records, and the mean share of false ones a record."""
    total = {k: sum(r[which][k] for r in records) for k in ("hits", "false", "missed")}
    named, wrong = total["hits"] + total["false"], total["hits"] + total["missed"]
    precision, recall = (total["hits"] / named if named else 1.0), (total["hits"] / wrong if wrong else 1.0)
    f1 = 2.0 * precision * recall / (precision + recall) if precision + recall else 0.0
    shares = [r[which]["false"] / max(r[which]["false"] + r[which]["hits"], 1) for r in records]
    return wrong, named, precision, recall, f1, sum(shares) / len(shares)


def table(records):
    """The scores, as Markdown."""
    rows = [
        "| truth | cases | cells | cells that fail | named by | named | precision | recall | F1 | false discovery rate |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in sorted({r["truth"] for r in records}):
        for title, of in (
            ("effects", [r for r in records if r["truth"] == kind and r["hidden"]]),
            ("without a hidden effect", [r for r in records if r["truth"] == kind and not r["hidden"]]),
        ):
            for which, how in (("controlled", "q-value"), ("alone", "its own interval")) if of else ():
                wrong, named, precision, recall, f1, rate = measures(of, which)
                cells = sum(r["cells"] - r["doubtful"] for r in of)
                rows.append(
                    f"| {kind}, {title} | {len(of)} | {cells} | {wrong} | {how} | {named} | {precision:.3f} | {recall:.3f} | {f1:.3f} | {rate:.3f} |"
                )
    rows += ["", "| case | fail | named | false | missed | channels that fail | channels named |", "|---|---|---|---|---|---|---|"]
    for r in sorted(records, key=lambda r: (r["truth"], r["hidden"] or "", r["case"])):
        c = r["controlled"]
        rows.append(
            f"| {r['case']} | {c['hits'] + c['missed']} | {c['hits'] + c['false']} | {c['false']} | {c['missed']} "
            f"| {' '.join(r['channels']['wrong']) or 'none'} | {' '.join(r['channels']['named']) or 'none'} |"
        )
    return "\n".join(rows)


def main():
    """Scores the cases of the command line."""
    p = scoring.arguments(__doc__)
    a = p.parse_args()
    if a.table:
        print(table(scoring.recorded(a.table)))
        return
    line = lambda record: f"{record['case']} {record['controlled']}"  # noqa: E731
    records = scoring.score(scoring.folders(p, a), a, lambda case: score(a.greylag, case), line)
    print("\n" + table(records))


if __name__ == "__main__":
    main()
