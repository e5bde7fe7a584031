#!/usr/bin/env bash
# JSBSim 1.3.3: FGLinearization lists the propeller's speed among the states of a Cessna and gives its units, but that state moves nothing and nothing moves it: full throttle accelerates the propeller by 1.5 rpm/s
# (in flight by 900 in the first half second), and the throttle pushes the aircraft at once, where in flight the thrust comes about a second later. The elevator's response, from the same matrices, is right to one percent.
# Before each difference the engine is brought to its steady state for the throttle of that moment, so the engine's inertia and the effect of its speed on thrust are gone.
# Why it matters: a speed hold designed on these matrices sees a delay of a second less than it will fly with, and a fit of the engine that begins at these numbers begins in the wrong model.
# The documentation of the class is one sentence and mentions no engine; the names of the states and their units say the opposite. Instead: strike out the state, and put the lag of the engine, measured by a
# step of the throttle in the simulation, before the input.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install jsbsim==1.3.3 numpy==2.2.6 scipy==1.15.3
"$folder/v/bin/python" - <<'PYTHON' 2>/dev/null | grep '^JSBSim 1\|^full\|^A \|^after'
import jsbsim
import numpy as np
from scipy.signal import lsim

HZ, SPEED, PITCH, PROPELLER = 120, "velocities/vt-fps", "velocities/q-rad_sec", "propulsion/engine/propeller-rpm"

def trimmed():
    f = jsbsim.FGFDMExec(None)
    f.set_debug_level(0)
    f.load_model("c172p")
    f.set_dt(1 / HZ)
    f["ic/h-sl-ft"], f["ic/vc-kts"], f["ic/gamma-deg"] = 4000, 100, 0
    f.run_ic()
    f["propulsion/set-running"] = -1
    f.do_trim(1)
    return f

def flown(control, step, seconds=4):
    """Airspeed, propeller speed and pitch rate in each frame after a step of a control."""
    f = trimmed()
    f[control] += step
    rows = []
    for _ in range(seconds * HZ):
        rows.append([f[SPEED], f[PROPELLER], f[PITCH]])
        f.run()
    return np.array(rows)

linear = jsbsim.FGLinearization(trimmed())
A, B, states, controls = np.array(linear.system_matrix), np.array(linear.input_matrix), linear.x_names, linear.u_names
rows = [states.index(name) for name in ("Vt", "Rpm0", "Q")]

def predicted(control, step, seconds=4):
    n = seconds * HZ
    u = np.zeros((n, len(controls)))
    u[:, controls.index(control)] = step
    return lsim((A, B, np.eye(len(A)), np.zeros(B.shape)), u, np.arange(n) / HZ)[1][:, rows]

print("JSBSim", trimmed().get_version(), "- Cessna 172P, 100 knots; states", *(f"{n} ({u})" for n, u in zip(states, linear.x_units)))
still = flown("fcs/throttle-cmd-norm", 0)
throttle, throttle_linear = flown("fcs/throttle-cmd-norm", 0.05) - still, predicted("ThtlCmd", 0.05)
elevator, elevator_linear = flown("fcs/elevator-cmd-norm", -0.01) - still, predicted("DeCmd", -0.01)
spin = throttle[HZ // 2, 1] / 0.5 / 0.05
print(f"full throttle: propeller {B[rows[1], 0]:.1f} rpm/s in the matrices, {spin:.0f} rpm/s in the first half second of flight; speed {B[rows[0], 0]:.1f} ft/s2 at once")
print(f"A of airspeed by propeller speed: {abs(A[rows[0], rows[1]]):.1e} ft/s2 by a rev/min")
for seconds in (0.5, 1, 2):
    k = round(seconds * HZ)
    print(f"after {seconds} s, throttle + 0.05: airspeed + {throttle[k, 0]:.3f} ft/s in flight, + {throttle_linear[k, 0]:.3f} in the matrices; propeller + {throttle[k, 1]:.1f} and + {throttle_linear[k, 1]:.1f} rpm; "
          f"elevator - 0.01: pitch rate {elevator[k, 2]:.5f} and {elevator_linear[k, 2]:.5f} rad/s")
half, second = HZ // 2, HZ
assert spin > 900 and 1 < B[rows[1], 0] < 2 and abs(A[rows[0], rows[1]]) < 1e-6
assert throttle_linear[half, 0] / throttle[half, 0] > 12 and throttle_linear[second, 0] / throttle[second, 0] > 4
assert all(abs(elevator_linear[k, 2] / elevator[k, 2] - 1) < 0.1 for k in (half, second, 2 * HZ))
PYTHON
test "${PIPESTATUS[0]}" -eq 0
