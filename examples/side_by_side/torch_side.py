"""PyTorch's part of the example side_by_side: the same sums on one thread, timed when asked.

Reads a problem (JSON, a file named on the command line), then one request a line on standard input, a
task and a number of calls, and answers each with a line of JSON: seconds of each call and a value that
says that the same was computed. Seconds are the processor's, as on the other side.
"""

import json
import math
import sys
import time

import torch
from torch import nn

torch.set_num_threads(1)
torch.manual_seed(0)
STEP = 0.01


def columns(rows):
    return rows.unbind(1)


class Model:
    """The prior's linear effects on a rigid body, with a residual beside them."""

    def __init__(self, p, learned):
        tensor = lambda x: torch.tensor(x, dtype=torch.float32)
        self.p = p
        self.coefficients = tensor(p["coefficients"]).requires_grad_(learned)
        self.thrust = tensor(p["thrust"]).requires_grad_(learned)
        self.jxz = tensor(p["jxz"]).requires_grad_(learned)
        self.layers = [
            (tensor(w).requires_grad_(learned), tensor(b).requires_grad_(learned))
            for w, b in p["residual"]
        ]
        self.offset, self.factor, self.output = map(tensor, p["scales"])
        self.levers = tensor(p["levers"])

    def parameters(self):
        return [self.coefficients, self.thrust, self.jxz] + [x for l in self.layers for x in l]

    def learned(self, s, controls):
        x = (torch.cat([s[:, 2:], controls], 1) - self.offset) * self.factor
        for k, (w, b) in enumerate(self.layers):
            x = torch.addmm(b, x, w)
            if k + 1 < len(self.layers):
                x = torch.relu(x)
        return x * self.output

    def ask(self, s, controls, density):
        """Acceleration and spin in body axes, and the state's rate."""
        p_ = self.p
        roll, pitch, v, p, q, r, alpha, beta = columns(s)
        aileron, elevator, throttle = columns(controls)
        sa, ca, sb, cb = alpha.sin(), alpha.cos(), beta.sin(), beta.cos()
        sr, cr, sp, cp = roll.sin(), roll.cos(), pitch.sin(), pitch.cos()
        per_2v = 0.5 / v
        per_span, per_chord = per_2v * p_["span"], per_2v * p_["chord"]
        features = torch.stack(
            [torch.ones_like(v), alpha, beta, p * per_span, q * per_chord, r * per_span, aileron, elevator], 1
        )
        wrench = (features @ self.coefficients) * self.levers * (density * v * v).unsqueeze(1)
        drag, side, lift, l, m, n = columns(wrench)
        g, mass = p_["gravity"], p_["mass"]
        x = (lift * sa - drag * ca + throttle * self.thrust) / mass - g * sp
        y = side / mass + g * sr * cp
        z = -(drag * sa + lift * ca) / mass + g * cr * cp
        jx, jy, jz, jxz = p_["jx"], p_["jy"], p_["jz"], self.jxz
        gamma = jx * jz - jxz * jxz
        roll_ = l + jxz * p * q - (jz - jy) * q * r
        pitch_ = m + (jz - jx) * p * r - jxz * (p * p - r * r)
        yaw_ = n - jxz * q * r + (jx - jy) * p * q
        spin = ((jz * roll_ + jxz * yaw_) / gamma, pitch_ / jy, (jxz * roll_ + jx * yaw_) / gamma)
        turn = (sr * q + cr * r) / cp
        forward, downward = x * ca + z * sa, z * ca - x * sa
        rate = torch.stack(
            [
                p + sp * turn,
                cr * q - sr * r,
                forward * cb + y * sb,
                *spin,
                q + (downward - sb * v * (p * ca + r * sa)) / (v * cb),
                p * sa - r * ca + (y * cb - sb * forward) / v,
            ],
            1,
        )
        return (x, y, z), spin, rate

    def step_rk4(self, s, controls, density):
        at, after, first = s, s, None
        for ahead, weight in ((0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)):
            prior, learned = self.ask(at, controls, density)[2], self.learned(at, controls)
            rate = prior + learned
            first = first or (prior, learned)
            at, after = s + ahead * STEP * rate, after + weight * STEP / 6.0 * rate
        return after, *first


    def step_jsbsim(self, s, controls, density, last):
        push, spin, prior = self.ask(s, controls, density)
        learned = self.learned(s, controls) * torch.tensor([0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
        roll, pitch, v, p, q, r, alpha, beta = columns(s)
        sa, ca, sb, cb = alpha.sin(), alpha.cos(), beta.sin(), beta.cos()
        sr, cr, sp, cp = roll.sin(), roll.cos(), pitch.sin(), pitch.cos()
        across = v * learned[:, 7]
        forward, downward = learned[:, 2] * cb - across * sb, v * cb * learned[:, 6]
        ax = push[0] + forward * ca - downward * sa
        ay = push[1] + learned[:, 2] * sb + across * cb
        az = push[2] + forward * sa + downward * ca

        def horizon(x, y, z):
            t = y * sr + z * cr
            return torch.stack([x * cp + t * sp, y * cr - z * sr, t * cp - x * sp], 1)

        a = horizon(ax, ay, az)
        last = a if last is None else last
        velocity = horizon(v * cb * ca, v * sb, v * cb * sa) + 1.5 * STEP * a - 0.5 * STEP * last
        hr, hp = 0.5 * roll, 0.5 * pitch
        w, x = hr.cos() * hp.cos(), hr.sin() * hp.cos()
        y, z = hr.cos() * hp.sin(), -hr.sin() * hp.sin()
        dp, dq, dr = 0.5 * STEP * p, 0.5 * STEP * q, 0.5 * STEP * r
        e0, e1 = w - x * dp - y * dq - z * dr, x + w * dp + y * dr - z * dq
        e2, e3 = y + w * dq + z * dp - x * dr, z + w * dr + x * dq - y * dp
        norm = e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3
        roll = torch.atan2(2 * (e0 * e1 + e2 * e3), e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3)
        pitch = torch.asin(2 * (e0 * e2 - e1 * e3) / norm)
        turn = torch.atan2(2 * (e0 * e3 + e1 * e2), e0 * e0 + e1 * e1 - e2 * e2 - e3 * e3)
        st, ct = turn.sin(), turn.cos()

        def heading(n, e, d):
            return n * ct + e * st, e * ct - n * st, d

        n, e, d = heading(*columns(velocity))
        sr, cr, sp, cp = roll.sin(), roll.cos(), pitch.sin(), pitch.cos()
        t = n * sp + d * cp
        u, v, w = n * cp - d * sp, e * cr + t * sr, t * cr - e * sr
        airspeed = (u * u + v * v + w * w).sqrt()
        after = torch.stack(
            [
                roll,
                pitch,
                airspeed,
                p + STEP * (spin[0] + learned[:, 3]),
                q + STEP * (spin[1] + learned[:, 4]),
                r + STEP * (spin[2] + learned[:, 5]),
                torch.atan2(w, u),
                torch.asin(v / airspeed),
            ],
            1,
        )
        return after, prior, learned, torch.stack(heading(*columns(a)), 1)


class Rollouts:
    """The rollout loss with its gradient, eqs. (20) to (24)."""

    def __init__(self, p, scheme, compiled):
        tensor = lambda x: torch.tensor(x, dtype=torch.float32)
        self.scheme = scheme
        self.model = Model(p["model"], True)
        self.states, self.controls = tensor(p["states"]), tensor(p["controls"])
        self.density, self.scale = tensor(p["density"]), tensor(p["scale"])
        self.unit, self.weight = p["unit"], p["lambda"]
        of = {"rk4": self.model.step_rk4, "jsbsim": self.model.step_jsbsim}
        self.step = torch.compile(of[scheme]) if compiled else of[scheme]

    def call(self):
        error = prior = learned = 0.0
        count = len(self.controls) - 1
        last, s = None, self.states[1]
        if self.scheme == "jsbsim":
            *_, last = self.step(self.states[0], self.controls[0], self.density[0], None)
        for k in range(1, count + 1):
            inputs = (s, self.controls[k], self.density[k])
            if self.scheme == "jsbsim":
                s, f_p, f_a, last = self.step(*inputs, last)
            else:
                s, f_p, f_a = self.step(*inputs)
            off = s - self.states[k + 1]
            # roll errors are wrapped to half a turn
            turns = torch.zeros_like(off)
            turns[:, 0] = torch.round(off[:, 0].detach() / math.tau) * math.tau
            error = error + (((off - turns) / self.scale) ** 2).sum()
            prior = prior + ((f_p / self.scale) ** 2).sum()
            learned = learned + ((f_a / self.scale) ** 2).sum()
        points = count * s.shape[0]
        ratio = (learned / points).sqrt() / (prior / points).sqrt()
        loss = error / points / self.unit + ratio / self.weight
        for x in self.model.parameters():
            x.grad = None
        loss.backward()
        return loss.item()


def network(layers):
    modules = []
    for k, (w, b) in enumerate(layers):
        linear = nn.Linear(len(w), len(b))
        with torch.no_grad():
            linear.weight.copy_(torch.tensor(w).T)
            linear.bias.copy_(torch.tensor(b))
        modules += [linear] + ([nn.ReLU()] if k + 1 < len(layers) else [])
    return nn.Sequential(*modules)


class Scoring:
    """The worth of 1024 plans of five steps: rewards, then what the critics say of the end."""

    def __init__(self, p, compiled):
        tensor = lambda x: torch.tensor(x, dtype=torch.float32)
        self.p, self.model = p, Model(p["model"], False)
        self.actions = tensor(p["actions"])
        self.start = tensor(p["state"]).expand(self.actions.shape[1], 8).contiguous()
        self.density = torch.full((self.actions.shape[1],), p["density"])
        self.unit = tensor(p["unit"])
        self.actor, self.one, self.two = (network(p[k]) for k in ("actor", "critic1", "critic2"))
        wrap = torch.compile if compiled else lambda f: f
        self.advance, self.end = wrap(self.advance_), wrap(self.end_)

    def advance_(self, s, z, action):
        """z: two inputs, two outputs and two clipped outputs of each surface, input and throttle."""
        p, limit = self.p, self.p["limit"]
        controls = torch.stack([z[:, 4], z[:, 10], z[:, 13]], 1)
        s, *_ = self.model.step_rk4(s, controls, self.density)
        b, a1, a2 = p["surface"]
        parts = []
        for k, i in ((0, 0), (1, 6)):
            new = action[:, k] * limit
            y = b * (new + 2 * z[:, i] + z[:, i + 1]) - a1 * z[:, i + 2] - a2 * z[:, i + 3]
            parts += [new, z[:, i], y, z[:, i + 2], y.clamp(-limit, limit), z[:, i + 4]]
        b, a = p["throttle"]
        throttle = 0.5 * (action[:, 2] + 1.0)
        parts += [throttle, b * (throttle + z[:, 12]) + a * z[:, 13]]
        reward = 0.0
        for x, wanted, (scale, cap) in zip(columns(s), p["target"], p["reward"]):
            reward = reward - ((x - wanted).abs() / scale).clamp(max=cap)
        return s, torch.stack(parts, 1), reward

    def end_(self, s, z):
        p = self.p
        roll, pitch = s[:, 0], s[:, 1]
        seen = [
            roll, pitch, s[:, 2] - p["airspeed"], *columns(s[:, 3:]),
            z[:, 4], (z[:, 4] - z[:, 5]) / STEP, z[:, 10], (z[:, 10] - z[:, 11]) / STEP, z[:, 13] - 0.5,
            p["target"][0] - roll, p["target"][1] - pitch, p["target"][2] - s[:, 2],
        ]
        seen = torch.stack(seen, 1) / self.unit
        there = torch.cat([seen, self.actor(seen).tanh()], 1)
        return torch.minimum(self.one(there), self.two(there)).squeeze(1)

    @torch.no_grad()
    def call(self):
        s, z = self.start, torch.zeros(len(self.start), 14)
        total, weight = 0.0, 1.0
        for action in self.actions:
            s, z, reward = self.advance(s, z, action)
            total, weight = total + weight * reward, weight * self.p["discount"]
        total = total + weight * self.end(s, z)
        return total.mean().item()


class Td3:
    """An update of Table VII, Adam fused."""

    def __init__(self, p):
        fresh = lambda sizes: nn.Sequential(
            *[
                m
                for k, (i, o) in enumerate(zip(sizes, sizes[1:]))
                for m in ([nn.Linear(i, o)] + ([nn.ReLU()] if k + 2 < len(sizes) else []))
            ]
        )
        nets = [(fresh(p[k]), fresh(p[k])) for k in ("actor", "critic", "critic")]
        for net, target in nets:
            target.load_state_dict(net.state_dict())
        (self.actor, self.target), *self.critics = nets
        self.nets = nets
        own = [x for critic, _ in self.critics for x in critic.parameters()]
        self.actor_adam = torch.optim.Adam(self.actor.parameters(), 3e-4, fused=True)
        self.critic_adam = torch.optim.Adam(own, 3e-4, fused=True)
        size, (o, a) = p["batch"], (p["actor"][0], p["actor"][-1])
        self.observed, self.next = torch.randn(size, o), torch.randn(size, o)
        self.action, self.reward = 2 * torch.rand(size, a) - 1, torch.randn(size, 1)
        self.count = 0

    def call(self):
        with torch.no_grad():
            noise = (0.2 * torch.randn_like(self.action)).clamp(-0.5, 0.5)
            action = (self.target(self.next).tanh() + noise).clamp(-1, 1)
            there = torch.cat([self.next, action], 1)
            values = [target(there) for _, target in self.critics]
            wanted = self.reward + 0.99 * torch.minimum(*values)
        here = torch.cat([self.observed, self.action], 1)
        loss = sum((critic(here) - wanted).square().mean() for critic, _ in self.critics)
        self.critic_adam.zero_grad()
        loss.backward()
        self.critic_adam.step()
        self.count += 1
        if self.count % 2 == 0:
            self.improve()
        return loss.item()

    def improve(self):
        critic = self.critics[0][0]
        critic.requires_grad_(False)
        here = torch.cat([self.observed, self.actor(self.observed).tanh()], 1)
        loss = -critic(here).mean()
        self.actor_adam.zero_grad()
        loss.backward()
        self.actor_adam.step()
        critic.requires_grad_(True)
        with torch.no_grad():
            for net, target in self.nets:
                torch._foreach_lerp_(list(target.parameters()), list(net.parameters()), 0.05)


def main():
    with open(sys.argv[1]) as file:
        problem = json.load(file)
    make = {"td3": lambda: Td3(problem["td3"])}
    for compiled, how in ((False, "eager"), (True, "compiled")):
        for scheme in ("rk4", "jsbsim"):
            make[f"rollouts-{scheme}-{how}"] = lambda s=scheme, c=compiled: Rollouts(problem["rollouts"], s, c)
        for name in problem["scoring"]:
            make[f"scoring-{name}-{how}"] = lambda n=name, c=compiled: Scoring(problem["scoring"][n], c)
    tasks = {}
    for line in sys.stdin:
        name, count = line.split()
        if name not in tasks:
            tasks[name] = make[name]()
            tasks[name].call()
            tasks[name].call()
        times = []
        for _ in range(int(count)):
            start = time.process_time()
            value = tasks[name].call()
            times.append(time.process_time() - start)
        print(json.dumps({"seconds": times, "value": value}), flush=True)


if __name__ == "__main__":
    main()
