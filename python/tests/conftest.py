"""Flights that several tests read."""

from __future__ import annotations

from pathlib import Path

import pytest

import greylag
from flights import fly, write_model

#: An effect that the prior lacks, strong enough to be found in a minute and a half.
MISSING = '\n[effects.pitch_break]\nCmalpha3 = { value = -40.0, source = "test" }\n'


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Models ``prior.toml`` and ``truth.toml``, flights ``flight-1.csv`` to ``flight-3.csv`` of the second."""
    folder = tmp_path_factory.mktemp("flights")
    write_model(folder, "prior.toml")
    truth = greylag.Model.load(write_model(folder, "truth.toml", MISSING))
    for seed in (1, 2, 3):
        fly(truth, folder / f"flight-{seed}.csv", 32.0, seed)
    return folder


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of models and flights as the working folder."""
    monkeypatch.chdir(folder)
    return folder
