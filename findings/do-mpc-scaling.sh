#!/usr/bin/env bash
# do-mpc 5.1.2 (2026), model-predictive control and moving-horizon estimation: a scaling factor, which is there for the solver's numbers, changes the controller and the estimate. set_rterm(thrust=r) weighs the change of the scaled input, so
# that a scaling of 100 makes the penalty a ten-thousandth: the first step of the thrust is 81 N where it was 11 N. A penalty of one's own, (u - u_prev)^2, takes the input in newtons and the one before in hundreds of newtons, and so
# weighs the thrust itself: 18.35 m/s are held where 20 were asked for, and 20.00 without scaling, without an error or a bound that was met.
# In the estimator the measurement equation gets the scaled parameter, the dynamics the unscaled one: of a gyro's bias of 0.02 rad/s 0.0002 are found with a scaling of 0.01, and 0.2 with 10. Attitude and rate are right with each, since
# the bias that is subtracted inside is right; only what is read out, and written to the next controller, is not.
# Why it matters: thrust in newtons or pulses of 1500 us beside angles in radians is what scaling is suggested for, and it is added after tuning, when the solver is slow.
# The documentation of `scaling`: "For the objective function and the nonlinear constraints the unscaled variables are used." Instead: no scaling of inputs and estimated parameters (states may be), or r times the square of it; or units near one.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install --no-compile do-mpc==5.1.2 casadi==3.8.2 numpy==2.2.6 pandas==2.2.3 matplotlib==3.10.3
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" -W ignore - <<'PYTHON'
from importlib.metadata import version

import do_mpc
import numpy as np

QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": 0}
DT, MASS, DRAG, TRIM = 0.5, 20.0, 2.0, 36.0      # s, kg, N/(m/s), N at 18 m/s
KEEP = np.exp(-DRAG / MASS * DT)

def speed_hold(scaling, weight, own):
    """60 s from 18 m/s with a setpoint of 20 m/s; the model is the aircraft."""
    model = do_mpc.model.Model("discrete")
    speed, thrust = model.set_variable("_x", "speed"), model.set_variable("_u", "thrust")
    model.set_rhs("speed", KEEP * speed + (1 - KEEP) / DRAG * thrust)
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.nlpsol_opts = 20, DT, QUIET
    error = (model.x["speed"] - 20) ** 2
    mpc.set_objective(mterm=error, lterm=error)
    if own:
        mpc.set_rterm(weight * (model.u["thrust"] - mpc.u_prev["thrust"]) ** 2)
    else:
        mpc.set_rterm(thrust=weight)
    mpc.scaling["_u", "thrust"] = scaling
    mpc.bounds["lower", "_u", "thrust"], mpc.bounds["upper", "_u", "thrust"] = 0, 200
    mpc.setup()
    x = np.array([[18.0]])
    mpc.x0, mpc.u0 = x, np.array([[TRIM]])
    mpc.set_initial_guess()
    thrusts = []
    for _ in range(120):
        u = mpc.make_step(x)
        assert mpc.solver_stats["success"]
        x = KEEP * x + (1 - KEEP) / DRAG * u
        thrusts.append(u[0, 0])
    return thrusts[0] - TRIM, x[0, 0]

def gyro_bias(scaling):
    """10 s of rolling with attitude and gyro measured, the gyro off by 0.02 rad/s."""
    model = do_mpc.model.Model("discrete")
    roll, rate = model.set_variable("_x", "roll"), model.set_variable("_x", "rate")
    bias, aileron = model.set_variable("_p", "bias"), model.set_variable("_u", "aileron")
    model.set_rhs("roll", roll + 0.1 * rate)
    model.set_rhs("rate", 0.7 * rate + 0.3 * aileron)
    model.set_meas("attitude", roll, meas_noise=True)
    model.set_meas("gyro", rate + bias, meas_noise=True)
    model.set_meas("surface", aileron, meas_noise=False)
    model.setup()
    mhe = do_mpc.estimator.MHE(model, ["bias"])
    mhe.settings.n_horizon, mhe.settings.t_step, mhe.settings.meas_from_data, mhe.settings.nlpsol_opts = 15, 0.1, True, QUIET
    mhe.set_default_objective(P_x=np.eye(2), P_v=1e4 * np.eye(2), P_p=0.01 * np.eye(1))
    mhe.scaling["_p_est", "bias"] = scaling
    mhe.setup()
    mhe.x0, mhe.p_est0 = np.zeros((2, 1)), np.zeros((1, 1))
    mhe.set_initial_guess()
    rng, x = np.random.default_rng(1), np.zeros(2)
    for k in range(100):
        u = 0.3 * np.sin(0.7 * k)
        x = np.array([x[0] + 0.1 * x[1], 0.7 * x[1] + 0.3 * u])
        attitude, gyro = x + [0, 0.02] + 1e-3 * rng.standard_normal(2)
        estimate = mhe.make_step(np.array([[attitude], [gyro], [u]]))
    return mhe.data["_p", "bias"][-1, 0], abs(estimate.ravel() - x).max()

print("do-mpc", version("do-mpc"), "- speed hold, 18 to 20 m/s, penalty 0.02 on the change of thrust squared")
flown = {}
for scaling, weight, own in ((1, 0.02, False), (100, 0.02, False), (100, 0.02 * 100**2, False), (1, 0.02, True), (100, 0.02, True)):
    flown[scaling, weight, own] = first, final = speed_hold(scaling, weight, own)
    print(f"{'own expression' if own else 'set_rterm(thrust=r)':20s} r = {weight:6.2f}, scaling {scaling:3d}: first step {first:6.2f} N, speed after 60 s {final:6.3f} m/s")
biases = {scaling: gyro_bias(scaling) for scaling in (1, 0.01, 10)}
for scaling, (bias, error) in biases.items():
    print(f"gyro bias of 0.02 rad/s, scaling {scaling:5}: {bias:9.6f}; largest error of roll and rate {error:.5f} rad, rad/s")
plain, scaled, undone = flown[1, 0.02, False], flown[100, 0.02, False], flown[100, 0.02 * 100**2, False]
assert 9 < plain[0] < 12 and 75 < scaled[0] < 90 and np.allclose(plain, undone, atol=0.01)
assert np.allclose(flown[1, 0.02, True], plain, atol=0.01) and 18.1 < flown[100, 0.02, True][1] < 18.6 and abs(plain[1] - 20) < 0.01
assert abs(biases[1][0] - 0.02) < 5e-4 and abs(biases[0.01][0] - 0.0002) < 5e-6 and abs(biases[10][0] - 0.2) < 5e-3
assert all(error < 2e-3 for _, error in biases.values())
PYTHON
