"""acados beside the planners: the learned model, ilqr's horizon and weights, constrained, real-time iteration.

    python3 -m venv target/acados-venv && target/acados-venv/bin/pip install -q comma-deps-acados jsbsim numpy
    cargo build --release --ignore-rust-version --no-default-features --features sitl,speed --bin greylag --example model_rates
    target/acados-venv/bin/python tests/acados_beside_planners.py --every 7 --steps 50 --out results/acados-beside-planners.json

Needs a C compiler. The grey box is written anew in CasADi from `params/x8/learned`, and its rates and their derivatives
are compared with those of the Rust model first. acados flies official JSBSim (PyPI); the planners are flown by
`greylag evaluate` in the same run, to the same targets and steps; the measures are those of `src/control/quality`. One core, one run.
"""

import argparse
import ctypes
import json
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time
import tomllib

import numpy as np

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = pathlib.Path(__file__).resolve().parent.parent
MODEL = ROOT / "params" / "x8" / "learned"
G0 = 9.80665
DT = 0.01
FOOT = 0.3048
STATES = ("roll", "pitch", "V", "p", "q", "r", "alpha", "beta")


class GreyBox:
    """The learned model as CasADi expressions, from its files."""

    def __init__(self, folder):
        model = tomllib.loads((folder / "model.toml").read_text())
        frame = tomllib.loads((folder / "airframe.toml").read_text())
        assert model["force_axes"] == "stability" and "residual" in model, "this script writes that one model anew"
        self.c = {(e, k): v["value"] for e, of in model["effects"].items() for k, v in of.items()}
        self.body = {k: v["value"] for k, v in model["rigid_body"].items()}
        self.rho = model["air"]["density"]["kgpm3"]["value"]
        self.g = model["air"]["gravity_mps2"]["value"]
        geometry = frame["geometry"]
        self.area, self.span, self.chord = (geometry[k]["value"] for k in ("wing_area_m2", "span_m", "mean_chord_m"))
        self.v0 = frame["reference"]["airspeed_mps"]["value"]
        aileron = frame["controls"]["aileron"]
        self.omega, self.zeta, self.travel = (
            aileron[k]["value"] for k in ("frequency_radps", "damping", "travel_rad")
        )
        self.lag = frame["controls"]["throttle"]["lag_s"]["value"]
        self.envelope, self.incidence = frame["envelope"], frame["incidence"]
        self.layers = safetensors(folder / model["residual"])
        self.x_c = [1, 1, self.v0, 2 * self.v0 / self.span, 2 * self.v0 / self.chord, 2 * self.v0 / self.span, 1, 1]

    def residual(self, x, u):
        """What the network adds to the rates; `Scales` of src/model/residual.rs."""
        import casadi as ca

        unit = [0.25 * self.v0, 0.1 * self.x_c[3], 0.02 * self.x_c[4], 0.05 * self.x_c[5], 0.2, 0.2]
        unit += [self.travel, self.travel, 0.5]
        offset = [self.v0, 0, 0, 0, 0, 0, 0, 0, 0.5]
        seen = [x[2], x[3], x[4], x[5], x[6], x[7], u[0], u[1], u[2]]
        h = ca.vertcat(*[(s - o) / f for s, o, f in zip(seen, offset, unit)])
        for k, (weight, bias) in enumerate(self.layers):
            h = ca.mtimes(ca.DM(weight.T), h) + ca.DM(bias)
            h = ca.fmax(h, 0) if k + 1 < len(self.layers) else h
        return h * ca.DM(self.x_c)

    def rates(self, x, u):
        """Rates of the eight states, and the specific force along body z; deflections in rad, throttle 0..1."""
        import casadi as ca

        phi, theta, v, p, q, r, alpha, beta = ca.vertsplit(x)
        da, de, dt = u[0], u[1], u[2]
        c = lambda effect, name: self.c[(effect + "_linear", name)]  # noqa: E731
        sa, cs, sb, cb = ca.sin(alpha), ca.cos(alpha), ca.sin(beta), ca.cos(beta)
        qs = 0.5 * self.rho * v**2 * self.area
        ph, qh, rh = p * self.span / (2 * v), q * self.chord / (2 * v), r * self.span / (2 * v)

        def longitudinal(effect, d):
            return c(effect, d + "0") + c(effect, d + "alpha") * alpha + c(effect, d + "q") * qh + c(effect, d + "de") * de

        def lateral(effect, d):
            first = c(effect, d + "0") + c(effect, d + "beta") * beta
            return first + c(effect, d + "p") * ph + c(effect, d + "r") * rh + c(effect, d + "da") * da

        drag, lift = qs * longitudinal("drag", "CD"), qs * longitudinal("lift", "CL")
        side = qs * lateral("side_force", "CY")
        force = [-drag * cs + lift * sa + c("thrust", "Cp_n") * dt, side, -drag * sa - lift * cs]
        moment = [
            qs * self.span * lateral("roll", "Cl"),
            qs * self.chord * longitudinal("pitch", "Cm"),
            qs * self.span * lateral("yaw", "Cn"),
        ]
        jx, jy, jz, jxz = (self.body[k + "_kgm2"] for k in ("jx", "jy", "jz", "jxz"))
        gamma = jx * jz - jxz**2
        l = moment[0] + jxz * p * q - (jz - jy) * q * r
        m = moment[1] + (jz - jx) * p * r - jxz * (p**2 - r**2)
        n = moment[2] - jxz * q * r + (jx - jy) * p * q
        spin = [(jz * l + jxz * n) / gamma, m / jy, (jxz * l + jx * n) / gamma]
        mass = self.body["mass_kg"]
        gx = force[0] / mass - self.g * ca.sin(theta)
        gy = force[1] / mass + self.g * ca.cos(theta) * ca.sin(phi)
        gz = force[2] / mass + self.g * ca.cos(theta) * ca.cos(phi)
        turn = (ca.sin(phi) * q + ca.cos(phi) * r) / ca.cos(theta)
        forward, downward = gx * cs + gz * sa, gz * cs - gx * sa
        rate = ca.vertcat(
            p + ca.sin(theta) * turn,
            ca.cos(phi) * q - ca.sin(phi) * r,
            forward * cb + gy * sb,
            *spin,
            q + (downward - sb * v * (p * cs + r * sa)) / (v * cb),
            p * sa - r * cs + (gy * cb - sb * forward) / v,
        )
        learned = self.residual(x, u)
        # the acceleration that changes airspeed, alpha and beta so: rigid_body::acceleration_of
        across, down = v * learned[7], v * cb * learned[6]
        push = (learned[2] * cb - across * sb) * sa + down * cs
        return rate + learned, force[2] / mass + push


