"""What OptVL 2.5.0 and AeroSandbox 4.2.10 compute of two aircraft, as JSON that `greylag aircraft import derivatives` reads.

    python -m venv v && v/bin/pip install optvl==2.5.0 AeroSandbox==4.2.10
    v/bin/python tests/derivatives/tools.py tests/data/derivatives

The trainer is our own. Areas, spans and arms of the Navion are those of JSBSim's L17.xml; its taper, dihedral, incidences and
the chords of its surfaces are guesses, as a user's would be.
"""

import json
import sys
import tempfile
from math import radians, tan
from pathlib import Path

import aerosandbox as asb
import numpy as np
from optvl import OVLSolver

# lengths in m, angles in degrees, x aft of the wing root's leading edge; surfaces are trailing-edge flaps from a share of the chord on
TRAINER = dict(
    name="trainer", mass=2.4, speed=15.0, alpha=3.0, area=0.45, chord=0.25, span=1.8, cg=0.08, taper=1.0, dihedral=3.0,
    incidence=2.0, airfoil="2412", aileron=(0.55, 0.75),
    tail=dict(x=0.80, z=0.05, span=0.6, root=0.16, tip=0.16, incidence=-1.0, hinge=0.6),
    fin=dict(x=0.76, z=0.05, height=0.22, root=0.22, tip=0.14, sweep=0.08, hinge=0.6))
NAVION = dict(
    name="navion", mass=1247.0, speed=54.0, alpha=1.0, area=17.09, chord=1.737, span=10.186, cg=0.512, taper=0.54, dihedral=7.5,
    incidence=2.0, airfoil="4412", aileron=(0.6, 0.78),
    tail=dict(x=4.55, z=0.6, span=3.5, root=0.90, tip=0.66, incidence=-2.0, hinge=0.62),
    fin=dict(x=4.45, z=0.3, height=1.3, root=1.6, tip=1.0, sweep=0.6, hinge=0.62))


def wing_sections(g):
    """x, y, z, chord of the wing's root, the aileron's inner end and the tip."""
    root = 2 * g["area"] / g["span"] / (1 + g["taper"])
    out = []
    for share in (0.0, g["aileron"][0], 1.0):
        y = share * g["span"] / 2
        chord = root * (1 - share * (1 - g["taper"]))
        out.append((0.25 * (root - chord), y, y * tan(radians(g["dihedral"])), chord))
    return out


def avl(g):
    """The geometry as AVL's file."""
    lines = [g["name"], "0.0", "0 0 0.0", f"{g['area']} {g['chord']} {g['span']}", f"{g['cg']} 0.0 0.0", "0.0"]

    def surface(name, cells, incidence, mirrored):
        lines.extend(["SURFACE", name, cells])
        lines.extend(["YDUPLICATE", "0.0"] if mirrored else [])
        lines.extend(["ANGLE", str(incidence)])

    def section(x, y, z, chord, naca=None, control=None):
        lines.extend(["SECTION", f"{x} {y} {z} {chord} 0.0 0 0"])
        lines.extend(["NACA", naca] if naca else [])
        if control:
            lines.extend(["CONTROL", "{} 1.0 {} 0 0 0 {}".format(*control)])

    surface("Wing", "10 1.0 24 1.0", g["incidence"], True)
    for k, place in enumerate(wing_sections(g)):
        section(*place, g["airfoil"], ("aileron", g["aileron"][1], -1.0) if k else None)
    t, f = g["tail"], g["fin"]
    surface("Tailplane", "8 1.0 12 1.0", t["incidence"], True)
    section(t["x"], 0.0, t["z"], t["root"], None, ("elevator", t["hinge"], 1.0))
    section(t["x"] + 0.25 * (t["root"] - t["tip"]), t["span"] / 2, t["z"], t["tip"], None, ("elevator", t["hinge"], 1.0))
    surface("Fin", "8 1.0 10 1.0", 0.0, False)
    section(f["x"], 0.0, f["z"], f["root"], None, ("rudder", f["hinge"], 1.0))
    section(f["x"] + f["sweep"], 0.0, f["z"] + f["height"], f["tip"], None, ("rudder", f["hinge"], 1.0))
    return "\n".join(lines) + "\n"


