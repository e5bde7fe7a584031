#!/usr/bin/env bash
# jax-sysid 1.1.0 (May 2026), identification of continuous-time models (CTModel): the input acts one sample too early. Between T[k] and T[k+1] the model gets U[k+1], where U[k] is meant, with the default interpolation, the zero-order hold: a
# first-order lag answers to a step before the step comes, and is ahead of the exact response by one sample from then on. (At the instants themselves it is U[k], so that a solver which ends there sees a little of both.)
# A fit makes up for the lead by whatever parameters it has. A short period without noise, sampled at 25 Hz with the elevator held between the samples as a servo's signal is, comes back with a fifth of its pitch damping M_q (-0.6 where -3 is
# true), with 1.7 times Z_alpha, 1.4 times M_alpha and three quarters of the elevator's effect, and R2 is 0.9 and more. With the input delayed by one sample all four are right to 4 %.
# interpolation_type="linear" draws a line from U[k] to U[k+1] and so is half a sample early for a signal that was held.
# Why it matters: logs of 10 to 50 Hz are what there is of most flights, one sample is then the size of a servo's or an estimator's delay, and the damping is what a gain is chosen by. Plots look right, and so does the score.
# Source: CTModel.integration_options(), input_fcn_gen(): a time before the first one is put before Tu, and U[-1] after the last of U, so that each value stands one place too early for diffrax.rectilinear_interpolation(), which holds forward.
# The documentation: "a zero-order hold (ZOH) keeps the samples U[k] constant over each time interval in T"; the comment in the source: "u(t) = u[k] for t in [Tu[k],Tu[k+1])".
# Instead: hand over np.vstack((U[:1], U[:-1])) for U, to fit() and predict(), with outputs that do not depend on u directly; the discrete-time models of the package (LinearModel, Model) do not interpolate.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile --no-deps jax-sysid==1.1.0 jax==0.4.31 jaxlib==0.4.31 jaxopt==0.8.5 diffrax==0.6.1 equinox==0.11.10 optimistix==0.0.10 lineax==0.0.7 jaxtyping==0.3.11 wadler_lindig==0.1.8 \
    typeguard==2.13.3 typing_extensions==4.16.0 opt_einsum==3.4.0 ml_dtypes==0.6.0 joblib==1.4.2 numpy==2.2.6 scipy==1.14.1
JAX_PLATFORMS=cpu OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" -W ignore - <<'PYTHON'
from importlib.metadata import version

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp
from jax_sysid.models import CTModel
from scipy.signal import cont2discrete

print("jax-sysid", version("jax-sysid"))

def held(A, B, U, dt):
    """States of x' = A x + B u at the samples, u held in between: exact, by the matrix exponential."""
    n = len(A)
    Ad, Bd, *_ = cont2discrete((A, B, np.eye(n), np.zeros((n, B.shape[1]))), dt, "zoh")
    X = np.zeros((len(U), n))
    for k in range(len(U) - 1):
        X[k + 1] = Ad @ X[k] + Bd @ U[k]
    return X

later = lambda U: np.vstack((U[:1], U[:-1]))

# A lag of 0.2 s and a step at 1.0 s, sampled at 10 Hz.
dt, n = 0.1, 30
T, U = np.arange(n) * dt, np.zeros((n, 1))
U[10:] = 1
exact = held(np.array([[-5.0]]), np.array([[5.0]]), U, dt)[:, 0]
lag = CTModel(1, 1, 1, state_fcn=lambda x, u, t, p: p[0] * (u - x))
response = {}
for name, kind, inputs in (("default (zoh)", "zoh", U), ("linear", "linear", U), ("zoh, U one sample later", "zoh", later(U))):
    lag.integration_options(interpolation_type=kind)
    lag.init(params=[jnp.array(5.0)])
    response[name] = np.asarray(lag.predict(np.zeros(1), inputs, T)[0]).ravel()
response["exact"] = exact
print("a step at 1.0 s, output at " + ", ".join(f"{t:.1f}" for t in T[9:14]) + " s")
for name, y in response.items():
    print(f"{name:24} {np.round(y[9:14], 3)}")
early, delayed = response["default (zoh)"], response["zoh, U one sample later"]
assert early[10] > 0.01 and abs(early[11:25] - exact[12:26]).max() < 0.03 and abs(early - exact).max() > 0.4
assert abs(delayed - exact).max() < 0.03 and abs(response["linear"] - exact).max() > 0.2

# A short period: w' = Zw w + q, q' = Mw w + Mq q + Md elevator; angle of attack w and pitch rate q, both measured without noise at 25 Hz.
names, true = ("Z_alpha", "M_alpha", "M_q", "M_delta"), np.array([-2.0, -12.0, -3.0, -20.0])
dt, n = 0.04, 90
T, U = np.arange(n) * dt, np.zeros((n, 1))
for begin, end, side in ((0.2, 0.8, 1), (0.8, 1.2, -1), (1.2, 1.4, 1), (1.4, 1.6, -1)):
    U[round(begin / dt):round(end / dt)] = side * np.radians(4)
Y = held(np.array([[true[0], 1.0], true[1:3]]), np.array([[0.0], [true[3]]]), U, dt)

def fitted(inputs):
    model = CTModel(2, 2, 1, state_fcn=lambda x, u, t, p: jnp.array([p[0] * x[0] + x[1], p[1] * x[0] + p[2] * x[1] + p[3] * u[0]]))
    model.integration_options()
    model.loss(rho_x0=0.0, rho_th=0.0, train_x0=False)
    model.optimization(adam_epochs=0, lbfgs_epochs=200, iprint=-1)
    model.init(params=[jnp.array(value) for value in (-1.0, -8.0, -2.0, -15.0)], x0=np.zeros(2))
    model.fit(50 * Y, 50 * inputs, T)
    return model, np.array([float(value) for value in model.params])

print("true                    ", dict(zip(names, true.tolist())))
(model, found), (_, right) = fitted(U), fitted(later(U))
residual = Y - np.asarray(model.predict(model.x0, U, T)[0])
score = 1 - (residual**2).sum(0) / ((Y - Y.mean(0)) ** 2).sum(0)
print("fitted as recorded      ", dict(zip(names, np.round(found, 2).tolist())), "R2 of angle of attack and pitch rate", np.round(score, 3))
print("fitted, U a sample later", dict(zip(names, np.round(right, 2).tolist())))
ratio = found / true
assert score.min() > 0.9 and ratio[2] < 0.4 and ratio[0] > 1.4 and ratio[1] > 1.25 and ratio[3] < 0.85
assert abs(right / true - 1).max() < 0.05
PYTHON
