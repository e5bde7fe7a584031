"""A model of an aircraft that is evaluated on numpy arrays."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _greylag
from .files import shipped

#: Columns of a table of states, with units: roll and pitch (Euler angles ZYX), true airspeed, body rates (FRD), angles of
#: attack and sideslip.
STATE_NAMES: tuple[str, ...] = tuple(_greylag.STATE_NAMES)
#: Columns of a table of controls, with units: actual deflections (elevator positive trailing edge down, rudder positive
#: trailing edge left) and the throttle position, 0 to 1.
CONTROL_NAMES: tuple[str, ...] = ("aileron_rad", "elevator_rad", "throttle", "rudder_rad")


class Model:
    """A grey-box model: physical effects with their coefficients, and optionally a learned residual.

    A table of states has the columns :data:`STATE_NAMES`. A table of controls has the columns :data:`CONTROL_NAMES`; the
    rudder may be omitted and is then 0. Angles are in radians, speeds in m/s, vectors in body axes FRD.
    """

    def __init__(self, native: _greylag.Model) -> None:
        self._native = native

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Model:
        """Reads a model file (TOML), or ``model.toml`` in a folder.

        Raises:
            GreylagError: The file cannot be read or is not a model.
        """
        found = shipped(path)
        return cls(_greylag.Model.load(str(found / "model.toml" if found.is_dir() else found)))

    @property
    def name(self) -> str:
        """The model's name, from its file."""
        return self._native.name

    @property
    def description(self) -> str:
        """The description of the model in its file."""
        return self._native.description

    @property
    def path(self) -> Path:
        """The path of the model file."""
        return Path(self._native.path)

    @property
    def sha256(self) -> str:
        """The SHA-256 of the files that the model was read from, as hexadecimal text."""
        return self._native.sha256

    @property
    def airframe(self) -> str:
        """The name of the aircraft."""
        return self._native.airframe

    @property
    def effects(self) -> list[str]:
        """The ids of the physical effects in the model."""
        return self._native.effects

    @property
    def coefficients(self) -> dict[str, float]:
        """The values of the coefficients, in the units of the model file, by full name ``effect.coefficient``."""
        return dict(self._native.coefficients)

    @property
    def altitude_m(self) -> float:
        """The altitude of the reference condition, m above mean sea level."""
        return self._native.altitude

    @property
    def start(self) -> NDArray[np.float64]:
        """The state at the start of an episode: wings level, α = β = 0, at the reference airspeed."""
        return np.array(self._native.start)

    def derivative(
        self, states: ArrayLike, controls: ArrayLike, altitude_m: float | None = None
    ) -> NDArray[np.float64]:
        """The time derivatives of states, per second, in double precision.

        Args:
            states: (n, 8), or (8,) for one aircraft.
            controls: (n, 3) or (n, 4), or one row for all aircraft.
            altitude_m: Altitude of all aircraft, by default that of the reference condition.

        Returns:
            An array with the shape of ``states``.
        """
        table, held, one = _tables(states, controls, np.float64)
        rates = self._native.derivative(table, held, self._altitude(altitude_m))
        return rates[0] if one else rates

    def step(
        self, states: ArrayLike, controls: ArrayLike, altitude_m: float | None = None
    ) -> NDArray[np.float32]:
        """The states after 0.01 s with constant controls, in single precision.

        The model file selects the integration scheme (``integrator``). The scheme of JSBSim also uses the acceleration of the
        previous step. A call of this function has no previous step and computes the first step of a flight: use
        :meth:`rollout` for more than one step. Roll is not wrapped to ±π. A state far outside the flight envelope may become
        NaN.

        Args:
            states: (n, 8), or (8,) for one aircraft. Tables of float32 are not copied.
            controls: (n, 3) or (n, 4), or one row for all aircraft.
            altitude_m: Altitude of all aircraft, by default that of the reference condition.

        Returns:
            An array with the shape of ``states``.
        """
        table, held, one = _tables(states, controls, np.float32)
        later = self._native.step(table, held, self._altitude(altitude_m))
        return later[0] if one else later

    def rollout(
        self, states: ArrayLike, controls: ArrayLike, altitude_m: float | None = None
    ) -> NDArray[np.float32]:
        """Simulates flights from ``states`` with ``controls`` in steps of 0.01 s, in single precision.

        Args:
            states: Initial states, (n, 8), or (8,) for one aircraft.
            controls: (steps, n, 3) or (steps, n, 4); or (steps, 3) or (steps, 4), equal for all aircraft.
            altitude_m: Constant altitude of all aircraft, by default that of the reference condition.

        Returns:
            The initial states and the states after each step: (steps + 1, n, 8), or (steps + 1, 8) for one aircraft.
        """
        table = np.asarray(states, np.float32)
        one = table.ndim == 1
        table = np.ascontiguousarray(np.atleast_2d(table))
        held = np.asarray(controls, np.float32)
        if held.ndim == 2:
            held = held[:, None, :]
        if held.ndim != 3:
            raise ValueError(f"controls have the shape {held.shape}, not (steps, n, 3 or 4)")
        held = np.ascontiguousarray(
            np.broadcast_to(_with_rudder(held), (held.shape[0], table.shape[0], 4))
        )
        flown = self._native.rollout(_finite("states", table), _finite("controls", held), self._altitude(altitude_m))
        return flown[:, 0] if one else flown

    def _altitude(self, altitude_m: float | None) -> float:
        return self.altitude_m if altitude_m is None else float(altitude_m)

    def __repr__(self) -> str:
        return f"<greylag.Model {self.name!r} of {self.airframe}, {len(self.effects)} effects>"


def _with_rudder(controls: NDArray) -> NDArray:
    """The controls with four columns. A missing rudder is added as zeros."""
    if controls.shape[-1] == 3:
        return np.concatenate([controls, np.zeros_like(controls[..., :1])], axis=-1)
    if controls.shape[-1] != 4:
        raise ValueError(f"controls have {controls.shape[-1]} columns, not {', '.join(CONTROL_NAMES)} (the rudder may be left out)")
    return controls


def _finite(what: str, table: NDArray) -> NDArray:
    # the sum is not finite if one of its terms is not; it takes a tenth of the time of a test of each term
    if not np.isfinite(table.sum()) and not np.isfinite(table).all():
        raise ValueError(f"{what} hold a number that is not finite at {tuple(np.argwhere(~np.isfinite(table))[0].tolist())}")
    return table


def _tables(states: ArrayLike, controls: ArrayLike, kind: type) -> tuple[NDArray, NDArray, bool]:
    """States and controls as tables with n rows, and whether ``states`` was a single row."""
    table = np.asarray(states, kind)
    one = table.ndim == 1
    table = np.ascontiguousarray(np.atleast_2d(table))
    held = _with_rudder(np.atleast_2d(np.asarray(controls, kind)))
    if held.shape[0] != table.shape[0]:
        held = np.broadcast_to(held, (table.shape[0], 4))
    return _finite("states", table), _finite("controls", np.ascontiguousarray(held)), one
