"""Formulas by other methods for effects that no catalogue holds, on the signals that `propose` works on.

    python3 -m venv target/others-venv && target/others-venv/bin/pip install -q numpy pysindy gplearn
    cargo run --release ... --example propose_hidden -- inside FIRST COUNT target/signals > target/ours.jsonl
    target/others-venv/bin/python tests/formulas_by_others.py target/signals target/ours.jsonl [ENGINE]

Each method sees what the tuned model leaves in each of six channels, window by window, over the dynamic pressure, and the
means of the variables. Each fits every channel on all flights but the last and takes the channel of which its formula
explains most on the last one; its formula is judged by the term with the largest amount. ENGINE is the program of
tests/formulas_by_engine, the Rust port of PySR's engine; PySR itself needs Julia. A method whose package is missing is left
out, and the table says so. Prints how often channel, variables, trend and form are right, and how often a method
names anything in flights that lack nothing.
"""

import json
import pathlib
import re
import subprocess
import sys
import warnings

import numpy as np

CHANNELS = ["drag", "lift", "side", "roll", "pitch", "yaw"]
VARIABLES = ["alpha", "beta", "p_hat", "q_hat", "r_hat", "aileron", "elevator", "throttle"]
REACH = dict(alpha=0.3, beta=0.18, p_hat=0.15, q_hat=0.03, r_hat=0.09, aileron=0.18, elevator=0.18, throttle=1.0)
# Share of the last flight's variance that a formula must explain to be called one; without it each method names
# something in every flight.
NAMED = 0.02
ROUNDING = 1e-9


def deadband(x, w):
    return x - np.clip(x, -w, w)


FUNCTIONS = dict(abs=np.abs, tanh=np.tanh, exp=np.exp, sin=np.sin, sqrt=np.sqrt, max=np.maximum, min=np.minimum,
                 deadband=deadband)


def evaluated(text, values):
    """The values of a formula in the language of effect files."""
    return eval(text.replace("^", "**"), {"__builtins__": {}}, {**FUNCTIONS, **values}) + 0.0 * values["alpha"]


def read(path):
    """The truth (channel, variables, shape), flights, variables, residuals over the dynamic pressure."""
    with open(path) as lines:
        truth = lines.readline().split(":", 1)[1].strip().split(";")
        names = lines.readline().strip().split(",")
        table = np.genfromtxt(lines, delimiter=",")
    column = {name: table[:, k] for k, name in enumerate(names)}
    pressure = column["qbar_S"] / np.mean(column["qbar_S"])
    left = {c: column["left_" + c] / pressure for c in CHANNELS}
    moving = {v: column[v] for v in VARIABLES if np.ptp(column[v]) > 0}
    return truth if len(truth) == 3 else None, column["flight"], moving, left


def library(x):
    """The terms of the linear methods: those of the library of `propose` without thresholds."""
    terms = {}
    for i, v in enumerate(x):
        terms[v] = x[v]
        terms[f"{v}^2"] = x[v] ** 2
        if v != "throttle":
            terms[f"abs({v})"] = np.abs(x[v])
            terms[f"{v}*abs({v})"] = x[v] * np.abs(x[v])
        for w in list(x)[i + 1:]:
            terms[f"{v}*{w}"] = x[v] * x[w]
        for w in x:
            if w not in (v, "throttle"):
                terms[f"{v}*abs({w})"] = x[v] * np.abs(x[w])
    return terms


def by_terms(choose):
    """A method that takes from the library: `choose` gives the coefficients of scaled, centred terms."""

    def method(x, y, train, test):
        terms = library(x)
        names = list(terms)
        columns = np.column_stack([terms[n] for n in names])
        mean, size = columns[train].mean(0), columns[train].std(0)
        size[size == 0] = 1
        scaled = (columns - mean) / size
        weights = choose(scaled[train], y[train] - y[train].mean())
        if not np.any(weights):
            return None
        said = scaled @ weights + y[train].mean()
        return names[int(np.argmax(np.abs(weights)))], said

    return method


def stlsq(columns, y):
    import pysindy

    best = None
    for threshold in np.geomspace(0.05, 0.8, 10) * y.std():
        optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-6, max_iter=30)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            optimizer.fit(columns, y[:, None])
        weights = np.asarray(optimizer.coef_).ravel()
        left = y - columns @ weights
        bic = len(y) * np.log(left @ left / len(y)) + np.count_nonzero(weights) * np.log(len(y))
        if best is None or bic < best[0]:
            best = (bic, weights)
    return best[1]