def airplane(g):
    """The geometry as AeroSandbox's airplane."""
    flap = lambda name, symmetric, hinge: [asb.ControlSurface(name=name, symmetric=symmetric, hinge_point=hinge)]
    section = lambda x, y, z, chord, twist, foil, flaps=None: asb.WingXSec(
        [x, y, z], chord, twist, foil, control_surfaces=flaps or [])
    curved, flat = asb.Airfoil("naca" + g["airfoil"]), asb.Airfoil("naca0010")
    aileron = flap("aileron", False, g["aileron"][1])
    wing = [section(*p, g["incidence"], curved, aileron if k == 1 else None) for k, p in enumerate(wing_sections(g))]
    t, f = g["tail"], g["fin"]
    tail = [
        section(t["x"], 0.0, t["z"], t["root"], t["incidence"], flat, flap("elevator", True, t["hinge"])),
        section(t["x"] + 0.25 * (t["root"] - t["tip"]), t["span"] / 2, t["z"], t["tip"], t["incidence"], flat)]
    fin = [
        section(f["x"], 0.0, f["z"], f["root"], 0.0, flat, flap("rudder", True, f["hinge"])),
        section(f["x"] + f["sweep"], 0.0, f["z"] + f["height"], f["tip"], 0.0, flat)]
    return asb.Airplane(
        name=g["name"], xyz_ref=[g["cg"], 0, 0], s_ref=g["area"], c_ref=g["chord"], b_ref=g["span"],
        wings=[asb.Wing(name="Wing", symmetric=True, xsecs=wing), asb.Wing(name="Tail", symmetric=True, xsecs=tail),
               asb.Wing(name="Fin", xsecs=fin)])


def by_optvl(g):
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plane.avl"
        file.write_text(avl(g))
        s = OVLSolver(geo_file=str(file))
    s.set_variable("alpha", g["alpha"])
    s.execute_run()
    return {
        "tool": "OptVL 2.5.0", "alpha_deg": s.get_variable("alpha"), "reference": s.get_reference_data(),
        "total": s.get_total_forces(), "stability": s.get_stab_derivs(), "controls": s.get_control_stab_derivs()}


def by_aerosandbox(g, method):
    plane, op = airplane(g), asb.OperatingPoint(velocity=g["speed"], alpha=g["alpha"])
    run = lambda p: getattr(asb, method)(p, op)
    numbers = lambda d: {k: float(np.ravel(x)[0]) for k, x in d.items() if k[0] in "Cx" and np.size(x) == 1}
    whole = numbers(run(plane).run_with_stability_derivatives())
    turned = {c: numbers(run(plane.with_control_deflections({c: 1.0})).run()) for c in ("aileron", "elevator", "rudder")}
    return {
        "tool": f"AeroSandbox 4.2.10 {method}", "alpha_deg": op.alpha,
        "reference": {"Sref": plane.s_ref, "Cref": plane.c_ref, "Bref": plane.b_ref, "XYZref": list(plane.xyz_ref)},
        "total": whole,
        "controls": {c: {k: t[k] - whole[k] for k in ("CL", "CY", "Cl", "Cm", "Cn")} for c, t in turned.items()}}


def main():
    out = Path(sys.argv[1])
    for g in (TRAINER, NAVION):
        results = {"optvl": by_optvl(g)}
        for method in ("VortexLatticeMethod", "AeroBuildup", "LiftingLine"):
            results[method.lower()] = by_aerosandbox(g, method)
        for tool, result in results.items():
            text = json.dumps(result, indent=1, default=lambda a: np.asarray(a).tolist())
            (out / f"{g['name']}-{tool}.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
