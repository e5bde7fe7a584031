"""How well a recording of the acceptance script knows the air, beside the simulator's truth.

    python3 tests/firmware/estimates.py acceptance-arduplane/arduplane-surfaces [params/x8/jsbsim.toml]

Reads recording-1/flight.csv and truth.csv of that folder. The clocks are aligned by the roll angle. Prints the errors of angle of
attack and sideslip (deg), how the side force correlates with the true sideslip, the share of steps that the disturbance estimate
takes (10 ms within 1 ms), and the model's angular accelerations beside the measured ones (standard deviations, rad/s²).
Needs numpy, pandas, scipy and the package in python/.
"""

import sys
from pathlib import Path

import greylag
import numpy as np
import pandas as pd
from scipy.signal import correlate

STATES = ["roll_rad", "pitch_rad", "airspeed_mps", "p_radps", "q_radps", "r_radps", "alpha_rad", "beta_rad"]
CONTROLS = ["aileron_rad", "elevator_rad", "throttle"]


def offset(flight, truth):
    """Seconds to add to the recording's time: the least squares of the roll over 60 s."""
    grid = np.arange(truth.time_s.iloc[0], truth.time_s.iloc[-1], 0.01)
    true = np.interp(grid, truth.time_s, truth.roll_rad)
    start = flight.time_s.iloc[0] + 5.0
    roll = np.interp(start + np.arange(0.0, 60.0, 0.01), flight.time_s, flight.roll_rad)
    squares = np.convolve(true**2, np.ones(len(roll)), "valid") - 2.0 * correlate(true, roll, "valid")
    return grid[squares.argmin()] - start


def main(folder, model="params/x8/jsbsim.toml"):
    """Prints the figures."""
    flight = pd.read_csv(folder / "recording-1" / "flight.csv")
    flight = flight[flight["mode"] == "OFFBOARD"]
    truth = pd.read_csv(folder / "truth.csv")
    time = flight.time_s.to_numpy()
    steps, shift = np.diff(time), offset(flight, truth)
    print(f"{len(flight)} states, 10 ms within 1 ms apart: {(abs(steps - 0.01) < 0.001).mean():.1%}")
    true = {name: np.interp(time + shift, truth.time_s, truth[name]) for name in ["alpha_rad", "beta_rad", "airspeed_mps"]}
    for name in ["alpha_rad", "beta_rad"]:
        seen, real = np.degrees(flight[name].to_numpy()), np.degrees(true[name])
        print(f"{name}: sd {seen.std():.2f} deg, true {real.std():.2f}, error {(seen - real).std():.2f}")
    print(f"side force and true sideslip: correlation {np.corrcoef(flight.ay_mps2, true['beta_rad'])[0, 1]:.3f}")
    states, controls = flight[STATES].to_numpy(), flight[CONTROLS].to_numpy()
    exact = states.copy()
    exact[:, 6], exact[:, 7], exact[:, 2] = true["alpha_rad"], true["beta_rad"], true["airspeed_mps"]
    aircraft, altitude = greylag.Model.load(model), float(flight.altitude_m.mean())
    for words, table in [("recorded air", states), ("true air", exact)]:
        predicted = np.asarray(aircraft.derivative(table, controls, altitude_m=altitude))[:-1]
        happened = np.diff(states, axis=0) / steps[:, None]
        for i, name in [(3, "p"), (4, "q"), (5, "r")]:
            fit = np.corrcoef(happened[:, i], predicted[:, i])[0, 1]
            print(f"{words}, {name}: measured {happened[:, i].std():.2f}, model {predicted[:, i].std():.2f}, correlation {fit:.2f}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        raise SystemExit("give the folder of a flight of the acceptance script, and a model")
    main(Path(sys.argv[1]), *sys.argv[2:])
