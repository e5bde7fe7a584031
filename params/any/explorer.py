"""`any` as the explorer of an aircraft without a model: what its test flights tell of the coefficients, beside those of an LQI on the exact model.

    python params/any/explorer.py --greylag target/release/greylag --seeds 129001 129002 129003 > results/any-explorer.txt

Each seed draws schedules, wind and sensors' errors of three training and two test flights of 50 s in JSBSim (`greylag mystery`). Both controllers fly the
same schedules. The same wrong model is fitted to the training flights of either (`amend --tune-only`). Printed are the ratio of the widths of the 95 %
intervals, coefficient by coefficient, and the error of both fits over 5 s on the LQI's test flights. `from-log` fits from mass, span and area alone.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

FLOWN = ("any", "lqi")
MEASURES = ("--mass-kg", "3.364", "--span-m", "2.1", "--area-m2", "0.75")
"""What a user knows of the X8 without a model."""


def run(command, allowed=(0, 3)):
    """Runs `command`; an error names it."""
    done = subprocess.run([str(x) for x in command], capture_output=True, text=True)
    if done.returncode not in allowed:
        sys.exit(f"{' '.join(str(x) for x in command)}: {done.stderr.strip()}")


def widths(amended):
    """The width of the 95 % interval of each coefficient; none for one at a bound."""
    parameters = json.loads((amended / "amend.json").read_text())["parameters"]
    ends = {p["name"]: p["ci95"] for p in parameters}
    return {name: e[1] - e[0] for name, e in ends.items() if None not in e and e[1] > e[0]}


def error(greylag, model, logs, out):
    """Error of `model` over 5 s, all states over their characteristic values."""
    run([greylag, "compare", "--model", model, "--log", *logs, "--json", out, "--force"])
    scores = json.loads(out.read_text())["models"][0]["free_run"]
    return next(s["rmse_scaled"] for s in scores if s["horizon_s"] == 5.0)


def explored(greylag, seed, folder):
    """Widths by controller, errors by controller, error from mass, span and area."""
    found, errors = {}, {}
    for controller in FLOWN:
        made, fitted = folder / controller, folder / f"fit-{controller}"
        run([greylag, "mystery", "--seed", seed, "--effect", "propwash", "--amplitude", "0", "--controller", controller, "--out", made])
        logs = sorted(made.glob("train-*.csv"))
        run([greylag, "amend", "--tune-only", "--accept-anyway", "--model", made / "model.toml", "--log", *logs,
             "--hold-out", *sorted(made.glob("test-*.csv")), "--out", fitted])  # fmt: skip
        found[controller] = widths(fitted)
    tests = sorted((folder / "lqi").glob("test-*.csv"))
    models = {"as given": folder / "lqi" / "model.toml", **{c: folder / f"fit-{c}" / "model.toml" for c in FLOWN}}
    own = folder / "own"
    run([greylag, "aircraft", "from-log", own, *MEASURES, "--log", *sorted((folder / "any").glob("train-*.csv"))])
    models |= {"estimated from size": own / "prior" / "model.toml", "from-log": own / "model.toml"}
    for name, model in models.items():
        errors[name] = error(greylag, model, tests, folder / "compared.json")
    return found, errors


def main():
    """Prints both tables."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--greylag", required=True)
    p.add_argument("--seeds", nargs="+", required=True)
    a = p.parse_args()
    ratios, errors = {}, {}
    for seed in a.seeds:
        with tempfile.TemporaryDirectory() as folder:
            found, of = explored(a.greylag, seed, Path(folder))
        for name in found["any"].keys() & found["lqi"].keys():
            ratios.setdefault(name, []).append(found["any"][name] / found["lqi"][name])
        for name, value in of.items():
            errors.setdefault(name, []).append(value)
        print(f"# seed {seed}: " + ", ".join(f"{name} {value:.5f}" for name, value in of.items()), flush=True)
    print(f"# python params/any/explorer.py --seeds {' '.join(a.seeds)}")
    print(f"{'coefficient':<28}{'interval, any by LQI':>22}")
    for name, own in sorted(ratios.items()):
        print(f"{name:<28}{statistics.median(own):>22.2f}")
    print(f"{'median':<28}{statistics.median(statistics.median(own) for own in ratios.values()):>22.2f}")
    print(f"{'error over 5 s on test flights':<34}{'median':>10}")
    for name, own in errors.items():
        print(f"{name:<34}{statistics.median(own):>10.5f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
