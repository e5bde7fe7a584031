"""Plain multiple-shooting output error in numpy, the yardstick of `greylag amend`: no line of it is shared.

    python tests/truth/output_error.py fit FOLDER OUT.toml     # FOLDER of make_cases.py: model.toml, train-*.csv
    python tests/truth/output_error.py judge CLEAN MODEL.toml...    # free runs of 5 s over CLEAN/test-*.csv

The flights are cut into shots of 2 s, whose initial states are unknown and eliminated; RK4 at the log's rate on recorded
deflections; Gauss-Newton with numerical derivatives, weights from the residuals; every coefficient that is not zero
is free, with the 15 % that a model file states by default as its prior. Sensors' errors and wind are not known of.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

import aircraft as x8
from atmosphere import density
from model_file import text

SHOT, WIDTH, ROUNDS, EVERY, HORIZON = 2.0, 0.15, 12, 3.0, 5.0
STATES = ("roll_rad", "pitch_rad", "airspeed_mps", "p_radps", "q_radps", "r_radps", "alpha_rad", "beta_rad")
SCALE = np.array([1, 1, 16.67, 2 * 16.67 / x8.SPAN, 2 * 16.67 / x8.CHORD, 2 * 16.67 / x8.SPAN, 1, 1])
FLOOR = 1e-4 * SCALE
NAMES = [(e, n) for e, names in x8.COEFFICIENTS.items() for n in names]


def table(path):
    """States, deflections and altitude, a row a sample."""
    rows = np.genfromtxt(path, delimiter=",", names=True)
    pick = lambda names: np.stack([rows[n] for n in names])
    return pick(STATES), pick(("aileron_rad", "elevator_rad", "throttle", "altitude_m"))


def read(path):
    """The coefficients of a model file, in the order of NAMES."""
    file = tomllib.loads(Path(path).read_text())["effects"]
    return np.array([file[e][n]["value"] for e, n in NAMES])


def write(path, c):
    """A model file with these coefficients."""
    parts = {e: {n: float(v) for (e2, n), v in zip(NAMES, c) if e2 == e} for e, _ in NAMES}
    Path(path).write_text(text("plain", parts))


def rates(x, z, c):
    """Rates of the states `x` (8 x shots) under `z`, with the coefficients `c`."""
    roll, pitch, v, p, q, r, alpha, beta = x
    aileron, elevator, throttle, altitude = z
    k = {n if n != "k" else e: value for (e, n), value in zip(NAMES, c)}
    qs = 0.5 * density(altitude) * v * v * x8.AREA
    ph, qh, rh = p * x8.SPAN / (2 * v), q * x8.CHORD / (2 * v), r * x8.SPAN / (2 * v)
    lift = k["CL0"] + k["CLalpha"] * alpha + k["lift_table"] * np.interp(alpha, x8.LIFT_ALPHA, x8.LIFT)
    lift = qs * (lift + k["CLq"] * qh + k["CLde"] * elevator)
    drag = k["drag_table"] * np.interp(alpha, x8.DRAG_ALPHA, x8.DRAG) + k["CDbeta"] * abs(beta)
    drag = qs * (drag + k["CDbeta2"] * beta**2 + k["CDde"] * abs(elevator))
    side = qs * (k["CY0"] + k["CYbeta"] * beta + k["CYp"] * ph + k["CYr"] * rh + k["CYda"] * aileron)
    l = qs * x8.SPAN * (k["Cl0"] + k["Clbeta"] * beta + k["Clp"] * ph + k["Clr"] * rh + k["Clda"] * aileron)
    m = qs * x8.CHORD * (k["Cm0"] + k["Cmalpha"] * alpha + k["Cmq"] * qh + k["Cmde"] * elevator)
    n = qs * x8.SPAN * (k["Cn0"] + k["Cnbeta"] * beta + k["Cnp"] * ph + k["Cnr"] * rh + k["Cnda"] * aileron)
    (sa, ca), (sb, cb) = (np.sin(alpha), np.cos(alpha)), (np.sin(beta), np.cos(beta))
    gx, gy, gz = -np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)
    along = -drag * cb - side * sb
    fx = (along * ca + lift * sa + k["Cp_n"] * throttle) / x8.MASS + x8.GRAVITY * gx
    fy = (side * cb - drag * sb) / x8.MASS + x8.GRAVITY * gy
    fz = (along * sa - lift * ca) / x8.MASS + x8.GRAVITY * gz
    hx, hy, hz = x8.JX * p - x8.JXZ * r, x8.JY * q, x8.JZ * r - x8.JXZ * p
    tl, tm, tn = l - q * hz + r * hy, m - r * hx + p * hz, n - p * hy + q * hx
    left, turn = x8.JX * x8.JZ - x8.JXZ**2, q * np.sin(roll) + r * np.cos(roll)
    return np.stack([
        p + turn * np.tan(pitch), q * np.cos(roll) - r * np.sin(roll), fx * ca * cb + fy * sb + fz * sa * cb,
        (x8.JZ * tl + x8.JXZ * tn) / left, tm / x8.JY, (x8.JXZ * tl + x8.JX * tn) / left,
        q - (p * ca + r * sa) * np.tan(beta) + (fz * ca - fx * sa) / (v * cb),
        p * sa - r * ca + (-fx * ca * sb + fy * cb - fz * sa * sb) / v,
    ])  # fmt: skip


def fly(start, z, c, step=0.01):
    """States at the samples of `z` (samples x 4 x shots) from `start`; between them controls are cubic."""
    far = np.concatenate([z[:1], z, z[-1:]])
    middle = (9 * (far[1:-2] + far[2:-1]) - far[:-3] - far[3:]) / 16
    path = [start]
    with np.errstate(all="ignore"):
        for before, half, after in zip(z[:-1], middle, z[1:]):
            x = path[-1]
            k1 = rates(x, before, c)
            k2 = rates(x + 0.5 * step * k1, half, c)
            k3 = rates(x + 0.5 * step * k2, half, c)
            k4 = rates(x + step * k3, after, c)
            path.append(x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return np.stack(path)


def cut(flights, seconds, every):
    """Measured states and controls of all pieces, samples x rows x pieces."""
    n, pieces = round(seconds * 100) + 1, []
    for states, controls in flights:
        starts = range(0, states.shape[1] - n + 1, round(every * 100))
        pieces += [(states[:, k : k + n].T, controls[:, k : k + n].T) for k in starts]
    return (np.stack([p[i] for p in pieces], axis=2) for i in (0, 1))


def residual(path, measured):
    """Predicted less measured, roll the short way round; what is lost counts as a whole scale."""
    r = path - measured
    r[:, 0] = np.mod(r[:, 0] + np.pi, 2 * np.pi) - np.pi
    return np.clip(np.nan_to_num(r, nan=1.0), -SCALE[:, None], SCALE[:, None])


def beside(c, starts, z, measured, free, steps):
    """Residuals with each free coefficient, then each state at the start, moved by its step: all flown at once."""
    n, shots = len(steps), starts.shape[1]
    wide = lambda x: np.repeat(x[..., None, :], n, axis=-2).reshape(*x.shape[:-1], n * shots)
    coefficients, begin = np.repeat(c[:, None, None], n, axis=1).repeat(shots, axis=2), wide(starts).reshape(8, n, shots)
    coefficients[free, range(len(free))] += steps[: len(free), None]
    begin[range(8), range(len(free), n)] += steps[len(free) :, None]
    path = fly(begin.reshape(8, -1), wide(z), coefficients.reshape(len(c), -1))
    return residual(path, wide(measured)).reshape(len(z), 8, n, shots)


def fit(flights, given):
    """The coefficients that shots of 2 s bear out, from those of the file on."""
    measured, z = cut(flights, SHOT, SHOT)
    free, width = np.flatnonzero(given), WIDTH * np.abs(given[given != 0])
    c, starts, shots, damping = given.copy(), measured[0].copy(), measured.shape[2], 1e-6
    of = lambda c, s: residual(fly(s, z, c), measured)
    r = of(c, starts)
    for _ in range(ROUNDS):
        root = 1 / np.maximum(np.sqrt((r**2).mean(axis=(0, 2))), FLOOR)
        scaled = lambda x: (x * root[:, None]).transpose(2, 0, 1).reshape(shots, -1)
        steps = np.concatenate([1e-4 * width, 1e-5 * SCALE])
        j = (beside(c, starts, z, measured, free, steps) - r[..., None, :]) * (root[:, None, None] / steps[:, None])
        j = j.transpose(3, 0, 1, 2).reshape(shots, -1, len(steps))
        a, own, y = j[..., : len(free)], j[..., len(free) :], scaled(r)
        inner = np.linalg.inv(own.transpose(0, 2, 1) @ own + 1e-9 * np.eye(8))
        through = inner @ own.transpose(0, 2, 1)
        rest = a - own @ (through @ a)
        h = np.einsum("sra,srb->ab", rest, rest) + np.diag(width**-2)
        g = np.einsum("sra,sr->a", rest, y) + (c[free] - given[free]) / width**2
        cost = lambda r, c: (scaled(r) ** 2).sum() + (((c - given)[free] / width) ** 2).sum()
        for _ in range(8):
            step = np.linalg.solve(h + damping * np.diag(np.diag(h)), -g)
            change = -np.einsum("sir,sr->is", through, y + a @ step)
            trial = c.copy()
            trial[free] += step
            new = of(trial, starts + change)
            if cost(new, trial) < cost(r, c):
                c, starts, r, damping = trial, starts + change, new, damping / 10
                break
            damping = max(10 * damping, 1e-4)
        else:
            break
    return c


def judge(clean, c):
    """Root mean square scaled error 5 s ahead over the test flights of `clean`, runs 3 s apart."""
    measured, z = cut([table(p) for p in sorted(Path(clean).glob("test-*.csv"))], HORIZON, EVERY)
    r = residual(fly(measured[0], z, c), measured)[-1] / SCALE[:, None]
    return float(np.sqrt((r**2).mean()))


def main():
    """Fits, or judges."""
    what, first, *rest = sys.argv[1:]
    if what == "judge":
        print(*(f"{judge(first, read(path)):.6f}" for path in rest))
        return
    flights = [table(p) for p in sorted(Path(first).glob("train-*.csv"))]
    write(rest[0], fit(flights, read(Path(first) / "model.toml")))


if __name__ == "__main__":
    main()
