"""Trains TD3 of RLtools (https://rl.tools) for the task of ``other_agents.py``: same model, networks and evaluation.

    python python/benches/rltools_td3.py --greylag target/release/greylag --out DIR [--steps 100000] [--seeds 3]

Needs greylag, ``pip install 'rltools[mkl]' gymnasium``, g++ and the headers of Python, because RLtools is compiled on first use. The
process must not import PyTorch: RLtools cannot use MKL with it.

Trains in ``Greylag/Imagined-v0`` (``greylag.LEARNED_MODEL``) for ``--steps`` steps, exports each policy and evaluates it with
``greylag evaluate`` in JSBSim over all targets. Prints a row of the table of ``other_agents.py``. DIR/agents.jsonl has a line for each
policy. Existing policies are neither trained nor evaluated again.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import re
import statistics
import time
from pathlib import Path
from typing import Any

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import gymnasium as gym
import numpy as np
import rltools

import greylag
from judging import judge

AGENT = "RLtools TD3"
# Settings at compile time; all others are defaults of RLtools. By default a network has two hidden layers, and the replay buffer
# holds all steps.
SETTINGS = {"ACTOR_HIDDEN_DIM": 128, "CRITIC_HIDDEN_DIM": 128, "STEP_LIMIT": 1_000_000}
VERSIONS = {name: importlib.metadata.version(name) for name in ("rltools", "mkl", "gymnasium")}


class Trainer:
    """TD3 of RLtools, compiled once for all seeds. Each seed has its own environment and networks."""

    def __init__(self) -> None:
        self.seed = 0
        self.made = rltools.TD3(self._environment, enable_evaluation=False, interface_name="mkl", **SETTINGS)

    def _environment(self) -> gym.Env:
        """An environment with one aircraft.

        RLtools ignores ``truncated``. It ends an episode at ``max_episode_steps``.
        """
        env = gym.make("Greylag/Imagined-v0", max_episode_steps=greylag.envs.STEPS, disable_env_checker=True)
        env.reset(seed=self.seed)
        return env

    def begin(self, seed: int) -> Any:
        """The state of a training with ``seed``: a new environment and new networks."""
        self.seed = seed
        return self.made.State(seed)


def train(asked: argparse.Namespace) -> None:
    """Trains all seeds in turn, ``--round`` steps at a time, and exports the policies after each round.

    After an interruption all seeds therefore have policies of equal numbers of steps.
    """
    trainer = Trainer()
    states = {seed: trainer.begin(seed) for seed in range(1, asked.seeds + 1)}
    used = dict.fromkeys(states, 0.0)
    for steps in range(asked.round, asked.steps + 1, asked.round):
        for seed, state in states.items():
            begun = time.process_time()
            for _ in range(asked.round):
                state.step()
            used[seed] += time.process_time() - begun
            folder = place(asked, seed, steps)
            row = {"agent": AGENT, "seed": seed, "steps": steps, "cpu_s": used[seed], "versions": VERSIONS}
            row["settings"], row["export_differs_by"] = SETTINGS, export(state, folder, seed, steps)
            (folder / "training.json").write_text(json.dumps(row))
            print(AGENT, seed, f"{steps} steps, {used[seed]:.0f} s of a core", flush=True)


def place(asked: argparse.Namespace, seed: int, steps: int) -> Path:
    """The folder for the policy of ``seed`` after ``steps`` steps."""
    return asked.out / f"RLtools-TD3-{seed}-{steps}"


def layers(state: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """The weights and biases of the actor, read from the C++ header that RLtools exports."""
    arrays = [
        np.array([float.fromhex(number.strip().rstrip("f")) for number in numbers.split(",")], np.float32).reshape(
            [int(extent) for extent in shape.split(",")]
        )
        for numbers, shape in re.findall(
            r"memory\[\] = \{([^}]*)\};\s*using SHAPE = [^<]*<[^,]*,([\d, ]+)>", state.export_policy()
        )
    ]
    return list(zip(arrays[::2], arrays[1::2], strict=True))


def export(state: Any, folder: Path, seed: int, steps: int) -> float:
    """Exports the policy to ``folder``.

    Returns the largest difference between its actions and those of RLtools on 1000 random observations.
    """
    greylag.export_policy(
        folder, layers(state), trained_in=greylag.LEARNED_MODEL, seed=seed, steps=steps, replace=True
    )
    seen = np.random.default_rng(0).normal(size=(1000, 16)).astype(np.float32)
    apart = float(np.abs(greylag.Policy.load(folder).act(seen) - [state.action(one) for one in seen]).max())
    if apart > 1e-3:
        raise SystemExit(f"{folder}: what was exported differs from what RLtools flies by {apart}")
    return apart


def main() -> None:
    """Trains the seeds, evaluates their policies and prints the row of the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--greylag", type=Path, required=True, help="the program, for its command evaluate")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--targets", type=Path, default=Path("params/targets.csv"))
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--round", type=int, default=5_000, help="steps between exports, of which --steps is a multiple")
    parser.add_argument("--seeds", type=int, default=3)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    folders = [place(asked, seed, asked.steps) for seed in range(1, asked.seeds + 1)]
    if not all((folder / "training.json").exists() for folder in folders):
        train(asked)
    record = asked.out / "agents.jsonl"
    done = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    rows = [row for row in done if row["agent"] == AGENT and row["steps"] == asked.steps]
    for folder in folders:
        row = json.loads((folder / "training.json").read_text())
        if any(known["seed"] == row["seed"] for known in rows):
            continue
        row["evaluation"] = judge(folder, asked)
        rows.append(row)
        with record.open("a") as file:
            file.write(json.dumps(row) + "\n")
    easy, corners = (
        statistics.fmean(row["evaluation"][group]["mean_deg"] for row in rows) for group in ("easy", "hard_corners")
    )
    each = ", ".join(f"{row['evaluation']['all']['mean_deg']:.2f}" for row in sorted(rows, key=lambda row: row["seed"]))
    lost = statistics.fmean(row["evaluation"]["all"]["divergence_rate"] for row in rows)
    seconds = statistics.fmean(row["cpu_s"] for row in rows)
    print(f"| {AGENT} | {asked.steps:,} | {seconds:.0f} | {easy:.2f} | {corners:.2f} | {each} | {lost:.1%} |")


if __name__ == "__main__":
    main()
