"""Makes cases for `greylag diagnose`: flights of a truth that shares no code with it, and a model.

    python tests/truth/make_cases.py --truth continuous --seed 1 --effects all --nulls 20 --out cases
    python tests/truth/make_cases.py --truth continuous --seed 1 --formulas 24 --nulls 20 --out cases
    python tests/truth/make_cases.py --truth official --seed 1 --effects all --nulls 20 --installed 1 --out cases
    python tests/truth/make_cases.py --truth official --seed 1 --effects all --strength 0.33 --out cases
    python tests/truth/make_cases.py --truth official --seed 1 --both 100 --installed 1 --out cases
    python tests/truth/make_cases.py --truth official --seed 1 --effects '' --nulls 100 --installed 1 --errors servo_sides --out cases

The second command hides formulas of `formulas.py` in place of effects, for `greylag propose`. The third draws an error of
installation or calibration (`installed.py`) for each case. The fourth hides a third of the usual amounts. The fifth draws an
effect and an error for each of 100 cases. The sixth hides nothing, and all cases have the named error. Every case is a folder
with model.toml, airframe.toml, train-1..3.csv, test-1..2.csv and truth.json. All of it follows from the seed.
"""

import argparse
import json
import shutil
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

import formulas
import hidden
import installed
import manoeuvres
import model_file
import sensors
from pilot import PERIOD

AIRFRAME = Path(__file__).resolve().parents[2] / "params" / "x8" / "airframe.toml"
ROLL_MAX, PITCH_MAX = np.radians(85.0), np.radians(60.0)
"""Bounds within which a flight is kept."""
WIND_MAX = 6.0
"""Strongest steady wind, m/s."""
GENTLER = 0.75
FORMULA, LAGGED = "formula", "lagged"
DRAWN = {FORMULA: formulas.drawn, LAGGED: formulas.drawn_lagged}
DRAWS = 20
"""Formulas drawn for a case before it is given up: some cannot be flown."""


class Lost(RuntimeError):
    """The aircraft leaves its bounds however gentle the flight."""


def truth_of(name):
    """What flies, and the length of its steps (s)."""
    if name == "continuous":
        import continuous

        return continuous.fly, continuous.STEP
    import official

    integrators = "adams" if name == "official-adams" else "default"
    return partial(official.fly, integrators=integrators), official.STEP


def fly_within_bounds(fly, case, seed, flight, effect, amount, duration, gust=0.0):
    """Truth, commands, and what was drawn; gentler where the aircraft leaves the bounds."""
    random = hidden.random_of(seed, case, *flight.encode(), 1)
    speed, course, heading = random.uniform(0.0, WIND_MAX), *random.uniform(0.0, 2.0 * np.pi, 2)
    wind = np.array([speed * np.cos(course), speed * np.sin(course), 0.0])
    scale = 1.0
    for _ in range(7):
        plan = manoeuvres.plan_of(flight, hidden.random_of(seed, case, *flight.encode(), 2), scale, duration)
        blows = wind
        if gust:
            blows = installed.gusty(wind, gust, len(plan), PERIOD, hidden.random_of(seed, case, *flight.encode(), 7))
        rows, commands = fly(plan, effect, amount, blows, heading)
        if np.isfinite(rows).all() and (np.abs(rows[:, :2]) < (ROLL_MAX, PITCH_MAX)).all():
            return rows, commands, {"wind_ned_mps": wind.tolist(), "scale": scale}
        scale *= GENTLER
    raise Lost(f"{case}, {flight}: the aircraft leaves its bounds; hide less of {effect}")


def flown(fly, case, seed, effect, amount, duration, gust=0.0):
    """Every flight of a case: truth, commands, what was drawn."""
    return {f: fly_within_bounds(fly, case, seed, f, effect, amount, duration, gust) for f in manoeuvres.FLIGHTS}


def flown_with_formula(fly, draw, case, seed, duration, strength):
    """The first formula drawn with which all flights can be flown, the flights, and the formulas before it."""
    lost = []
    for k in range(DRAWS):
        formula = draw(hidden.random_of(seed, case, 6, k), strength)
        try:
            return formula, flown(partial(fly, formula=formula), case, seed, None, 0.0, duration), lost
        except Lost:
            lost.append(formula.text())
    raise Lost(f"{case}: none of {DRAWS} formulas can be flown")


