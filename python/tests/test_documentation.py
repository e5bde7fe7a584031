"""The examples of docs/how-to/python.md run without changes. test_study.py runs the longest and checks its results."""

from __future__ import annotations

import pytest

from page import EXAMPLES, run

SHORT = [example for example in EXAMPLES if "greylag.diagnose" not in example]


@pytest.mark.parametrize("example", SHORT, ids=[f"example {k + 1}" for k in range(len(SHORT))])
def test_an_example_runs(example, here):
    if "stable_baselines3" in example:
        pytest.importorskip("stable_baselines3")
    run(example)


def test_there_is_a_short_example_of_each_thing():
    assert len(EXAMPLES) == 7 and max(len(example.splitlines()) for example in EXAMPLES) <= 12
