"""Flies the X8 in the official JSBSim and writes the golden files of the plant's tests.

    python -m venv .venv && .venv/bin/pip install jsbsim==1.3.3 numpy
    .venv/bin/python sitl/tests/golden/generate.py [--out DIR]

Without --out, the files beside this script are replaced. Everything is seeded; commands come from
the standard library's random numbers, whose sequence is the same in every version of Python.
"""

import argparse
import json
import math
import random
from pathlib import Path

import jsbsim
import numpy as np

HERE = Path(__file__).resolve().parent
AIRCRAFT = HERE.parent.parent / "aircraft"

DT = 0.01
STEPS = 1000
STATE_EVERY = 5  # every command is kept, and every fifth state, to keep the files small
FT = 0.3048
LBF = 4.4482216152605
CALM = (0.0, 0.0, 0.0)

STATE = {  # column: (property, factor to SI)
    "roll_rad": ("attitude/phi-rad", 1.0),
    "pitch_rad": ("attitude/theta-rad", 1.0),
    "yaw_rad": ("attitude/psi-rad", 1.0),
    "airspeed_mps": ("velocities/vt-fps", FT),
    "p_radps": ("velocities/p-rad_sec", 1.0),
    "q_radps": ("velocities/q-rad_sec", 1.0),
    "r_radps": ("velocities/r-rad_sec", 1.0),
    "alpha_rad": ("aero/alpha-rad", 1.0),
    "beta_rad": ("aero/beta-rad", 1.0),
    "altitude_m": ("position/h-sl-ft", FT),
    "aileron_rad": ("fcs/effective-aileron-pos", 1.0),
    "elevator_rad": ("fcs/elevator-pos-rad", 1.0),
    "throttle": ("fcs/throttle-pos-norm", 1.0),
    "thrust_n": ("propulsion/engine/thrust-lbs", LBF),
}


def load():
    """Loads the X8. The time step is set before, because filters keep the step set at loading."""
    fdm = jsbsim.FGFDMExec(str(AIRCRAFT.parent))
    fdm.set_debug_level(0)
    fdm.set_aircraft_path(str(AIRCRAFT))
    fdm.set_dt(DT)
    if not fdm.load_model("x8"):
        raise SystemExit(f"JSBSim cannot load {AIRCRAFT / 'x8' / 'x8.xml'}")
    return fdm


def start(fdm, airspeed=16.67, altitude=600.0, pitch=0.0, alpha=0.0, wind=CALM):
    """Starts as the plant does: heading north, wings level, with surfaces centred."""
    cos_pitch, sin_pitch = math.cos(pitch), math.sin(pitch)
    north, east, down = wind
    u = airspeed * math.cos(alpha) + north * cos_pitch - down * sin_pitch
    w = airspeed * math.sin(alpha) + north * sin_pitch + down * cos_pitch
    for name, value in {
        "lat-geod-deg": 46.8,
        "long-gc-deg": 0.0,
        "h-sl-ft": altitude / FT,
        "psi-true-rad": 0.0,
        "theta-rad": pitch,
        "phi-rad": 0.0,
        "u-fps": u / FT,
        "v-fps": east / FT,
        "w-fps": w / FT,
    }.items():
        fdm[f"ic/{name}"] = value
    fdm.run_ic()
    for name, speed in zip(("north", "east", "down"), wind):
        fdm[f"atmosphere/wind-{name}-fps"] = speed / FT
    if wind == CALM:
        fdm["atmosphere/psiw-rad"] = 0.0
    else:  # evaluates the derivatives in this wind and fills the integrators' histories with them
        fdm.set_dt(1e-12)
        for _ in range(5):
            fdm.run()
        fdm.set_dt(DT)


def command(fdm, aileron, elevator, throttle):
    fdm["fcs/aileron-cmd-norm"] = aileron
    fdm["fcs/elevator-cmd-norm"] = elevator
    fdm["fcs/throttle-cmd-norm"] = throttle


def clip(x, low, high):
    return min(max(x, low), high)


