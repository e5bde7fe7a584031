"""Compares agents of Stable-Baselines3 with greylag's own trainings: same model, task, processor time and evaluation.

    python python/benches/other_agents.py --greylag target/release/greylag --out DIR [--cpu-seconds 300] [--seeds 3]

Trains PPO, SAC and TD3 with their usual settings in the shipped learned model (``greylag.LEARNED_MODEL``), each for
``--cpu-seconds`` of one core. Trains TD3 and the analytic policy gradient of greylag with ``greylag train policy``; the options
``--td3-steps`` and ``--analytic-updates`` determine their duration. Exports every policy and evaluates it with ``greylag evaluate``
in JSBSim over all targets. Prints a table. DIR/agents.jsonl has a line for each policy; a policy with a line is not trained again.

A tanh is added to the mean of PPO, because greylag only flies policies with tanh at the output.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import time
from pathlib import Path

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.policies import ActorCriticPolicy

import greylag
from greylag.stable_baselines3 import ImaginedVecEnv
from judging import judge

torch.set_num_threads(1)
OTHERS = ("PPO", "SAC", "TD3")
OWN = ("greylag TD3", "greylag analytic")
# Number of environments. PPO needs many for its batches. SAC and TD3 make as many updates per step as they have
# environments.
ENVIRONMENTS = {"PPO": 64, "SAC": 4, "TD3": 4}


class BoundedPolicy(ActorCriticPolicy):
    """The default networks of PPO, with a tanh that bounds the mean."""

    def _build(self, lr_schedule) -> None:
        super()._build(lr_schedule)
        self.action_net = torch.nn.Sequential(self.action_net, torch.nn.Tanh())
        self.optimizer = self.optimizer_class(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)


class ProcessorTime(BaseCallback):
    """Ends a training after ``seconds`` of processor time."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.end = time.process_time() + seconds

    def _on_step(self) -> bool:
        return time.process_time() < self.end


def train_other(name: str, seed: int, folder: Path, asked: argparse.Namespace) -> dict[str, float]:
    """Trains an agent of Stable-Baselines3 and exports its policy.

    Returns the number of steps and the processor time in s.
    """
    envs = ImaginedVecEnv(ENVIRONMENTS[name])
    if name == "PPO":
        # 64 x 128 steps per rollout, as in RL Zoo for tasks of this size; the other settings are the defaults
        agent = PPO(
            BoundedPolicy, envs, seed=seed, device="cpu", n_steps=128, batch_size=256, n_epochs=10,
            policy_kwargs={"net_arch": [128, 128], "activation_fn": torch.nn.ReLU, "log_std_init": -1.0},
        )  # fmt: skip
    else:
        kind = {"SAC": SAC, "TD3": TD3}[name]
        agent = kind(
            "MlpPolicy", envs, seed=seed, device="cpu", learning_starts=2_000, gradient_steps=ENVIRONMENTS[name],
            policy_kwargs={"net_arch": [128, 128]},
        )  # fmt: skip
        if name == "TD3":
            agent.action_noise = NormalActionNoise(np.zeros(3), 0.1 * np.ones(3))
    begun = time.process_time()
    agent.learn(10**9, callback=ProcessorTime(asked.cpu_seconds))
    used = time.process_time() - begun
    what = agent
    if name == "PPO":
        modules = [m for m in agent.policy.mlp_extractor.policy_net if isinstance(m, torch.nn.Linear)]
        modules.append(agent.policy.action_net[0])
        what = [(m.weight.detach().numpy(), m.bias.detach().numpy()) for m in modules]
    greylag.export_policy(
        folder, what, trained_in=envs.envs.model, seed=seed, steps=agent.num_timesteps, replace=True
    )
    return {"steps": agent.num_timesteps, "cpu_s": used}


def train_own(name: str, seed: int, folder: Path, asked: argparse.Namespace) -> dict[str, float]:
    """Trains a policy with ``greylag train policy``.

    Returns the number of steps (TD3) or updates (analytic), and the processor time in s.
    """
    model = str(greylag.files.shipped(greylag.LEARNED_MODEL).parent)
    command = [
        str(asked.greylag), "train", "policy", "--env", f"model:{model}", "--seed", str(seed), "--out", str(folder),
        "--actor", "128,128", "--critic", "128,128",
    ]  # fmt: skip
    if name == "greylag TD3":
        command += ["--algorithm", "td3", "--steps", str(asked.td3_steps), "--evaluate", str(asked.td3_steps)]
    else:
        command += ["--algorithm", "analytic", "--updates", str(asked.analytic_updates), "--window", "200",
                    "--gradient-batch", "64", "--corners", "0.3"]  # fmt: skip
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"steps": asked.td3_steps if name == "greylag TD3" else asked.analytic_updates, "cpu_s": used}


def table(rows: list[dict]) -> None:
    """Prints one line for each agent: means over its seeds, and the mean settled error of each seed over all targets."""
    print("| agent | steps | s of a core | easy, ° | hard corners, ° | all, each seed, ° | diverged |")
    print("|---|---|---|---|---|---|---|")
    for agent in dict.fromkeys(row["agent"] for row in rows):
        own = [row for row in rows if row["agent"] == agent]

        def mean(group: str, what: str) -> float:
            return statistics.fmean(row["evaluation"][group][what] for row in own)

        each = ", ".join(f"{row['evaluation']['all']['mean_deg']:.2f}" for row in own)
        steps, seconds = (statistics.fmean(row[key] for row in own) for key in ("steps", "cpu_s"))
        print(
            f"| {agent} | {steps:,.0f} | {seconds:.0f} | {mean('easy', 'mean_deg'):.2f} | "
            f"{mean('hard_corners', 'mean_deg'):.2f} | {each} | {mean('all', 'divergence_rate'):.1%} |"
        )


def main() -> None:
    """Trains the agents, evaluates their policies and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--greylag", type=Path, required=True, help="the program, built with the feature learn")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--targets", type=Path, default=Path("params/targets.csv"))
    parser.add_argument("--cpu-seconds", type=float, default=300.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--agents", nargs="+", default=[*OTHERS, *OWN], choices=[*OTHERS, *OWN])
    parser.add_argument("--td3-steps", type=int, default=200_000, help="of greylag's TD3, about --cpu-seconds long")
    parser.add_argument("--analytic-updates", type=int, default=800)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    record = asked.out / "agents.jsonl"
    done = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    for seed in range(1, asked.seeds + 1):
        for name in asked.agents:
            if any(row["agent"] == name and row["seed"] == seed for row in done):
                continue
            folder = asked.out / f"{name.replace(' ', '-')}-{seed}"
            train = train_other if name in OTHERS else train_own
            row = {"agent": name, "seed": seed, **train(name, seed, folder, asked)}
            row["stable_baselines3"] = stable_baselines3.__version__ if name in OTHERS else None
            row["evaluation"] = judge(folder, asked)
            done.append(row)
            with record.open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(name, seed, f"{row['cpu_s']:.0f} s of a core", flush=True)
    table(done)


if __name__ == "__main__":
    main()
