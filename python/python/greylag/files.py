"""Paths of the parameter files that are shipped with Greylag."""

from __future__ import annotations

import os
from pathlib import Path

from . import _greylag
from ._greylag import GreylagError

#: The default model: an imperfect prior model, refined from flights.
LEARNED_MODEL = "params/x8/learned/model.toml"
#: The model of the X8 with the equations and coefficients of JSBSim: it is exact in that simulator.
EXACT_MODEL = "params/x8/jsbsim.toml"


def shipped(path: str | os.PathLike[str]) -> Path:
    """The path of an existing file for ``path``.

    A path that exists is returned as given. A relative path below ``params/`` is searched in ``$XDG_CONFIG_HOME/greylag``,
    then in ``/etc/greylag``, then in the package's copy. The program ``greylag`` searches in the same order.

    Raises:
        GreylagError: The file does not exist in any of these places.
    """
    found = Path(_greylag.shipped(os.fspath(path)))
    if not found.exists():
        raise GreylagError(f"cannot find {found}; give the path of an existing file, or one of those shipped below params/")
    return found
