"""Fixtures: models and simulated flights that several tests use."""

from __future__ import annotations

from pathlib import Path

import pytest

import greylag
from flights import fly, write_model

#: An effect that the prior lacks. It is large enough to be found in 90 s of flight.
MISSING = '\n[effects.pitch_break]\nCmalpha3 = { value = -40.0, source = "test" }\n'


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the models ``prior.toml`` and ``truth.toml``.

    ``flight-1.csv`` to ``flight-3.csv`` are flights that ``truth.toml`` simulates.
    """
    folder = tmp_path_factory.mktemp("flights")
    write_model(folder, "prior.toml")
    truth = greylag.Model.load(write_model(folder, "truth.toml", MISSING))
    for seed in (1, 2, 3):
        fly(truth, folder / f"flight-{seed}.csv", 32.0, seed)
    return folder


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder with models and flights, as the working directory."""
    monkeypatch.chdir(folder)
    return folder
