"""The examples of docs/how-to/python.md run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs/how-to/python.md"
EXAMPLES = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("example", EXAMPLES, ids=[f"example {k + 1}" for k in range(len(EXAMPLES))])
def test_an_example_runs(example, here, capsys):
    if "stable_baselines3" in example:
        pytest.importorskip("stable_baselines3")
    exec(compile(example, str(PAGE), "exec"), {"__name__": "example"})
    assert len(example.splitlines()) <= 14, "an example is ten lines or a few more"


def test_there_is_an_example_of_each_thing():
    assert len(EXAMPLES) >= 6
