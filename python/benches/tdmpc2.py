"""Trains TD-MPC2 (Hansen, Su, Wang 2024) for the task of ``other_agents.py``: same training model, same evaluation targets.

    python python/benches/tdmpc2.py --out DIR [--steps 100000] [--seeds 3] [--seconds 400] [--judge-seconds 120]

Needs greylag, PyTorch, gymnasium and a GPU. On one core of a CPU the planner takes 0.85 s for one step of one aircraft.

This is a new implementation with the settings of the public code (https://github.com/nicklashansen/tdmpc2, commit e9f5932): one task,
5M parameters, and ``episodic=true``, because an aircraft can be lost. It differs from the public code as follows:

- All seeds are trained at the same time as one batch of networks. Each seed has its own weights, gradient norm, scale and transitions.
  Initial weights and targets are drawn from the seed. All other random numbers come from one generator for all seeds.
- ``--lanes`` aircraft of each seed fly at the same time, and one call of the planner plans for all of them. The number of updates
  after each step is the number of new transitions times ``--updates-per-step``.
- A transition can be sampled as soon as it is stored, not only after the end of its episode. All start steps of sequences are sampled
  with the same probability, whereas the public code samples all episodes with the same probability.
- On a GPU the planner computes in half precision, and the weights are saved in half precision. Its mantissa is as long as that of
  TF32, in which the public code computes.
- ``--seconds`` can end a training before ``--steps``. The record has the numbers of steps and updates.

The controller that TD-MPC2 trains is a planner. ``greylag evaluate`` does not have this planner, so this script evaluates it in JSBSim
(``greylag.X8Env``) by the rules of ``greylag evaluate``. There is one difference: an aircraft that leaves the envelope of the
environment is lost at once, and its error is 180°. ``--check-judge POLICY --greylag PROGRAM`` evaluates a policy both ways.
``--flown-by prior`` evaluates the mean of the policy without the planner, which is feasible on a CPU.

Prints a row of the table of ``other_agents.py``. DIR/agents.jsonl has a line for each seed, DIR/training.jsonl the learning curve,
DIR/flights.jsonl the flights, and DIR/TD-MPC2-SEED.pt the weights. Existing results are neither trained nor flown again.
``--judge-only`` continues the evaluation after an interruption, also with the weights of an incomplete training.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import os
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

os.environ.update(OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import gymnasium as gym
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

import greylag
from greylag.envs import OBSERVATION_UNITS, STEP_S, STEPS
from judging import judge

try:
    import triton
    import triton.language as tl
except ImportError:
    triton = None

AGENT = "TD-MPC2"
OBSERVATIONS, ACTIONS = 16, 3
# Number of action inputs of a network. Widths are multiples of 8, the block size of the tensor cores. The padded inputs are zero.
ACTIONS_WIDE = 8
# As in src/sim/episode.rs: number of last steps over which the settled error is computed, error within which a target is reached
# (°), settled error above which a flight has diverged (°), and error of a lost aircraft (°).
SETTLED, REACHED_DEG, DIVERGED_DEG, LOST_DEG = 200, 1.0, 10.0, 180.0
GROUPS = ("easy", "hard_corners")
VERSIONS = {"torch": str(torch.__version__), "gymnasium": gym.__version__, "numpy": np.__version__}


@dataclasses.dataclass(frozen=True)
class Settings:
    """Settings of TD-MPC2. Names and default values are those of the public code."""

    enc_dim: int = 256
    mlp_dim: int = 512
    latent_dim: int = 512
    num_q: int = 5
    simnorm_dim: int = 8
    dropout: float = 0.01
    num_bins: int = 101
    vmin: float = -10.0
    vmax: float = 10.0
    horizon: int = 3
    iterations: int = 6
    num_samples: int = 512
    num_elites: int = 64
    num_pi_trajs: int = 24
    min_std: float = 0.05
    max_std: float = 2.0
    temperature: float = 0.5
    log_std_min: float = -10.0
    log_std_max: float = 2.0
    entropy_coef: float = 1e-4
    batch_size: int = 256
    reward_coef: float = 0.1
    value_coef: float = 0.1
    termination_coef: float = 1.0
    consistency_coef: float = 20.0
    rho: float = 0.5
    lr: float = 3e-4
    enc_lr_scale: float = 0.3
    grad_clip_norm: float = 20.0
    tau: float = 0.01
    # by the rules of the public code: min(0.995, (1000 / 5 - 1) / (1000 / 5)) and max(1000, steps of five episodes)
    discount: float = 0.995
    seed_steps: int = 5000


if triton is not None:

    @triton.jit
    def _fused(x, bias, scale, shift, out, rows, stride, SIZE: tl.constexpr, GROUP: tl.constexpr):  # noqa: N803
        """Computes one row of :func:`activated`. The row is read once and written once."""
        row = tl.program_id(0).to(tl.int64)
        at, own = tl.arange(0, SIZE), (row // rows) * stride + tl.arange(0, SIZE)
        y = tl.load(x + row * SIZE + at).to(tl.float32) + tl.load(bias + own).to(tl.float32)
        y -= tl.sum(y, 0) / SIZE
        y *= tl.rsqrt(tl.sum(y * y, 0) / SIZE + 1e-5)
        y = y * tl.load(scale + own).to(tl.float32) + tl.load(shift + own).to(tl.float32)
        if GROUP:
            parts = tl.reshape(y, (SIZE // GROUP, GROUP))
            parts = tl.exp(parts - tl.max(parts, 1, keep_dims=True))
            y = tl.reshape(parts / tl.sum(parts, 1, keep_dims=True), (SIZE,))
        else:
            e = tl.exp(tl.minimum(y, 20.0))
            y = y * (e * (e + 2.0)) / (e * (e + 2.0) + 2.0)
        tl.store(out + row * SIZE + at, y.to(out.dtype.element_ty))


# Whether the planner uses the kernel `_fused`. `fusing` sets it at the start of a run.
FUSED = False


def activated(x: Tensor, bias: Tensor, scale: Tensor, shift: Tensor, group: int) -> Tensor:
    """Layer normalisation of x + bias, followed by an activation; x is (networks, rows, units).

    The activation is Mish if ``group`` is 0, otherwise a softmax over each group of ``group`` units.
    """
    if FUSED and not torch.is_grad_enabled():
        out = torch.empty_like(x)
        rows, size = x.shape[1:]
        _fused[(x.shape[0] * rows,)](x, bias, scale, shift, out, rows, bias.stride(0), size, group, num_warps=2)
        return out
    y = torch.addcmul(shift, F.layer_norm(x + bias, x.shape[-1:]), scale)
    return y.unflatten(-1, (-1, group)).softmax(-1).flatten(-2) if group else F.mish(y)


class Net:
    """The architecture of a network that exists many times.

    The parameters of each network are a row of one tensor. A layer is evaluated for all networks at once.
    """

    def __init__(self, *sizes: int, group: int = 0, zero: bool = False, bins: int = 0) -> None:
        self.layers = list(itertools.pairwise(sizes))
        self.group, self.zero, self.bins = group, zero, bins
        self.normed = [k + 1 < len(self.layers) or group > 0 for k in range(len(self.layers))]
        self.parts = [
            part
            for (width, units), normed in zip(self.layers, self.normed, strict=True)
            for part in ([width * units] + [units] * (3 if normed else 1))
        ]

    def begun(self, generator: torch.Generator) -> Tensor:
        """Random initial parameters of one network."""
        parts = []
        for (width, units), normed in zip(self.layers, self.normed, strict=True):
            last = not normed
            std = 0.0 if last and self.zero else 0.02
            parts.append(torch.randn(width * units, generator=generator) * std)
            parts.append(torch.zeros(units))
            if last and self.bins:
                parts[-1][self.bins :] = -30_000.0  # logit of padded bins: their probability is 0; half precision can represent it
            if normed:
                parts += [torch.ones(units), torch.zeros(units)]
        return torch.cat(parts)

    def __call__(self, flat: Tensor, x: Tensor, dropout: float = 0.0) -> Tensor:
        """The outputs (networks, rows, out) for parameters (networks, parameters) and inputs (networks, rows, in)."""
        parts = iter(flat.split(self.parts, 1))
        for k, ((width, units), normed) in enumerate(zip(self.layers, self.normed, strict=True)):
            weight, bias = next(parts).view(-1, width, units), next(parts).unsqueeze(1)
            x = torch.bmm(x, weight)
            if not normed:
                return (x + bias).float()
            scale, shift = next(parts).unsqueeze(1), next(parts).unsqueeze(1)
            if dropout and k == 0:
                x, bias = F.dropout(x + bias, dropout), torch.zeros_like(bias)
            x = activated(x, bias, scale, shift, self.group if k + 1 == len(self.layers) else 0)
        return x


def wide(size: int) -> int:
    """The smallest multiple of 8 that is at least ``size``."""
    return -(-size // 8) * 8


def joined(z: Tensor, action: Tensor) -> Tensor:
    """The input of the dynamics, reward and value networks: the latent state and the padded action."""
    return torch.cat([z, F.pad(action, (0, ACTIONS_WIDE - ACTIONS)).to(z.dtype)], -1)


def symlog(x: Tensor) -> Tensor:
    """The signed logarithm sign(x) ln(1 + |x|)."""
    return x.sign() * x.abs().log1p()


class Agents:
    """World models, value functions and policies of all seeds.

    The first dimension of parameters is the seed; that of the value functions is seeds * num_q.
    """

    def __init__(self, settings: Settings, seeds: list[int], device: torch.device) -> None:
        s = self.settings = settings
        self.seeds, self.device = seeds, device
        seen, latent, bins = s.latent_dim + ACTIONS_WIDE, s.latent_dim, wide(s.num_bins)
        hidden = [s.mlp_dim, s.mlp_dim]
        self.nets = {
            "encoder": Net(OBSERVATIONS, s.enc_dim, latent, group=s.simnorm_dim),
            "dynamics": Net(seen, *hidden, latent, group=s.simnorm_dim),
            "reward": Net(seen, *hidden, bins, zero=True, bins=s.num_bins),
            "termination": Net(latent, *hidden, 8),
            "value": Net(seen, *hidden, bins, zero=True, bins=s.num_bins),
            "policy": Net(latent, *hidden, 8),
        }
        first = [torch.Generator().manual_seed(seed) for seed in seeds]
        self.flat = {
            name: torch.stack([net.begun(g) for g in first for _ in range(s.num_q if name == "value" else 1)]).to(device)
            for name, net in self.nets.items()
        }
        self.bins = F.pad(torch.linspace(s.vmin, s.vmax, s.num_bins), (0, bins - s.num_bins)).to(device)
        self.of_seed = torch.arange(len(seeds), device=device)[:, None]
        self.rho = s.rho ** torch.arange(s.horizon + 1, device=device)

    def pick(self, flat: Tensor) -> Tensor:
        """The parameters of two value functions of each seed, which are drawn at random in each call."""
        all_of = flat.view(len(self.seeds), self.settings.num_q, -1)
        drawn = torch.rand(all_of.shape[:2], device=self.device).topk(2).indices
        return all_of[self.of_seed, drawn].flatten(0, 1)

    def logits(self, flat: Tensor, x: Tensor, dropout: float = 0.0) -> Tensor:
        """The logits (seeds, functions, rows, bins) of the value functions with the parameters ``flat`` at the inputs x."""
        functions = flat.shape[0] // len(self.seeds)
        several = x.unsqueeze(1).expand(-1, functions, -1, -1).flatten(0, 1)
        return self.nets["value"](flat, several, dropout).unflatten(0, (-1, functions))

    def scalar(self, logits: Tensor) -> Tensor:
        """The values that distributions over the bins (as logits) encode: the inverse of :func:`symlog` at their means."""
        x = (logits.softmax(-1) * self.bins).sum(-1)  # a matrix product would round the bins
        return x.sign() * x.abs().expm1()

    def two_hot(self, x: Tensor) -> Tensor:
        """The two-hot encoding of x: a distribution over two adjacent bins with the mean symlog(x)."""
        s = self.settings
        place = (symlog(x).clamp(s.vmin, s.vmax) - s.vmin) * ((s.num_bins - 1) / (s.vmax - s.vmin))
        low = place.floor().clamp(max=s.num_bins - 2)
        part = (place - low).unsqueeze(-1)
        at = low.long().unsqueeze(-1)
        hot = torch.zeros(*x.shape, len(self.bins), device=x.device)
        return hot.scatter(-1, at, 1 - part).scatter(-1, at + 1, part)

    def policy(self, flat: Tensor, z: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The mean action, a random action, and its entropy estimate times the number of actions, as in the public code."""
        s = self.settings
        out = self.nets["policy"](flat, z)
        mean, log_std = out[..., :ACTIONS], out[..., ACTIONS : 2 * ACTIONS]
        log_std = s.log_std_min + 0.5 * (s.log_std_max - s.log_std_min) * (log_std.tanh() + 1)
        noise = torch.randn_like(mean)
        density = (-0.5 * noise.square() - log_std - 0.9189385).sum(-1)
        return mean.tanh(), (mean + noise * log_std.exp()).tanh(), -ACTIONS * density


