#!/usr/bin/env bash
# JSBSim 1.3.3: a second run_ic() on one executive is no reset. Control-system components and integrators keep their history: the same commands, flown again for 5 s, move the roll of c172x by 2 degrees.
# reset_to_initial_conditions(0) repeats the Cessnas to the bit, but not F-16 and 747 (roll 6e-8 and 4e-7 rad). Only a new executive repeats all of them.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install jsbsim==1.3.3
cd "$folder"   # some of the aircraft write files
v/bin/python - <<'PYTHON' 2>/dev/null | grep '^JSBSim 1\|executive'
import jsbsim

def begin(f, knots):
    f["ic/h-sl-ft"], f["ic/vc-kts"], f["ic/gamma-deg"] = 8000, knots, 0
    f.run_ic()
    f["propulsion/set-running"] = -1

def new(name, knots):
    f = jsbsim.FGFDMExec(None)
    f.set_debug_level(0)
    f.load_model(name)
    begin(f, knots)
    return f

def flown(f):
    """Roll (rad) in 600 frames: half a second of level flight, then aileron and elevator."""
    rolls = []
    for frame in range(600):
        f["fcs/aileron-cmd-norm"], f["fcs/elevator-cmd-norm"] = (0.2, -0.1) if frame > 60 else (0.0, 0.0)
        f["fcs/throttle-cmd-norm"] = 0.7
        f.run()
        rolls.append(f["attitude/phi-rad"])
    return rolls

print("JSBSim", jsbsim.FGFDMExec(None).get_version(), "- largest difference of the roll from the first flight, rad")
found = {}
for name, knots in (("c172p", 100), ("c172x", 100), ("f16", 350), ("B747", 300)):
    f = new(name, knots)
    first = flown(f)
    off = lambda again: max(abs(a - b) for a, b in zip(first, again))
    f.reset_to_initial_conditions(0)
    f["propulsion/set-running"] = -1
    reset = off(flown(f))
    begin(f, knots)
    found[name] = reset, off(flown(f)), off(flown(new(name, knots)))
    print(f"{name:6} reset_to_initial_conditions(0) {found[name][0]:.1e}, run_ic() {found[name][1]:.1e}, a new executive {found[name][2]:.1e}")
assert all(of_new == 0 and of_ic > 5e-4 for _, of_ic, of_new in found.values()) and found["c172x"][1] > 0.03
assert found["c172p"][0] == found["c172x"][0] == 0 and all(0 < found[k][0] < 1e-4 for k in ("f16", "B747"))
PYTHON
