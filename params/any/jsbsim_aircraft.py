"""Flies `any`, `adaptive` and an LQI on JSBSim's own aircraft in JSBSim: 12 steps of 5 s between random attitudes, wind of 3 m/s, light turbulence.

    python params/any/jsbsim_aircraft.py --greylag target/release/greylag --aircraft .../site-packages/jsbsim/aircraft > results/any-jsbsim.txt

The aircraft and their airspeeds are those that import (results/aircraft-that-import.txt): none of them was looked at when the distribution was made. The LQI is
designed from the imported model; the others read its cruise airspeed and whether there is a rudder. Lost is what `evaluate` calls diverged.
"""

import argparse
import json
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

CONTROLLERS = ["lqi", "adaptive", "any"]


def flown(greylag, folder, name, airspeed):
    """Settled error (median, degrees) and share of steps that are lost, by controller; the reason if there is none."""
    with tempfile.TemporaryDirectory() as out:
        made, scores = Path(out) / "made", Path(out) / "scores.json"
        start = ["--aircraft-dir", folder, "--aircraft", name, "--start-altitude-m", "1000", "--start-airspeed-mps", airspeed]
        air = ["--wind-ned-mps", "3,0,0", "--turbulence-severity", "3", "--no-targets", "--steps", "12", "--json", scores]
        for command in (["aircraft", "import", "jsbsim", folder, name, "--cruise-mps", airspeed, "--altitude-m", "1000", "--out", made],
                        ["evaluate", *start, *air, "--model", made / "model.toml", "--controller", *CONTROLLERS]):
            run = subprocess.run([greylag, *map(str, command)], capture_output=True, text=True)
            if not (scores.exists() or (made / "model.toml").exists()):
                return (run.stderr.strip().splitlines() or ["?"])[-1]
        if not scores.exists():
            return (run.stderr.strip().splitlines() or ["?"])[-1]
        steps = [c["groups"][0] for c in json.loads(scores.read_text())["controllers"]]
        return [(g["median_deg"], g["divergence_rate"]) for g in steps]


def main():
    a = argparse.ArgumentParser()
    a.add_argument("--greylag", default="target/release/greylag")
    a.add_argument("--aircraft", required=True)
    a.add_argument("--known", default="results/aircraft-that-import.txt")
    a = a.parse_args()
    known = re.findall(r"^(\S+) +imported at (\d+) m/s", Path(a.known).read_text(), re.M)
    print("# python params/any/jsbsim_aircraft.py; settled error in degrees, median of 12 steps, and steps lost, in JSBSim")
    print(f"{'aircraft':<18}{'m/s':>5}" + "".join(f"{c:>22}" for c in CONTROLLERS), flush=True)
    all_of = {c: [] for c in CONTROLLERS}
    for name, airspeed in known:
        found = flown(a.greylag, a.aircraft, name, airspeed)
        if isinstance(found, str):
            print(f"{name:<18}{airspeed:>5}  not flown: {found}", flush=True)
            continue
        for controller, own in zip(CONTROLLERS, found):
            all_of[controller].append(own)
        print(f"{name:<18}{airspeed:>5}" + "".join(f"{e if e is not None else float('nan'):>14.2f}, {12 * d:>2.0f} lost" for e, d in found), flush=True)
    for controller, own in all_of.items():
        kept = [e for e, d in own if d == 0]
        print(f"{controller}: {len(kept)} of {len(own)} aircraft without a loss, settled {statistics.median(kept):.2f} deg in the median of these", flush=True)
    return 0 if known else "no aircraft in " + a.known


if __name__ == "__main__":
    sys.exit(main())
