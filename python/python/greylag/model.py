"""A model of an aircraft over numpy arrays."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _greylag
from .files import shipped

#: Columns of a table of states, with units: Euler angles ZYX, true airspeed, rates in body axes (FRD), incidence.
STATE_NAMES: tuple[str, ...] = tuple(_greylag.STATE_NAMES)
#: Columns of a table of controls, with units: deflections that act (elevator positive trailing edge down, rudder positive
#: trailing edge left) and the throttle's position, 0 to 1.
CONTROL_NAMES: tuple[str, ...] = ("aileron_rad", "elevator_rad", "throttle", "rudder_rad")


class Model:
    """A grey-box model: physical effects with their coefficients, and what was learned beside them.

    Every table of states has the columns :data:`STATE_NAMES`, every table of controls the columns :data:`CONTROL_NAMES`;
    the rudder may be left out. Angles are radians, speeds m/s, body axes FRD.
    """

    def __init__(self, native: _greylag.Model) -> None:
        self._native = native

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Model:
        """Reads a model file (TOML) or a folder that holds ``model.toml``.

        Raises:
            GreylagError: The file cannot be read or is no model.
        """
        found = shipped(path)
        return cls(_greylag.Model.load(str(found / "model.toml" if found.is_dir() else found)))

    @property
    def name(self) -> str:
        """The model's name, from its file."""
        return self._native.name

    @property
    def description(self) -> str:
        """What its file says that it is."""
        return self._native.description

    @property
    def path(self) -> Path:
        """The file that it was read from."""
        return Path(self._native.path)

    @property
    def sha256(self) -> str:
        """SHA-256 of the files that it was read from, hexadecimal."""
        return self._native.sha256

    @property
    def airframe(self) -> str:
        """The aircraft's name."""
        return self._native.airframe

    @property
    def effects(self) -> list[str]:
        """Ids of its physical effects."""
        return self._native.effects

    @property
    def coefficients(self) -> dict[str, float]:
        """Its coefficients by full name, ``effect.coefficient``."""
        return dict(self._native.coefficients)

    @property
    def altitude_m(self) -> float:
        """Altitude of its reference condition, m above mean sea level."""
        return self._native.altitude

    @property
    def start(self) -> NDArray[np.float64]:
        """The state in which an episode starts: wings level, no incidence, at the reference airspeed."""
        return np.array(self._native.start)

    def derivative(
        self, states: ArrayLike, controls: ArrayLike, altitude_m: float | None = None
    ) -> NDArray[np.float64]:
        """The rate of change of each state, per second, in double precision.

        Args:
            states: (n, 8), or (8,) for one.
            controls: (n, 3) or (n, 4), or one row for all.
            altitude_m: Altitude of all; that of the reference condition if left out.

        Returns:
            As ``states``.
        """
        table, held, one = _tables(states, controls, np.float64)
        rates = self._native.derivative(table, held, self._altitude(altitude_m))
        return rates[0] if one else rates

    def step(
        self, states: ArrayLike, controls: ArrayLike, altitude_m: float | None = None
    ) -> NDArray[np.float32]:
        """Each state 0.01 s later, controls held, in single precision: sixteen aircraft to an instruction.

        The scheme is the model file's ``integrator``. That of JSBSim remembers the last acceleration, of which a single step
        knows nothing: it starts as an episode does. Use :meth:`rollout` for more than one step. Roll is not wrapped; a state
        far outside flight may become NaN.

        Args:
            states: (n, 8), or (8,) for one. Tables of float32 are not copied.
            controls: (n, 3) or (n, 4), or one row for all.
            altitude_m: Altitude of all; that of the reference condition if left out.

        Returns:
            As ``states``.
        """
        table, held, one = _tables(states, controls, np.float32)
        later = self._native.step(table, held, self._altitude(altitude_m))
        return later[0] if one else later

    def rollout(
        self, states: ArrayLike, controls: ArrayLike, altitude_m: float | None = None
    ) -> NDArray[np.float32]:
        """The flights from ``states`` under ``controls``, steps of 0.01 s, in single precision.

        Args:
            states: (n, 8), or (8,) for one.
            controls: (steps, n, 3) or (steps, n, 4); (steps, 3) or (steps, 4) for all alike.
            altitude_m: Altitude of all, held; that of the reference condition if left out.

        Returns:
            (steps + 1, n, 8), or (steps + 1, 8) for one: the states given, then those after each step.
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
    """The controls with a rudder at rest where they have none."""
    if controls.shape[-1] == 3:
        return np.concatenate([controls, np.zeros_like(controls[..., :1])], axis=-1)
    if controls.shape[-1] != 4:
        raise ValueError(f"controls have {controls.shape[-1]} columns, not {', '.join(CONTROL_NAMES)} (the rudder may be left out)")
    return controls


def _finite(what: str, table: NDArray) -> NDArray:
    # a sum is not finite if one of its terms is not, and costs a tenth of looking at each
    if not np.isfinite(table.sum()) and not np.isfinite(table).all():
        raise ValueError(f"{what} hold a number that is not finite at {tuple(np.argwhere(~np.isfinite(table))[0].tolist())}")
    return table


def _tables(states: ArrayLike, controls: ArrayLike, kind: type) -> tuple[NDArray, NDArray, bool]:
    """States and controls as whole tables, and whether the states were a single row."""
    table = np.asarray(states, kind)
    one = table.ndim == 1
    table = np.ascontiguousarray(np.atleast_2d(table))
    held = _with_rudder(np.atleast_2d(np.asarray(controls, kind)))
    if held.shape[0] != table.shape[0]:
        held = np.broadcast_to(held, (table.shape[0], 4))
    return _finite("states", table), _finite("controls", np.ascontiguousarray(held)), one
