"""The imagined aircraft as a vectorised environment of Stable-Baselines3, which has a convention of its own."""

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
        """The start of new episodes."""
        seen, _ = self.envs.reset(seed=self._seeds[0])
        self._reset_seeds()
        return seen

    def step_async(self, actions: np.ndarray) -> None:
        """Keeps the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One step of every aircraft."""
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
        """Gives nothing back: there is nothing."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the environments, which share it."""
        return [getattr(self.envs, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets the attribute of the environments, which share it."""
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Calls the method of the environments, which share it, once."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """None is."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
