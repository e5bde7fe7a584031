#!/usr/bin/env bash
# python-control 0.10.2 and aeroid 0.5.0, an identification package of 2026, fly an aircraft that is in trim past a whole doublet of the elevator: zeros, with `success` true, although the input is given at
# every 10 ms. Their adaptive solver looks at the input only where it steps, and its step grows tenfold as long as nothing moves. python-control's forced_response() is exact for the matrices, and loses the doublet for
# the same model as a nonlinear system. aeroid then says of a clean flight that the "residuals are insensitive to all parameters"; had the doublet begun 3 s later, it would have found all three within two percent.
# Why it matters: whether a simulated manoeuvre is flown depends on nothing but the second at which it begins. What follows a manoeuvre that was seen is seen.
# Documentation: python-control warns of inaccuracy with discontinuous inputs and offers LSODA, a smaller `rtol` or a `max_step`, of which only the last helps: an error of exactly zero meets any tolerance. aeroid asks
# for inputs "sampled fast relative to their frequency content", as these are. Instead: `max_step` of one sample, for both.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/v" && "$folder/v/bin/pip" -q install control==0.10.2 aeroid==0.5.0 numpy==2.2.6 scipy==1.15.3
"$folder/v/bin/python" - <<'PYTHON'
from importlib.metadata import version

import aeroid
import control
import numpy as np

# short period of a small aircraft: angle of attack and pitch rate, elevator; rad and s
A, B = np.array([[-2.0, 0.98], [-30.0, -3.0]]), np.array([[-0.1], [-40.0]])
linear = control.ss(A, B, np.eye(2), 0)
nonlinear = control.nlsys(lambda t, x, u, p: A @ x + B @ u, None, inputs=1, states=2, outputs=2)
time = np.arange(0, 30, 0.01)

def doublet(start, width):
    up, down = (time >= start) & (time < start + width), (time >= start + width) & (time < start + 2 * width)
    return 0.05 * (up * 1.0 - down * 1.0)

def peak(response):
    assert response.success and abs(response.inputs).max() == 0.05
    return float(abs(response.outputs[1]).max())

print("python-control", control.__version__, "- peak of the pitch rate, rad/s, for a doublet of 0.05 rad and 1 s a side that begins at 5 s")
u = doublet(5, 1)
found = {
    "forced_response, linear": peak(control.forced_response(linear, time, u)),
    "forced_response, nonlinear": peak(control.forced_response(nonlinear, time, u)),
    "input_output_response, linear": peak(control.input_output_response(linear, time, u)),
    "input_output_response, nonlinear": peak(control.input_output_response(nonlinear, time, u)),
}
advised = {
    "LSODA": dict(solve_ivp_method="LSODA"),
    "rtol 1e-4": dict(solve_ivp_kwargs={"rtol": 1e-4}),
    "rtol 1e-10": dict(solve_ivp_kwargs={"rtol": 1e-10}),
    "max_step 0.01": dict(solve_ivp_kwargs={"max_step": 0.01}),
}
found |= {name: peak(control.input_output_response(nonlinear, time, u, **how)) for name, how in advised.items()}
for name, value in found.items():
    print(f"{name:34} {value:.4f}")
exact = found.pop("forced_response, linear")
assert exact > 0.4 and abs(found.pop("max_step 0.01") - exact) < 1e-3 and set(found.values()) == {0.0}

starts = np.arange(1, 20, 0.5)
for width in (0.25, 0.5, 1.0):
    lost = [s for s in starts if peak(control.input_output_response(nonlinear, time, doublet(s, width))) == 0]
    print(f"{width} s a side, begun between 1 s and 19.5 s: {len(lost)} of {len(starts)} are lost")
    assert 0.1 < len(lost) / len(starts) < 0.95

model = aeroid.Model(
    states=("alpha", "q"), controls=("elevator",), parameters={"M_alpha": -20.0, "M_q": -2.0, "M_elevator": -30.0},
    dynamics=lambda t, x, u, p: [A[0] @ x + B[0, 0] * u[0], p["M_alpha"] * x[0] + p["M_q"] * x[1] + p["M_elevator"] * u[0]],
)

def identified(start, **options):
    u = doublet(start, 1)
    y = np.array(control.forced_response(linear, time, u).outputs) + np.random.default_rng(0).normal(size=(2, len(time))) * [[0.002], [0.01]]
    flight = aeroid.FlightData(time, {"alpha": y[0], "q": y[1], "elevator": u})
    try:
        return aeroid.identify(model, flight, tuple(model.parameters), x0={"alpha": 0.0, "q": 0.0}, simulate_options=options).parameters
    except aeroid.IdentificationError as refusal:
        return str(refusal)

print("aeroid", version("aeroid"), "- M_alpha, M_q, M_elevator are -30, -3, -40")
for start, options in ((5, {}), (8, {}), (5, {"max_step": 0.01})):
    got = identified(start, **options)
    print(f"begun at {start} s {options or ''}:", got if isinstance(got, str) else {name: round(value, 2) for name, value in got.items()})
    if start == 5 and not options:
        assert got == "residuals are insensitive to all parameters"
    else:
        assert np.allclose(list(got.values()), [-30, -3, -40], rtol=0.03)
PYTHON
