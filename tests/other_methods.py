"""PySINDy's STLSQ and classical stepwise regression on the regressions of the benchmark.

    python3 -m venv target/sindy-venv && target/sindy-venv/bin/pip install -q pysindy numpy
    cargo run --release ... --example hide_and_find -- --part effects --export target/regressions --export-only
    target/sindy-venv/bin/python tests/other_methods.py target/regressions

Prints how often each ranks the hidden effect first, and among the first three, over the files whose
truth is a single effect, and how often it adds anything to the nulls.
"""

import pathlib
import sys
import warnings

import numpy as np


def read(path):
    """y, the columns that are fitted anyway, the candidates by effect, the truth, the rows behind them."""
    with open(path) as lines:
        truth = lines.readline().split(":", 1)[1].strip()
        names = lines.readline().strip().split(",")
        table = np.loadtxt(lines, delimiter=",", ndmin=2)
    table = table[np.isfinite(table).all(axis=1)]
    rows = len(table)
    # least squares needs no more of the table than its triangular factor, which is far smaller
    table = np.linalg.qr(table, mode="r")
    own = [k for k, name in enumerate(names) if name.startswith(("prior:", "bias:"))]
    effects = {}
    for k, name in enumerate(names):
        if name.startswith("candidate:"):
            effects.setdefault(name.split(":")[1], []).append(k)
    return table[:, 0], table[:, own], {e: table[:, k] for e, k in effects.items()}, truth, rows


def stlsq(y, own, effects, rows):
    """Effects by the size of what STLSQ gives them, at the threshold of the lowest BIC."""
    import pysindy

    names = list(effects)
    columns = np.hstack([own] + [effects[name] for name in names])
    owner = ["" for _ in range(own.shape[1])]
    owner += [name for name in names for _ in range(effects[name].shape[1])]
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1
    scaled = columns / size
    best = None
    for threshold in np.geomspace(0.02, 2, 12) * np.linalg.norm(y) / 10:
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-6, max_iter=30)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            optimizer.fit(scaled, y[:, None])
        x = np.asarray(optimizer.coef_).ravel()
        residual = y - scaled @ x
        bic = rows * np.log(residual @ residual / rows) + np.count_nonzero(x) * np.log(rows)
        if best is None or bic < best[0]:
            best = (bic, x)
    share = {name: 0.0 for name in names}
    for name, x in zip(owner, best[1]):
        if name:
            share[name] += x**2
    ranked = sorted((n for n in names if share[n] > 0), key=lambda n: -share[n])
    return ranked


def stepwise(y, own, effects, rows, enter=4.0):
    """Effects in the order in which partial F tests let them in (Klein and Morelli, section 5.4)."""
    chosen, ranked = own, []
    while len(ranked) < 5:
        q, _ = np.linalg.qr(chosen)
        left = y - q @ (q.T @ y)
        best = None
        for name, columns in effects.items():
            if name in ranked:
                continue
            for k in range(columns.shape[1]):
                column = columns[:, k] - q @ (q.T @ columns[:, k])
                length = column @ column
                if length < 1e-8 * (columns[:, k] @ columns[:, k]) or length == 0:
                    continue
                gain = (column @ left) ** 2 / length
                f = gain / ((left @ left - gain) / (rows - chosen.shape[1] - 1))
                if best is None or f > best[0]:
                    best = (f, name, columns[:, [k]])
        if best is None or best[0] < enter:
            break
        ranked.append(best[1])
        chosen = np.hstack([chosen, best[2]])
    return ranked


def main():
    files = sorted(pathlib.Path(sys.argv[1]).glob("*.csv"))
    methods = {"PySINDy STLSQ": stlsq, "stepwise regression": stepwise}
    first = {name: [] for name in methods}
    three = {name: [] for name in methods}
    nulls = {name: [] for name in methods}
    for path in files:
        y, own, effects, truth, rows = read(path)
        if "without_" in path.name or "+" in truth:
            continue
        for name, method in methods.items():
            ranked = method(y, own, effects, rows)
            if truth:
                first[name].append(ranked[:1] == [truth])
                three[name].append(truth in ranked[:3])
            else:
                nulls[name].append(bool(ranked))
    print(f"{'':24}{'first':>16}{'in three':>16}{'nulls with any':>18}")
    for name in methods:
        cells = [first[name], three[name], nulls[name]]
        told = [f"{100 * np.mean(c):.1f} % of {len(c)}" if c else "-" for c in cells]
        print(f"{name:24}{told[0]:>16}{told[1]:>16}{told[2]:>18}")


if __name__ == "__main__":
    main()
