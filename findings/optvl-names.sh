#!/usr/bin/env bash
# OptVL 2.5.0 is AVL in Python, and writes none of AVL's names: a prime means stability axes, controls are by a degree beside angles by a radian,
# and get_control_stab_derivs() holds the same moment about both axes under names that differ by an apostrophe.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install optvl==2.5.0
cat > "$folder/wing.avl" <<'AVL'
wing
0.0
0 0 0.0
0.45 0.25 1.8
0.08 0.0 0.0
SURFACE
Wing
8 1.0 20 1.0
YDUPLICATE
0.0
SECTION
0.0 0.0 0.0 0.25 0.0 0 0
CONTROL
aileron 1.0 0.75 0 0 0 -1.0
SECTION
0.0 0.9 0.1 0.25 0.0 0 0
CONTROL
aileron 1.0 0.75 0 0 0 -1.0
AVL
cd "$folder" && v/bin/python - <<'PYTHON' 2>/dev/null | tail -n 6
from importlib.metadata import version
from math import cos, isclose, radians, sin
from optvl import OVLSolver
print("OptVL", version("optvl"))
s = OVLSolver(geo_file="wing.avl")
s.set_variable("alpha", 8.0)
s.execute_run()
stability, controls, body = s.get_stab_derivs(), s.get_control_stab_derivs(), s.get_body_axis_derivs()
assert "CLa" not in stability and "Clp" not in stability
print("dCl'/dp'", stability["dCl'/dp'"], "dCl/dp", body["dCl/dp"])
both = controls["dCl'/daileron"], controls["dCn'/daileron"], controls["dCl/daileron"]
print("dCl'/daileron, dCn'/daileron, dCl/daileron", *both)
assert isclose(both[0] * cos(radians(8)) - both[1] * sin(radians(8)), both[2], rel_tol=1e-6)
assert not isclose(both[0], both[2], rel_tol=1e-3)
# a full radian of aileron would roll by more than one of p: these are degrees
assert abs(controls["dCl/daileron"]) < 0.02 < abs(body["dCl/dp"])
print("controls are by a degree")
PYTHON
test "${PIPESTATUS[0]}" -eq 0
