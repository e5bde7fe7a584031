"""Gymnasium environments: hold an attitude, with task, observation, action and reward of the Rust policy training.

An episode is 1000 steps of 0.01 s from wings-level flight at the reference airspeed towards one target: roll within ±60°,
pitch within ±30°, stratified over a 5 × 5 grid of them.

Observation (16, float32): φ, θ, V_a, p, q, r, α, β, the actuators δa, δ̇a, δe, δ̇e, δt, then what is left to the target in
φ, θ and V_a, each divided by its unit (:data:`OBSERVATION_UNITS`; V_a counts from 16.67 m/s, throttle from one half).

Action (3, float32, each −1 to 1): aileron, elevator, thrust; throttle = (thrust + 1) / 2.

Reward: minus the capped errors of eq. (30) of the paper, from 0 (on target) to −1.1 a step. An aircraft that leaves the
envelope in which a state can be believed ends its episode (``terminated``) and earns −110, the worst for ever at a discount
of 0.99: without it, ending an episode early would pay. After 1000 steps an episode is ``truncated``.
"""

from __future__ import annotations

import os
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from . import _greylag
from .files import EXACT_MODEL, LEARNED_MODEL
from .model import Model

#: What each number of an observation is divided by, SI units and radians.
OBSERVATION_UNITS: NDArray[np.float64] = np.array(_greylag.OBSERVATION_UNITS)
#: Steps of an episode, and their length in s.
STEPS, STEP_S = 1000, 0.01
_TRUNCATED, _LOST = 1, 2


class _AttitudeEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One aircraft in a world of the native part."""

    metadata = {"render_modes": [], "render_fps": 100}

    def __init__(self, corners: float, airspeeds: str) -> None:
        self._targets = (corners, airspeeds)
        self._world = self._begun(0)
        self._seeded = False
        self._fresh = False
        self.observation_space, self.action_space = _spaces(self._world)

    def _begun(self, seed: int) -> _greylag.World:
        raise NotImplementedError

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """The start of an episode with the next target; ``seed`` begins the row of targets anew."""
        super().reset(seed=seed)
        if seed is not None or not self._seeded:
            self._world = self._begun(_drawn(self.np_random))
            self._seeded = True
        elif not self._fresh:
            self._world.restart()
        self._fresh = False
        seen = self._world.observe()[0]
        return seen, _errors(seen)

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One step of 0.01 s; ``info`` holds what is left to the target."""
        _, reward, ended, seen = self._world.step(np.ascontiguousarray(action, np.float32).reshape(1, 3))
        # an episode that ended has begun anew already, with the next target
        self._fresh = bool(ended[0])
        return (
            seen[0],
            float(reward[0]),
            bool(ended[0] == _LOST),
            bool(ended[0] == _TRUNCATED),
            _errors(seen[0]),
        )


class X8Env(_AttitudeEnv):
    """``Greylag/X8-v0``: the Skywalker X8 flown by JSBSim in this process, in still air."""

    def __init__(self, corners: float = 0.0, airspeeds: str = "envelope") -> None:
        """
        Args:
            corners: Share of the targets that lie in the hard corners instead (0 is the paper's).
            airspeeds: ``"envelope"``: half the targets want another airspeed, as ``greylag train policy`` trains;
                ``"start"``: all want that of the start, as in the paper.
        """
        self._airframe = Model.load(EXACT_MODEL)
        super().__init__(corners, airspeeds)

    def _begun(self, seed: int) -> _greylag.World:
        return _greylag.World.x8(self._airframe._native, seed, *self._targets)


