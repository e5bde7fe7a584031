"""The parameter files that come with Greylag."""

from __future__ import annotations

import os
from pathlib import Path

from . import _greylag
from ._greylag import GreylagError

#: The model that flies by default: learned from flights, starting at an imperfect prior.
LEARNED_MODEL = "params/x8/learned/model.toml"
#: The simulator's own model of the X8, an oracle: exact in JSBSim.
EXACT_MODEL = "params/x8/jsbsim.toml"


def shipped(path: str | os.PathLike[str]) -> Path:
    """``path`` as given, or, of a path below ``params/`` that does not exist, the file that comes with the package.

    ``$XDG_CONFIG_HOME/greylag`` and ``/etc/greylag`` come before the package's own copy, as for the program.

    Raises:
        GreylagError: There is none.
    """
    found = Path(_greylag.shipped(os.fspath(path)))
    if not found.exists():
        raise GreylagError(f"cannot find {found}; give the path of an existing file, or one of those shipped below params/")
    return found