def white(rng):
    def at(_fdm, _k):
        return rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0, 1)

    return at


def held(rng):
    kept = None

    def at(_fdm, k):
        nonlocal kept
        if k % 25 == 0:  # 0.25 s
            kept = rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6), rng.uniform(0, 1)
        return kept

    return at


def ornstein_uhlenbeck(rng):
    """Commands of slow correlated noise about a nose-up elevator, with which the wing stalls."""
    x = [0.0, 0.0, 0.0]

    def at(_fdm, _k):
        for i in range(3):  # correlation time 0.5 s, standard deviation 0.35
            x[i] += -x[i] * DT / 0.5 + 0.35 * math.sqrt(2 * DT / 0.5) * rng.gauss(0, 1)
        return clip(x[0], -1, 1), clip(-0.25 + x[1], -1, 1), clip(0.4 + x[2], 0, 1)

    return at


def pid(roll_deg, pitch_deg, airspeed=20.0):
    """A simple attitude controller with realistic commands. Its accuracy does not matter."""
    roll, pitch = math.radians(roll_deg), math.radians(pitch_deg)
    integral = [0.0, 0.0, 0.0]

    def at(fdm, _k):
        errors = (
            roll - fdm["attitude/phi-rad"],
            pitch - fdm["attitude/theta-rad"],
            airspeed - fdm["velocities/vt-fps"] * FT,
        )
        for i, error in enumerate(errors):
            integral[i] = clip(integral[i] + error * DT, -1.0, 1.0)
        aileron = 1.2 * errors[0] + 0.3 * integral[0] - 0.06 * fdm["velocities/p-rad_sec"]
        elevator = -(1.5 * errors[1] + 0.8 * integral[1] - 0.25 * fdm["velocities/q-rad_sec"])
        throttle = 0.25 + 0.15 * errors[2] + 0.05 * integral[2]
        return clip(aileron, -1, 1), clip(elevator, -1, 1), clip(throttle, 0, 1)

    return at


def with_gust(history):
    """The commands of `history`, with a gust that begins in the step at 2 s."""

    def at(fdm, k):
        if k == 200:
            velocity = (2.0, -1.0, -3.0)
            for name, value in {
                "startup-duration-sec": 0.5,
                "steady-duration-sec": 0.3,
                "end-duration-sec": 0.8,
                "magnitude-ft_sec": math.hypot(*velocity) / FT,
                "frame": 3,  # north-east-down
                "X-velocity-ft_sec": velocity[0],
                "Y-velocity-ft_sec": velocity[1],
                "Z-velocity-ft_sec": velocity[2],
                "start": 1,
            }.items():
                fdm[f"atmosphere/cosine-gust/{name}"] = value
        return history(fdm, k)

    return at


FLIGHTS = {  # name: (command history, steady wind)
    "white": (white(random.Random(11)), CALM),
    "held": (held(random.Random(12)), CALM),
    "ornstein_uhlenbeck": (ornstein_uhlenbeck(random.Random(13)), CALM),
    "pid_30_5": (pid(30, 5), CALM),
    "pid_50_20": (pid(50, 20), CALM),
    "pid_m40_m20": (pid(-40, -20), CALM),
    "wind": (pid(20, 5), (5.0, -3.0, 1.0)),
    "gust": (with_gust(pid(10, 5)), CALM),
}


def fly(history, wind):
    """The rows of one flight: the commands of every step, and the state after every fifth step."""
    fdm = load()
    start(fdm, wind=wind)
    rows = []
    for k in range(STEPS):
        # The file holds six decimals, so the commands are rounded to six before they are flown.
        inputs = [round(x, 6) for x in history(fdm, k)]
        command(fdm, *inputs)
        fdm.run()
        row = [repr(x) for x in inputs]
        if (k + 1) % STATE_EVERY == 0:
            row += [repr(fdm[name] * factor) for name, factor in STATE.values()]
        rows.append(row + [""] * (3 + len(STATE) - len(row)))
    return rows


