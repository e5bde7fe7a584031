"""Evaluates the policies of ``other_agents.py`` and ``rltools_td3.py`` in JSBSim.

This module must not import PyTorch: RLtools cannot use MKL in a process that has imported PyTorch.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from pathlib import Path


def judge(folder: Path, asked: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Evaluates the policy in ``folder`` in JSBSim.

    Returns for each group of targets the settled errors in degrees, the fraction of diverged flights and the settling time in s.
    """
    out = folder / "evaluation.json"
    command = [str(asked.greylag), "evaluate", "--controller", "policy", "--policy", str(folder)]
    command += ["--targets", str(asked.targets), "--json", str(out), "--force"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    scores = json.loads(out.read_text())["controllers"][0]["groups"]
    kept = ("count", "mean_deg", "median_deg", "max_deg", "divergence_rate", "settling_s")
    return {score["targets"]: {name: score[name] for name in kept} for score in scores}
