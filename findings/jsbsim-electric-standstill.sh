#!/usr/bin/env bash
# JSBSim 1.3.3: an electric engine that is set running in flight leaves its propeller at rest (a piston engine's turns at once), and is a source of constant power: torque = P / max(speed, 1 rad/s).
# The first frame of open throttle adds P dt / J to the speed: 250 W on a 12-inch propeller make 153,000 rpm at the default 120 Hz, where 8,000 are right, and in the next frames
# a thrust of hundreds of times the weight. Frames of 0.1 ms end at the right speed without that. So a flight should begin with a propeller that turns.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install jsbsim==1.3.3
"$folder/v/bin/python" - "$folder" <<'PYTHON' 2>/dev/null
import math, sys
from pathlib import Path
import jsbsim

root = Path(sys.argv[1]) / "tree"
(root / "aircraft" / "toy").mkdir(parents=True)
(root / "engine").mkdir()
POWER_W, INERTIA = 500.0, 1.3e-4
(root / "engine" / "motor.xml").write_text(f'<electric_engine name="motor"><power unit="WATTS">{POWER_W}</power></electric_engine>')
(root / "engine" / "prop.xml").write_text(f"""<propeller name="prop"><ixx unit="KG*M2">{INERTIA}</ixx><diameter unit="IN">12</diameter><numblades>2</numblades>
<table name="C_THRUST" type="internal"><tableData>0 0.11
0.4 0.07
0.8 0.0
1.0 -0.04</tableData></table>
<table name="C_POWER" type="internal"><tableData>0 0.045
0.4 0.04
0.8 0.01
1.0 -0.01</tableData></table></propeller>""")
(root / "aircraft" / "toy" / "toy.xml").write_text("""<fdm_config name="toy" version="2.0"><metrics><wingarea unit="M2">0.4</wingarea><wingspan unit="M">1.5</wingspan><chord unit="M">0.27</chord>
<location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location></metrics>
<mass_balance><ixx unit="KG*M2">0.1</ixx><iyy unit="KG*M2">0.1</iyy><izz unit="KG*M2">0.2</izz><emptywt unit="KG">2</emptywt><location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<propulsion><engine file="motor"><thruster file="prop"><location unit="M"><x>-0.2</x><y>0</y><z>0</z></location><sense>1</sense></thruster></engine></propulsion>
<ground_reactions><contact type="STRUCTURE" name="belly"><location unit="M"><x>0</x><y>0</y><z>-0.1</z></location><static_friction>0.5</static_friction><dynamic_friction>0.4</dynamic_friction>
<spring_coeff unit="N/M">500</spring_coeff><damping_coeff unit="N/M/SEC">50</damping_coeff></contact></ground_reactions>
<flight_control name="none"><channel name="throttle"><pure_gain name="fcs/throttle-pos-norm-0"><input>fcs/throttle-cmd-norm</input><gain>1</gain><output>fcs/throttle-pos-norm</output></pure_gain></channel></flight_control>
<aerodynamics><axis name="DRAG"><function name="aero/drag"><product><property>aero/qbar-area</property><value>0.05</value></product></function></axis></aerodynamics></fdm_config>""")

def flown(dt, seconds):
    """Propeller speed after starting, after the first frame of half throttle, and at the end; largest thrust by the weight."""
    f = jsbsim.FGFDMExec(str(root))
    f.set_debug_level(0)
    f.load_model("toy")
    f.set_dt(dt)
    f["ic/h-sl-ft"], f["ic/u-fps"] = 3000, 17 / 0.3048
    f.run_ic()
    f["propulsion/set-running"] = -1
    f.run()
    started = f["propulsion/engine/propeller-rpm"]
    f["fcs/throttle-cmd-norm"] = 0.5
    first = most = 0.0
    for _ in range(round(seconds / dt)):
        f.run()
        first = first or f["propulsion/engine/propeller-rpm"]
        most = max(most, f["propulsion/engine/thrust-lbs"] / f["inertia/weight-lbs"])
    return started, first, f["propulsion/engine/propeller-rpm"], most

print("JSBSim", jsbsim.FGFDMExec(None).get_version())
usual, fine, later = flown(1 / 120, 0.2), flown(1e-4, 0.2), flown(1e-4, 2.0)
for name, (started, first, last, most) in (("120 Hz, 0.2 s", usual), ("10 kHz, 0.2 s", fine), ("10 kHz, 2 s", later)):
    print(f"{name}: started {started:.0f} rpm, first frame of half throttle {first:.0f} rpm, end {last:.0f} rpm, thrust at most {most:.2f} times the weight")
expected = 0.5 * POWER_W / INERTIA / 120 * 30 / math.pi
print(f"P dt / J at 120 Hz: {expected:.0f} rpm")
f = jsbsim.FGFDMExec(None)
f.set_debug_level(0)
f.load_model("c172p")
f["ic/h-sl-ft"], f["ic/vc-kts"] = 3000, 100
f.run_ic()
f["propulsion/set-running"] = -1
f.run()
print(f"piston engine of c172p, set running in flight: {f['propulsion/engine/propeller-rpm']:.0f} rpm")
assert usual[0] < 1 and abs(usual[1] / expected - 1) < 0.05 and usual[3] > 50
assert fine[1] < 2500 and fine[3] < 2 and 7000 < later[2] < 9500
assert f["propulsion/engine/propeller-rpm"] > 300
PYTHON