def safetensors(path):
    """Weights [in, out] and biases of the layers."""
    data = path.read_bytes()
    (size,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])

    def array(name):
        first, last = header[name]["data_offsets"]
        values = np.frombuffer(data[8 + size + first : 8 + size + last], dtype="<f4")
        return values.reshape(header[name]["shape"]).astype(float)

    count = sum(name.endswith(".weight") for name in header)
    return [(array(f"layers.{k}.weight"), array(f"layers.{k}.bias")) for k in range(count)]


def held(a, b):
    """Exact step of x' = a x + b u with u held."""
    size = len(b)
    block = np.zeros((size + 1, size + 1))
    block[:size, :size], block[:size, size] = a, b
    step, term = np.eye(size + 1), np.eye(size + 1)
    for k in range(1, 40):
        term = term @ block * (DT / k)
        step = step + term
    return step[:size, :size], step[:size, size]


def acados_home(folder):
    """The layout of acados' source tree, of links into the wheel: its template looks there for headers and libraries."""
    import acados

    package = pathlib.Path(acados.__file__).parent
    home = folder / "acados"
    (home / "interfaces" / "acados_template").mkdir(parents=True)
    for part in ("include", "lib", "bin"):
        (home / part).symlink_to(package / "install" / part)
    (home / "interfaces" / "acados_template" / "acados_template").symlink_to(package / "acados_template")
    os.environ["ACADOS_SOURCE_DIR"] = str(home)
    os.environ["TERA_PATH"] = str(home / "bin" / "t_renderer")
    # loaded by their full path, for the linker is not told where they are
    for name in ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so.3.1", "libacados.so"):
        ctypes.CDLL(str(home / "lib" / name), mode=ctypes.RTLD_GLOBAL)


