"""Control policies: exports policies that were trained elsewhere for ``greylag fly``, and evaluates exported policies."""

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

#: Discount factor per step of the task. The planning controllers use it with the critics.
DISCOUNT = 0.99

#: Layers of a network: for each layer the weights, (outputs, inputs) as in PyTorch's ``Linear``, and the biases.
Layers = Sequence[tuple[ArrayLike, ArrayLike]]


class Policy:
    """A control policy that was read from its folder."""

    def __init__(self, native: _greylag.Policy) -> None:
        self._native = native

    @classmethod
    def load(cls, folder: str | os.PathLike[str], model: Model | str | os.PathLike[str] = EXACT_MODEL) -> Policy:
        """Reads the policy in ``folder`` for the airframe of ``model``.

        Raises:
            GreylagError: The folder holds no policy, or a policy for another airframe.
        """
        aircraft = model if isinstance(model, Model) else Model.load(model)
        return cls(_greylag.Policy.load(str(shipped(folder)), aircraft._native))

    @property
    def origin(self) -> dict[str, Any]:
        """The origin of the policy from its files: airframe, model, seed, number of training steps."""
        return json.loads(self._native.origin)

    @property
    def has_critics(self) -> bool:
        """Whether the policy has critics. Planning controllers need them for the terminal value of a plan."""
        return self._native.has_critics

    @property
    def layers(self) -> list[int]:
        """The number of units of each layer of the actor, including the input layer."""
        return self._native.sizes

    def act(self, observations: ArrayLike) -> NDArray[np.float32]:
        """The actions, (n, 3), for (n, 16) observations of the environments; (3,) for one observation (16,)."""
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
    """Writes a policy that was trained elsewhere to a folder for ``greylag fly --policy`` and ``greylag evaluate --policy``.

    The actor must be a dense network with 16 inputs (the observation of the environments), hidden layers of at most 512
    units with ReLU, and 3 outputs with tanh. TD3, DDPG and SAC of Stable-Baselines3 have such actors if their activation
    function is ReLU. Their critics are exported too if there are two. These are refused: networks with tanh in hidden layers,
    PPO and A2C (no tanh at the output), normalised observations (``VecNormalize``), and state-dependent exploration
    (``use_sde``).

    Args:
        folder: Folder for the files. It is created if it does not exist.
        policy: A model of Stable-Baselines3, or the layers of the actor (see :data:`Layers`) without the tanh of the outputs,
            which is added.
        trained_in: The model in which the policy was trained, or ``"jsbsim"`` for ``Greylag/X8-v0``.
        critics: The layers of two critics, each with 16 + 3 inputs and 1 output. By default those of a model of
            Stable-Baselines3. The controllers `hybrid` and `cem-critic` need critics; `policy`, `cem-policy` and
            `hybrid-lqi` do not.
        seed: Seed of the training, which is recorded in the folder. By default that of a model of Stable-Baselines3.
        steps: Number of training steps, which is recorded in the folder. By default that of a model of Stable-Baselines3.
        replace: Whether to replace a policy in the folder.

    Returns:
        The folder.

    Raises:
        GreylagError: The network cannot be exported.
        FileExistsError: The folder holds a policy, and ``replace`` is false.
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
    """The layers as float32 arrays, as the native module expects them."""
    return [(np.array(weights, np.float32, order="C"), np.array(bias, np.float32)) for weights, bias in layers]


def _refuse(what: str) -> GreylagError:
    return GreylagError(
        f"cannot export this policy: {what}. What greylag flies is dense, of 16 inputs, ReLU inside, 3 outputs with tanh: "
        "TD3, DDPG or SAC of Stable-Baselines3 with policy_kwargs=dict(activation_fn=torch.nn.ReLU)"
    )


def _of_stable_baselines3(algorithm: Any) -> tuple[Layers, tuple[Layers, Layers] | None]:
    """The layers of the actor and of the critics of a Stable-Baselines3 model. The critics are ``None`` unless there are two."""
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
    # in SAC, `mu` is the last layer after `latent_pi`, and tanh is applied to its output;
    # in TD3, `mu` is the whole network with tanh
    shared = getattr(actor, "latent_pi", None)
    modules = [*actor.mu] if shared is None else [*shared, actor.mu]
    if shared is None:
        if type(modules[-1]).__name__ != "Tanh":
            raise _refuse(f"its actor ends in {type(modules[-1]).__name__}")
        modules = modules[:-1]
    return _layers(modules, "actor"), _critics(algorithm)


def _critics(algorithm: Any) -> tuple[Layers, Layers] | None:
    """The layers of the two critics; ``None`` if the number of critics is not two."""
    networks = getattr(getattr(algorithm, "critic", None), "q_networks", [])
    if len(networks) != 2:
        return None
    return _layers([*networks[0]], "critic"), _layers([*networks[1]], "critic")


def _layers(modules: Sequence[Any], of: str) -> Layers:
    """The weights and biases of ``Linear`` modules with ReLU between them. Other modules are refused."""
    names = [type(module).__name__ for module in modules]
    if names[::2] != ["Linear"] * len(names[::2]) or names[1::2] != ["ReLU"] * len(names[1::2]) or len(names) % 2 == 0:
        raise _refuse(f"its {of} is made of {', '.join(names)}")
    return [(m.weight.detach().cpu().numpy(), m.bias.detach().cpu().numpy()) for m in modules[::2]]
