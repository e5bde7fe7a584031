"""From flight logs to what a model lacks: the functions of ``greylag compare``, ``diagnose`` and ``amend``.

They give up the interpreter's lock. Ctrl-C ends them at their next stage, as does whatever ``progress`` raises.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from . import _greylag
from ._greylag import GreylagError
from .model import Model
from .results import Amendment, Comparison, Diagnosis, Log

_Path = str | os.PathLike[str]
_Model = Model | _Path
#: Called with what is being done, in words, and the share of the whole that is done, 0 to 1.
Progress = Callable[[str, float], object]


@dataclass(frozen=True)
class _Reading:
    mapping: str | None
    lenient: bool
    despite_problems: bool


@dataclass(frozen=True)
class _Wanted:
    effects: list[tuple[str, dict[str, float]]] | None
    conventions: bool
    from_scratch: bool
    keep_refused: bool


def load(
    log: _Path, *, mapping: _Path | None = None, lenient: bool = False, despite_problems: bool = False
) -> Log:
    """Reads a flight log: CSV, PX4 ULog, ArduPilot .bin or MAVLink .tlog, told apart by content.

    Args:
        log: The file.
        mapping: A TOML file that says where columns come from.
        lenient: Read logs in which more than 5 % of the rows are unusable.
        despite_problems: Use logs in which wrong units, signs or axes were found.

    Raises:
        GreylagError: The file is no log, lacks a needed column, or holds what makes figures wrong.
    """
    reading = _reading(mapping, lenient, despite_problems)
    name, kind, notes, columns = _greylag.load(os.fspath(log), reading)
    return Log(name=name, format=kind, notes=notes, columns=dict(columns))


def compare(
    models: _Model | Sequence[_Model],
    logs: _Path | Sequence[_Path],
    *,
    horizons_s: Sequence[float] = (1.0, 2.0, 5.0, 10.0),
    seed: int = 1,
    mapping: _Path | None = None,
    lenient: bool = False,
    despite_problems: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Where models fail against flight logs.

    Args:
        models: One model or several: :class:`Model` or files. The first gives gravity and actuators for the reconstruction.
        logs: The files of the flights.
        horizons_s: Horizons of the free runs, s.
        seed: Seed of the bootstrap intervals.
        mapping, lenient, despite_problems: As for :func:`load`.
        progress: Hears how far it is.

    Raises:
        GreylagError: A log or a model cannot be used.
    """
    found = _greylag.compare(
        [_model(m)._native for m in _several(models)],
        _paths(logs),
        list(horizons_s),
        seed,
        _reading(mapping, lenient, despite_problems),
        progress,
    )
    return Comparison._of(json.loads(found))


def diagnose(
    model: _Model,
    logs: _Path | Sequence[_Path],
    *,
    nulls: int = 100,
    without: Sequence[str] = (),
    seed: int = 1,
    mapping: _Path | None = None,
    lenient: bool = False,
    despite_problems: bool = False,
    progress: Progress | None = None,
) -> Diagnosis:
    """Which physical effect a model lacks, if any.

    Args:
        model: The model or its file.
        logs: The files of the flights.
        nulls: Bootstrap draws under the null hypothesis (no effect missing) that set the thresholds; 20 or more.
        without: Ids left out of the catalogue.
        seed: Seed of everything that is drawn.
        mapping, lenient, despite_problems: As for :func:`load`.
        progress: Hears how far it is.

    Raises:
        GreylagError: A log or the model cannot be used, or too little was flown.
    """
    if nulls < 20:
        raise ValueError(f"nulls is {nulls}; thresholds need 20 or more")
    found = _greylag.diagnose(
        _model(model)._native,
        _paths(logs),
        nulls,
        seed,
        list(without),
        _reading(mapping, lenient, despite_problems),
        progress,
    )
    return Diagnosis._of(json.loads(found))


