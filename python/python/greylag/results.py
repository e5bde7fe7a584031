"""Results of the functions on flight logs. ``frame()`` returns a result as a pandas table."""

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
    """An instance of ``kind`` from the fields of a JSON document. A number that does not exist (``null``) is NaN."""
    given = {f.name: found[f.name] for f in fields(kind) if f.name in found and f.name not in more}  # type: ignore[arg-type]
    for f in fields(kind):  # type: ignore[arg-type]
        if f.type == "float" and f.name in given and given[f.name] is None:
            given[f.name] = float("nan")
    return kind(**given, **more)


def _interval(found: list[float | None]) -> tuple[float, float]:
    """The ends of an interval in a JSON document. An end that does not exist (``null``) is NaN."""
    low, high = (float("nan") if end is None else end for end in found)
    return low, high


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Log:
    """A flight log as a table: SI units, radians, body axes FRD, earth axes NED. A missing value is NaN."""

    name: str
    """Name of the file."""
    format: str
    """Name of the file's format, such as ``CSV table``."""
    notes: list[str]
    """Assumptions, derived columns and anomalies that the reader reports."""
    columns: dict[str, NDArray[np.float64]]
    """Columns with at least one value. The unit is at the end of the name."""

    @property
    def states(self) -> NDArray[np.float64]:
        """The states, (n, 8), for :class:`greylag.Model`. A state that was not logged is NaN."""
        return self._matrix(STATE_NAMES)

    @property
    def controls(self) -> NDArray[np.float64]:
        """The controls, (n, 4), for :class:`greylag.Model`. A control that was not logged is NaN."""
        return self._matrix(("aileron_rad", "elevator_rad", "throttle", "rudder_rad"))

    def frame(self) -> pd.DataFrame:
        """The columns as a table, with the time in s as index."""
        return _table([]).assign(**self.columns).set_index("time_s")

    def _matrix(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        missing = np.full(len(self.columns["time_s"]), np.nan)
        return np.column_stack([self.columns.get(name, missing) for name in names])

    def __len__(self) -> int:
        return len(self.columns["time_s"])


@dataclass(frozen=True)
class HorizonScore:
    """Free-run errors at one horizon (time after the start of a run), over all runs."""

    horizon_s: float
    """Time after the start of a run, s."""
    runs: int
    """Number of runs that reach the horizon, including diverged runs."""
    diverged: int
    """Number of these runs that have diverged by then."""
    rmse_scaled: float
    """Root mean square, over runs and states, of error / x_c, where x_c is the reference scale of a state in [GSFM26]."""
    states: dict[str, float] = field(default_factory=dict)
    """Root mean square error of each state over the runs that did not diverge, in the unit of the state."""

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
    """Errors of one model in one channel over all flights: a force, a moment, or the rate of V, α or β."""

    name: str
    """Name of the channel, such as ``lift``."""
    unit: str
    """Unit of the channel."""
    measured_sd: float
    """Standard deviation of the measured channel, in ``unit``."""
    residual_rms: float
    """Root mean square of the residual (measured minus model), in ``unit``."""
    noise_sd: float
    """Standard deviation of the residual due to sensor noise, in ``unit``."""
    unexplained_fraction: float
    """Residual variance divided by measured variance, both less noise. NaN if the channel hardly varies beyond noise."""
    worst_regime: str
    """One sentence on the flight regime with the largest error."""


@dataclass(frozen=True)
class ModelResult:
    """Errors of one model over all flights."""

    name: str
    """Name of the model."""
    sentences: list[str]
    """Findings on the model in sentences, the most important first."""
    free_run: list[HorizonScore]
    """Free-run errors, one entry for each horizon."""
    channels: list[Channel]
    """Errors in forces, moments and rates, one entry for each channel."""


@dataclass(frozen=True)
class Comparison:
    """Errors of models over flights: the result of ``greylag compare``."""

    models: list[ModelResult]
    """Result of each model, in the order of the call."""
    forecasts: dict[str, list[HorizonScore]]
    """Free-run errors of baseline forecasts without aerodynamics, by name of the forecast."""
    notes: list[str]
    """Notes on skipped flights, assumptions and lost accuracy."""
    document: dict[str, Any]
    """The whole result, as in ``greylag compare --json``."""

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
        """The findings on the first model in sentences."""
        return self.models[0].sentences

    def frame(self) -> pd.DataFrame:
        """Free-run errors, one row for each model or forecast and horizon. Errors of states are in the units of the states."""
        runs = [(m.name, m.free_run) for m in self.models] + [*self.forecasts.items()]
        return _table([{"model": name, **_score_row(s)} for name, scores in runs for s in scores])

    def channels_frame(self) -> pd.DataFrame:
        """Errors in channels, one row for each model and channel."""
        return _table([{"model": m.name, **vars(c)} for m in self.models for c in m.channels])


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter of an effect."""

    name: str
    """Name in model files."""
    value: float
    """Estimate, in the unit that ``unit`` names."""
    ci95: tuple[float, float]
    """95 % confidence interval of ``value``."""
    unit: str
    """Unit of ``value``, with the meaning of the parameter."""


@dataclass(frozen=True)
class Candidate:
    """A physical effect that the model may lack, with its evidence."""

    id: str
    """Id of the effect in the catalogue."""
    description: str
    """Description of the effect, in one sentence."""
    asserted: bool
    """Whether the diagnosis asserts that the model lacks the effect."""
    evidence: float
    """The smaller of the penalised gain and the block-robust Wald statistic. It is compared with ``threshold``."""
    threshold: float
    """Evidence that chance reaches in simulated flights without a missing effect."""
    parameters: list[Parameter]
    """Parameters of the effect, fitted together with the model's own coefficients."""
    channels: list[str]
    """Channels (D, L, Y, l, m, n) whose residual the effect reduces, the largest reduction first."""
    indistinguishable_from: list[str]
    """Ids of effects that these flights cannot distinguish from this effect."""
    heldout_error_reduction: float
    """Relative reduction of the error on segments that the fit did not use, 0 to 1; NaN if it was not computed."""
    refused: list[str]
    """Reasons why the effect is not asserted although its evidence exceeds the threshold."""


@dataclass(frozen=True)
class Diagnosis:
    """Physical effects that a model lacks: the result of ``greylag diagnose``."""

    model: str
    """Name of the model."""
    verdict: str
    """Verdict on the model: ``effect`` (at least one effect is asserted), ``adequate`` (no effect is missing),
    ``unexplained`` (something is missing that no effect of the catalogue explains), or ``unknown`` (the flights allow no
    verdict)."""
    sentences: list[str]
    """Answer in sentences, the most important first."""
    effects: list[Candidate]
    """All candidates: first the asserted ones, then the others in descending order of evidence."""
    notes: list[str]
    """Further notes for the reader."""
    document: dict[str, Any]
    """The whole result, as in ``greylag diagnose --json``."""

    @classmethod
    def _of(cls, document: dict[str, Any]) -> Diagnosis:
        def candidate(found: dict[str, Any]) -> Candidate:
            parameters = [_read(Parameter, p, ci95=_interval(p["ci95"])) for p in found["parameters"]]
            return _read(Candidate, found, parameters=parameters)

        effects = [candidate(found) for found in document["effects"]]
        return _read(cls, document, effects=effects, document=document)

    @property
    def asserted(self) -> list[Candidate]:
        """The candidates that are asserted."""
        return [effect for effect in self.effects if effect.asserted]

    def frame(self) -> pd.DataFrame:
        """The candidates, one row each, with name and value of their first parameter."""

        def row(effect: Candidate) -> dict[str, Any]:
            of = {k: v for k, v in vars(effect).items() if k not in ("parameters", "description")}
            first = effect.parameters[0] if effect.parameters else None
            return {**of, "parameter": first and first.name, "value": first.value if first else float("nan")}

        return _table([row(effect) for effect in self.effects])


@dataclass(frozen=True)
class FittedParameter:
    """A coefficient before and after a fit."""

    name: str
    """Name, ``effect.coefficient``, as in the model file."""
    added: bool
    """Whether the coefficient belongs to an added effect."""
    prior: float
    """Value before the fit, in the unit of the model file."""
    value: float
    """Estimate, in the unit of the model file."""
    sd: float
    """Standard deviation of ``value``."""
    ci95: tuple[float, float]
    """95 % confidence interval of ``value``."""
    at_bound: bool
    """Whether the estimate is at a bound of the physically possible range."""


@dataclass(frozen=True)
class Amendment:
    """A model refitted to flights, with added effects: the result of ``greylag amend``.

    Free-run errors are those on the held-out flights.
    """

    path: Path
    """File of the amended model."""
    sentences: list[str]
    """Sentences on conventions, on refused effects and on an unmodelled rudder."""
    added: list[str]
    """Ids of the added effects."""
    refused: dict[str, list[str]]
    """Reasons to reject an effect, by id of the effect."""
    parameters: list[FittedParameter]
    """All free coefficients of the amended model, including those of added effects."""
    given: list[HorizonScore]
    """Free-run errors of the model as given, one entry for each horizon."""
    before: list[HorizonScore]
    """Free-run errors of the model with tuned coefficients and without added effects."""
    after: list[HorizonScore]
    """Free-run errors of the amended model."""
    notes: list[str]
    """Further notes for the reader."""
    document: dict[str, Any]
    """The whole result, as in ``amend.json``."""

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
        """Free-run errors of the model as given, tuned and amended, one row for each horizon.

        Errors of states are in the units of the states.
        """
        stages = {"given": self.given, "tuned": self.before, "amended": self.after}
        return _table([{"model": name, **_score_row(s)} for name, all in stages.items() for s in all])

    def parameters_frame(self) -> pd.DataFrame:
        """The free coefficients, one row each."""
        return _table([vars(p) for p in self.parameters])
