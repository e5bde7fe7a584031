"""The native part: what the modules of this package are made of."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

OBSERVATION_UNITS: list[float]
STATE_NAMES: list[str]
SOURCE: str
VERSION: str

Layers = Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]]
Progress = Callable[[str, float], object]

class GreylagError(Exception): ...

class Model:
    @staticmethod
    def load(path: str) -> Model: ...
    @property
    def name(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def sha256(self) -> str: ...
    @property
    def path(self) -> str: ...
    @property
    def airframe(self) -> str: ...
    @property
    def airframe_sha256(self) -> str: ...
    @property
    def altitude(self) -> float: ...
    @property
    def start(self) -> list[float]: ...
    @property
    def effects(self) -> list[str]: ...
    @property
    def coefficients(self) -> list[tuple[str, float]]: ...
    def derivative(self, states: NDArray[np.float64], controls: NDArray[np.float64], altitude: float) -> NDArray[np.float64]: ...
    def step(self, states: NDArray[np.float32], controls: NDArray[np.float32], altitude: float) -> NDArray[np.float32]: ...
    def rollout(self, states: NDArray[np.float32], controls: NDArray[np.float32], altitude: float) -> NDArray[np.float32]: ...

class World:
    @staticmethod
    def imagined(model: Model, instances: int, seed: int, corners: float, airspeeds: str) -> World: ...
    @staticmethod
    def x8(model: Model, seed: int, corners: float, airspeeds: str) -> World: ...
    @property
    def bounds(self) -> list[list[float]]: ...
    @property
    def episodes(self) -> tuple[int, int]: ...
    def restart(self) -> None: ...
    def observe(self) -> NDArray[np.float32]: ...
    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32]]: ...

class Policy:
    @staticmethod
    def load(folder: str, model: Model) -> Policy: ...
    @property
    def origin(self) -> str: ...
    @property
    def has_critics(self) -> bool: ...
    @property
    def sizes(self) -> list[int]: ...
    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]: ...

def export_policy(
    folder: str,
    model: Model,
    actor: Layers,
    critics: Sequence[Layers] | None,
    trained_in: str,
    seed: int,
    steps: int,
) -> None: ...
def load(path: str, reading: object) -> tuple[str, str, list[str], list[tuple[str, NDArray[np.float64]]]]: ...
def compare(
    models: Sequence[Model],
    logs: Sequence[str],
    horizons_s: Sequence[float],
    seed: int,
    reading: object,
    progress: Progress | None,
) -> str: ...
def diagnose(
    model: Model,
    logs: Sequence[str],
    nulls: int,
    seed: int,
    without: Sequence[str],
    reading: object,
    progress: Progress | None,
) -> str: ...
def amend(
    model: Model,
    original: str,
    logs: Sequence[str],
    hold_out: Sequence[str],
    out: str,
    wanted: object,
    reading: object,
    progress: Progress | None,
) -> str: ...