def amend(
    model: _Model,
    logs: _Path | Sequence[_Path],
    out: _Path,
    *,
    effects: Diagnosis | Sequence[str] | None = None,
    hold_out: _Path | Sequence[_Path] = (),
    conventions: bool = False,
    from_scratch: bool = False,
    keep_refused: bool = False,
    replace: bool = False,
    mapping: _Path | None = None,
    lenient: bool = False,
    despite_problems: bool = False,
    progress: Progress | None = None,
) -> Amendment:
    """A model refitted to flights, missing effects added; written to the folder ``out``.

    Args:
        model: The model to start from, or its file; it stays as it is.
        logs: The files of the flights to fit to.
        out: Folder for ``model.toml``, the airframe and ``amend.json``; made if there is none.
        effects: What to add: the asserted effects of a :class:`Diagnosis`, ids of the catalogue, ``[]`` to fit the
            model's own coefficients only; left out, the effects that a diagnosis of these logs asserts.
        hold_out: Files to judge by, which the fit does not see. Left out, the last of ``logs``; of a single one, its last
            third.
        conventions: Also try the model's other conventions (integrator, axes of the forces, the standard atmosphere).
        from_scratch: The model holds guesses: fit its coefficients without their priors.
        keep_refused: Write effects into the model that the data refuse.
        replace: Replace an amended model in ``out``.
        mapping, lenient, despite_problems: As for :func:`load`.
        progress: Hears how far it is.

    Raises:
        GreylagError: A log or the model cannot be used, or no effect was accepted.
        FileExistsError: ``out`` holds a model.
    """
    start, folder = _model(model), Path(out)
    file = folder / "model.toml"
    for there in (file, folder / "airframe.toml", folder / "amend.json"):
        if there.exists() and not replace:
            raise FileExistsError(f"{there} exists; name another folder, or give replace=True")
    if isinstance(effects, Diagnosis):
        _checked(effects, start)
    if file.exists() and file.samefile(start.path):
        raise FileExistsError(f"{file} is the model to start from; name another folder")
    fit, judged = _paths(logs), _paths(hold_out)
    if not judged and len(fit) > 1:
        fit, judged = fit[:-1], fit[-1:]
    wanted = _Wanted(_effects(effects), conventions, from_scratch, keep_refused)
    reading = _reading(mapping, lenient, despite_problems)
    found = _greylag.amend(
        start._native, os.fspath(start.path), fit, judged, os.fspath(folder), wanted, reading, progress
    )
    return Amendment._of(json.loads(found), file)


def _checked(diagnosis: Diagnosis, model: Model) -> None:
    """Refuses a diagnosis that has nothing to add, or is of another model."""
    if diagnosis.model != model.name:
        raise GreylagError(f"the diagnosis is of model {diagnosis.model}, not of {model.name}; diagnose this one")
    if not diagnosis.asserted:
        raise GreylagError("the diagnosis asserts no effect, so there is none to add; effects=[] fits the model's own")


def _effects(effects: Diagnosis | Sequence[str] | None) -> list[tuple[str, dict[str, float]]] | None:
    """The effects to add with the values near which to search."""
    if effects is None:
        return None
    if isinstance(effects, Diagnosis):
        return [(e.id, {p.name: p.value for p in e.parameters}) for e in effects.asserted]
    return [(str(effect), {}) for effect in effects]


def _model(model: _Model) -> Model:
    return model if isinstance(model, Model) else Model.load(model)


def _several(models: _Model | Sequence[_Model]) -> list[_Model]:
    return [models] if isinstance(models, (str, os.PathLike, Model)) else list(models)


def _paths(logs: _Path | Sequence[_Path]) -> list[str]:
    return [os.fspath(logs)] if isinstance(logs, (str, os.PathLike)) else [os.fspath(log) for log in logs]


def _reading(mapping: _Path | None, lenient: bool, despite_problems: bool) -> _Reading:
    return _Reading(None if mapping is None else os.fspath(mapping), lenient, despite_problems)