def make_case(folder, kind, case, seed, effect, options, duration, wrong, strengths=(1.0, 1.0), errors=((), 0)):
    """Writes one case; `effect` is an id, one of `DRAWN` for a formula that is drawn, or None.

    `strengths`: least and largest factor on the amount, which is drawn log-uniformly.
    `errors`: kinds of errors of installation, and how many of them are drawn.
    """
    (fly, step), folder = truth_of(kind), folder / case
    folder.mkdir(parents=True)
    record = {"case": case, "truth": kind, "seed": seed, "hidden": effect, "amount": 0.0, "duration_s": duration}
    record.update(sensors=asdict(options), wrong=wrong, flights={})
    erring = hidden.random_of(seed, case, 8)
    kinds = erring.choice(errors[0], min(errors[1], len(errors[0])), replace=False) if errors[1] else ()
    wrongly = installed.drawn([str(k) for k in kinds], erring)
    gust = wrongly.get("gusts", {}).get("size", 0.0)
    if wrongly:
        record["installed"] = wrongly
    low, high = strengths
    strength = low * (high / low) ** hidden.random_of(seed, case, 11).random() if low < high else low
    if effect in DRAWN:
        formula, flights, lost = flown_with_formula(fly, DRAWN[effect], case, seed, duration, strength)
        record.update(hidden=formula.text(), amount=formula.amount, formula=formula.record(), strength=strength)
        record["not_flown"] = lost
        effect = None
    else:
        if effect:
            record["amount"] = hidden.amplitude(effect, kind.split("-")[0], hidden.random_of(seed, case, 3), strength)
            record["strength"] = strength
        flights = flown(fly, case, seed, effect, record["amount"], duration, gust)
    for flight, (rows, commands, drawn) in flights.items():
        random = hidden.random_of(seed, case, *flight.encode(), 4)
        rows = installed.seen(rows, step, wrongly)
        names, table, errors = sensors.log(rows, step, commands, manoeuvres.SETTLE, options, random)
        table = installed.frozen(names, table, wrongly, hidden.random_of(seed, case, *flight.encode(), 9))
        sensors.write(folder / f"{flight}.csv", names, table)
        record["flights"][flight] = {**drawn, "errors": errors}
    parts = model_file.coefficients(effect, hidden.random_of(seed, case, 5), wrong)
    (folder / "model.toml").write_text(model_file.text(case, parts))
    shutil.copyfile(AIRFRAME, folder / "airframe.toml")
    (folder / "truth.json").write_text(json.dumps(record, indent=1) + "\n")


def chosen(text):
    """The effects of `--effects`."""
    ids = list(hidden.AMPLITUDES) if text == "all" else [x for x in text.split(",") if x]
    unknown = [x for x in ids if x not in hidden.AMPLITUDES]
    if unknown:
        sys.exit(f"--effects: {', '.join(unknown)} cannot be hidden; those that can are {', '.join(hidden.AMPLITUDES)}")
    return ids


def kinds_of_errors(text, truth):
    """The errors of `--errors` that a truth can have, in the order of `installed.KINDS`."""
    asked = [x for x in text.split(",") if x] or installed.KINDS
    unknown = [x for x in asked if x not in installed.KINDS]
    if unknown:
        sys.exit(f"--errors: no error {', '.join(unknown)}; there are {', '.join(installed.KINDS)}")
    kinds = [k for k in installed.KINDS if k in asked and (k != "gusts" or truth != "continuous")]
    return kinds or sys.exit("--errors: only the official truths fly through gusts")


def beside_errors(count, truth, seed, text):
    """`count` cases, each with an effect drawn from those of `--effects`."""
    effects = [x for x in chosen(text) if text != "all" or x not in hidden.BY_NAME]
    if count and not effects:
        sys.exit("--both: name effects from which one is drawn for each case")
    cases = [f"{truth}-both-{k:02}" for k in range(count)]
    return [(case, str(hidden.random_of(seed, case, 10).choice(effects))) for case in cases]