def write_flights(out):
    header = ",".join(["aileron", "elevator", "throttle", *STATE])
    for name, (history, wind) in FLIGHTS.items():
        lines = [",".join(row) for row in fly(history, wind)]
        (out / f"{name}.csv").write_text("\n".join([header, *lines]) + "\n")


# Turbulence statistics: flights with level wings at 20 m/s and 400 m, where the intensity depends on
# both the wind at 20 ft and the severity. The first 20 s of every flight are left out.
EPISODES, SKIPPED, KEPT = 400, 2000, 6000
WIND_20FT, SEVERITY = 7.6, 3
BANDS_HZ = (0.05, 0.2, 0.8, 3.0, 12.0)
BINS = 5  # neighbouring frequencies of 1/60 Hz that are averaged into a band
GUSTS = {
    "north": ("atmosphere/turb-north-fps", FT),
    "east": ("atmosphere/turb-east-fps", FT),
    "down": ("atmosphere/turb-down-fps", FT),
    "p": ("atmosphere/p-turb-rad_sec", 1.0),
    "q": ("atmosphere/q-turb-rad_sec", 1.0),
    "r": ("atmosphere/r-turb-rad_sec", 1.0),
}


def turbulent_flight(seed):
    """The six turbulence signals of one flight, as an array of KEPT rows."""
    fdm = load()
    alpha = math.radians(0.858)  # level trim at 20 m/s
    start(fdm, airspeed=20.0, altitude=400.0, pitch=alpha, alpha=alpha)
    fdm["atmosphere/randomseed"] = seed
    fdm["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = WIND_20FT / FT
    fdm["atmosphere/turbulence/milspec/severity"] = SEVERITY
    signals = np.empty((KEPT, len(GUSTS)))
    for k in range(SKIPPED + KEPT):
        roll, pitch = fdm["attitude/phi-rad"], fdm["attitude/theta-rad"]
        p, q = fdm["velocities/p-rad_sec"], fdm["velocities/q-rad_sec"]
        heading = math.remainder(fdm["attitude/psi-rad"], 2 * math.pi)
        aileron = clip(1.2 * (-0.5 * heading - roll) - 0.06 * p, -1, 1)
        elevator = clip(0.0688 / 0.5235 - 1.5 * (alpha - pitch) + 0.25 * q, -1, 1)
        command(fdm, aileron, elevator, 0.185)
        fdm.run()
        if k >= SKIPPED:
            signals[k - SKIPPED] = [fdm[name] * factor for name, factor in GUSTS.values()]
    return signals


def seed(episode):
    """A seed far from the others: JSBSim's congruential generator gives similar numbers for near seeds."""
    return (episode * 1_103_515_245 + 12_345) % 2**31


def power(signals):
    """Mean square of each signal, then its periodogram averaged over each band."""
    spectrum = np.abs(np.fft.rfft(signals, axis=0)) ** 2 * DT / KEPT
    rows = [np.mean(signals**2, axis=0)]
    for band in BANDS_HZ:
        first = round(band * KEPT * DT)
        rows.append(np.mean(spectrum[first : first + BINS], axis=0))
    return np.array(rows)


def write_turbulence(out):
    powers = np.array([power(turbulent_flight(seed(k))) for k in range(EPISODES)])
    mean = powers.mean(axis=0)
    error = powers.std(axis=0, ddof=1) / math.sqrt(EPISODES)
    rows = ["mean_square", *(f"psd_{band}_hz" for band in BANDS_HZ)]
    statistics = {
        row: {name: [mean[i, j], error[i, j]] for j, name in enumerate(GUSTS)}
        for i, row in enumerate(rows)
    }
    note = "[mean, standard error] over the flights; m2/s2 or rad2/s2; the spectra two-sided, per Hz"
    document = {"note": note, "episodes": EPISODES, "statistics": statistics}
    (out / "turbulence.json").write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE, help="folder to write to")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    if jsbsim.__version__ != "1.3.3":
        raise SystemExit(f"JSBSim {jsbsim.__version__} found; the golden files are of 1.3.3")
    write_flights(out)
    write_turbulence(out)