class ImaginedEnv(_AttitudeEnv):
    """``Greylag/Imagined-v0``: one aircraft that flies as a model says; the shipped learned model if none is named."""

    def __init__(
        self,
        model: Model | str | os.PathLike[str] = LEARNED_MODEL,
        corners: float = 0.0,
        airspeeds: str = "envelope",
    ) -> None:
        """
        Args:
            model: A model or its file; :data:`greylag.EXACT_MODEL` is the simulator's own.
            corners: As for :class:`X8Env`.
            airspeeds: As for :class:`X8Env`.
        """
        self.model = model if isinstance(model, Model) else Model.load(model)
        super().__init__(corners, airspeeds)

    def _begun(self, seed: int) -> _greylag.World:
        return _greylag.World.imagined(self.model._native, 1, seed, *self._targets)


class ImaginedVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray]):
    """Many aircraft that fly as a model says, sixteen to an instruction.

    Each has an episode of its own. One that ends begins anew in the same step (``AutoresetMode.SAME_STEP``): the observation
    returned is that of the new episode, ``info["final_obs"]`` holds the last of the old one.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: int = 64,
        model: Model | str | os.PathLike[str] = LEARNED_MODEL,
        corners: float = 0.0,
        airspeeds: str = "envelope",
    ) -> None:
        """
        Args:
            num_envs: Aircraft; multiples of 16 waste nothing.
            model: As for :class:`ImaginedEnv`.
            corners: As for :class:`X8Env`.
            airspeeds: As for :class:`X8Env`.
        """
        self.model = model if isinstance(model, Model) else Model.load(model)
        self.num_envs = num_envs
        self._targets = (corners, airspeeds)
        self._world = self._begun(0)
        self._seeded = False
        self.single_observation_space, self.single_action_space = _spaces(self._world)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def _begun(self, seed: int) -> _greylag.World:
        return _greylag.World.imagined(self.model._native, self.num_envs, seed, *self._targets)

    @property
    def episodes(self) -> tuple[int, int]:
        """Episodes begun, and those that ended outside the envelope."""
        return self._world.episodes

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """The start of new episodes; ``seed`` begins the row of targets anew."""
        super().reset(seed=seed)
        if seed is not None or not self._seeded:
            self._world = self._begun(_drawn(self.np_random))
            self._seeded = True
        else:
            self._world.restart()
        return self._world.observe(), {}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray, NDArray, NDArray, dict[str, Any]]:
        """One step of 0.01 s of every aircraft under (num_envs, 3) actions."""
        actions = np.ascontiguousarray(actions, np.float32)
        seen, reward, ended, last = self._world.step(actions)
        info: dict[str, Any] = {}
        over = ended > 0
        if over.any():
            final = np.full(self.num_envs, None, dtype=object)
            for i in np.flatnonzero(over):
                final[i] = last[i]
            info = {"final_obs": final, "_final_obs": over}
        return seen, reward, ended == _LOST, ended == _TRUNCATED, info


def _drawn(generator: np.random.Generator) -> int:
    """A seed for the native part."""
    return int(generator.integers(2**63 - 1))


def _spaces(world: _greylag.World) -> tuple[gym.spaces.Box, gym.spaces.Box]:
    """What can be observed while an episode goes on, and what can be done."""
    low, high = (np.array(bound, np.float32) for bound in world.bounds)
    return gym.spaces.Box(low, high, dtype=np.float32), gym.spaces.Box(-1.0, 1.0, (3,), np.float32)


def _errors(seen: NDArray[np.float32]) -> dict[str, float]:
    """What is left to the target."""
    roll, pitch, airspeed = (seen[13:16] * OBSERVATION_UNITS[13:16]).tolist()
    return {
        "roll_left_deg": float(np.degrees(roll)),
        "pitch_left_deg": float(np.degrees(pitch)),
        "airspeed_left_mps": airspeed,
    }


def register() -> None:
    """Makes the environments known to :func:`gymnasium.make`; importing the package does it."""
    if "Greylag/X8-v0" in gym.registry:
        return
    gym.register(id="Greylag/X8-v0", entry_point="greylag.envs:X8Env")
    gym.register(
        id="Greylag/Imagined-v0",
        entry_point="greylag.envs:ImaginedEnv",
        vector_entry_point="greylag.envs:ImaginedVectorEnv",
    )