def stepwise(columns, y, enter=4.0, most=5):
    chosen = []
    weights = np.zeros(columns.shape[1])
    left = y
    while len(chosen) < most:
        gains = (columns.T @ left) ** 2 / np.maximum((columns**2).sum(0), 1e-12)
        gains[chosen] = 0
        k = int(np.argmax(gains))
        rest = left @ left - gains[k]
        if gains[k] / (rest / (len(y) - len(chosen) - 1)) < enter:
            break
        chosen.append(k)
        fit = np.linalg.lstsq(columns[:, chosen], y, rcond=None)[0]
        left = y - columns[:, chosen] @ fit
        weights[:] = 0
        weights[chosen] = fit
    return weights


def genetic(x, y, train, test):
    """gplearn; the formula in the language of effect files."""
    from gplearn.functions import make_function
    from gplearn.genetic import SymbolicRegressor

    tanh = make_function(function=np.tanh, name="tanh", arity=1)
    names = list(x)
    scale = {v: np.std(x[v][train]) for v in names}
    columns = np.column_stack([x[v] / scale[v] for v in names])
    model = SymbolicRegressor(
        population_size=1000, generations=15, function_set=("add", "sub", "mul", "div", "abs", "max", "min", tanh),
        metric="pearson", parsimony_coefficient=0.003, init_depth=(1, 3), random_state=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(columns[train], y[train])
        raw = model.predict(columns)
    if not np.std(raw[train]) > 0:
        return None
    slope, offset = np.polyfit(raw[train], y[train], 1)

    def shape(values):
        return model._program.execute(np.column_stack([values[v] / scale[v] for v in names]))

    used = sorted({names[k] for k in model._program.program if isinstance(k, int)})
    return (shape, used, str(model._program)), slope * raw + offset


def engine(program):
    """The Rust port of PySR's engine: a table in, the front out; the score of PySR picks one of it."""

    def method(x, y, train, test):
        names = list(x)
        scale = {v: np.std(x[v][train]) for v in names}
        columns = np.column_stack([x[v] / scale[v] for v in names] + [y / y[train].std()])
        text = "\n".join(",".join(f"{a:.9e}" for a in row) for row in columns[train])
        done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
        front = [line.split("\t") for line in done.stdout.splitlines()]
        front = [(int(size), float(loss), formula) for size, loss, formula in front]
        best, last = None, None
        for size, loss, formula in front:
            if last is not None and loss > 0:
                score = -(np.log(loss) - np.log(last[1])) / (size - last[0])
                # PySR's `model_selection="best"`: the highest score among those near the lowest loss
                if loss <= 1.5 * front[-1][1] and (best is None or score > best[0]):
                    best = (score, formula)
            last = (size, loss)
        if best is None:
            return None
        formula = re.sub(r"x(\d+)", lambda m: f"({names[int(m[1])]}/{scale[names[int(m[1])]]:.6e})", best[1])
        with np.errstate(all="ignore"):
            raw = evaluated(formula, x)
        slope, offset = np.polyfit(raw[train], y[train], 1)
        return formula, slope * raw + offset

    return method


def explained(y, said):
    return 1 - np.mean((y - said) ** 2) / np.var(y)


def trend(shape, used):
    """How a shape runs with each variable, as `propose` says it."""
    along = np.array([0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0])
    beside = [0.9, 0.37, 0.71]

    def values(v, sign):
        all = {w: np.zeros(len(along)) for w in VARIABLES}
        for k, w in enumerate(u for u in VARIABLES if u in used):
            all[w] = sign * along * REACH[w] if w == v else np.full(len(along), beside[k % 3] * REACH[w])
        return shape(all)

    def runs(x, size):
        steps = np.diff(x)
        return bool(np.all(steps >= -ROUNDING * size) or np.all(steps <= ROUNDING * size))

    words = []
    for v in used:
        up, down = values(v, 1), values(v, -1)
        size = max(np.abs(up).max(), np.abs(down).max(), 1e-300)
        near = lambda x: np.all(np.abs(x) <= 1e-6 * size)  # noqa: E731
        if v == "throttle":
            words.append(f"{'runs' if runs(up, size) else 'turns'} {v}")
            continue
        # a formula may have an offset, which is the model's own constant
        middle = 0.5 * (up[0] + down[0])
        if near(up + down - 2 * middle):
            parity = "odd"
        elif near(up - down):
            parity = "even"
        elif near(np.diff(down)) or near(np.diff(up)):
            parity = "one-sided"
        else:
            parity = "neither"
        words.append(f"{'' if runs(up, size) and runs(down, size) else 'turning '}{parity} {v}")
    return sorted(words)


def judged(found, truth, x):
    """Channel, variables, trend and form of what was found."""
    channel, formula = found
    right, variables, hidden = truth
    variables = variables.split()
    if isinstance(formula, tuple):
        shape, used, _ = formula
    else:
        used = sorted(v for v in VARIABLES if re.search(rf"\b{v}\b", formula))
        shape = lambda values: evaluated(formula, values)  # noqa: E731
    true_shape = lambda values: evaluated(hidden, values)  # noqa: E731
    same = used == variables
    with np.errstate(all="ignore"):
        runs = same and trend(shape, used) == trend(true_shape, variables)
        likeness = np.corrcoef(shape(x), true_shape(x))[0, 1]
    return [channel == right, same, runs, same and runs and abs(likeness) > 0.9995]


def found_by(method, flights, x, left):
    """The channel of which a method explains most on the last flight, with its formula."""
    best = None
    last = flights == flights.max()
    for channel in CHANNELS:
        y = left[channel]
        finite = np.isfinite(y)
        own = {v: x[v][finite] for v in x}
        y, train, test = y[finite], ~last[finite], last[finite]
        if len(y) < 100:
            continue
        said = method(own, y, train, test)
        if said is not None:
            share = explained(y[test], said[1][test])
            if best is None or share > best[0]:
                best = (share, channel, said[0])
    return best[1:] if best is not None and best[0] > NAMED else None


def available(program):
    methods = {"stepwise regression": by_terms(stepwise)}
    for name, package, method in [("PySINDy STLSQ", "pysindy", by_terms(stlsq)), ("gplearn", "gplearn", genetic)]:
        try:
            __import__(package)
            methods[name] = method
        except ImportError:
            print(f"{name} is left out: `pip install {package}`")
    if program:
        methods["PySR's engine in Rust"] = engine(program)
    return methods


def ours(path, seeds):
    """Channel, variables, trend and form of `propose` on the same seeds."""
    rows, nulls = [], []
    for line in open(path):
        line = json.loads(line)
        if line.get("failed") or line["seed"] not in seeds:
            continue
        if line["hidden"] is None:
            nulls.append(line["free"]["proposed"])
        else:
            rows.append(line["free"]["channel_variables_trend_form"] or [False] * 4)
    return rows, nulls


def main():
    files = sorted(pathlib.Path(sys.argv[1]).glob("*.csv"))
    methods = available(sys.argv[3] if len(sys.argv) > 3 else None)
    rows = {name: [] for name in methods}
    nulls = {name: [] for name in methods}
    for path in files:
        truth, flights, x, left = read(path)
        for name, method in methods.items():
            found = found_by(method, flights, x, left)
            row = None
            if truth is None:
                nulls[name].append(found is not None)
            else:
                all = {**{v: np.zeros(len(flights)) for v in VARIABLES}, **x}
                row = [bool(r) for r in judged(found, truth, all)] if found else [False] * 4
                rows[name].append(row)
            named = found and [found[0], found[1][2] if isinstance(found[1], tuple) else found[1]]
            print(json.dumps({"file": path.name, "method": name, "truth": truth, "found": named, "right": row}), flush=True)
    rows["greylag propose"], nulls["greylag propose"] = ours(sys.argv[2], {int(f.stem.split("-")[1]) for f in files})
    print(f"{'':24}{'channel':>10}{'variables':>10}{'trend':>10}{'form':>10}{'names in a null':>18}")
    for name in rows:
        share = [f"{100 * c:.0f} %" for c in np.mean(np.array(rows[name], float).reshape(-1, 4), 0)]
        null = f"{sum(nulls[name])} of {len(nulls[name])}"
        print(f"{name:24}" + "".join(f"{s:>10}" for s in share) + f"{null:>18}   of {len(rows[name])}")


if __name__ == "__main__":
    main()