class Captured:
    """A function on tensors at fixed addresses, captured as a CUDA graph. Without ``graphs`` it is called directly."""

    def __init__(self, work: Callable[[], None], graphs: bool, rounds: int = 3) -> None:
        self.work, self.graph = work, None
        if not graphs:
            return
        # warm-up: the libraries choose their kernels before the capture
        aside = torch.cuda.Stream()
        aside.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(aside):
            for _ in range(rounds):
                work()
        torch.cuda.current_stream().wait_stream(aside)
        torch.cuda.synchronize()
        self.graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self.graph):
            work()

    def __call__(self) -> None:
        if self.graph is None:
            self.work()
        else:
            self.graph.replay()


class Planner:
    """Plans actions by MPPI in the latent space, for ``lanes`` aircraft of each seed at once."""

    def __init__(self, agents: Agents, lanes: int, explore: bool, graphs: bool, dtype: torch.dtype) -> None:
        self.agents, self.lanes, self.explore, self.dtype = agents, lanes, explore, dtype
        s, device, shape = agents.settings, agents.device, (len(agents.seeds), lanes)
        self.seen = torch.zeros(*shape, OBSERVATIONS, device=device)
        self.goes_on = torch.zeros(*shape, 1, 1, device=device)
        self.mean = torch.zeros(*shape, s.horizon, ACTIONS, device=device)
        self.action = torch.zeros(*shape, ACTIONS, device=device)
        self.captured = Captured(self._plan, graphs)
        self.mean.zero_()

    def __call__(self, seen: np.ndarray, begun: np.ndarray) -> np.ndarray:
        """The actions (seeds, lanes, 3) for the observations ``seen``. Where an episode has just begun, the old plan is discarded."""
        self.seen.copy_(torch.from_numpy(seen))
        self.goes_on.copy_(torch.from_numpy(1 - begun.astype(np.float32))[..., None, None])
        self.captured()
        return self.action.cpu().numpy()

    @torch.no_grad()
    def _plan(self) -> None:
        agents, s, lanes = self.agents, self.agents.settings, self.lanes
        flat = {name: x.to(self.dtype) for name, x in agents.flat.items()}
        z = agents.nets["encoder"](flat["encoder"], self.seen.to(self.dtype))
        prior, now = [], z.repeat_interleave(s.num_pi_trajs, 1)
        for t in range(s.horizon):
            prior.append(agents.policy(flat["policy"], now)[1])
            if t + 1 < s.horizon:
                now = agents.nets["dynamics"](flat["dynamics"], joined(now, prior[-1]))
        prior = torch.stack(prior, 2).unflatten(1, (lanes, -1))
        mean = F.pad(self.mean[:, :, 1:] * self.goes_on, (0, 0, 0, 1))
        std = torch.full_like(mean, s.max_std)
        z = z.repeat_interleave(s.num_samples, 1)
        drawn = s.num_samples - s.num_pi_trajs
        for _ in range(s.iterations):
            noise = torch.randn(*mean.shape[:2], drawn, *mean.shape[2:], device=mean.device)
            sample = (mean.unsqueeze(2) + std.unsqueeze(2) * noise).clamp(-1, 1)
            actions = torch.cat([prior, sample], 2)
            best = self._value(flat, z, actions).topk(s.num_elites)
            elite = actions.gather(2, best.indices[..., None, None].expand(-1, -1, -1, s.horizon, ACTIONS))
            weight = (s.temperature * best.values).softmax(-1)
            score = weight[..., None, None]
            mean = (score * elite).sum(2)
            std = (score * (elite - mean.unsqueeze(2)).square()).sum(2).sqrt().clamp(s.min_std, s.max_std)
        # draws an elite with a probability proportional to its weight: the argmax of weight / exponential noise has this
        # distribution
        chosen = (weight / torch.empty_like(weight).exponential_()).argmax(-1)
        action = elite[:, :, :, 0].gather(2, chosen[..., None, None].expand(-1, -1, 1, ACTIONS)).squeeze(2)
        if self.explore:
            action = action + std[:, :, 0] * torch.randn_like(action)
        self.action.copy_(action.clamp(-1, 1))
        self.mean.copy_(mean)

    def _value(self, flat: dict[str, Tensor], z: Tensor, actions: Tensor) -> Tensor:
        """The estimated return (seeds, lanes, samples) of each action sequence (seeds, lanes, samples, horizon, 3)."""
        agents, s = self.agents, self.agents.settings
        total, factor, alive = 0.0, 1.0, 1.0
        for t in range(s.horizon):
            x = joined(z, actions[:, :, :, t].flatten(1, 2))
            total = total + factor * alive * agents.scalar(agents.nets["reward"](flat["reward"], x))
            z = agents.nets["dynamics"](flat["dynamics"], x)
            alive = alive * (agents.nets["termination"](flat["termination"], z)[..., 0] <= 0)
            factor *= s.discount
        last = agents.policy(flat["policy"], z)[1]
        worth = agents.scalar(agents.logits(agents.pick(flat["value"]), joined(z, last))).mean(1)
        return (total + factor * alive * worth).nan_to_num(0).unflatten(1, actions.shape[1:3])