def checked(box, exe):
    """Largest differences of rates, derivatives and load factor between CasADi and the Rust model."""
    import casadi as ca

    x, u = ca.SX.sym("x", 8), ca.SX.sym("u", 3)
    rate, fz = box.rates(x, u)
    both = ca.Function("f", [x, u], [rate, ca.jacobian(rate, x), ca.jacobian(rate, u), -fz / G0])
    lines = subprocess.run([exe, str(MODEL / "model.toml"), "200"], capture_output=True, text=True, check=True)
    worst = np.zeros(3)
    for line in lines.stdout.splitlines():
        row = json.loads(line)
        f, a, b, load = both(row["state"], row["controls"])
        jacobian = np.hstack([np.array(a), np.array(b)])
        theirs = np.array(row["jacobian"])
        scale = 1 + np.abs(theirs)
        off = [
            np.max(np.abs(np.array(f).ravel() - row["rate"]) / (1 + np.abs(row["rate"]))),
            np.max(np.abs(jacobian - theirs) / scale),
            abs(float(load) - row["load_factor"]),
        ]
        worst = np.maximum(worst, off)
    print("CasADi against Rust, largest relative difference: rates %.1e, derivatives %.1e, load factor %.1e" % tuple(worst))
    # single-precision weights on both sides, double arithmetic: rounding alone is 1e-12
    assert (worst < 1e-6).all(), worst
    return worst.tolist()


