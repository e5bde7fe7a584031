"""Ordinary least squares beside `greylag amend`: least_squares.py MODEL OUT RECONSTRUCTED.csv ...

Forces and moments of every sample of reconstructed flights (`greylag logs reconstruct`) on the model's own regressors,
angular accelerations by central differences. OUT is MODEL with the coefficients that came out. Needs numpy.
"""

import csv
import re
import sys
from pathlib import Path

import numpy as np

S, B, C, M = 0.0408, 0.43, 0.0978, 0.1
J = np.diag((2.24e-4, 2.62e-4, 4.82e-4))


def table(path):
    """Columns of a flight; rows that lack a neighbour are left out."""
    rows = list(csv.DictReader(open(path, newline="")))
    f = {k: np.array([float(r[k]) if r[k] else np.nan for r in rows]) for k in rows[0]}
    rate = np.stack([f[k] for k in ("p_radps", "q_radps", "r_radps")], axis=1)
    turning = np.full_like(rate, np.nan)
    turning[1:-1] = (rate[2:] - rate[:-2]) / (f["time_s"][2:] - f["time_s"][:-2])[:, None]
    turning[1:-1][f["time_s"][2:] - f["time_s"][:-2] > 0.03] = np.nan
    f["moment"] = turning @ J + np.cross(rate, rate @ J)
    f["force"] = M * np.stack([f[k] for k in ("ax_mps2", "ay_mps2", "az_mps2")], axis=1)
    usable = np.isfinite(f["moment"]).all(axis=1) & np.isfinite(f["force"]).all(axis=1)
    return {k: x[usable] for k, x in f.items()}


def equations(f, given):
    """By channel: what was measured, and the regressor of each coefficient.

    Drag, thrust, side force, CLq and CLde keep the model's values, for what comes out is not physical and the program
    refuses it: free, the thrust is a brake and CDalpha2 12.6; with the model's thrust CD0 is -0.23; CLq is 33, CY0 -0.12.
    """
    v, a, b = f["airspeed_mps"], f["alpha_rad"], f["beta_rad"]
    p, q, r = f["p_radps"] * B / (2 * v), f["q_radps"] * C / (2 * v), f["r_radps"] * B / (2 * v)
    da, de = f["aileron_rad"], f["elevator_rad"]
    qs, one = 0.5 * f["air_density_kgpm3"] * v * v * S, np.ones_like(v)
    lift = f["force"][:, 0] * np.sin(a) - f["force"][:, 2] * np.cos(a)
    yield lift - qs * (given["CLq"] * q + given["CLde"] * de), {"CL0": qs, "CLalpha": qs * a}
    lateral = {"0": one, "beta": b, "p": p, "r": r, "da": da}
    yield f["moment"][:, 0], {"Cl" + n: qs * B * x for n, x in lateral.items()}
    yield f["moment"][:, 1], {"Cm0": qs * C, "Cmalpha": qs * C * a, "Cmq": qs * C * q, "Cmde": qs * C * de}
    yield f["moment"][:, 2], {"Cn" + n: qs * B * x for n, x in lateral.items()}


def main():
    """Fits and writes."""
    model, out, *paths = map(Path, sys.argv[1:])
    flights = [table(path) for path in paths]
    text = model.read_text()
    given = {n: float(v) for n, v in re.findall(r"(?m)^(\w+) = \{ value = ([^,]+)", text)}
    for parts in zip(*(equations(f, given) for f in flights)):
        names = list(parts[0][1])
        left = np.concatenate([y for y, _ in parts])
        right = np.vstack([np.stack([x[n] for n in names], axis=1) for _, x in parts])
        for name, value in zip(names, np.linalg.lstsq(right, left, rcond=None)[0]):
            if name == "Cmq":  # 0.24 comes out; the nearest that is physical
                value = min(value, 0.0)
            text, count = re.subn(rf"(?m)^({name} = {{ value = )[^,]+", rf"\g<1>{value:.6g}", text)
            assert count == 1, name
    text = re.sub(r'(?m)^name = ".*"', 'name = "a430-least-squares"', text)
    text = text.replace('airframe = "airframe.toml"', f'airframe = "{model.resolve().parent / "airframe.toml"}"')
    out.write_text(text)


if __name__ == "__main__":
    main()
