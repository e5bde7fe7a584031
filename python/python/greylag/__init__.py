"""Models, logs and policies of fixed-wing aircraft.

- :class:`Model`: rates, steps and flights of thousands of aircraft at once, as numpy arrays.
- :func:`load`, :func:`compare`, :func:`diagnose`, :func:`amend`: from flight logs to what a model lacks.
- :func:`logs.mat_to_csv`: a MATLAB file as the CSV that :func:`load` reads.
- ``Greylag/X8-v0``, ``Greylag/Imagined-v0`` and :class:`ImaginedVectorEnv`: Gymnasium environments with the task of the
  Rust policy training. Importing this package registers them.
- :func:`export_policy`: a policy trained elsewhere as a folder that ``greylag fly --policy`` flies.
"""

from . import logs
from ._greylag import VERSION as __version__
from ._greylag import GreylagError
from .envs import ImaginedEnv, ImaginedVectorEnv, X8Env, register
from .files import EXACT_MODEL, LEARNED_MODEL, shipped
from .model import CONTROL_NAMES, STATE_NAMES, Model
from .policy import Policy, export_policy
from .results import Amendment, Comparison, Diagnosis, Log
from .study import amend, compare, diagnose, load

__all__ = [
    "CONTROL_NAMES",
    "EXACT_MODEL",
    "LEARNED_MODEL",
    "STATE_NAMES",
    "Amendment",
    "Comparison",
    "Diagnosis",
    "GreylagError",
    "ImaginedEnv",
    "ImaginedVectorEnv",
    "Log",
    "Model",
    "Policy",
    "X8Env",
    "__version__",
    "amend",
    "compare",
    "diagnose",
    "export_policy",
    "load",
    "logs",
    "shipped",
]

register()
