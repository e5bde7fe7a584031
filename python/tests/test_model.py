"""Tests of models on numpy arrays."""

from __future__ import annotations

import numpy as np
import pytest

import greylag

STATE = np.array([0.2, 0.05, 18.0, 0.1, -0.05, 0.02, 0.04, 0.01])
CONTROLS = np.array([0.02, -0.03, 0.4])


def rk4(model: greylag.Model, state: np.ndarray, controls: np.ndarray, step: float = 0.01) -> np.ndarray:
    """One step of the classical Runge–Kutta scheme, as a reference."""
    k1 = model.derivative(state, controls)
    k2 = model.derivative(state + step / 2 * k1, controls)
    k3 = model.derivative(state + step / 2 * k2, controls)
    k4 = model.derivative(state + step * k3, controls)
    return state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def test_a_step_is_the_integral_of_the_derivative():
    model = greylag.Model.load("params/x8/prior.toml")
    random = np.random.default_rng(1)
    # 37 rows are two full blocks of sixteen SIMD lanes and a partial block
    states = STATE + 0.05 * random.standard_normal((37, 8))
    controls = CONTROLS + 0.02 * random.standard_normal((37, 3))
    # single precision has seven digits: the error of an airspeed of 18 m/s is about 1e-6 m/s
    assert np.abs(model.step(states, controls) - rk4(model, states, controls)).max() < 1e-5
    assert np.array_equal(model.step(states, controls)[36], model.step(states[36], controls[36]))


def test_a_rollout_is_one_step_after_another():
    model = greylag.Model.load("params/x8/prior.toml")
    states = np.tile(STATE, (20, 1)).astype(np.float32)
    flown = model.rollout(states, np.tile(CONTROLS, (5, 1)))
    assert flown.shape == (6, 20, 8)
    for _ in range(5):
        states = model.step(states, CONTROLS)
    assert np.array_equal(flown[5], states)


def test_the_simulators_scheme_remembers_within_a_rollout():
    model = greylag.Model.load(greylag.EXACT_MODEL)
    flown = model.rollout(STATE, np.tile(CONTROLS, (2, 1)))
    forgetful = model.step(model.step(STATE, CONTROLS), CONTROLS)
    assert np.array_equal(flown[1], model.step(STATE, CONTROLS))
    # Adams–Bashforth uses the previous acceleration, so the second step of the rollout differs from a separate step
    assert 0 < np.abs(flown[2] - forgetful).max() < 1e-2


def test_what_a_model_is_can_be_read():
    model = greylag.Model.load(greylag.LEARNED_MODEL)
    assert "lift_linear" in model.effects and model.coefficients["lift_linear.CLalpha"] > 0
    assert model.start[2] == pytest.approx(16.67) and len(model.sha256) == 64
    assert list(greylag.STATE_NAMES[:3]) == ["roll_rad", "pitch_rad", "airspeed_mps"]


def test_errors_say_what_is_wrong():
    model = greylag.Model.load("params/x8/prior.toml")
    with pytest.raises(ValueError, match=r"states has the shape \[1, 7\]"):
        model.step(STATE[:7], CONTROLS)
    with pytest.raises(ValueError, match="controls have 2 columns"):
        model.step(STATE, CONTROLS[:2])
    with pytest.raises(ValueError, match=r"not finite at \(1, 2\)"):
        model.step([STATE, [0, 0, np.nan, 0, 0, 0, 0, 0]], CONTROLS)
    with pytest.raises(greylag.GreylagError, match="no-such-model.toml"):
        greylag.Model.load("no-such-model.toml")


def test_a_file_that_is_no_model_is_refused_with_the_librarys_words(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text("schema = 1\nname = 3\n")
    with pytest.raises(greylag.GreylagError, match="model.toml"):
        greylag.Model.load(path)
