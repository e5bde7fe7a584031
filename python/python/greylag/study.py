"""Functions on flight logs: :func:`load`, and the commands ``greylag compare``, ``diagnose`` and ``amend``.

The functions release the interpreter's lock. Ctrl-C, or an exception that ``progress`` raises, cancels them at their next
stage.
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
#: Callback with a description of the present stage and the completed fraction of the work, 0 to 1.
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
    """Reads a flight log: CSV, PX4 ULog, ArduPilot .bin, MAVLink .tlog or ROS 2 .mcap. The content decides the format.

    Args:
        log: The file.
        mapping: A TOML file that assigns fields of the log to columns.
        lenient: Whether to accept logs in which more than 5 % of the rows are unusable.
        despite_problems: Whether to accept logs in which wrong units, signs or axes were found.

    Raises:
        GreylagError: The file is not a log, lacks a required column, or has wrong units, signs or axes.
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
    """Computes the errors of models over flights: in free runs, and in forces, moments and rates.

    Args:
        models: One or several models, or their files. The flight path reconstruction uses gravity and actuators of the first.
        logs: The log files of the flights.
        horizons_s: Horizons of the free runs, s.
        seed: Seed of the bootstrap intervals.
        mapping, lenient, despite_problems: As for :func:`load`.
        progress: Callback for the progress.

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
    """Finds the physical effects that a model lacks.

    Args:
        model: The model or its file.
        logs: The log files of the flights.
        nulls: Number of bootstrap draws under the null hypothesis (no effect is missing), at least 20. They determine the
            thresholds of the evidence.
        without: Ids of effects that are not considered.
        seed: Seed of all random draws.
        mapping, lenient, despite_problems: As for :func:`load`.
        progress: Callback for the progress.

    Raises:
        GreylagError: A log or the model cannot be used, or the flights are too short.
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
    """Adds missing effects to a model, refits it to flights and writes it to the folder ``out``.

    Args:
        model: The model to start from, or its file. It is not changed.
        logs: The log files of the flights for the fit.
        out: Folder for ``model.toml``, the airframe and ``amend.json``. It is created if it does not exist.
        effects: The effects to add: a :class:`Diagnosis` (its asserted effects) or ids of the catalogue. ``[]`` adds none and
            fits the model's own coefficients. By default the effects that a diagnosis of these logs asserts.
        hold_out: Log files for validation, which the fit does not use. By default the last of ``logs``, or the last third of
            a single log.
        conventions: Whether to try other modelling conventions too (integrator, force axes, standard atmosphere).
        from_scratch: Whether to fit the coefficients without their priors, for a model whose coefficients are guesses.
        keep_refused: Whether to add effects that the data refuse, too.
        replace: Whether to replace an amended model in ``out``.
        mapping, lenient, despite_problems: As for :func:`load`.
        progress: Callback for the progress.

    Raises:
        GreylagError: A log or the model cannot be used, or no effect was accepted.
        FileExistsError: ``out`` holds a model, and ``replace`` is false.
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
    """Raises an error if the diagnosis is of another model or asserts no effect."""
    if diagnosis.model != model.name:
        raise GreylagError(f"the diagnosis is of model {diagnosis.model}, not of {model.name}; diagnose this one")
    if not diagnosis.asserted:
        raise GreylagError("the diagnosis asserts no effect, so there is none to add; effects=[] fits the model's own")


def _effects(effects: Diagnosis | Sequence[str] | None) -> list[tuple[str, dict[str, float]]] | None:
    """The effects to add, with start values of their parameters. ``None`` adds those that a diagnosis asserts."""
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
