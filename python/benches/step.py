"""Measures how many steps of aircraft per second Python, numpy and greylag compute on one core.

    python python/benches/step.py [--aircraft 16384] [--seconds 1] [--least 0]

The first three lines of the table use the same states, controls and model (params/x8/prior.toml, RK4); the others use other models
or the environments. The script fails if ``Model.step`` with the prior makes fewer transitions per second than ``--least``.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable

# numpy is limited to one core, too
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")

import numpy as np

import greylag

STEP = 0.01


def rate(seconds: float, transitions: int, step: Callable[[], object]) -> float:
    """The transitions per second of processor time: the highest rate of several rounds within ``seconds``."""
    step()
    best, end = 0.0, time.perf_counter() + seconds
    while time.perf_counter() < end:
        begun = time.process_time()
        rounds = 0
        while time.process_time() - begun < 0.05:
            step()
            rounds += 1
        best = max(best, rounds * transitions / (time.process_time() - begun))
    return best


def rk4(model: greylag.Model, states: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """One RK4 step in numpy with the derivatives of the model, in double precision."""
    k1 = model.derivative(states, controls)
    k2 = model.derivative(states + STEP / 2 * k1, controls)
    k3 = model.derivative(states + STEP / 2 * k2, controls)
    k4 = model.derivative(states + STEP * k3, controls)
    return states + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def main() -> None:
    """Measures all variants and prints their rates."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--aircraft", type=int, default=16384)
    options.add_argument("--seconds", type=float, default=1.0)
    options.add_argument("--least", type=float, default=0.0)
    asked = options.parse_args()
    random = np.random.default_rng(1)
    model = greylag.Model.load("params/x8/prior.toml")
    learned = greylag.Model.load(greylag.LEARNED_MODEL)
    states = (model.start + 0.02 * random.standard_normal((asked.aircraft, 8))).astype(np.float32)
    controls = random.uniform([-0.1, -0.1, 0], [0.1, 0.1, 1], (asked.aircraft, 3)).astype(np.float32)
    controls = np.hstack([controls, np.zeros_like(controls[:, :1])])
    actions = random.uniform(-0.1, 0.1, (asked.aircraft, 3)).astype(np.float32)
    one = (states[0].astype(float), controls[0].astype(float))
    wide = (states.astype(float), controls.astype(float))
    envs, env = greylag.ImaginedVectorEnv(asked.aircraft), greylag.ImaginedEnv()
    exact, jsbsim = greylag.ImaginedVectorEnv(asked.aircraft, model=greylag.EXACT_MODEL), greylag.X8Env()
    for each in (envs, exact, env, jsbsim):
        each.reset(seed=1)

    def single() -> None:
        for _ in range(100):
            if any(env.step(actions[0])[2:4]):
                env.reset()

    def simulated() -> None:
        for _ in range(100):
            if any(jsbsim.step(actions[0])[2:4]):
                jsbsim.reset()

    n = asked.aircraft
    lines = [
        ("one aircraft, RK4 in Python over derivative", 1, lambda: rk4(model, *one)),
        ("batch, RK4 in numpy over derivative (double)", n, lambda: rk4(model, *wide)),
        ("Model.step, prior (single)", n, lambda: model.step(states, controls)),
        ("Model.step, learned with its residual network", n, lambda: learned.step(states, controls)),
        ("ImaginedVectorEnv.step, simulator's model", n, lambda: exact.step(actions)),
        ("ImaginedVectorEnv.step, learned", n, lambda: envs.step(actions)),
        ("Greylag/Imagined-v0, one aircraft", 100, single),
        ("Greylag/X8-v0, JSBSim", 100, simulated),
    ]
    print(f"transitions a second of one core, {n} aircraft, greylag {greylag.__version__}")
    found = {}
    for name, count, step in lines:
        found[name] = rate(asked.seconds, count, step)
        print(f"{name:48} {found[name]:14,.0f}", flush=True)
    if found[lines[2][0]] < asked.least:
        sys.exit(f"Model.step makes {found[lines[2][0]]:,.0f} transitions a second, fewer than {asked.least:,.0f}")


if __name__ == "__main__":
    main()
