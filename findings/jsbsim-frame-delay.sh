#!/usr/bin/env bash
# JSBSim 1.3.3: a command set before run() moves the surface in that frame, the pitch rate a frame later, the attitude two frames later. Flown at 100 Hz the attitude
# is late by 12.5 ms, one and a quarter frames, where an explicit Euler step would suggest half a frame: a loop closed over it has that much less delay margin than the same loop at 1 kHz.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install jsbsim==1.3.3
"$folder/v/bin/python" - <<'PYTHON' 2>/dev/null
import jsbsim, math

def flown(dt):
    """Surface, pitch rate and pitch (degrees) in each frame of 0.1 s after a step of the elevator's command."""
    f = jsbsim.FGFDMExec(None)
    f.set_debug_level(0)
    f.load_model("c172p")
    f.set_dt(dt)
    f["ic/h-sl-ft"], f["ic/vc-kts"], f["ic/gamma-deg"] = 4000, 100, 0
    f.run_ic()
    f["propulsion/set-running"] = -1
    f.do_trim(1)
    f["fcs/elevator-cmd-norm"] -= 0.1
    rows = []
    for _ in range(round(0.1 / dt)):
        f.run()
        rows.append([f["fcs/elevator-pos-rad"], math.degrees(f["velocities/q-rad_sec"]), math.degrees(f["attitude/theta-rad"])])
    return rows

print("JSBSim", jsbsim.FGFDMExec(None).get_version())
slow, fast, fine = flown(0.01), flown(0.001), flown(0.0001)
for k in range(3):
    print(f"100 Hz, frame {k + 1}: elevator {slow[k][0]:.5f} rad, pitch rate {slow[k][1]:7.4f} deg/s, pitch {slow[k][2]:.5f} deg")
late = {hz: 1000 * (fine[-1][2] - rows[-1][2]) / rows[-1][1] for hz, rows in ((100, slow), (1000, fast))}
print(f"attitude 0.1 s after the step: late by {late[100]:.1f} ms at 100 Hz, by {late[1000]:.1f} ms at 1 kHz, beside 10 kHz")
assert slow[0][0] == slow[1][0] and abs(slow[0][1]) < 1e-6 < 0.5 < slow[1][1]
assert abs(slow[1][2] - slow[0][2]) < 1e-4 < 5e-3 < slow[2][2] - slow[1][2]
assert 11 < late[100] < 14 and late[1000] < 2
PYTHON