def pairs(text):
    """`group=rate,...` as a table."""
    return {k: float(v) for k, v in (pair.split("=") for pair in text.split(",") if pair)}


def range_of(text):
    """`FACTOR` or `LOW..HIGH`."""
    low, _, high = text.partition("..")
    return float(low), float(high or low)


def arguments():
    """The command line."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--truth", choices=("continuous", "official", "official-adams"), required=True)
    p.add_argument("--seed", type=int, required=True)
    p.add_argument("--effects", help="'all', or ids with commas between; '' for none; all if no formulas are asked for")
    p.add_argument("--formulas", type=int, default=0, help="cases that hide a formula; of the continuous truth alone")
    p.add_argument("--lagged", type=int, default=0, help="cases that hide a control through a lag; of the same")
    p.add_argument("--strength", type=range_of, default=(1.0, 1.0), help="factor on the amounts; LOW..HIGH: drawn for each case, log-uniformly")
    p.add_argument("--nulls", type=int, default=0, help="cases without a hidden effect")
    p.add_argument("--rate", type=float, default=100.0, help="samples a second of the logs")
    p.add_argument("--noise", type=float, default=1.0, help="factor on the sensors' noise and biases")
    p.add_argument("--skew", type=float, default=0.01, help="most that a sensor group is late, s; 0 for one clock")
    p.add_argument("--wrong", type=float, default=model_file.WRONG, help="standard deviation of coefficients' errors")
    p.add_argument("--quantised", action="store_true", help="whole counts of each sensor")
    p.add_argument("--held", default="", help="slower sensors, held in between: airspeed=25,velocity=10")
    p.add_argument("--missing", default="", help="sensor groups that are not logged: vanes,actuators")
    p.add_argument("--drift", type=float, default=0.0, help="drift of the gyros' biases, rad/s²; warm: 1.5e-5")
    p.add_argument("--installed", type=int, default=0, help="errors of installation drawn for each case")
    p.add_argument("--errors", default="", help="errors from which they are drawn, with commas between; all without")
    p.add_argument("--both", type=int, default=0, help="cases with one drawn effect of --effects and errors of --installed at once")
    p.add_argument("--duration", type=float, default=manoeuvres.FLIGHT, help="length of each flight, s")
    p.add_argument("--out", type=Path, required=True, help="folder of the cases; each must be new")
    return p.parse_args()


def main():
    """Makes the cases of the command line."""
    a = arguments()
    missing = [x for x in a.missing.split(",") if x]
    options = sensors.Options(a.rate, a.noise, a.skew, a.quantised, pairs(a.held), missing, a.drift)
    unknown = [x for x in (*missing, *options.held) if x not in sensors.GROUPS]
    if unknown:
        sys.exit(f"no sensor group {', '.join(unknown)}; there are {', '.join(sensors.GROUPS)}")
    if (a.formulas or a.lagged) and a.truth != "continuous":
        sys.exit("--formulas, --lagged: only the continuous truth can hide formulas")
    if a.installed and (a.formulas or a.lagged):
        sys.exit("--installed: not beside formulas")
    if a.both and not a.installed:
        sys.exit("--both: say with --installed how many errors each case has")
    errors = (kinds_of_errors(a.errors, a.truth), a.installed)
    effects = a.effects if a.effects is not None else "" if a.formulas or a.lagged else "all"
    if effects == "all" and a.strength != (1.0, 1.0):
        effects = ",".join(x for x in hidden.AMPLITUDES if x not in hidden.THRESHOLDS)
    cases = [(f"{a.truth}-null-{k:02}", None) for k in range(a.nulls)]
    cases += beside_errors(a.both, a.truth, a.seed, effects) if a.both else [(f"{a.truth}-{e}", e) for e in chosen(effects)]
    cases += [(f"{a.truth}-formula-{k:02}", FORMULA) for k in range(a.formulas)]
    cases += [(f"{a.truth}-lagged-{k:02}", LAGGED) for k in range(a.lagged)]
    for case, effect in cases:
        make_case(a.out, a.truth, case, a.seed, effect, options, a.duration, a.wrong, a.strength, errors)
        print(a.out / case, flush=True)


if __name__ == "__main__":
    main()