class Memory:
    """Replay buffer: all transitions of a training, and the steps at which a sequence within one episode can start."""

    def __init__(self, agents: Agents, lanes: int, length: int) -> None:
        self.agents, self.lanes, self.length, self.at = agents, lanes, length, 0
        seeds, device = len(agents.seeds), agents.device
        # columns: observation, next observation, action, reward, and 1 if the aircraft was lost
        self.rows = torch.zeros(seeds, lanes, length, 2 * OBSERVATIONS + ACTIONS + 2, device=device)
        self.starts = torch.zeros(seeds, lanes * length, dtype=torch.long, device=device)
        self.count = torch.zeros(seeds, 1, dtype=torch.float64, device=device)
        self.known = np.zeros(seeds, int)
        self.ended: list[np.ndarray] = []

    def add(self, rows: np.ndarray, ended: np.ndarray) -> None:
        """Adds one transition of each lane, (seeds, lanes, columns), and whether its episode ended with it, (seeds, lanes)."""
        self.rows[:, :, self.at] = torch.from_numpy(rows).to(self.rows.device)
        self.ended.append(ended)
        self.at += 1
        horizon = self.agents.settings.horizon
        if self.at < horizon:
            return
        whole = ~np.logical_or.reduce(self.ended[-horizon:-1]) if horizon > 1 else np.ones_like(ended)
        for seed, lanes in enumerate(whole):
            new = np.flatnonzero(lanes) * self.length + self.at - horizon
            self.starts[seed, self.known[seed] : self.known[seed] + len(new)] = torch.from_numpy(new)
            self.known[seed] += len(new)
        self.count.copy_(torch.from_numpy(self.known[:, None].astype(float)))

    def sample(self) -> Tensor:
        """A random batch of sequences, (seeds, horizon, batch, columns). It uses tensors only, for the CUDA graph."""
        s, device = self.agents.settings, self.rows.device
        drawn = torch.rand(len(self.known), s.batch_size, dtype=torch.float64, device=device) * self.count
        start = self.starts.gather(1, drawn.long())
        at = start[:, None] + torch.arange(s.horizon, device=device)[:, None]
        return self.rows.flatten(1, 2)[self.agents.of_seed[..., None], at]


