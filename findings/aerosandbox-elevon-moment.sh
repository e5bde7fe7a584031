#!/usr/bin/env bash
# AeroSandbox 4.2.10: an elevon changes the lift but not the section's pitching moment, so that a straight flying wing has next to no pitch control: a thirtieth of AVL's in AeroBuildup, a seventh in LiftingLine, and one
# that turns its sign with the direction of the deflection. A swept one whose elevons run along the span pitches up in AeroBuildup when they go down. With elevons on the outer half the sign is right, and the value 1.4 and
# 0.9 times AVL's: too much lift and no moment make up for each other.
# A flap is handed to NeuralFoil as a change of the angle of attack. The same flap, cut into the airfoil with the package's own add_control_surface(), has the moment of thin-airfoil theory in the same NeuralFoil.
# Why it matters: C_m by elevon of a flying wing is the first number that a prior for its identification, and a gain, is taken from.
# Documentation: `control_surfaces` of get_aero_from_neuralfoil() are "Control surfaces to apply to the airfoil before analysis"; only the source names the angle of attack. An open issue (170) reports a section's moment.
# Instead: AVL, or airplanes whose airfoils are cut with add_control_surface() up and down, and their difference.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install AeroSandbox==4.2.10 NeuralFoil==0.3.3 optvl==2.5.0 numpy==2.2.6
cd "$folder"
v/bin/python - <<'PYTHON' 2>/dev/null | grep '^[A-Z].*:\|^AeroSandbox'
from importlib.metadata import version
from pathlib import Path

import aerosandbox as asb
import numpy as np
from optvl import OVLSolver

SPAN, CHORD, HINGE, STEP = 2.0, 0.25, 0.7, 5.0
number = lambda x: float(np.ravel(x)[0])
foil, flow = asb.Airfoil("naca0010"), dict(alpha=2.0, Re=3e5)
print("AeroSandbox", version("AeroSandbox"), "NeuralFoil", version("NeuralFoil"), "OptVL (AVL)", version("optvl"), "- flap of 30 % chord, by a degree of deflection")

def section(cut):
    """Slopes of lift and of moment about the quarter chord of the airfoil."""
    def at(deflection):
        if cut:
            return foil.add_control_surface(deflection=deflection, hinge_point_x=HINGE).get_aero_from_neuralfoil(**flow)
        return foil.get_aero_from_neuralfoil(**flow, control_surfaces=[asb.ControlSurface(hinge_point=HINGE, deflection=deflection)])
    down, up = at(STEP), at(-STEP)
    return [(number(down[k]) - number(up[k])) / (2 * STEP) for k in ("CL", "CM")]

hinge = np.arccos(1 - 2 * HINGE)
thin = -0.5 * np.sin(hinge) * (1 - np.cos(hinge)) * np.pi / 180
given, cut = section(False), section(True)
print(f"Section: control_surfaces: lift {given[0]:.4f}, moment {given[1]:.4f}; flap cut into the outline: lift {cut[0]:.4f}, moment {cut[1]:.4f}; thin-airfoil theory: moment {thin:.4f}")
assert 0.85 < given[0] / cut[0] < 1.15 and abs(given[1]) < 0.15 * abs(thin) and 0.8 < cut[1] / thin < 1.2

def stations(sweep, inner):
    """Places of the sections along the half span, and whether the elevon begins there."""
    return [(0.0, inner == 0)] + [(inner, True)] * (inner > 0) + [(1.0, inner == 0)]

def wing(sweep, inner, method, alpha, deflection):
    """Lift and moment about the quarter chord at half of the half span."""
    control = [asb.ControlSurface(name="elevon", hinge_point=HINGE)]
    rows = [asb.WingXSec([sweep * y, y * SPAN / 2, 0], CHORD, 0, foil, control_surfaces=control if elevon else []) for y, elevon in stations(sweep, inner)]
    plane = asb.Airplane(xyz_ref=[CHORD / 4 + sweep / 2, 0, 0], s_ref=SPAN * CHORD, c_ref=CHORD, b_ref=SPAN, wings=[asb.Wing(symmetric=True, xsecs=rows)])
    found = method(plane.with_control_deflections({"elevon": deflection}), asb.OperatingPoint(velocity=15, alpha=alpha)).run()
    return np.array([number(found["CL"]), number(found["Cm"])])

