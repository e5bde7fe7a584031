"""Tests of the functions on flight logs: load, compare, diagnose and amend."""

from __future__ import annotations

import os
import signal
import threading
import time

import numpy as np
import pytest

import greylag
from page import EXAMPLES, run

LOGS = ["flight-1.csv", "flight-2.csv", "flight-3.csv"]


def test_a_log_is_a_table(here):
    log = greylag.load("flight-1.csv")
    assert log.format == "CSV table" and len(log) == 3200 and log.columns["time_s"][-1] == pytest.approx(31.99)
    frame = log.frame()
    assert frame.index.name == "time_s" and frame["airspeed_mps"].between(8, 40).all()
    assert log.states.shape == (3200, 8) and np.isnan(log.controls[:, 3]).all()
    with pytest.raises(greylag.GreylagError, match="flight-9.csv"):
        greylag.load("flight-9.csv")


def test_a_comparison_shows_the_better_model(here):
    heard = []
    found = greylag.compare(["prior.toml", "truth.toml"], LOGS[:2], progress=lambda *stage: heard.append(stage))
    frame = found.frame()
    assert list(frame["horizon_s"]) == [1, 2, 5, 10] * (2 + len(found.forecasts))
    prior, truth, *forecasts = frame[frame["horizon_s"] == 1]["rmse_scaled"]
    # the prior lacks an effect; its error is more than twice that of the model that simulated the flights
    assert prior > 2 * truth and min(forecasts) > truth
    assert found.channels_frame()["unexplained_fraction"].between(-1, 2).any()
    assert found.sentences and found.document["schema"] == "greylag.comparison/1"
    assert heard and all(0 <= share <= 1 for _, share in heard)


def test_an_end_of_an_interval_that_cannot_be_given_is_nan():
    parameter = {"name": "a", "value": None, "ci95": [None, 1.0], "unit": ""}
    effect = {"id": "e", "description": "", "asserted": False, "evidence": 1.0, "threshold": 2.0, "parameters": [parameter],
              "channels": [], "indistinguishable_from": [], "heldout_error_reduction": None, "refused": []}
    document = {"model": "m", "verdict": "unknown", "sentences": [], "effects": [effect], "notes": []}
    found = greylag.Diagnosis._of(document).effects[0].parameters[0]
    assert np.isnan(found.value) and np.isnan(found.ci95[0]) and found.ci95[1] == 1.0


def test_the_missing_effect_is_found_and_added(here):
    names = run(next(example for example in EXAMPLES if "greylag.diagnose" in example))
    found, amended = names["found"], names["amended"]
    assert found.verdict == "effect"
    assert "pitch_break" in [effect.id for effect in found.asserted]
    frame = found.frame()
    assert frame.loc[0, "asserted"] and {"evidence", "threshold", "value"} <= set(frame.columns)
    assert "pitch_break" in amended.added and amended.path.exists()
    assert "pitch_break" in amended.model.effects
    judged = {row["model"]: row["rmse_scaled"] for _, row in amended.frame().query("horizon_s == 1").iterrows()}
    assert judged["amended"] < 0.7 * judged["given"]
    # the true value is -40
    value = amended.parameters_frame().set_index("name").loc["pitch_break.Cmalpha3", "value"]
    assert value == pytest.approx(-40, rel=0.2)
    with pytest.raises(FileExistsError, match="replace=True"):
        greylag.amend("prior.toml", LOGS, "better", effects=found)


def test_a_flight_that_is_named_twice_or_judges_itself_is_refused(here):
    with pytest.raises(greylag.GreylagError, match="same flight"):
        greylag.amend("prior.toml", LOGS[:1], "twice", effects=[], hold_out=LOGS[:1])
    with pytest.raises(greylag.GreylagError, match="count twice"):
        greylag.diagnose("prior.toml", [LOGS[0], LOGS[0]])


def test_amend_leaves_what_stands_in_the_folder(here):
    kept = here / "kept" / "notes.txt"
    kept.parent.mkdir()
    kept.write_text("mine")
    greylag.amend("prior.toml", LOGS, kept.parent, effects=[])
    assert kept.read_text() == "mine"
    assert sorted(p.name for p in kept.parent.iterdir()) == ["airframe.toml", "amend.json", "model.toml", "notes.txt"]
    with pytest.raises(FileExistsError):
        greylag.amend("prior.toml", LOGS, kept.parent, effects=[])


def test_progress_that_raises_ends_the_work(here):
    def stop(doing: str, share: float) -> None:
        raise RuntimeError(f"stopped at {doing}")

    with pytest.raises(RuntimeError, match="stopped at"):
        greylag.diagnose("prior.toml", LOGS[:1], progress=stop)


def test_an_interrupt_ends_the_work_and_other_threads_go_on_meanwhile(here):
    # a shell without a terminal starts background processes with SIGINT ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    turns, over = [], threading.Event()

    def count() -> None:
        while not over.wait(0.01):
            turns.append(time.monotonic())

    def interrupt() -> None:
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=count, daemon=True).start()
    threading.Thread(target=interrupt, daemon=True).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        greylag.diagnose("prior.toml", LOGS, nulls=2000)
    over.set()
    # without the interrupt, 2000 nulls take minutes; the counting thread has 50 turns in 0.5 s, and half of them
    # suffice on a busy machine
    assert time.monotonic() - begun < 30 and len(turns) > 25
