"""What memory and scales are worth: the policy of train.py trained with one of them left out, several seeds at once.

    python params/any/ablations.py --variant gru --seeds 3 --updates 400

Variants: `gru` (as shipped), `no-memory` (the same weights, the state of the GRU at zero at every step), `mlp` (two hidden
layers with as many weights), `no-scales` (airspeed and time counted in 20 m/s, the same for all aircraft, in place of each one's
cruise airspeed). All seeds fly the same drawn aircraft and are judged on others. Needs jax and numpy alone.
"""

import argparse
import math
import time

import jax
import jax.numpy as jnp
import numpy as np

import train

WIDTH = 61  # of both hidden layers of the MLP: as many weights as the GRU of 32 has, within 1 %


def without_memory(policy):
    return lambda W, h, x: (h, policy(W, jnp.zeros_like(h), x)[1])


def mlp(W, h, x):
    a = jnp.tanh(W["w1"] @ x + W["b1"][:, None])
    a = jnp.tanh(W["w2"] @ a + W["b2"][:, None])
    o = jnp.tanh(W["out"] @ a + W["skip"] @ x + W["ob"][:, None])
    return h, jnp.stack([o[0], o[1], 0.5 + 0.5 * o[2], o[3] * x[22]])


def mlp_init(init):
    def made(key):
        W, k = init(key), jax.random.split(key, 3)
        scale = lambda k, shape: jax.random.normal(k, shape) / math.sqrt(shape[1])
        return dict(w1=scale(k[0], (WIDTH, train.INPUTS)), b1=jnp.zeros(WIDTH), w2=scale(k[1], (WIDTH, WIDTH)), b2=jnp.zeros(WIDTH),
                    out=0.1 * scale(k[2], (4, WIDTH)), skip=W["skip"], ob=W["ob"])
    return made


def without_scales(see):
    return lambda mem, s, target, P: see(mem, s, target, dict(P, V=jnp.full_like(P["V"], 20.0)))


def main():
    a = argparse.ArgumentParser()
    a.add_argument("--variant", choices=["gru", "no-memory", "mlp", "no-scales"], required=True)
    a.add_argument("--aircraft", default="params/any/aircraft.toml")
    a.add_argument("--seeds", type=int, default=3)
    a.add_argument("--updates", type=int, default=400)
    a.add_argument("--count", type=int, default=4096)
    a.add_argument("--window", type=int, default=150)
    a.add_argument("--rate", type=float, default=2e-3)
    a = a.parse_args()
    if a.variant == "no-memory":
        train.policy = without_memory(train.policy)
    if a.variant == "mlp":
        train.policy, train.init = mlp, mlp_init(train.init)
    if a.variant == "no-scales":
        train.see = without_scales(train.see)
    P = {k: jnp.array(v) for k, v in train.draw(a.count, 1, a.aircraft).items()}
    unseen = {k: jnp.array(v) for k, v in train.draw(min(a.count, 2048), 1001, a.aircraft).items()}
    keys = jax.random.split(jax.random.key(100), a.seeds)
    W = jax.vmap(train.init)(keys)
    zeros = jax.tree.map(jnp.zeros_like, W)
    opt, c = (zeros, zeros, jnp.zeros(a.seeds)), jax.vmap(lambda k: train.start(P, k))(keys)
    step = jax.jit(jax.vmap(lambda W, opt, c, key, lr: train.update(W, opt, P, c, key, lr, 0.01, a.window), in_axes=(0, 0, 0, 0, None)))
    judge = jax.jit(jax.vmap(lambda W: train.minute(W, unseen, jax.random.key(7))))
    weights = sum(x.size for x in jax.tree.leaves(W)) // a.seeds
    print(f"{a.variant}: {weights} weights, {P['m'].shape[0]} aircraft, judged on {unseen['m'].shape[0]}, on {jax.devices()[0]}", flush=True)
    begin = time.time()
    for k in range(1, a.updates + 1):
        keys = jax.vmap(lambda k: jax.random.split(k)[0])(keys)
        lr = a.rate * min(1, k / 100) * 0.5 * (1 + math.cos(math.pi * k / a.updates))
        W, opt, c, *_ = step(W, opt, c, jax.vmap(lambda k: jax.random.fold_in(k, 1))(keys), lr)
        if k % 100 == 0 or k == a.updates:
            lost, settled, integral = (np.array(x) for x in judge(W))
            for seed in range(a.seeds):
                ok = lost[seed] == 0
                print(f"{a.variant} seed {seed} updates {k} {time.time() - begin:.0f} s lost {100 * (1 - ok.mean()):.2f} % "
                      f"settled {np.median(settled[seed][ok]):.2f} deg integral {np.median(integral[seed][ok]):.0f}", flush=True)


if __name__ == "__main__":
    main()