class Learner:
    """Updates the networks of all seeds."""

    def __init__(self, agents: Agents, memory: Memory) -> None:
        self.agents, self.memory, s = agents, memory, agents.settings
        cuda = agents.device.type == "cuda"
        flat = agents.flat
        for x in flat.values():
            x.requires_grad_()
        self.world = [name for name in flat if name != "policy"]
        groups = [{"params": [flat[name]], "lr": s.lr * (s.enc_lr_scale if name == "encoder" else 1)} for name in self.world]
        self.adam = torch.optim.Adam(groups, fused=True, capturable=cuda)
        self.policy_adam = torch.optim.Adam([flat["policy"]], lr=s.lr, eps=1e-5, fused=True, capturable=cuda)
        self.target = flat["value"].detach().clone()
        self.scale = torch.ones(len(agents.seeds), 1, 1, device=agents.device)
        self.told = torch.zeros(6, len(agents.seeds), device=agents.device)

    def update(self) -> None:
        """Makes one update from a random batch. It reads no value on the CPU, so that a CUDA graph can capture it."""
        agents, s, nets, flat = self.agents, self.agents.settings, self.agents.nets, self.agents.flat
        rows = self.memory.sample()
        seen, later, action, reward, lost = rows.split([OBSERVATIONS, OBSERVATIONS, ACTIONS, 1, 1], -1)
        reward, lost = reward[..., 0], lost[..., 0]
        shape = reward.shape[1:]
        with torch.no_grad():
            next_z = nets["encoder"](flat["encoder"], later.flatten(1, 2))
            _, next_action, _ = agents.policy(flat["policy"], next_z)
            worth = agents.scalar(agents.logits(agents.pick(self.target), joined(next_z, next_action))).amin(1)
            aim = agents.two_hot(reward + s.discount * (1 - lost) * worth.unflatten(1, shape))
            next_z = next_z.unflatten(1, shape)
        zs = [nets["encoder"](flat["encoder"], seen[:, 0])]
        for t in range(s.horizon):
            zs.append(nets["dynamics"](flat["dynamics"], joined(zs[-1], action[:, t])))
        zs = torch.stack(zs, 1)
        rho = self.agents.rho[: s.horizon]
        consistency = ((zs[:, 1:] - next_z).square().mean((2, 3)) * rho).mean(1)
        x = joined(zs[:, :-1], action).flatten(1, 2)

        def entropy(logits: Tensor, wanted: Tensor) -> Tensor:
            """The cross entropy over the bins, averaged over the batch: (seeds, …, horizon)."""
            return -(wanted * logits.log_softmax(-1)).sum(-1).mean(-1)

        wanted = agents.two_hot(reward)
        of_reward = (entropy(nets["reward"](flat["reward"], x).unflatten(1, shape), wanted) * rho).mean(1)
        logits = agents.logits(flat["value"], x, s.dropout).unflatten(2, shape)
        of_value = (entropy(logits, aim.unsqueeze(1)).mean(1) * rho).mean(1)
        ends = nets["termination"](flat["termination"], zs[:, 1:].flatten(1, 2))[..., 0].unflatten(1, shape)
        of_end = F.binary_cross_entropy_with_logits(ends, lost, reduction="none").mean((1, 2))
        loss = (
            s.consistency_coef * consistency + s.reward_coef * of_reward
            + s.value_coef * of_value + s.termination_coef * of_end
        )  # fmt: skip
        self._step(self.adam, [flat[name] for name in self.world], loss)
        self._improve(zs.detach())
        with torch.no_grad():
            self.target.lerp_(flat["value"], s.tau)
            self.told[:5].copy_(torch.stack([loss, consistency, of_reward, of_value, of_end]))

    def _improve(self, zs: Tensor) -> None:
        """Updates the policy with the present value functions, at the latent states ``zs``."""
        agents, s, flat = self.agents, self.agents.settings, self.agents.flat
        z = zs.flatten(1, 2)
        _, action, entropy = agents.policy(flat["policy"], z)
        two = agents.pick(flat["value"].detach())
        worth = agents.scalar(agents.logits(two, joined(z, action), s.dropout)).mean(1).unflatten(1, zs.shape[1:3])
        with torch.no_grad():
            ranked = worth[:, 0].sort(1).values
            low, high = (self._quantile(ranked, share) for share in (0.05, 0.95))
            self.scale.lerp_((high - low).clamp(min=1.0)[:, None, None], s.tau)
        gain = s.entropy_coef * entropy.unflatten(1, zs.shape[1:3]) + worth / self.scale
        loss = -(gain.mean(2) * agents.rho).mean(1)
        self._step(self.policy_adam, [flat["policy"]], loss)
        self.told[5].copy_(loss.detach())

    @staticmethod
    def _quantile(ranked: Tensor, share: float) -> Tensor:
        place = share * (ranked.shape[1] - 1)
        low = int(place)
        return torch.lerp(ranked[:, low], ranked[:, min(low + 1, ranked.shape[1] - 1)], place - low)

    def _step(self, adam: torch.optim.Adam, leaves: list[Tensor], loss: Tensor) -> None:
        """Makes one step of the optimiser for the losses (seeds). The gradient of each seed is clipped by its own norm."""
        seeds = len(loss)
        slopes = torch.autograd.grad(loss.sum(), leaves)
        norm = torch.stack([slope.reshape(seeds, -1).norm(dim=1) for slope in slopes]).norm(dim=0)
        factor = (self.agents.settings.grad_clip_norm / (norm + 1e-6)).clamp(max=1.0)
        for leaf, slope in zip(leaves, slopes, strict=True):
            leaf.grad = (slope.reshape(seeds, -1) * factor[:, None]).view_as(leaf)
        adam.step()


