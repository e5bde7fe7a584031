#!/usr/bin/env bash
# llsi 0.5.0 (December 2025), system identification: the time scale of a model depends on how many columns the record has. SysIdData.downsample(q), a step of the package's own introduction, multiplies the sampling time by q
# once for each series: by q^2 with an input and an output, by q^3 with an attitude beside them. A short period of 6 rad/s, read at 100 Hz and taken down to 50, is identified with 3 rad/s, and with 0.75 rad/s
# when two more channels of the same flight are in the record. The poles of the discrete model are right, the damping ratio is right, and so is the fit: all of it is counted in samples.
# And the delay of an ARX model is in its simulation alone: frequency_response() and to_tf() leave `nk` out. A model that was fitted with 70 ms, and repeats the record to the last digit, has a frequency response without
# them, 24 degrees of phase too good at the frequency where it is to be controlled.
# Why it matters: a gain, a filter, or a margin that is computed from either is for another aircraft, and the fit in percent, which is what is looked at, says 100.
# The introduction has equidistant(), downsample(3), crop() and center() in this order and does not speak of it. Instead: decimate each channel with scipy.signal.decimate, and build the record with the new Ts; multiply by z^-nk.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v"
"$folder/v/bin/pip" -q install --no-compile numpy==2.2.6 scipy==1.15.3 numba==0.61.2 matplotlib==3.10.3 tqdm==4.67.1
"$folder/v/bin/pip" -q install --no-compile --no-deps llsi==0.5.0
OPENBLAS_NUM_THREADS=1 "$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import llsi
import numpy as np
from scipy.signal import cont2discrete, lfilter

DT, OMEGA, ZETA, DELAY = 0.01, 6.0, 0.5, 6
rng = np.random.default_rng(3)
elevator = np.repeat(rng.choice([-1.0, 1.0], 100), 40)
numerator, denominator, _ = cont2discrete(([OMEGA**2], [1, 2 * ZETA * OMEGA, OMEGA**2]), DT)
numerator = numerator.ravel()
rate = lfilter(numerator, denominator, elevator)

def pole(matrix, step):
    """Natural frequency and damping ratio."""
    s = np.log(np.linalg.eigvals(matrix).astype(complex)[0]) / step
    return abs(s), -s.real / abs(s)

print("llsi", version("llsi"), "- a mode of 6 rad/s and damping 0.5, 40 s at 100 Hz, taken down to 50 Hz by downsample(2)")
for more in (0, 1, 2):
    others = {name: np.cumsum(rate) * DT for name in ("pitch", "height")[:more]}
    data = llsi.SysIdData(t=np.arange(len(rate)) * DT, elevator=elevator, rate=rate, **others)
    data.equidistant()
    data.downsample(2)
    assert data.N == len(rate) // 2
    model = llsi.sysid(data, "rate", "elevator", (2,), method="po-moesp")
    omega, zeta = pole(model.A, model.Ts)
    true = pole(model.A, 2 * DT)
    fit = model.compare(data["rate"], data["elevator"])
    print(f"{2 + more} series: Ts {model.Ts:.3f} s, true 0.020; record of {data.time()[-1]:.1f} s; mode {omega:.2f} rad/s, damping {zeta:.2f}, fit {fit:.1%}; with the true Ts {true[0]:.2f} rad/s")
    assert abs(model.Ts / DT - 2 ** (2 + more)) < 1e-3
    assert abs(true[0] - OMEGA) < 0.1 and abs(zeta - ZETA) < 0.02 and fit > 0.98
    assert abs(omega - OMEGA / 2 ** (1 + more)) < 0.1

late = np.r_[np.zeros(DELAY), rate[:-DELAY]]
model = llsi.sysid(llsi.SysIdData(Ts=DT, u=elevator, y=late), "y", "u", (2, 2, DELAY + 1), method="arx")
error = np.linalg.norm(model.simulate(elevator).ravel() - late) / np.linalg.norm(late)
z = np.exp(1j * OMEGA * DT)
true = np.polyval(numerator, z) / np.polyval(denominator, z) * z**-DELAY
shown = model.frequency_response(np.array([OMEGA]))[1].ravel()[0]
function = model.to_tf()
of_function = np.polyval(function.num, z) / np.polyval(function.den, z)
print(f"ARX with nk = {model.nk}: misfit of its simulation {error:.0e}; phase at 6 rad/s {np.degrees(np.angle(true)):.1f} degrees, frequency_response() {np.degrees(np.angle(shown)):.1f}, to_tf() {np.degrees(np.angle(of_function)):.1f}")
assert error < 1e-9 and np.isclose(abs(shown), abs(true)) and np.isclose(abs(of_function), abs(true))
lost = np.degrees(np.angle(shown / true))
assert abs(lost - np.degrees(OMEGA * DT) * (DELAY + 1)) < 0.1
assert np.degrees(np.angle(of_function / true)) > 15
PYTHON
