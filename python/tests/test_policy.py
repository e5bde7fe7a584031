"""Tests of the export and import of policies."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import greylag

SIZES = [16, 40, 24, 3]


def layers(sizes: list[int], seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random layers of a network, with the initial distribution of PyTorch."""
    random = np.random.default_rng(seed)
    bound = [1 / np.sqrt(n) for n in sizes[:-1]]
    return [(random.uniform(-b, b, (m, n)), random.uniform(-b, b, m)) for n, m, b in zip(sizes, sizes[1:], bound)]


def answer(network: list[tuple[np.ndarray, np.ndarray]], seen: np.ndarray) -> np.ndarray:
    """The outputs of the network, in double precision."""
    for k, (weights, bias) in enumerate(network):
        seen = seen @ weights.T + bias
        seen = np.maximum(seen, 0) if k + 1 < len(network) else np.tanh(seen)
    return seen


def program() -> str | None:
    """The path of the program `greylag`; ``None`` if it is neither built nor installed."""
    built = Path(__file__).parents[2] / "target"
    found = [p for p in (built / "release/greylag", built / "debug/greylag") if p.exists()]
    return os.environ.get("GREYLAG") or shutil.which("greylag") or (str(found[0]) if found else None)


def test_an_exported_policy_acts_as_its_network(tmp_path):
    network = layers(SIZES, 1)
    folder = greylag.export_policy(tmp_path / "policy", network, trained_in=greylag.LEARNED_MODEL, seed=1, steps=10)
    policy = greylag.Policy.load(folder)
    seen = np.random.default_rng(2).standard_normal((50, 16))
    # rounding errors of single precision in sums of 40 terms
    assert np.abs(policy.act(seen) - answer(network, seen)).max() < 1e-5
    assert policy.layers == SIZES and not policy.has_critics
    assert policy.origin["model_sha256"] == greylag.Model.load(greylag.LEARNED_MODEL).sha256
    with pytest.raises(FileExistsError, match="replace=True"):
        greylag.export_policy(folder, network, trained_in="jsbsim")
    critics = (layers([19, 8, 1], 3), layers([19, 8, 1], 4))
    greylag.export_policy(folder, network, trained_in="jsbsim", critics=critics, replace=True)
    assert greylag.Policy.load(folder).has_critics
    greylag.export_policy(folder, network, trained_in="jsbsim", replace=True)
    assert not greylag.Policy.load(folder).has_critics


def test_other_networks_are_refused(tmp_path):
    def refused(network, words):
        with pytest.raises((greylag.GreylagError, ValueError), match=words):
            greylag.export_policy(tmp_path / "policy", network, trained_in="jsbsim")
        assert not (tmp_path / "policy").exists()

    refused(layers([15, 8, 3], 1), "16 inputs and 3 outputs")
    refused(layers([16, 600, 3], 1), "600")
    refused(layers([16, 8, 3], 1)[:1] + layers([9, 3], 1), r"layer 1 has weights \[3, 9\]")
    refused([(np.full((3, 16), np.nan), np.zeros(3))], "not a finite number")


def test_a_policy_of_another_airframe_is_refused():
    with pytest.raises(greylag.GreylagError, match="another airframe"):
        greylag.Policy.load("params/x8/policy", "params/aerosonde/prior.toml")


@pytest.mark.skipif(program() is None, reason="the program greylag is not built")
def test_the_program_flies_an_exported_policy(tmp_path):
    # a shipped policy, which is known to fly well, is read into numpy arrays and exported again
    shipped = greylag.shipped("params/x8/policy")
    network = read(shipped / "actor.safetensors")
    folder = greylag.export_policy(tmp_path / "policy", network, trained_in="jsbsim")
    targets = tmp_path / "targets.csv"
    targets.write_text("group,roll_deg,pitch_deg\neasy,20,5\neasy,-30,-10\n")

    def evaluated(controller: str, policy: Path) -> subprocess.CompletedProcess[str]:
        words = ["evaluate", "--controller", controller, "--policy", policy, "--targets", targets]
        command = [program(), *words, "--json", tmp_path / "scores.json", "--force"]
        return subprocess.run(command, capture_output=True, text=True, timeout=120)

    scores = []
    for each in (folder, shipped):
        done = evaluated("policy", each)
        assert done.returncode == 0, done.stderr
        groups = json.loads((tmp_path / "scores.json").read_text())["controllers"][0]["groups"]
        scores.append([group["mean_deg"] for group in groups])
    assert scores[0] == scores[1] and max(scores[0]) < 2
    refused = evaluated("hybrid", folder)
    assert refused.returncode != 0 and "critics" in refused.stderr


def read(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """The layers in a safetensors file. The file has weights (inputs, outputs), the result has (outputs, inputs)."""
    content = path.read_bytes()
    size = int.from_bytes(content[:8], "little")
    header, body = json.loads(content[8 : 8 + size]), content[8 + size :]

    def tensor(name: str) -> np.ndarray:
        about = header[name]
        start, end = about["data_offsets"]
        return np.frombuffer(body[start:end], "<f4").reshape(about["shape"])

    count = sum(name.endswith(".weight") for name in header)
    return [(tensor(f"layers.{k}.weight").T, tensor(f"layers.{k}.bias")) for k in range(count)]


@pytest.mark.parametrize("algorithm", ["TD3", "SAC"])
def test_policies_of_stable_baselines3(algorithm, tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    import torch

    env = greylag.ImaginedEnv()
    model = getattr(sb3, algorithm)("MlpPolicy", env, seed=1, policy_kwargs={"net_arch": [32, 32]})
    folder = greylag.export_policy(tmp_path / "policy", model, trained_in=env.model)
    policy = greylag.Policy.load(folder)
    seen = np.random.default_rng(2).standard_normal((50, 16)).astype(np.float32)
    theirs, _ = model.predict(seen, deterministic=True)
    assert np.abs(policy.act(seen) - theirs).max() < 1e-5
    assert policy.has_critics
    tanh = {"net_arch": [32, 32], "activation_fn": torch.nn.Tanh}
    with pytest.raises(greylag.GreylagError, match="Tanh"):
        greylag.export_policy(tmp_path / "other", getattr(sb3, algorithm)("MlpPolicy", env, policy_kwargs=tanh), trained_in=env.model)


def test_what_stable_baselines3_cannot_give_is_refused(tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    with pytest.raises(greylag.GreylagError, match="PPO has no deterministic actor"):
        greylag.export_policy(tmp_path / "policy", sb3.PPO("MlpPolicy", greylag.ImaginedEnv()), trained_in="jsbsim")
