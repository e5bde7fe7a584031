"""What the functions on logs find, as plain classes; what is a table has a ``frame()``."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .model import STATE_NAMES, Model

if TYPE_CHECKING:
    import pandas as pd

_T = TypeVar("_T")


def _read(kind: type[_T], found: dict[str, Any], /, **more: Any) -> _T:
    """An instance of the fields that were found; a number that cannot be given (``null``) is NaN."""
    given = {f.name: found[f.name] for f in fields(kind) if f.name in found and f.name not in more}  # type: ignore[arg-type]
    for f in fields(kind):  # type: ignore[arg-type]
        if f.type == "float" and f.name in given and given[f.name] is None:
            given[f.name] = float("nan")
    return kind(**given, **more)


def _interval(found: list[float | None]) -> tuple[float, float]:
    """The ends of an interval; an end that cannot be given (``null``) is NaN."""
    low, high = (float("nan") if end is None else end for end in found)
    return low, high


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Log:
    """A flight log as one table: SI units, radians, body axes FRD, earth axes NED; a missing value is NaN."""

    name: str
    """The file's name."""
    format: str
    """The file's format."""
    notes: list[str]
    """What was assumed, derived or found odd while reading."""
    columns: dict[str, NDArray[np.float64]]
    """The columns that hold something, each with a unit at the end of its name."""

    @property
    def states(self) -> NDArray[np.float64]:
        """The states, (n, 8), for :class:`greylag.Model`; NaN where a sensor is missing."""
        return self._matrix(STATE_NAMES)

    @property
    def controls(self) -> NDArray[np.float64]:
        """The deflections with the throttle, (n, 4), for :class:`greylag.Model`; NaN where they were not logged."""
        return self._matrix(("aileron_rad", "elevator_rad", "throttle", "rudder_rad"))

    def frame(self) -> pd.DataFrame:
        """The table, indexed by time in s."""
        return _table([]).assign(**self.columns).set_index("time_s")

    def _matrix(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        missing = np.full(len(self.columns["time_s"]), np.nan)
        return np.column_stack([self.columns.get(name, missing) for name in names])

    def __len__(self) -> int:
        return len(self.columns["time_s"])


@dataclass(frozen=True)
class HorizonScore:
    """Free-run error at one time after the start, over all starts."""

    horizon_s: float
    """Time after the start, s."""
    runs: int
    """Runs that the flights are long enough for."""
    diverged: int
    """Those of them that diverged by then."""
    rmse_scaled: float
    """Root mean square of the error divided by the paper's scale x_c."""
    states: dict[str, float] = field(default_factory=dict)
    """Root mean square error of each state, in its unit."""

    @classmethod
    def _of(cls, document: dict[str, Any]) -> HorizonScore:
        nan = float("nan")
        states = {s["state"]: nan if s["rmse"] is None else s["rmse"] for s in document["states"]}
        return _read(cls, document, states=states)


def _scores(document: list[dict[str, Any]]) -> list[HorizonScore]:
    return [HorizonScore._of(score) for score in document]


def _score_row(score: HorizonScore) -> dict[str, Any]:
    row = {"horizon_s": score.horizon_s, "runs": score.runs, "diverged": score.diverged}
    return {**row, "rmse_scaled": score.rmse_scaled, **score.states}


@dataclass(frozen=True)
class Channel:
    """One channel of a model over all flights: a force, a moment, or the rate of airspeed or incidence."""

    name: str
    """Its name."""
    unit: str
    """Its unit."""
    measured_sd: float
    """Standard deviation of what was measured, in ``unit``."""
    residual_rms: float
    """Root mean square of measured minus model, in ``unit``."""
    noise_sd: float
    """Part of it that the sensors' noise accounts for, in ``unit``."""
    unexplained_fraction: float
    """Share of the variance beyond noise that the model leaves; NaN where the flights do not move the channel."""
    worst_regime: str
    """Where the model is worst, in one sentence."""


@dataclass(frozen=True)
class ModelResult:
    """One model against all flights."""

    name: str
    """The model."""
    sentences: list[str]
    """What it finds in plain words, the leading sentences first."""
    free_run: list[HorizonScore]
    """Free-run error by horizon."""
    channels: list[Channel]
    """Channel by channel."""


@dataclass(frozen=True)
class Comparison:
    """Models against flights: what ``greylag compare`` finds."""

    models: list[ModelResult]
    """The models, in the order given."""
    forecasts: dict[str, list[HorizonScore]]
    """What a model has to beat: free runs by forecasts that know no aerodynamics, by name."""
    notes: list[str]
    """What the reader must know: what was skipped, assumed or lost."""
    document: dict[str, Any]
    """Everything that was found, as in ``greylag compare --json``."""

    @classmethod
    def _of(cls, document: dict[str, Any]) -> Comparison:
        def model(found: dict[str, Any]) -> ModelResult:
            channels = [_read(Channel, c) for c in found["channels"]]
            return _read(ModelResult, found, free_run=_scores(found["free_run"]), channels=channels)

        models = [model(found) for found in document["models"]]
        forecasts = {found["name"]: _scores(found["free_run"]) for found in document["forecasts"]}
        return cls(models=models, forecasts=forecasts, notes=document["notes"], document=document)

    @property
    def sentences(self) -> list[str]:
        """The finding of the first model in plain words."""
        return self.models[0].sentences

    def frame(self) -> pd.DataFrame:
        """Free-run errors, a row a model and horizon, then the forecasts'; states in their units."""
        runs = [(m.name, m.free_run) for m in self.models] + [*self.forecasts.items()]
        return _table([{"model": name, **_score_row(s)} for name, scores in runs for s in scores])

    def channels_frame(self) -> pd.DataFrame:
        """What each model leaves unexplained, a row a model and channel."""
        return _table([{"model": m.name, **vars(c)} for m in self.models for c in m.channels])


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter of an effect."""

    name: str
    """Its name in model files."""
    value: float
    """Its value."""
    ci95: tuple[float, float]
    """Its 95 % interval."""
    unit: str
    """What it is, with its unit."""


@dataclass(frozen=True)
class Candidate:
    """An effect that the model may lack."""

    id: str
    """Its id in the catalogue."""
    description: str
    """What it is, in one sentence."""
    asserted: bool
    """Whether the data say that it is missing."""
    evidence: float
    """Its evidence."""
    threshold: float
    """What chance reaches in flights that lack nothing."""
    parameters: list[Parameter]
    """Its parameters, fitted together with the model's own."""
    channels: list[str]
    """Channels in which it takes part of the residual, the largest first."""
    indistinguishable_from: list[str]
    """Ids that these flights cannot tell from it."""
    heldout_error_reduction: float
    """Share by which it lowers the error of stretches that the fit did not see."""
    refused: list[str]
    """Why it is not asserted although its evidence exceeds the threshold."""


@dataclass(frozen=True)
class Diagnosis:
    """Which physical effect a model lacks: what ``greylag diagnose`` finds."""

    model: str
    """The model's name."""
    verdict: str
    """``effect``, ``adequate``, ``unexplained``, or ``unknown`` if the flights allow no verdict."""
    sentences: list[str]
    """The answer in plain words, the most important first."""
    effects: list[Candidate]
    """Every candidate: asserted ones first, then by evidence."""
    notes: list[str]
    """What the reader must know besides."""
    document: dict[str, Any]
    """Everything that was found, as in ``greylag diagnose --json``."""

    @classmethod
    def _of(cls, document: dict[str, Any]) -> Diagnosis:
        def candidate(found: dict[str, Any]) -> Candidate:
            parameters = [_read(Parameter, p, ci95=_interval(p["ci95"])) for p in found["parameters"]]
            return _read(Candidate, found, parameters=parameters)

        effects = [candidate(found) for found in document["effects"]]
        return _read(cls, document, effects=effects, document=document)

    @property
    def asserted(self) -> list[Candidate]:
        """The effects that the data say are missing."""
        return [effect for effect in self.effects if effect.asserted]

    def frame(self) -> pd.DataFrame:
        """The candidates, a row each, with their first parameter."""

        def row(effect: Candidate) -> dict[str, Any]:
            of = {k: v for k, v in vars(effect).items() if k not in ("parameters", "description")}
            first = effect.parameters[0] if effect.parameters else None
            return {**of, "parameter": first and first.name, "value": first.value if first else float("nan")}

        return _table([row(effect) for effect in self.effects])


@dataclass(frozen=True)
class FittedParameter:
    """A coefficient before and after a fit."""

    name: str
    """``effect.coefficient``, as in the model file."""
    added: bool
    """Whether it belongs to an effect that was added."""
    prior: float
    """Value before the fit."""
    value: float
    """The fitted value."""
    sd: float
    """Its standard deviation."""
    ci95: tuple[float, float]
    """Its 95 % interval."""
    at_bound: bool
    """Whether it stands at a bound of what is physically possible."""


@dataclass(frozen=True)
class Amendment:
    """A model refitted to flights, effects added: what ``greylag amend`` does."""

    path: Path
    """The amended model's file."""
    sentences: list[str]
    """The story in plain words."""
    added: list[str]
    """Ids of the effects that the amended model has more."""
    refused: dict[str, list[str]]
    """Effects that the data refuse, with why."""
    parameters: list[FittedParameter]
    """Every coefficient that was free."""
    given: list[HorizonScore]
    """Free-run error on held-out flights of the model as given,"""
    before: list[HorizonScore]
    """with its coefficients tuned,"""
    after: list[HorizonScore]
    """with the effects."""
    notes: list[str]
    """What the reader must know besides."""
    document: dict[str, Any]
    """Everything that was found, as in ``amend.json``."""

    @classmethod
    def _of(cls, document: dict[str, Any], path: Path) -> Amendment:
        parameters = [_read(FittedParameter, p, ci95=_interval(p["ci95"])) for p in document["parameters"]]
        effects = document["effects"]
        return _read(
            cls,
            document,
            path=path,
            added=[e["id"] for e in effects if e["joined"]],
            refused={e["id"]: e["refused"] for e in effects if e["refused"]},
            parameters=parameters,
            given=_scores(document["given"]),
            before=_scores(document["before"]),
            after=_scores(document["after"]),
            document=document,
        )

    @property
    def model(self) -> Model:
        """The amended model, read from its file."""
        return Model.load(self.path)

    def frame(self) -> pd.DataFrame:
        """Free-run errors on flights that the fit did not see: as given, tuned, amended; states in their units."""
        stages = {"given": self.given, "tuned": self.before, "amended": self.after}
        return _table([{"model": name, **_score_row(s)} for name, all in stages.items() for s in all])

    def parameters_frame(self) -> pd.DataFrame:
        """The coefficients, a row each."""
        return _table([vars(p) for p in self.parameters])
