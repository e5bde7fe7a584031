"""System identification and attitude control of fixed-wing aircraft: models, flight logs and control policies.

- :class:`Model` computes state derivatives, single steps and simulated flights of thousands of aircraft at once, as numpy
  arrays.
- :func:`load` reads a flight log. :func:`compare` computes the errors of models in flights, :func:`diagnose` finds the
  physical effects that a model lacks, and :func:`amend` adds them and refits the model.
- :func:`logs.mat_to_csv` converts a MATLAB file to a CSV that :func:`load` reads.
- ``Greylag/X8-v0``, ``Greylag/Imagined-v0`` and :class:`ImaginedVectorEnv` are Gymnasium environments with the task of the
  Rust policy training. Importing this package registers them.
- :func:`export_policy` writes a policy that was trained elsewhere to a folder for ``greylag fly --policy``.
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
