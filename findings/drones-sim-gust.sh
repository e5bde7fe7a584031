#!/usr/bin/env bash
# drones-sim 0.2.0 (September 2026), simulator of quadcopters for control, estimation and learning: a gust's strength goes with the inverse of the time step. DrydenGust(intensity=2.0), its default, has some 110 m/s rms in each axis in steps
# of 10 ms, and 430 m/s in steps of 2.5 ms: at half the step, with which one looks whether a simulation has converged, the wind is twice as strong. Noise whose variance goes with 1/dt is added once a step, where the equation that the class
# gives for itself multiplies it by dt. Carried out as written that equation has 1.1 m/s, at any step: the intensity over the root of pi, since the spectrum of MIL-F-8785C, whose root it takes, is one-sided and per radian.
# A quadcopter that hovers in turbulence of 0.02 m/s, which is none, is carried along at 2 m/s. The wind's mean of zero and its memory of 10 s are right, so that it looks like wind.
# Why it matters: whoever finds a drone blown away turns the intensity down until it flies, to a hundredth, and from then on the step decides on the weather: with another rate of the controller, or for a policy that is run faster than it
# was trained. Other than PyFly's (pyfly-turbulence.sh), which is too weak and has no memory, this turbulence fails by nothing but its strength.
# The documentation: "sigma [m/s]" and d(wind)/dt = -(V / L) * wind + sigma * sqrt(2*V / (pi*L)) * eta(t). Instead: DrydenGust(intensity=sigma * dt * sqrt(pi)) for a standard deviation of sigma, anew for each step.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile numpy==2.2.6 scipy==1.15.3 matplotlib==3.10.3
"$folder/v/bin/pip" -q install --no-compile --no-deps drones-sim==0.2.0
OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=Agg MPLCONFIGDIR="$folder" "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from drones_sim.dynamics.disturbances import DrydenGust
from drones_sim.dynamics.quadcopter import QuadcopterDynamics
from scipy.signal import lfilter

SIGMA, LENGTH, SPEED, SERIES = 2.0, 50.0, 5.0, 20         # the defaults of the class

def package(dt, steps, seed, intensity=SIGMA):
    gust, wind = DrydenGust(intensity=intensity, seed=seed), np.empty((steps, 3))
    for k in range(steps):
        gust.advance(k * dt, dt, np.zeros(13))
        wind[k] = gust.wind_velocity(k * dt)
    return wind

def written_out(dt, steps, seed):
    """The equation in the documentation of the class, by Euler's method: eta has the variance 1/dt."""
    noise = np.random.default_rng(seed).normal(0, 1 / np.sqrt(dt), (steps, 3))
    return lfilter([dt * SIGMA * np.sqrt(2 * SPEED / (np.pi * LENGTH))], [1, -(1 - SPEED / LENGTH * dt)], noise, axis=0)

print("drones-sim", version("drones-sim"), f"- DrydenGust(intensity={SIGMA:.0f}), three axes of {SERIES} series of 100 s, the first 30 s left out")
for dt in (0.02, 0.01, 0.005, 0.0025):
    steps, skip, lag = round(100 / dt), round(30 / dt), round(5 / dt)
    def rms_of(series):
        return np.sqrt(np.mean([(s[skip:]**2).mean() for s in series]))
    def memory(series):
        return np.mean([(s[skip:-lag] * s[skip + lag:]).mean() for s in series]) / np.mean([(s[skip:]**2).mean() for s in series])
    series = [package(dt, steps, i) for i in range(SERIES)]
    wind, right, small = rms_of(series), rms_of([written_out(dt, steps, i) for i in range(SERIES)]), rms_of([package(dt, steps, i, SIGMA * dt * np.sqrt(np.pi)) for i in range(SERIES)])
    print(f"step of {1000 * dt:4.1f} ms: {wind:6.1f} m/s rms, intensity / (root of pi * step) is {SIGMA / np.sqrt(np.pi) / dt:6.1f}; correlation after 5 s {memory(series):.2f}; "
          f"the equation as written {right:.2f} m/s; with intensity * step * root of pi {small:.2f}")
    assert abs(wind / (SIGMA / np.sqrt(np.pi) / dt) - 1) < 0.2
    assert abs(right / (SIGMA / np.sqrt(np.pi)) - 1) < 0.2 and abs(small / SIGMA - 1) < 0.2
    assert abs(memory(series) - np.exp(-5 * SPEED / LENGTH)) < 0.15

def hover(intensity, dt):
    """Level, with the thrust of its weight, and no controller: the largest speed in a minute."""
    copter = QuadcopterDynamics(disturbances=[DrydenGust(intensity=intensity, seed=3)])
    copter.reset(position=np.array([0, 0, 100.0]))
    speed = np.sqrt(copter.mass * copter.g / 4 / copter.k_f)
    fastest = 0.0
    for _ in range(round(60 / dt)):
        copter.update(dt, np.full(4, speed))
        fastest = max(fastest, np.linalg.norm(copter.get_velocity()))
    return fastest

calm, weak, weaker_step = hover(0.0, 0.01), hover(0.02, 0.01), hover(0.02, 0.005)
print(f"quadcopter that hovers for a minute: at most {calm:.3f} m/s without wind, {weak:.2f} m/s with an intensity of 0.02 m/s in steps of 10 ms, {weaker_step:.2f} m/s in steps of 5 ms")
assert calm < 1e-6 and weak > 0.5 and weaker_step > 0.5
PYTHON