class Rti:
    """SQP real-time iteration over 50 steps of 10 ms, Gauss-Newton, HPIPM with partial condensing."""

    STEPS, LAST = 50, 20.0
    ATTITUDE, RATE, SIDESLIP, MOVE = 0.05, 2.0, 0.3, 0.3
    TIME_CONSTANT_S, TURN_S = 0.3, 1.0

    def __init__(self, box, folder, limits):
        acados_home(folder)
        import casadi as ca
        from acados.acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver

        self.box = box
        x, u, d = ca.SX.sym("x", 15), ca.SX.sym("u", 2), ca.SX.sym("d", 8)
        goal, throttle = ca.SX.sym("goal", 8), ca.SX.sym("throttle")

        # as JSBSim steps and the model's file asks for: explicit Euler, surfaces held; the servos by their exact solution
        flown, fz = box.rates(x[:8], ca.vertcat(x[8], x[10], x[12]))
        servo, drive = held(np.array([[0, 1], [-(box.omega**2), -2 * box.zeta * box.omega]]), [0, box.omega**2 * box.travel])
        moved_to = [ca.mtimes(ca.DM(servo), x[at : at + 2]) + ca.DM(drive) * u[k] for k, at in enumerate((8, 10))]
        share = 1 - math.exp(-DT / box.lag)
        following = ca.vertcat(x[:8] + DT * (flown + d), *moved_to, x[12] + share * (throttle - x[12]), u)
        load = -fz / G0
        wrap = ca.atan2(ca.sin(x[0] - goal[0]), ca.cos(x[0] - goal[0]))
        off = [
            wrap / self.ATTITUDE,
            (x[1] - goal[1]) / self.ATTITUDE,
            *[(x[3 + k] - goal[3 + k]) / self.RATE for k in range(3)],
            (x[7] - goal[7]) / self.SIDESLIP,
        ]
        moved = [(u[k] - x[13 + k]) / self.MOVE for k in range(2)]
        model = AcadosModel()
        model.name, model.x, model.u, model.p = "x8", x, u, ca.vertcat(d, goal, throttle)
        model.disc_dyn_expr = following
        model.cost_y_expr, model.cost_y_expr_e = ca.vertcat(*off, *moved), ca.vertcat(*off)
        model.con_h_expr, model.con_h_expr_e = load, load
        self.step = ca.Function("step", [x, u, d, throttle], [following])

        ocp = AcadosOcp()
        ocp.model, ocp.dims.N = model, self.STEPS
        ocp.parameter_values = np.zeros(17)
        ocp.cost.cost_type = ocp.cost.cost_type_e = "NONLINEAR_LS"
        ocp.cost.W, ocp.cost.W_e = np.eye(8), self.LAST * np.eye(6)
        ocp.cost.yref, ocp.cost.yref_e = np.zeros(8), np.zeros(6)
        c = ocp.constraints
        c.x0 = np.zeros(15)
        c.lbu, c.ubu, c.idxbu = -np.ones(2), np.ones(2), np.arange(2)
        slew = limits["slew"] * DT
        c.C, c.D = np.hstack([np.zeros((2, 13)), -np.eye(2)]), np.eye(2)
        c.lg, c.ug = -slew * np.ones(2), slew * np.ones(2)
        # angle of attack and load factor are soft, so that there is always a plan
        c.idxbx, c.lbx, c.ubx = np.array([6]), np.array([-limits["stall"]]), np.array([limits["stall"]])
        c.idxbx_e, c.lbx_e, c.ubx_e = c.idxbx, c.lbx, c.ubx
        c.lh, c.uh = np.array([limits["load"][0]]), np.array([limits["load"][1]])
        c.lh_e, c.uh_e = c.lh, c.uh
        c.idxsbx, c.idxsh, c.idxsbx_e, c.idxsh_e = (np.array([0]) for _ in range(4))
        linear, square = np.array([500.0, 300.0]), np.array([5e3, 1e3])
        ocp.cost.zl = ocp.cost.zu = linear
        ocp.cost.Zl = ocp.cost.Zu = square
        ocp.cost.zl_e, ocp.cost.zu_e, ocp.cost.Zl_e, ocp.cost.Zu_e = linear, linear, square, square
        o = ocp.solver_options
        o.integrator_type, o.nlp_solver_type, o.hessian_approx = "DISCRETE", "SQP_RTI", "GAUSS_NEWTON"
        o.qp_solver, o.qp_solver_cond_N, o.tf = "PARTIAL_CONDENSING_HPIPM", limits["blocks"], self.STEPS * DT
        o.qp_solver_iter_max, o.qp_solver_warm_start = 50, 1
        o.hpipm_mode = "SPEED"
        o.regularize_method, o.levenberg_marquardt = "NO_REGULARIZE", 1e-3
        o.ext_fun_compile_flags = "-O2 -march=native"
        ocp.code_export_directory = str(folder / "generated")
        self.solver = AcadosOcpSolver(ocp, json_file=str(folder / "x8.json"), verbose=False)
        self.reset()

    def reset(self):
        self.d, self.beside, self.last, self.planned, self.speed = np.zeros(8), np.zeros(2), None, False, 0.0

    def command(self, seen, target):
        """The command of this tick, and the time that it took, s: preparation and feedback together."""
        before = time.perf_counter()
        if self.last is not None:
            before_it, u, throttle = self.last
            expected = np.array(self.step(before_it, u, self.d, throttle)).ravel()[:8]
            error = seen[:8] - expected
            error[0] = (error[0] + math.pi) % (2 * math.pi) - math.pi
            self.d += error / self.TIME_CONSTANT_S
        slow = target[2] - seen[2]
        throttle = min(max(0.16 + 0.08 * slow + self.speed, 0.0), 1.0)
        if 0.0 < throttle < 1.0:
            self.speed += DT * 0.03 * slow
        p = np.concatenate([self.d, self.goal(seen, target), [throttle]])
        solver = self.solver
        for k in range(self.STEPS + 1):
            solver.set(k, "p", p)
            if not self.planned:
                solver.set(k, "x", seen)
        start = time.perf_counter()
        overhead = start - before
        solver.set(0, "lbx", seen)
        solver.set(0, "ubx", seen)
        status = solver.solve()
        u = solver.get(0, "u")
        # what C takes of it: Python's own loops above are no part of the method
        took = float(np.ravel(solver.get_stats("time_tot"))[0])
        self.planned = status in (0, 2) and bool(np.isfinite(u).all())
        if not self.planned:
            solver.reset()
            u = seen[13:15]
        else:
            self.shift()
        self.last = (seen, u, throttle)
        return np.array([*u, throttle]), took, overhead, status

    def shift(self):
        """The next tick starts from this plan, one step on."""
        get, put = self.solver.get, self.solver.set
        for k in range(self.STEPS):
            put(k, "x", get(k + 1, "x"))
            if k + 1 < self.STEPS:
                put(k, "u", get(k + 1, "u"))

    def goal(self, seen, target):
        """States of the steady turn at the attitude wanted; what the turn is beside it is followed slowly, so that nothing
        pulls at a steady attitude."""
        roll, pitch, airspeed = target
        speed = max(seen[2], 5.0)
        turning = (seen[4] * math.sin(seen[0]) + seen[5] * math.cos(seen[0])) / math.cos(seen[1])
        now = np.array([turning - self.box.g * math.tan(seen[0]) / speed, seen[7]])
        self.beside += DT / self.TURN_S * (now - self.beside)
        turn = self.box.g * math.tan(roll) / speed + self.beside[0]
        rates = [-turn * math.sin(pitch), turn * math.sin(roll) * math.cos(pitch), turn * math.cos(roll) * math.cos(pitch)]
        return np.array([roll, pitch, airspeed, *rates, 0.0, self.beside[1]])


