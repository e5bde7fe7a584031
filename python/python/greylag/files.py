"""The parameter files that come with Greylag."""

from __future__ import annotations

import os
from pathlib import Path

from ._greylag import SOURCE, GreylagError

#: The model that flies by default: learned from flights, starting at an imperfect prior.
LEARNED_MODEL = "params/x8/learned/model.toml"
#: The simulator's own model of the X8, an oracle: exact in JSBSim.
EXACT_MODEL = "params/x8/jsbsim.toml"


def shipped(path: str | os.PathLike[str]) -> Path:
    """``path`` as given, or, if there is no such file, the one of that name in the source tree that the package was built
    from.

    Raises:
        GreylagError: There is neither.
    """
    given = Path(path)
    built = Path(SOURCE).resolve() / given
    if not given.exists() and built.exists():
        return built
    if not given.exists():
        raise GreylagError(
            f"cannot find {given}, neither here nor in the source tree {Path(SOURCE).resolve()} that this package was built from; "
            "give the path of an existing file"
        )
    return given
