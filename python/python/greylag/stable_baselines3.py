"""Adapter of :class:`greylag.ImaginedVectorEnv` to the vectorised environments of Stable-Baselines3."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from .envs import ImaginedVectorEnv
from .files import LEARNED_MODEL
from .model import Model


class ImaginedVecEnv(VecEnv):
    """:class:`greylag.ImaginedVectorEnv` for the algorithms of Stable-Baselines3."""

    def __init__(
        self,
        num_envs: int = 64,
        model: Model | str | os.PathLike[str] = LEARNED_MODEL,
        corners: float = 0.0,
        airspeeds: str = "envelope",
    ) -> None:
        self.envs = ImaginedVectorEnv(num_envs, model, corners, airspeeds)
        self.render_mode = None
        self._actions = np.zeros((num_envs, 3), np.float32)
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self) -> np.ndarray:
        """Restarts all episodes and returns the first observations."""
        seen, _ = self.envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return seen

    def step_async(self, actions: np.ndarray) -> None:
        """Stores the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Makes one step of all aircraft with the stored actions."""
        seen, reward, terminated, truncated, info = self.envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        done = terminated | truncated
        for i in np.flatnonzero(done):
            infos[i] = {
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i]),
            }
        return seen, reward, done, infos

    def close(self) -> None:
        """Does nothing, because the environment holds no resources to release."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The value of an attribute, once for each index. All aircraft share the attribute."""
        return [getattr(self.envs, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets an attribute. All aircraft share it, so ``indices`` has no effect."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Calls a method once for all aircraft and returns its result once for each index."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Always false: no environment is wrapped."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
