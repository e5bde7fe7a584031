#!/usr/bin/env bash
# pyfly-fixed-wing 0.1.2 (2020, the latest), a simulator of the Skywalker X8: with turbulence on, its gusts have a tenth of the strength of the intensity that was asked for, a sixtieth in the vertical, and no memory: each step of 10 ms
# is a new draw. How strong they are is set by `turbulence_sim_length`, of which the documentation says that it is the number of steps that are computed at a time, for speed: ten times as many steps weaken them to a third.
# The wind gives its arguments to the Dryden model one place off: the number of steps is taken for the sampling time in seconds, the step for the span, and the span for the height above ground. The same model, with its arguments in
# place, has the strength of MIL-F-8785C and gusts that last for seconds.
# Why it matters: "severe", 3.2 m/s along and 2.3 m/s in the vertical, is 0.3 and 0.04 m/s of noise that an airframe does not follow; a controller or a learned policy that was shown to hold in it has flown in calm air, and an identification that
# was shown to bear turbulence was shown white noise.
# The documentation: "stochastic turbulence, modeled with the Dryden turbulence model". Instead: before reset(), sim.wind.dryden = DrydenGustModel(sim.dt, sim.params["b"], h=..., V_a=..., intensity=...), and its seed.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile numpy==2.2.6 scipy==1.15.3 matplotlib==3.10.3
"$folder/v/bin/pip" -q install --no-compile --no-deps pyfly-fixed-wing==0.1.2
OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" -W ignore - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from pyfly.dryden import DrydenGustModel
from pyfly.pyfly import PyFly

STEPS = 24_000   # four minutes at 100 Hz

def made(intensity, length=None, mended=False):
    """A simulator, ready to step."""
    settings = {"turbulence": True, "turbulence_intensity": intensity}
    sim = PyFly(config_kw=settings | ({"turbulence_sim_length": length} if length else {}))
    if mended:
        sim.wind.dryden = DrydenGustModel(sim.dt, sim.params["b"], h=100, V_a=25, intensity=intensity)
    sim.seed(1)
    sim.reset()
    return sim

def gusts(sim):
    """RMS of the gusts along, across and down (m/s) and of the roll rate's (deg/s), the step's correlation with the next."""
    seen = np.array([np.r_[sim.wind.get_turbulence_linear(k), np.degrees(sim.wind.get_turbulence_angular(k)[0])] for k in range(STEPS)]).T
    return np.sqrt(np.mean(seen**2, 1)), np.array([np.corrcoef(x[1:], x[:-1])[0, 1] for x in seen[:3]])

print("pyfly-fixed-wing", version("pyfly-fixed-wing"), "- gusts along, across, down (m/s), roll rate (deg/s)")
feet = 100 * 3.281
for intensity, knots in (("light", 15), ("severe", 45)):
    down = 0.1 * knots * 0.5144
    along = down / (0.177 + 0.000823 * feet) ** 0.4
    print(f"{intensity}: MIL-F-8785C at 100 m: {along:.2f} {along:.2f} {down:.2f}")
    as_is, memory = gusts(made(intensity))
    longer, _ = gusts(made(intensity, 3000))
    right, right_memory = gusts(made(intensity, 3000, mended=True))
    print("  as installed              ", as_is.round(3), "correlation of a step with the next", memory.round(3))
    print("  turbulence_sim_length 3000", longer.round(3))
    print("  arguments in place        ", right.round(3), "correlation of a step with the next", right_memory.round(4))
    assert as_is[0] < 0.13 * along and as_is[2] < 0.02 * down and np.all(abs(memory) < 0.05)
    assert np.allclose(as_is / longer, np.sqrt(10), rtol=0.1)   # noise of the sampling time 300 s, then 3000 s
    assert np.allclose(right[:3], (along, along, down), rtol=0.35) and np.all(right_memory > 0.99)

print("sampling time that the model was given:", made("severe").wind.dryden.dt, "s; step of the simulator:", made("severe").dt, "s")
assert made("severe").wind.dryden.dt == 300
PYTHON
