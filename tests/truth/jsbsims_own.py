"""Aircraft that JSBSim's authors wrote: what a model without some effects lacks, as `diagnose` finds it in noisy logs.

    python tests/truth/jsbsims_own.py PROGRAM TREE/aircraft OUT --seeds 1 2 3 c172p:45 pa28:52

For each aircraft the program imports a model (central differences on the simulator's loads), the effects of EFFECTS are
taken out of it, JSBSim's aircraft flies the test flights of `mystery` with nothing hidden, and `diagnose` is asked what the
model lacks. An assertion is right if the effect is in the import; its amount if each 95 % interval, widened by a tenth of the
amount, holds the import's figure. A line of JSON a case goes to OUT/cases.jsonl; cases that are in it are not flown again.
"""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

EFFECTS = [
    "unsteady_lift",
    "tail_slipstream",
    "propeller_gyro",
    "propeller_gyro_throttle",
    "p_factor",
    "thrust_line_sideways",
    "lateral_with_lift",
    "roll_control_alpha",
]
# One body of fact under two names: a momentum that is constant, and one that goes with the throttle. Flights tell their
# shares apart only in part, so either amount is held against the range from its own share to the whole.
SAME = {"propeller_gyro": "propeller_gyro_throttle", "propeller_gyro_throttle": "propeller_gyro"}
ALTITUDE_M = "1000"
WIDENED = 0.1


def run(words):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        raise RuntimeError(f"{' '.join(str(w) for w in words)}: {done.stderr.strip().splitlines()[-1]}")


def sections(text):
    """The model file in pieces, each with the effect it belongs to, or None."""
    found = []
    for piece in re.split(r"(?m)^(?=\[)", text):
        named = re.match(r"\[effects\.(\w+)", piece)
        found.append((named.group(1) if named else None, piece))
    return found


def numbers(piece):
    return {name: float(value) for name, value in re.findall(r"(?m)^(\w+) = \{ value = ([-\d.e]+)", piece)}


def imported(program, tree, out, aircraft, cruise):
    """The folder of the import, and what it has of EFFECTS."""
    folder = out / aircraft
    if not (folder / "plain.toml").exists():
        run([program, "aircraft", "import", "jsbsim", tree, aircraft, "--out", folder, "--cruise-mps", cruise,
             "--altitude-m", ALTITUDE_M])
        pieces = sections((folder / "model.toml").read_text())
        (folder / "plain.toml").write_text("".join(p for effect, p in pieces if effect not in EFFECTS))
    pieces = sections((folder / "model.toml").read_text())
    return folder, {effect: numbers(piece) for effect, piece in pieces if effect in EFFECTS}


def case(program, tree, out, aircraft, cruise, seed):
    folder, truth = imported(program, tree, out, aircraft, cruise)
    flights = out / f"{aircraft}-{seed}"
    if not flights.exists():
        run([program, "mystery", "--seed", seed, "--effect", "thrust_scale", "--amplitude", "0", "--model",
             folder / "model.toml", "--aircraft-dir", tree, "--aircraft", aircraft, "--out", flights])
    answer = out / f"{aircraft}-{seed}.json"
    run([program, "diagnose", "--model", folder / "plain.toml", "--log", *sorted(flights.glob("train-*.csv")),
         "--json", answer, "--force"])
    found = json.loads(answer.read_text())
    return {"aircraft": aircraft, "seed": seed, "verdict": found["verdict"], "truth": truth,
            "asserted": [stated(e) for e in found["effects"] if e["asserted"]],
            "unexplained_percent": unexplained(found)}


def stated(effect):
    return {"id": effect["id"], "amounts": {p["name"]: [p["value"], *p["ci95"]] for p in effect["parameters"]}}


def is_right(asserted, truth):
    return asserted["id"] in truth or SAME.get(asserted["id"]) in truth


def holds(asserted, truth):
    """Whether every parameter's interval, widened, meets what the aircraft has."""
    for name, (_, low, high) in asserted["amounts"].items():
        own = [truth.get(asserted["id"], {}).get(name, 0.0)]
        if asserted["id"] in SAME:
            own.append(sum(truth.get(effect, {}).get(name, 0.0) for effect in SAME))
        slack = WIDENED * max(abs(x) for x in own)
        if low - slack > max(own) or high + slack < min(own):
            return False
    return True


def unexplained(found):
    """Per channel, % of its variation before and after what is asserted."""
    names = ["tuned_unexplained_fraction", "unexplained_fraction"]
    return {c["channel"]: [round(100 * c[name], 3) for name in names] for c in found["channels"]}


def table(cases):
    print("| aircraft | flights | asserted, right | amount within its interval | asserted, wrong | in the aircraft, not asserted |")
    print("|---|---|---|---|---|---|")
    for aircraft in dict.fromkeys(c["aircraft"] for c in cases):
        own = [c for c in cases if c["aircraft"] == aircraft]
        asserted = [(a, c["truth"]) for c in own for a in c["asserted"]]
        right = [(a, truth) for a, truth in asserted if is_right(a, truth)]
        wrong = sorted({a["id"] for a, truth in asserted if not is_right(a, truth)})
        held = sum(holds(a, truth) for a, truth in right)
        count = len(asserted) - len(right)
        named = {a["id"] for a, _ in asserted}
        named |= {SAME[effect] for effect in named if effect in SAME}
        missed = sorted(set(own[0]["truth"]) - named)
        print(f"| {aircraft} | {len(own)} | {len(right)} | {held} | {count} {' '.join(wrong)} | {', '.join(missed)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("tree", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("aircraft", nargs="+", help="NAME:CRUISE, m/s")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    arguments = parser.parse_intermixed_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    record = arguments.out / "cases.jsonl"
    cases = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    done = {(c["aircraft"], c["seed"]) for c in cases}
    for named in arguments.aircraft:
        aircraft, cruise = named.split(":")
        for seed in arguments.seeds:
            if (aircraft, seed) in done:
                continue
            try:
                one = case(arguments.program, arguments.tree, arguments.out, aircraft, cruise, seed)
            except RuntimeError as error:
                print(f"{aircraft} {seed}: {error}", file=sys.stderr)
                continue
            cases.append(one)
            with record.open("a") as file:
                file.write(json.dumps(one) + "\n")
            print(aircraft, seed, one["verdict"], *(a["id"] for a in one["asserted"]), file=sys.stderr)
    table(cases)


if __name__ == "__main__":
    main()