class Plant:
    """Official JSBSim at 100 Hz from the paper's start."""

    SEEN = (
        ("attitude/phi-rad", 1.0), ("attitude/theta-rad", 1.0), ("velocities/vt-fps", FOOT), ("velocities/p-rad_sec", 1.0),
        ("velocities/q-rad_sec", 1.0), ("velocities/r-rad_sec", 1.0), ("aero/alpha-rad", 1.0), ("aero/beta-rad", 1.0),
        ("fcs/effective-aileron-pos", 1.0), ("fcs/elevator-pos-rad", 1.0), ("fcs/throttle-pos-norm", 1.0),
        ("forces/fbz-total-lbs", 1.0),
    )  # fmt: skip

    def __init__(self, airspeed):
        import jsbsim

        jsbsim.FGJSBBase().debug_lvl = 0
        self.folder = tempfile.TemporaryDirectory()
        root = pathlib.Path(self.folder.name)
        (root / "aircraft").mkdir()
        (root / "aircraft" / "x8").symlink_to(ROOT / "sitl" / "aircraft" / "x8")
        (root / "engine").symlink_to(ROOT / "sitl" / "aircraft" / "x8" / "Engines")
        self.sim = jsbsim.FGFDMExec(str(root))
        self.sim.set_debug_level(0)
        self.sim.set_dt(DT)
        assert self.sim.load_model("x8")
        self.airspeed = airspeed

    def reset(self):
        for name, value in {
            "ic/lat-geod-deg": 0.0, "ic/h-sl-ft": 600.0 / FOOT, "ic/theta-rad": 0.0, "ic/phi-rad": 0.0, "ic/alpha-rad": 0.0,
            "ic/beta-rad": 0.0, "ic/vt-fps": self.airspeed / FOOT, "ic/p-rad_sec": 0.0, "ic/q-rad_sec": 0.0, "ic/r-rad_sec": 0.0,
        }.items():  # fmt: skip
            self.sim[name] = value
        for c in ("aileron", "elevator", "throttle"):
            self.sim[f"fcs/{c}-cmd-norm"] = 0.0
        self.sim.reset_to_initial_conditions(0)
        assert self.sim.run_ic()
        self.sim["propulsion/set-running"] = -1
        self.before = self.read()[8:10]

    def read(self):
        return np.array([self.sim[name] * unit for name, unit in self.SEEN])

    def seen(self, command):
        """What the planner sees: states, surfaces with their rates, throttle, the surfaces' command in force; and the load factor."""
        now = self.read()
        rates, self.before = (now[8:10] - self.before) / DT, now[8:10]
        load = -now[11] / (self.sim["inertia/mass-slugs"]) * FOOT / G0
        return np.concatenate([now[:8], [now[8], rates[0], now[9], rates[1], now[10]], command[:2]]), load

    def step(self, command):
        for c, value in zip(("aileron", "elevator", "throttle"), command):
            self.sim[f"fcs/{c}-cmd-norm"] = float(value)
        self.sim.run()