def avl(sweep, inner):
    """Slopes by a degree: lift and moment by the elevon, lift by the angle of attack."""
    elevon = f"CONTROL\nelevon 1.0 {HINGE} 0 0 0 1.0\n"
    sections = "".join(f"SECTION\n{sweep * y} {y * SPAN / 2} 0.0 {CHORD} 0.0 0 0\nNACA\n0010\n{elevon if begins or y == 1 else ''}" for y, begins in stations(sweep, inner))
    Path("wing.avl").write_text(f"wing\n0.0\n0 0 0.0\n{SPAN * CHORD} {CHORD} {SPAN}\n{CHORD / 4 + sweep / 2} 0.0 0.0\nSURFACE\nWing\n10 1.0 24 1.0\nYDUPLICATE\n0.0\n{sections}")
    s = OVLSolver(geo_file="wing.avl")
    s.set_variable("alpha", flow["alpha"])
    s.execute_run()
    slopes, total = s.get_control_stab_derivs(), s.get_stab_derivs()
    return np.array([slopes["dCL/delevon"], slopes["dCm/delevon"], np.radians(total["dCL/dalpha"])])

def cut_wing(method, deflection):
    bent = foil.add_control_surface(deflection=deflection, hinge_point_x=HINGE)
    plane = asb.Airplane(xyz_ref=[CHORD / 4, 0, 0], s_ref=SPAN * CHORD, c_ref=CHORD, b_ref=SPAN, wings=[asb.Wing(symmetric=True, xsecs=[
        asb.WingXSec([0, 0, 0], CHORD, 0, bent), asb.WingXSec([0, SPAN / 2, 0], CHORD, 0, bent)])])
    return number(method(plane, asb.OperatingPoint(velocity=15, alpha=flow["alpha"])).run()["Cm"])

ratios = {}
for name, sweep, inner in (("straight, elevon along the span", 0.0, 0.0), ("swept, elevon along the span", 0.4, 0.0), ("swept, elevon on the outer half", 0.4, 0.5)):
    right = avl(sweep, inner)
    print(f"Wing: {name}: AVL: lift {right[0]:.4f}, moment {right[1]:.4f}")
    for method in (asb.AeroBuildup, asb.LiftingLine):
        up, level, down = (wing(sweep, inner, method, flow["alpha"], d) for d in (-STEP, 0.0, STEP))
        lift = (wing(sweep, inner, method, flow["alpha"] + 1, 0.0)[0] - wing(sweep, inner, method, flow["alpha"] - 1, 0.0)[0]) / 2
        slopes = (down - up) / (2 * STEP)
        ratios[name, method.__name__] = slopes[1] / right[1]
        print(f"Wing: {name}: {method.__name__:12} lift {slopes[0]:.4f}, moment {slopes[1]:.4f} (up {(level - up)[1] / STEP:.4f}, down {(down - level)[1] / STEP:.4f}); lift by angle of attack, to AVL's {lift / right[2]:.2f}")
print("Ratios: moment to AVL's:", {f"{name}, {method}": round(float(r), 2) for (name, method), r in ratios.items()})
cut = [(cut_wing(method, STEP) - cut_wing(method, -STEP)) / (2 * STEP) / avl(0.0, 0.0)[1] for method in (asb.AeroBuildup, asb.LiftingLine)]
print(f"Ratios: straight, with the elevon cut into the airfoil: AeroBuildup {cut[0]:.2f}, LiftingLine {cut[1]:.2f}")
straight, along, outer = ([ratios[name, method] for method in ("AeroBuildup", "LiftingLine")] for name in dict.fromkeys(name for name, _ in ratios))
assert max(map(abs, straight)) < 0.25 and along[0] < -0.3 and abs(along[1]) < 0.3 and all(0.7 < r < 1.6 for r in outer)
assert all(0.8 < r < 1.35 for r in cut)
PYTHON
