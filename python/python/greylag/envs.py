"""Gymnasium environments with the attitude control task of the Rust policy training.

Task, observation, action and reward are those of the training.

An episode starts in wings-level flight at the reference airspeed and has at most 1000 steps of 0.01 s. It has one target
attitude: roll within ±60° and pitch within ±30°. The targets are stratified over a 5 × 5 grid in roll and pitch.

Observation (16, float32): the state φ, θ, V_a, p, q, r, α, β, the actuators δa, δ̇a, δe, δ̇e, δt, then the control errors
(target minus state) of φ, θ and V_a. Each component is divided by its scale (:data:`OBSERVATION_UNITS`). V_a is relative to
16.67 m/s, throttle to one half.

Action (3, float32, each −1 to 1): aileron, elevator, thrust; throttle = (thrust + 1) / 2.

Reward: minus the sum of the capped errors, eq. (30) of the paper [GSFM26], from 0 (on target) to −1.1 per step. An episode
is ``terminated`` when θ, α, β, a body rate or V_a exceeds the limit up to which the simulation is valid. The reward of that
step is −110, the discounted sum of −1.1 per step for ever (discount factor 0.99). Without it, an early end would avoid the
cost of the remaining steps. An episode is ``truncated`` after 1000 steps.
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

#: Scale by which each component of an observation is divided: rad, m/s, rad/s, and 0 to 1 for the throttle.
OBSERVATION_UNITS: NDArray[np.float64] = np.array(_greylag.OBSERVATION_UNITS)
#: Number of steps of an episode, and duration of a step in s.
STEPS, STEP_S = 1000, 0.01
_TRUNCATED, _LOST = 1, 2


class _AttitudeEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One aircraft, simulated by the native module."""

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
        """Starts an episode with the next target. A ``seed`` restarts the sequence of targets.

        Returns:
            The first observation, and the control errors as ``info``.
        """
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
        """Makes one step of 0.01 s. ``info`` has the control errors, target minus state, in degrees and m/s."""
        _, reward, ended, seen = self._world.step(np.ascontiguousarray(action, np.float32).reshape(1, 3))
        # the native module has already restarted an ended episode with the next target
        self._fresh = bool(ended[0])
        return (
            seen[0],
            float(reward[0]),
            bool(ended[0] == _LOST),
            bool(ended[0] == _TRUNCATED),
            _errors(seen[0]),
        )


class X8Env(_AttitudeEnv):
    """``Greylag/X8-v0``: the Skywalker X8 in still air, simulated by JSBSim in this process."""

    def __init__(self, corners: float = 0.0, airspeeds: str = "envelope") -> None:
        """
        Args:
            corners: Fraction, 0 to 1, of targets drawn from the hard corners: |roll| 45° to 60° with |pitch| 25° to 30°.
                The paper has 0.
            airspeeds: ``"envelope"``: half of the targets have a random airspeed, as in ``greylag train policy``.
                ``"start"``: all targets have the airspeed of the start, as in the paper.
        """
        self._airframe = Model.load(EXACT_MODEL)
        super().__init__(corners, airspeeds)

    def _begun(self, seed: int) -> _greylag.World:
        return _greylag.World.x8(self._airframe._native, seed, *self._targets)


class ImaginedEnv(_AttitudeEnv):
    """``Greylag/Imagined-v0``: one aircraft, simulated by a model; by default the shipped learned model."""

    def __init__(
        self,
        model: Model | str | os.PathLike[str] = LEARNED_MODEL,
        corners: float = 0.0,
        airspeeds: str = "envelope",
    ) -> None:
        """
        Args:
            model: A model or its file. :data:`greylag.EXACT_MODEL` has the equations of the simulator.
            corners: As for :class:`X8Env`.
            airspeeds: As for :class:`X8Env`.
        """
        self.model = model if isinstance(model, Model) else Model.load(model)
        super().__init__(corners, airspeeds)

    def _begun(self, seed: int) -> _greylag.World:
        return _greylag.World.imagined(self.model._native, 1, seed, *self._targets)


class ImaginedVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray]):
    """Many aircraft, simulated by a model. A SIMD instruction processes sixteen aircraft.

    Each aircraft has its own episode. An episode that ends is restarted in the same step (``AutoresetMode.SAME_STEP``): the
    returned observation is the first of the new episode, and ``info["final_obs"]`` has the last of the old one.
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
            num_envs: Number of aircraft. It is most efficient if it is a multiple of 16.
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
        """Number of episodes started, and number of episodes that were ``terminated``."""
        return self._world.episodes

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Restarts all episodes with the next targets, and returns the first observations.

        A ``seed`` restarts the sequence of targets.
        """
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
        """Makes one step of 0.01 s of all aircraft with (num_envs, 3) actions."""
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
    """A random seed for the native module."""
    return int(generator.integers(2**63 - 1))


def _spaces(world: _greylag.World) -> tuple[gym.spaces.Box, gym.spaces.Box]:
    """The observation space and the action space of one aircraft."""
    low, high = (np.array(bound, np.float32) for bound in world.bounds)
    return gym.spaces.Box(low, high, dtype=np.float32), gym.spaces.Box(-1.0, 1.0, (3,), np.float32)


def _errors(seen: NDArray[np.float32]) -> dict[str, float]:
    """The control errors, target minus state, of one observation."""
    roll, pitch, airspeed = (seen[13:16] * OBSERVATION_UNITS[13:16]).tolist()
    return {
        "roll_left_deg": float(np.degrees(roll)),
        "pitch_left_deg": float(np.degrees(pitch)),
        "airspeed_left_mps": airspeed,
    }


def register() -> None:
    """Registers the environments for :func:`gymnasium.make`. The import of the package calls it."""
    if "Greylag/X8-v0" in gym.registry:
        return
    gym.register(id="Greylag/X8-v0", entry_point="greylag.envs:X8Env")
    gym.register(
        id="Greylag/Imagined-v0",
        entry_point="greylag.envs:ImaginedEnv",
        vector_entry_point="greylag.envs:ImaginedVectorEnv",
    )