def train(asked: argparse.Namespace, settings: Settings, device: torch.device) -> None:
    """Trains all seeds at the same time until ``--steps`` or ``--seconds``, and saves their weights every ``--round`` steps."""
    begun_at, seeds, lanes = time.monotonic(), list(range(1, asked.seeds + 1)), asked.lanes
    torch.manual_seed(asked.seeds)
    agents = Agents(settings, seeds, device)
    graphs = device.type == "cuda" and not asked.eager
    envs = [greylag.ImaginedVectorEnv(lanes) for _ in seeds]
    chance = [np.random.default_rng(seed) for seed in seeds]
    seen = np.stack([env.reset(seed=seed)[0] for env, seed in zip(envs, seeds, strict=True)])
    begun = np.ones((len(seeds), lanes), bool)
    memory = Memory(agents, lanes, -(-asked.steps // lanes))
    learner = Learner(agents, memory)
    planner, update = None, None
    owed, updates, steps, earned, lost, mark = 0.0, 0, 0, [], 0, 0
    log = asked.out / "training.jsonl"
    log.unlink(missing_ok=True)

    def keep(complete: bool) -> None:
        about = {
            "steps": steps, "updates": updates, "complete": complete, "lanes": lanes, "seeds_at_once": len(seeds),
            "wall_s": time.monotonic() - begun_at, "cpu_s": time.process_time() / len(seeds), "versions": VERSIONS,
            "device": torch.cuda.get_device_name() if device.type == "cuda" else "cpu", "cuda_graphs": graphs,
            "updates_per_step": asked.updates_per_step, "settings": dataclasses.asdict(settings),
        }  # fmt: skip
        for k, seed in enumerate(seeds):
            flat = {name: x.detach().unflatten(0, (len(seeds), -1))[k].half().cpu() for name, x in agents.flat.items()}
            part = weights(asked, seed).with_suffix(".part")
            torch.save({"about": {"agent": AGENT, "seed": seed, **about}, "flat": flat}, part)
            part.replace(weights(asked, seed))

    while steps < asked.steps and time.monotonic() - begun_at < asked.seconds:
        if steps < settings.seed_steps:
            action = np.stack([c.uniform(-1, 1, (lanes, ACTIONS)) for c in chance]).astype(np.float32)
        else:
            planner = planner or Planner(agents, lanes, True, graphs, plan_dtype(device))
            action = planner(seen, begun)
        rows = np.zeros((*begun.shape, memory.rows.shape[-1]), np.float32)
        for k, env in enumerate(envs):
            rows[k, :, :OBSERVATIONS] = seen[k]
            seen[k], reward, terminated, truncated, info = env.step(action[k])
            begun[k] = terminated | truncated
            rows[k, :, OBSERVATIONS : 2 * OBSERVATIONS] = seen[k]
            for i in np.flatnonzero(begun[k]):
                rows[k, i, OBSERVATIONS : 2 * OBSERVATIONS] = info["final_obs"][i]
            rows[k, :, -2], rows[k, :, -1] = reward, terminated
            lost += int(terminated.sum())
        rows[..., 2 * OBSERVATIONS : -2] = action
        memory.add(rows, begun.copy())
        earned.append(rows[..., -2].mean(1))
        steps += lanes
        if steps < settings.seed_steps:
            continue
        # the first updates are for all transitions so far, the later ones for the new transitions of a step
        owed += asked.updates_per_step * (lanes if update else steps)
        first = update is None
        if first:
            update = Captured(learner.update, graphs)
            done = 3 if graphs else 0
            owed, updates = owed - done, updates + done
        while owed >= 1 and time.monotonic() - begun_at < asked.seconds:
            update()
            owed, updates = owed - 1, updates + 1
            if updates % 64 == 0 and device.type == "cuda":
                torch.cuda.synchronize()  # waits for the GPU, so that the time limit includes its work
        if steps // 2000 != mark or first:
            mark = steps // 2000
            told = dict(zip(("loss", "consistency", "reward", "value", "end", "policy"), learner.told.tolist(), strict=True))
            line = {"steps": steps, "updates": updates, "wall_s": time.monotonic() - begun_at, "lost": lost}
            line |= {"earned": np.mean(earned, 0).tolist(), **told}
            with log.open("a") as file:
                file.write(json.dumps(line) + "\n")
            print(f"{steps} steps, {updates} updates, {line['wall_s']:.0f} s,", "earned a step",
                  np.round(line["earned"], 3), f"lost {lost}, loss {np.mean(told['loss']):.3f}", flush=True)  # fmt: skip
            earned, lost = [], 0
        if steps // asked.round != (steps - lanes) // asked.round:
            keep(False)
    keep(True)


def weights(asked: argparse.Namespace, seed: int) -> Path:
    """The path of the file with the weights of a seed."""
    return asked.out / f"{AGENT}-{seed}.pt"


def plan_dtype(device: torch.device) -> torch.dtype:
    """The data type in which the planner computes."""
    return torch.float16 if device.type == "cuda" else torch.float32


class Flight:
    """Simulates aircraft in JSBSim, one for each target, for one episode."""

    def __init__(self, aircraft: int, threads: int) -> None:
        self.envs = [greylag.X8Env(airspeeds="start") for _ in range(aircraft)]
        self.pool, self.threads = ThreadPoolExecutor(threads), threads

    def fly(self, targets: np.ndarray, act: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> dict[str, list]:
        """Flies one aircraft to each target (roll and pitch in degrees, one row each) with the actions of ``act``.

        Returns for each target the settled error in degrees and the settling time in s, as in src/sim/episode.rs, and whether
        the aircraft left the envelope.
        """
        count = len(targets)
        seen = np.stack([env.reset()[0] for env in self.envs[:count]]).astype(np.float64)
        # in an observation, airspeed is relative to 16.67 m/s; the commanded airspeed is that of the start
        wanted = np.column_stack([np.radians(targets), seen[:, 2] * OBSERVATION_UNITS[2]])
        alive, away, squares = np.ones(count, bool), np.zeros(count, int), np.zeros((count, 2))
        for step in range(STEPS):
            # replaces the control errors for the target of the environment by those for `targets`
            seen[:, 13:] = (wanted - seen[:, :3] * OBSERVATION_UNITS[:3]) / OBSERVATION_UNITS[13:]
            action = act(seen.astype(np.float32), np.full(count, step == 0))

            def advance(first: int) -> None:
                for i in range(first, count, self.threads):
                    if alive[i]:
                        seen[i], _, terminated, _, _ = self.envs[i].step(action[i])
                        alive[i] = not terminated

            list(self.pool.map(advance, range(self.threads)))
            error = (np.degrees(seen[:, :2] * OBSERVATION_UNITS[:2]) - targets + 180) % 360 - 180
            away[~(np.abs(error) <= REACHED_DEG).all(1)] = step + 1
            if step >= STEPS - SETTLED:
                squares += error**2
        settled = np.where(alive, np.sqrt(squares / SETTLED).mean(1), LOST_DEG)
        return {
            "settled_deg": settled.tolist(),
            "settling_s": np.where(alive, away * STEP_S, STEPS * STEP_S).tolist(),
            "left": (~alive).tolist(),
        }


def rows_of(asked: argparse.Namespace) -> list[tuple[str, float, float]]:
    """The group, the roll and the pitch in degrees of each target in the groups ``GROUPS``."""
    rows = [line.split(",") for line in asked.targets.read_text().splitlines()[1:]]
    return [(group, float(roll), float(pitch)) for group, roll, pitch in rows if group in GROUPS]


def scores(groups: list[str], settled: np.ndarray, settling: np.ndarray, left: np.ndarray) -> dict[str, dict[str, float]]:
    """The scores of ``judging.judge``, and the number of aircraft that left the envelope, by group of targets."""
    found = {}
    for name in (*GROUPS, "all"):
        own = np.array([group == name or name == "all" for group in groups])
        errors = settled[own]
        found[name] = {
            "count": int(own.sum()), "mean_deg": float(errors.mean()), "median_deg": float(np.median(errors)),
            "max_deg": float(errors.max()), "divergence_rate": float((errors > DIVERGED_DEG).mean()),
            "settling_s": float(np.median(settling[own])), "left_envelope": int(left[own].sum()),
        }  # fmt: skip
    return found


def fly(asked: argparse.Namespace, device: torch.device) -> list[dict]:
    """Flies the targets that are not in the record, ``--at-once`` targets of each seed at a time.

    Returns one row with the scores of each seed; no rows if targets are still missing.
    """
    begun_at, targets = time.monotonic(), rows_of(asked)
    seeds = list(range(1, asked.seeds + 1))
    kept = {seed: torch.load(weights(asked, seed), map_location="cpu") for seed in seeds}
    settings = Settings(**kept[1]["about"]["settings"])
    agents = Agents(settings, seeds, device)
    for name, x in agents.flat.items():
        x.copy_(torch.cat([kept[seed]["flat"][name] for seed in seeds]))
    record, found = asked.out / "flights.jsonl", {}
    for line in record.read_text().splitlines() if record.exists() else []:
        row = json.loads(line)
        if row["flown_by"] == asked.flown_by and all(row[key] == kept[row["seed"]]["about"][key] for key in ("steps", "updates")):
            for k, i in enumerate(row["targets"]):
                found[row["seed"], i] = (row["settled_deg"][k], row["settling_s"][k], row["left"][k])
    left = [i for i in range(len(targets)) if not all((seed, i) in found for seed in seeds)]
    parts = max(1, -(-len(left) // asked.at_once))
    flight, act = None, None
    for part in range(parts if left else 0):
        # the stride gives each part targets of all groups
        own = left[part::parts]
        at = time.monotonic()
        if part and at + (at - begun_at) / part > begun_at + asked.judge_seconds:
            break
        if act is None:
            flight = Flight(len(seeds) * asked.at_once, asked.threads)
            graphs = device.type == "cuda" and not asked.eager
            act = pilot(agents, asked.at_once, asked.flown_by, graphs)
        one = np.array([targets[i][1:] for i in own])
        flown = flight.fly(np.concatenate([one] * len(seeds)), act)
        with record.open("a") as file:
            for k, seed in enumerate(seeds):
                own_of = {key: values[k * len(own) : (k + 1) * len(own)] for key, values in flown.items()}
                about = {key: kept[seed]["about"][key] for key in ("seed", "steps", "updates")}
                file.write(json.dumps({**about, "flown_by": asked.flown_by, "targets": own, **own_of}) + "\n")
                for i, *outcome in zip(own, *own_of.values(), strict=True):
                    found[seed, i] = tuple(outcome)
        print(f"flown by {asked.flown_by}: {len(own)} targets of each seed, {time.monotonic() - at:.0f} s", flush=True)
    if any((seed, i) not in found for seed in seeds for i in range(len(targets))):
        print(f"not judged yet: {len({i for _, i in found})} of {len(targets)} targets are flown; --judge-only flies the others")
        return []
    rows = []
    for seed in seeds:
        outcomes = [np.array(x) for x in zip(*(found[seed, i] for i in range(len(targets))), strict=True)]
        row = {key: value for key, value in kept[seed]["about"].items() if key != "complete"}
        rows.append({**row, "flown_by": asked.flown_by, "evaluation": scores([t[0] for t in targets], *outcomes)})
    return rows


def pilot(agents: Agents, lanes: int, flown_by: str, graphs: bool) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """A controller for up to ``lanes`` aircraft of each seed: the planner, or the mean of the policy.

    It maps observations, and whether an episode has just begun, to actions.
    """
    seeds = len(agents.seeds)
    planner = Planner(agents, lanes, False, graphs, plan_dtype(agents.device)) if flown_by == "planner" else None

    @torch.no_grad()
    def act(seen: np.ndarray, begun: np.ndarray) -> np.ndarray:
        count = len(seen) // seeds
        seen = np.concatenate([seen.reshape(seeds, count, -1), np.zeros((seeds, lanes - count, OBSERVATIONS), np.float32)], 1)
        if planner is not None:
            action = planner(seen, np.broadcast_to(begun[:1], (seeds, lanes)))
        else:
            z = agents.nets["encoder"](agents.flat["encoder"], torch.from_numpy(seen).to(agents.device))
            action = agents.policy(agents.flat["policy"], z)[0].cpu().numpy()
        return np.ascontiguousarray(action[:, :count]).reshape(-1, ACTIONS)

    return act


def check_judge(asked: argparse.Namespace) -> None:
    """Evaluates one policy with ``greylag evaluate`` and with this script, and prints both scores."""
    targets = rows_of(asked)
    policy = greylag.Policy.load(asked.check_judge)
    flown = Flight(len(targets), asked.threads).fly(np.array([t[1:] for t in targets]), lambda seen, begun: policy.act(seen))
    here = scores([t[0] for t in targets], *(np.array(x) for x in flown.values()))
    with tempfile.TemporaryDirectory() as folder:
        # a copy, because `judge` writes to the policy's folder
        there = judge(Path(shutil.copytree(asked.check_judge, Path(folder) / "policy")), asked)
    for name, score in here.items():
        each = ", ".join(f"{key} {score[key]:.6f} and {there[name][key]:.6f}" for key in there[name] if key != "count")
        print(f"{name}: {each}; left the envelope: {score['left_envelope']}")


def fusing(device: torch.device) -> bool:
    """Tests whether the fused kernel gives the results of PyTorch. Sets ``FUSED`` and returns it."""
    global FUSED
    try:
        x = torch.randn(2, 5, 256, device=device)
        own = torch.randn(3, 2, 1, 256, device=device)
        with torch.no_grad():
            for group in (0, 8):
                FUSED = False
                plain = activated(x, *own, group)
                FUSED = True
                if (activated(x, *own, group) - plain).abs().max() > 1e-4:
                    raise ValueError("it computes something else")
    except Exception as error:  # after any error, PyTorch computes the same more slowly
        print(f"the fused kernel is not used: {type(error).__name__}: {error}", flush=True)
        FUSED = False
    return FUSED


def table(rows: list[dict]) -> None:
    """Prints a row of the table of ``other_agents.py``. The seconds are wall time for all seeds together."""
    easy, corners = (statistics.fmean(row["evaluation"][group]["mean_deg"] for row in rows) for group in GROUPS)
    each = ", ".join(f"{row['evaluation']['all']['mean_deg']:.2f}" for row in rows)
    lost = statistics.fmean(row["evaluation"]["all"]["divergence_rate"] for row in rows)
    name = AGENT if rows[0]["flown_by"] == "planner" else f"{AGENT}, policy without planner"
    seconds = f"{rows[0]['wall_s']:.0f} of {rows[0]['device']} for {rows[0]['seeds_at_once']} seeds"
    print(f"| {name} | {rows[0]['steps']:,} | {seconds} | {easy:.2f} | {corners:.2f} | {each} | {lost:.1%} |")


def options() -> argparse.Namespace:
    """The options of the command line. ``--set`` can reduce the settings of the public code for a test on a small machine."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--targets", type=Path, default=Path("params/targets.csv"))
    parser.add_argument("--steps", type=int, default=100_000, help="of each seed")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="wall time at which the training ends")
    parser.add_argument("--updates-per-step", type=float, default=1.0)
    parser.add_argument("--lanes", type=int, default=16, help="aircraft of each seed that fly at once")
    parser.add_argument("--round", type=int, default=10_000, help="steps between two times that weights are kept")
    parser.add_argument("--judge-seconds", type=float, default=float("inf"), help="no further targets are flown after these")
    parser.add_argument("--at-once", type=int, default=80, help="targets that are flown together")
    parser.add_argument("--threads", type=int, default=min(4, os.cpu_count() or 1), help="that step JSBSim")
    parser.add_argument("--flown-by", choices=["planner", "prior"], default="planner")
    parser.add_argument("--train-only", action="store_true")
    parser.add_argument("--judge-only", action="store_true")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--eager", action="store_true", help="no CUDA graphs")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="other settings than the public code's")
    parser.add_argument("--check-judge", type=Path, metavar="POLICY", help="fly this policy by both judges, and nothing else")
    parser.add_argument("--greylag", type=Path, help="the program, for --check-judge")
    asked = parser.parse_args()
    if asked.out is None and asked.check_judge is None:
        parser.error("--out is missing")
    return asked


def main() -> None:
    """Trains the agents, evaluates them in JSBSim and prints the row of the table."""
    asked = options()
    if asked.check_judge is not None:
        check_judge(asked)
        return
    asked.out.mkdir(parents=True, exist_ok=True)
    device = torch.device(asked.device)
    torch.set_float32_matmul_precision("high")
    if device.type == "cuda":
        torch.backends.cuda.matmul.allow_fp16_reduced_precision_reduction = False
        fusing(device)
    changed: dict[str, Any] = {name: json.loads(value) for name, value in (one.split("=") for one in asked.set)}
    settings = dataclasses.replace(Settings(), **changed)
    record = asked.out / "agents.jsonl"
    done = [json.loads(line) for line in record.read_text().splitlines()] if record.exists() else []
    rows = [row for row in done if row["agent"] == AGENT and row["flown_by"] == asked.flown_by and row["seed"] <= asked.seeds]
    if len(rows) < asked.seeds:
        there = [weights(asked, seed) for seed in range(1, asked.seeds + 1)]
        trained = all(path.exists() and torch.load(path)["about"]["complete"] for path in there)
        try:
            if not (trained or asked.judge_only):
                train(asked, settings, device)
            if asked.train_only:
                return
            rows = fly(asked, device)
        except RuntimeError as error:
            if device.type != "cuda" or asked.eager:
                raise
            # after a failed capture CUDA is unusable in this process, so the script restarts without graphs
            print(f"CUDA graphs fail, again without: {error}", flush=True)
            os.execv(sys.executable, [sys.executable, *sys.argv, "--eager"])
        with record.open("a") as file:
            for row in rows:
                file.write(json.dumps(row) + "\n")
    if rows:
        table(rows)


if __name__ == "__main__":
    main()
