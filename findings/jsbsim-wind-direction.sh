#!/usr/bin/env bash
# JSBSim 1.3.3: wind directions are those to which the wind blows, not those from which it comes, as in every weather report: with `ic/vw-dir-deg` = 90 an aircraft on the heading 90 has a tailwind.
# `atmosphere/psiw-rad`, the wind's direction, follows the wind except where its north component is exactly zero: a wind that is set to blow to the east, or to the west, keeps the direction of the wind
# before, and its turbulence, which goes by that direction, is turned.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install jsbsim==1.3.3
"$folder/v/bin/python" - <<'PYTHON' 2>/dev/null | sed "/^ *$/d; /Flight Dynamics Model/d; /JSBSim-ML/d; /startup/d"
import math
import jsbsim

f = jsbsim.FGFDMExec(None)
f.set_debug_level(0)
f.load_model("c172p")
f["ic/h-sl-ft"], f["ic/vc-kts"], f["ic/psi-true-deg"] = 4000, 100, 90
f["ic/vw-mag-fps"], f["ic/vw-dir-deg"] = 20, 90
f.run_ic()
print("JSBSim", f.get_version())
east, along = f["atmosphere/wind-east-fps"], f["velocities/vg-fps"] - f["velocities/vt-fps"]
print(f"ic/vw-dir-deg 90, heading 90: wind to the east {east:.1f} ft/s, ground speed less airspeed {along:.1f} ft/s")
assert abs(east - 20) < 1e-9 and abs(along - 20) < 0.1
read = {}
for north, east in ((-20.0, 0.0), (0.0, 20.0), (1e-9, 20.0), (0.0, -20.0)):
    f["atmosphere/wind-north-fps"], f["atmosphere/wind-east-fps"] = north, east
    f.run()
    read[north, east] = math.degrees(f["atmosphere/psiw-rad"])
    print(f"wind ({north:g}, {east:g}) ft/s north, east: psiw {read[north, east]:.0f} deg, atan2 {math.degrees(math.atan2(east, north)) % 360:.0f} deg")
assert [round(x) for x in read.values()] == [180, 180, 90, 90]

def gust(north):
    """Turbulence (ft/s, north and east) 1 s after a wind to the north turned to (north, 20)."""
    f = jsbsim.FGFDMExec(None)
    f.set_debug_level(0)
    f.load_model("c172p")
    f["ic/h-sl-ft"], f["ic/vc-kts"], f["ic/vw-mag-fps"], f["ic/vw-dir-deg"] = 1000, 100, 20, 0
    f.run_ic()
    f["atmosphere/wind-north-fps"], f["atmosphere/wind-east-fps"] = north, 20
    f["atmosphere/randomseed"], f["atmosphere/turb-type"] = 3, 3
    f["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"], f["atmosphere/turbulence/milspec/severity"] = 50, 5
    for _ in range(120):
        f.run()
    return f["atmosphere/total-wind-north-fps"] - north, f["atmosphere/total-wind-east-fps"] - 20

exact, nearly = gust(0.0), gust(1e-9)
print(f"turbulence of one seed, wind (0, 20): {exact[0]:.2f}, {exact[1]:.2f} ft/s; wind (1e-09, 20): {nearly[0]:.2f}, {nearly[1]:.2f} ft/s")
assert abs(exact[0] + nearly[1]) < 0.05 and abs(exact[1] - nearly[0]) < 0.05 < abs(nearly[0])
PYTHON
