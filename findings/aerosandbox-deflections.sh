#!/usr/bin/env bash
# AeroSandbox 4.2.10: one elevator, three methods, three answers. The vortex lattice ignores deflected surfaces without a word; AeroBuildup's
# surface does twice what the lifting line's does; the lifting line has no damping in roll.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install AeroSandbox==4.2.10 numpy
"$folder/v/bin/python" - <<'PYTHON'
import aerosandbox as asb, numpy as np
print("AeroSandbox", asb.__version__)
foil = asb.Airfoil("naca0010")
flap = [asb.ControlSurface(name="elevator", hinge_point=0.6)]
wing = asb.Wing(symmetric=True, xsecs=[asb.WingXSec([0, 0, 0], 0.25, 0, foil), asb.WingXSec([0, 0.9, 0], 0.25, 0, foil)])
tail = asb.Wing(symmetric=True, xsecs=[asb.WingXSec([0.8, 0, 0], 0.16, 0, foil, control_surfaces=flap), asb.WingXSec([0.8, 0.3, 0], 0.16, 0, foil)])
plane = asb.Airplane(xyz_ref=[0.08, 0, 0], s_ref=0.45, c_ref=0.25, b_ref=1.8, wings=[wing, tail])
op = asb.OperatingPoint(velocity=15, alpha=2)
first = lambda x: float(np.ravel(x)[0])
found = {}
for method in (asb.VortexLatticeMethod, asb.LiftingLine, asb.AeroBuildup):
    run = lambda p: first(method(p, op).run()["Cm"])
    slope = run(plane.with_control_deflections({"elevator": 1.0})) - run(plane)
    roll = first(method(plane, op).run_with_stability_derivatives()["Clp"])
    found[method.__name__] = slope, roll
    print(f"{method.__name__:20} Cm by a degree of elevator {slope:9.5f}   Clp {roll:8.4f}")
assert found["VortexLatticeMethod"][0] == 0.0
assert 1.7 < found["AeroBuildup"][0] / found["LiftingLine"][0] < 3.0
assert abs(found["LiftingLine"][1]) < 0.01 < 0.3 < abs(found["VortexLatticeMethod"][1])
PYTHON