def fly(rti, plant, first, target, steps):
    """A flight to `target` (rad, m/s) over `steps` ticks, after `first` for 500 if there is one: its track."""
    plant.reset()
    rti.reset()
    command, rows, cost, failed = np.zeros(3), [], [], 0
    legs = ([(first, 500, False)] if first is not None else []) + [(target, steps, True)]
    before = None
    for wanted, ticks, scored in legs:
        for _ in range(ticks):
            seen, load = plant.seen(command)
            command, took, _, status = rti.command(seen, wanted)
            if scored:
                rows.append([*seen[:8], load, *command])
                cost.append(took)
                failed += status not in (0, 2)
            else:
                before = command
            plant.step(command)
    seen, load = plant.seen(command)
    rows.append([*seen[:8], load, *command])
    return np.array(rows), before, np.array(cost), failed


def measured(rows, before, target, limits):
    """The measures as `src/control/quality` defines them."""
    wrap = lambda a: (a + 180) % 360 - 180  # noqa: E731
    error = np.stack([wrap(np.degrees(rows[:, k] - target[k])) for k in (0, 1)], axis=1)
    size = np.abs(error).sum(axis=1)
    last = lambda outside: float(np.max(np.nonzero(outside)[0], initial=0)) * DT  # noqa: E731
    over = [max(0.0, float(np.max(-np.sign(e[0]) * e[1:]))) if e[0] else float(np.max(np.abs(e))) for e in error.T]
    commands = rows[:-1, 9:12] if before is None else np.vstack([before, rows[:-1, 9:12]])
    settled = error[-(len(rows) - 1) // 5 :]
    alpha, load = np.degrees(rows[:, 6]), rows[:, 8]
    return {
        "error_integral_deg_s": float(np.sum(0.5 * DT * (size[1:] + size[:-1]))),
        "to_one_deg_s": last(np.abs(error).max(axis=1) > 1),
        "overshoot_roll_deg": over[0],
        "overshoot_pitch_deg": over[1],
        "load_factor_max": float(load.max()),
        "load_factor_min": float(load.min()),
        "alpha_max_deg": float(alpha.max()),
        "surface_travel": float(np.abs(np.diff(commands[:, :2], axis=0)).sum()),
        "settled_deg": float(np.sqrt((settled**2).mean(axis=0)).mean()),
        "kept": bool(load.max() <= 1.05 * limits["load"][1] and alpha.max() <= 1.05 * math.degrees(limits["stall"])),
    }


KEYS = (
    "error_integral_deg_s", "to_one_deg_s", "overshoot_roll_deg", "overshoot_pitch_deg", "load_factor_max", "load_factor_min",
    "alpha_max_deg", "surface_travel", "settled_deg",
)  # fmt: skip


def ours(flight):
    """The same measures of a flight of `greylag evaluate --json`."""
    q = flight["quality"]
    return {
        "error_integral_deg_s": q["error_integral_deg_s"],
        "to_one_deg_s": q["to_one_deg_s"],
        "overshoot_roll_deg": q["overshoot_deg"][0],
        "overshoot_pitch_deg": q["overshoot_deg"][1],
        "load_factor_max": q["load_factor"][1],
        "load_factor_min": q["load_factor"][0],
        "alpha_max_deg": q["alpha_deg"][1],
        "surface_travel": q["travel"]["aileron"] + q["travel"]["elevator"],
        "settled_deg": flight["settled_deg"],
        "kept": q["kept"],
    }


def summed(flights):
    """Medians with bootstrap intervals, and the worst."""
    rng = np.random.default_rng(1)
    out = {"n": len(flights), "kept": float(np.mean([f["kept"] for f in flights]))}
    for key in KEYS:
        values = np.array([f[key] for f in flights])
        drawn = np.median(values[rng.integers(0, len(values), (2000, len(values)))], axis=1)
        worst = values.min() if key == "load_factor_min" else values.max()
        out[key] = [float(np.median(values)), *(float(v) for v in np.quantile(drawn, [0.025, 0.975])), float(worst)]
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--greylag", default=str(ROOT / "target/release/greylag"))
    parser.add_argument("--rates", default=str(ROOT / "target/release/examples/model_rates"))
    parser.add_argument("--controllers", nargs="+", default=["lqi", "hybrid-ilqr", "ilqr", "hybrid-lqi"])
    parser.add_argument("--every", type=int, default=7)
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--blocks", type=int, default=25, help="blocks after partial condensing")
    parser.add_argument("--margin", type=float, default=0.9, help="share of the load factor's and the stall's limit that is planned to")
    parser.add_argument("--out", type=pathlib.Path)
    arguments = parser.parse_args()
    box = GreyBox(MODEL)
    limits = {
        "load": [-box.envelope["load_factor_max"], box.envelope["load_factor_max"]],
        "stall": box.incidence["stall_rad"],
        "slew": box.envelope["surface_slew_per_s"],
        "blocks": arguments.blocks,
    }
    differences = checked(box, arguments.rates)
    with tempfile.TemporaryDirectory() as folder:
        scores = pathlib.Path(folder) / "scores.json"
        command = [arguments.greylag, "evaluate", "--controller", *arguments.controllers, "--every", str(arguments.every)]
        command += ["--steps", str(arguments.steps), "--json", str(scores)]
        subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL, env={**os.environ, "RAYON_NUM_THREADS": "1"})
        document = json.loads(scores.read_text())
    tables, cost = {}, {}
    for c in document["controllers"]:
        by_group = {}
        for f in c["flights"]:
            by_group.setdefault(f["targets"], []).append(ours(f))
        tables[c["controller"]] = {g: summed(f) for g, f in by_group.items()}
        cost[c["controller"]] = c["ms_per_step"]
    planned = {**limits, "load": [m * arguments.margin for m in limits["load"]], "stall": limits["stall"] * arguments.margin}
    with tempfile.TemporaryDirectory() as folder:
        rti, plant = Rti(box, pathlib.Path(folder), planned), Plant(box.v0)
        by_group, times, failures = {}, [], 0
        for f in document["controllers"][0]["flights"]:
            rad = lambda deg, v: np.array([*np.radians(deg), v])  # noqa: E731
            step = f["from_deg"] is not None
            speed = box.envelope["airspeed_cruise_mps"] if step else box.v0
            first, target = rad(f["from_deg"], speed) if step else None, rad(f["to_deg"], speed)
            rows, before, took, failed = fly(rti, plant, first, target, 800 if step else 1000)
            by_group.setdefault(f["targets"], []).append(measured(rows, before, target, limits))
            times.append(took)
            failures += failed
        tables["acados"] = {g: summed(f) for g, f in by_group.items()}
        ms = 1e3 * np.concatenate(times)
        cost["acados"] = dict(zip(("p50", "p99", "p999"), (float(x) for x in np.quantile(ms, [0.5, 0.99, 0.999]))))
    for group in tables["acados"]:
        print(f"\n{group}: median [95 %], worst")
        for key in KEYS:
            cells = (
                "%s %.3g [%.3g, %.3g] %.3g" % (who, *tables[who][group][key]) for who in tables if group in tables[who]
            )
            print(f"  {key:22}", "  ".join(cells))
        print("  kept                  ", "  ".join(f"{who} {100 * t[group]['kept']:.0f} %" for who, t in tables.items()))
    print("\nms a tick:", "  ".join(f"{who} {c['p50']:.4f} p99 {c['p99']:.4f} p99.9 {c['p999']:.4f}" for who, c in cost.items()))
    print("ticks without a plan of acados:", failures)
    if arguments.out:
        record = {
            "command": " ".join(["tests/acados_beside_planners.py", *(Path(w).name if Path(w).is_absolute() else w for w in sys.argv[1:])]),
            "processor": next((l.split(":")[1].strip() for l in open("/proc/cpuinfo") if "model name" in l), ""),
            "casadi_against_rust": differences,
            "settings": {"blocks": arguments.blocks, "margin": arguments.margin},
            "ms_a_tick": cost,
            "ticks_without_plan": failures,
            "tables": tables,
        }
        arguments.out.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
