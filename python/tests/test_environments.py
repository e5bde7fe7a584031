"""Tests of the Gymnasium environments."""

from __future__ import annotations

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import greylag
from greylag.envs import OBSERVATION_UNITS

NAMES = ["Greylag/X8-v0", "Greylag/Imagined-v0"]


@pytest.mark.parametrize("name", NAMES)
def test_gymnasium_finds_nothing_wrong(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(name).unwrapped)


@pytest.mark.parametrize("name", NAMES)
def test_stable_baselines3_finds_nothing_wrong(name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gym.make(name).unwrapped)


@pytest.mark.parametrize("name", NAMES)
def test_an_episode_is_truncated_after_ten_seconds_and_the_next_has_the_next_target(name):
    env = gym.make(name, airspeeds="start").unwrapped
    policy = greylag.Policy.load("params/x8/policy")
    seen, told = env.reset(seed=3)
    first, steps, over = told, 0, False
    while not over:
        seen, reward, lost, over, told = env.step(policy.act(seen))
        steps += 1
        assert not lost and -1.1 <= reward <= 0
    assert steps == 1000
    # the shipped policy settles; at its worst targets the remaining error can exceed half a degree
    assert abs(told["roll_left_deg"]) < 2 and abs(told["pitch_left_deg"]) < 2
    seen, told = env.reset()
    second = env.reset(seed=3), env.reset()[1]
    assert told == second[1] and told != first
    assert second[0][1] == first


def test_a_lost_aircraft_ends_its_episode_and_earns_the_worst_for_ever():
    env = gym.make("Greylag/Imagined-v0").unwrapped
    env.reset(seed=1)
    for _ in range(1000):
        seen, reward, lost, over, _ = env.step(np.array([1, -1, 1], np.float32))
        assert seen in env.observation_space
        if lost:
            break
    # -(0.5 + 0.5 + 0.1) / (1 - 0.99): the smallest reward per step, summed with the discount factor
    assert lost and not over and reward == pytest.approx(-110)


def test_both_worlds_are_the_same_where_the_model_is_exact():
    one, other = gym.make(NAMES[0]).unwrapped, gym.make(NAMES[1], model=greylag.EXACT_MODEL).unwrapped
    # JSBSim computes the initial state from earth axes, which changes the last bits
    assert np.abs(one.reset(seed=5)[0] - other.reset(seed=5)[0]).max() < 1e-6
    random = np.random.default_rng(2)
    for _ in range(50):
        action = random.uniform(-0.3, 0.3, 3).astype(np.float32)
        there, here = one.step(action), other.step(action)
        # rounding errors of single precision accumulate over half a second
        assert np.abs(there[0] - here[0]).max() < 1e-3 and there[1] == pytest.approx(here[1], abs=1e-4)


def test_the_observation_holds_what_is_left_to_the_target():
    env = gym.make("Greylag/Imagined-v0", airspeeds="start").unwrapped
    seen, told = env.reset(seed=7)
    assert np.degrees(seen[13] * OBSERVATION_UNITS[13]) == pytest.approx(told["roll_left_deg"])
    assert abs(told["roll_left_deg"]) <= 60 and abs(told["pitch_left_deg"]) <= 30
    assert told["airspeed_left_mps"] == pytest.approx(0, abs=1e-5)
    # eq. (30): |roll error| / 3.3 + |pitch error| / 2.25, each at most 0.5, and |airspeed error| / 48, at most 0.1
    _, reward, *_, told = env.step(np.zeros(3, np.float32))
    roll, pitch = np.radians([told["roll_left_deg"], told["pitch_left_deg"]])
    airspeed = min(abs(told["airspeed_left_mps"]) / 48, 0.1)
    expected = -(min(abs(roll) / 3.3, 0.5) + min(abs(pitch) / 2.25, 0.5) + airspeed)
    assert reward == pytest.approx(expected, abs=1e-5)


def test_a_vector_begins_anew_in_the_same_step():
    envs = gym.make_vec("Greylag/Imagined-v0", num_envs=20, vectorization_mode="vector_entry_point")
    assert envs.metadata["autoreset_mode"] == gym.vector.AutoresetMode.SAME_STEP
    seen, _ = envs.reset(seed=4)
    assert seen.shape == (20, 16) and seen in envs.observation_space
    again, _ = envs.reset(seed=4)
    assert np.array_equal(seen, again)
    actions = np.zeros((20, 3), np.float32)
    actions[::2] = [1, -1, 1]
    ended = np.zeros(20, bool)
    for _ in range(1000):
        seen, reward, lost, over, info = envs.step(actions)
        for i in np.flatnonzero(lost | over):
            # the new episode starts in the same state with another target; `info` has the last state of the old one
            assert np.array_equal(seen[i, :8], again[i, :8])
            assert info["_final_obs"][i] and not np.array_equal(info["final_obs"][i][:8], seen[i, :8])
        assert np.array_equal(reward == -110, lost)
        ended |= lost | over
        if ended.all():
            break
    assert ended.all() and envs.unwrapped.episodes[0] > 40


def test_a_vector_steps_as_one_aircraft_does():
    envs = greylag.ImaginedVectorEnv(3)
    env = greylag.ImaginedEnv()
    # the first aircraft gets the first target of the sequence
    seen, _ = envs.reset(seed=9)
    assert np.array_equal(seen[0], env.reset(seed=9)[0])
    for k in range(20):
        actions = np.full((3, 3), 0.02 * k, np.float32)
        assert np.array_equal(envs.step(actions)[0][0], env.step(actions[0])[0])


def test_wrong_options_are_refused():
    with pytest.raises(ValueError, match="corners is 2"):
        greylag.ImaginedEnv(corners=2.0)
    with pytest.raises(ValueError, match='airspeeds is "all"'):
        greylag.X8Env(airspeeds="all")
    with pytest.raises(ValueError, match="actions have the shape"):
        greylag.ImaginedVectorEnv(3).step(np.zeros((2, 3), np.float32))
