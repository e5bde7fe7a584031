"""Policies: those trained elsewhere as folders that ``greylag fly`` flies, and folders as functions of observations."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _greylag
from ._greylag import GreylagError
from .files import EXACT_MODEL, shipped
from .model import Model

#: The discount of the task, which planners value plans with.
DISCOUNT = 0.99

#: A network: for each layer its weights, (outputs, inputs) as PyTorch's ``Linear`` has them, and its biases.
Layers = Sequence[tuple[ArrayLike, ArrayLike]]


class Policy:
    """A policy read from its folder."""

    def __init__(self, native: _greylag.Policy) -> None:
        self._native = native

    @classmethod
    def load(cls, folder: str | os.PathLike[str], model: Model | str | os.PathLike[str] = EXACT_MODEL) -> Policy:
        """Reads the policy in ``folder`` for the airframe of ``model``.

        Raises:
            GreylagError: It is no policy, or one of another airframe.
        """
        aircraft = model if isinstance(model, Model) else Model.load(model)
        return cls(_greylag.Policy.load(str(shipped(folder)), aircraft._native))

    @property
    def origin(self) -> dict[str, Any]:
        """What its files say of where it comes from."""
        return json.loads(self._native.origin)

    @property
    def has_critics(self) -> bool:
        """Whether planners can value the end of their plans with it."""
        return self._native.has_critics

    @property
    def layers(self) -> list[int]:
        """Units of each layer of the actor, inputs first."""
        return self._native.sizes

    def act(self, observations: ArrayLike) -> NDArray[np.float32]:
        """The actions, (n, 3), of (n, 16) observations as the environments give them; (3,) of (16,)."""
        seen = np.asarray(observations, np.float32)
        actions = self._native.act(np.ascontiguousarray(np.atleast_2d(seen)))
        return actions[0] if seen.ndim == 1 else actions


def export_policy(
    folder: str | os.PathLike[str],
    policy: Any,
    *,
    trained_in: Model | str | os.PathLike[str],
    critics: tuple[Layers, Layers] | None = None,
    seed: int = 0,
    steps: int = 0,
    replace: bool = False,
) -> Path:
    """Writes a policy trained elsewhere as a folder for ``greylag fly --policy`` and ``greylag evaluate --policy``.

    The networks that can be exported are dense: 16 inputs (the environments' observation), hidden layers of at most 512
    units with ReLU, 3 outputs with tanh. TD3, DDPG and SAC of Stable-Baselines3 have them, with their critics where there are
    two with ReLU; networks with tanh inside, PPO's and A2C's (no tanh at the end), normalised observations
    (``VecNormalize``) and state-dependent exploration (``use_sde``) are refused.

    Args:
        folder: Where the files go; made if there is none.
        policy: A model of Stable-Baselines3, or the layers of the actor (see :data:`Layers`), tanh being added at the end.
        trained_in: The model that it was trained in, or ``"jsbsim"`` for ``Greylag/X8-v0``.
        critics: The layers of two critics, each from 16 + 3 inputs to 1; taken from a model of Stable-Baselines3. Without
            critics the controllers `policy`, `cem-policy` and `hybrid-lqi` fly it; `hybrid` and `cem-critic` do not.
        seed: Seed of the training, for the record.
        steps: Steps of the training, for the record; those of a model of Stable-Baselines3 are known.
        replace: Replace a policy in the folder.

    Returns:
        The folder.

    Raises:
        GreylagError: The network cannot be exported.
        FileExistsError: The folder holds a policy.
    """
    file = Path(folder) / "actor.safetensors"
    if file.exists() and not replace:
        raise FileExistsError(f"{file} exists; name another folder, or give replace=True")
    simulated = isinstance(trained_in, str) and trained_in == "jsbsim"
    if isinstance(trained_in, Model):
        model = trained_in
    else:
        model = Model.load(EXACT_MODEL if simulated else trained_in)
    if hasattr(policy, "policy") and hasattr(policy, "num_timesteps"):
        actor, found = _of_stable_baselines3(policy)
        if found is not None and policy.gamma != DISCOUNT:
            warnings.warn(
                f"the critics are left out: they were trained for a discount of {policy.gamma}, planners use {DISCOUNT}",
                stacklevel=2,
            )
            found = None
        critics = critics or found
        steps, seed = steps or policy.num_timesteps, seed or policy.seed or 0
    else:
        actor = policy
    _greylag.export_policy(
        str(folder),
        model._native,
        _arrays(actor),
        None if critics is None else [_arrays(critic) for critic in critics],
        None if simulated else model.name,
        seed,
        steps,
    )
    return Path(folder)


def _arrays(layers: Layers) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """The layers as the native part takes them."""
    return [(np.array(weights, np.float32, order="C"), np.array(bias, np.float32)) for weights, bias in layers]


def _refuse(what: str) -> GreylagError:
    return GreylagError(
        f"cannot export this policy: {what}. What greylag flies is dense, of 16 inputs, ReLU inside, 3 outputs with tanh: "
        "TD3, DDPG or SAC of Stable-Baselines3 with policy_kwargs=dict(activation_fn=torch.nn.ReLU)"
    )


def _of_stable_baselines3(algorithm: Any) -> tuple[Layers, tuple[Layers, Layers] | None]:
    """Actor and critics of a model of Stable-Baselines3."""
    actor = getattr(algorithm.policy, "actor", None)
    if actor is None or not hasattr(actor, "mu"):
        raise _refuse(f"{type(algorithm).__name__} has no deterministic actor that ends in tanh")
    if algorithm.get_env() is None:
        raise _refuse("it has no environment, so a normalisation of its observations cannot be seen; load it with env=")
    space = algorithm.action_space
    if space.shape != (3,) or not (np.all(space.low == -1) and np.all(space.high == 1)):
        raise _refuse("its actions are not three numbers from -1 to 1")
    if algorithm.get_vec_normalize_env() is not None:
        raise _refuse("its observations are normalised by VecNormalize, which greylag does not do")
    if getattr(actor, "use_sde", False):
        raise _refuse("it explores by its state (use_sde)")
    if type(actor.features_extractor).__name__ != "FlattenExtractor":
        raise _refuse(f"its observations pass a {type(actor.features_extractor).__name__}")
    # SAC's mean is a layer of its own after the shared ones, and squashed by tanh; TD3's is the whole network
    shared = getattr(actor, "latent_pi", None)
    modules = [*actor.mu] if shared is None else [*shared, actor.mu]
    if shared is None:
        if type(modules[-1]).__name__ != "Tanh":
            raise _refuse(f"its actor ends in {type(modules[-1]).__name__}")
        modules = modules[:-1]
    return _layers(modules, "actor"), _critics(algorithm)


def _critics(algorithm: Any) -> tuple[Layers, Layers] | None:
    """Its two critics; ``None`` where it has another number, or features of their own that are not observations."""
    networks = getattr(getattr(algorithm, "critic", None), "q_networks", [])
    if len(networks) != 2:
        return None
    return _layers([*networks[0]], "critic"), _layers([*networks[1]], "critic")


def _layers(modules: Sequence[Any], of: str) -> Layers:
    """Weights and biases of ``Linear`` modules with ReLU between them."""
    names = [type(module).__name__ for module in modules]
    if names[::2] != ["Linear"] * len(names[::2]) or names[1::2] != ["ReLU"] * len(names[1::2]) or len(names) % 2 == 0:
        raise _refuse(f"its {of} is made of {', '.join(names)}")
    return [(m.weight.detach().cpu().numpy(), m.bias.detach().cpu().numpy()) for m in modules[::2]]
