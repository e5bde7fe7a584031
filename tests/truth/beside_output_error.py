"""`greylag amend --tune-only` beside a plain output error in numpy, on flights of official JSBSim.

    python tests/truth/make_cases.py --truth official --seed 91132 --nulls 10 --effects '' --duration 40 --out cases/real
    python tests/truth/make_cases.py --truth official --seed 91132 --nulls 10 --effects '' --duration 40 --noise 0 --skew 0 --out cases/clean
    python tests/truth/make_cases.py --truth official --seed 91131 --nulls 20 --effects '' --duration 40 --wrong 0 --out cases/true
    python tests/truth/make_cases.py --truth official --seed 91131 --nulls 20 --effects '' --duration 40 --wrong 0 --noise 0 --skew 0 --out cases/true-clean
    python tests/truth/beside_output_error.py --greylag target/release/greylag --cases cases/clean --clean cases/clean --out fits/clean
    python tests/truth/beside_output_error.py --greylag target/release/greylag --cases cases/real --clean cases/clean --out fits/real
    python tests/truth/beside_output_error.py --greylag target/release/greylag --cases cases/true --clean cases/true-clean --out fits/true

Both fit the three training flights of each case; both models are judged by free runs of 5 s over the test flights without
sensors' errors (`output_error.judge`, RK4 of its own). `amend` holds out the test flights of `--cases`. With `--wrong 0` the given model is the true one.
"""

import argparse
import subprocess
import time
from pathlib import Path

import numpy as np

import output_error


def amended(greylag, case, out):
    """Coefficients that `amend` leaves, its exit status, and processor seconds; those given where it keeps them."""
    logs = lambda kind: [str(p) for p in sorted(case.glob(f"{kind}-*.csv"))]
    line = [greylag, "amend", "--model", str(case / "model.toml"), "--tune-only", "--force", "--out", str(out)]
    line += ["--log", *logs("train"), "--hold-out", *logs("test")]
    (out / "model.toml").unlink(missing_ok=True)
    begun = time.perf_counter()
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        raise RuntimeError(done.stderr)
    kept = not (out / "model.toml").exists()
    read = case / "model.toml" if kept else out / "model.toml"
    return output_error.read(read), done.returncode, kept, time.perf_counter() - begun


def yardstick(case, path):
    """Coefficients of the plain output error and its seconds; from `path` if that is there already."""
    begun = time.perf_counter()
    if not path.exists():
        flights = [output_error.table(f) for f in sorted(case.glob("train-*.csv"))]
        output_error.write(path, output_error.fit(flights, output_error.read(case / "model.toml")))
    return output_error.read(path), time.perf_counter() - begun


def main():
    """Fits every case in both ways and prints the errors."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--greylag", required=True)
    p.add_argument("--cases", type=Path, required=True, help="folder of make_cases.py")
    p.add_argument("--clean", type=Path, required=True, help="the same cases without errors of sensors, to judge on")
    p.add_argument("--out", type=Path, required=True, help="folder for the fitted models")
    a = p.parse_args()
    rows = []
    print("case                    given     amend     numpy  amend/given  amend/numpy  kept  amend s  numpy s")
    for case in sorted(x for x in a.cases.iterdir() if x.is_dir()):
        out = a.out / case.name
        out.mkdir(parents=True, exist_ok=True)
        given = output_error.read(case / "model.toml")
        fitted, _, kept, seconds = amended(a.greylag, case, out)
        plain, took = yardstick(case, out / "plain.toml")
        e = [output_error.judge(a.clean / case.name, c) for c in (given, fitted, plain)]
        rows.append((e[1] / e[0], e[1] / e[2]))
        print(f"{case.name:20} {e[0]:9.5f} {e[1]:9.5f} {e[2]:9.5f} {rows[-1][0]:12.3f} {rows[-1][1]:12.3f} "
              f"{'yes' if kept else 'no':>5} {seconds:8.1f} {took:8.1f}", flush=True)  # fmt: skip
    rows = np.array(rows)
    print(f"median {np.median(rows, axis=0).round(3)}, worst {rows.max(axis=0).round(3)}, "
          f"amend at most as wrong as numpy in {(rows[:, 1] <= 1).sum()} of {len(rows)}")  # fmt: skip


if __name__ == "__main__":
    main()
