"""Settled error of several controllers, target by target, and what each differs from the first by.

    python python/benches/paired_targets.py write results/campaign-paper-targets.csv policy=A/evaluation.json hybrid=B/evaluation.json
    python python/benches/paired_targets.py print results/campaign-paper-targets.csv [CONTROLLER]

``write`` keeps the settled errors (degrees) of evaluations (``greylag evaluate --json``) in one table, of the targets that all of them
have. ``print``
gives each controller's mean error and the mean of its differences from the first one, or from CONTROLLER, paired by target, with 95 %
percentile-bootstrap intervals over the targets (10,000 resamples, seed 1). These intervals hold no scatter of training: for one
policy they say what other targets would give, not what another seed would.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np

USAGE = "give write TABLE.csv NAME=EVALUATION.json …, or print TABLE.csv [CONTROLLER]"


def write(table: Path, named: list[str]) -> None:
    """Writes ``table`` from the evaluations ``named``, each NAME=FILE: the targets that all of them have."""
    columns: dict[str, dict[tuple[str, float, float], float]] = {}
    for one in named:
        name, _, path = one.partition("=")
        flights = json.loads(Path(path).read_text())["controllers"][0]["flights"]
        columns[name] = {(f["targets"], *f["to_deg"][:2]): f["settled_deg"] for f in flights}
    common = [key for key in next(iter(columns.values())) if all(key in errors for errors in columns.values())]
    if not common:
        raise SystemExit("the evaluations have no target in common; evaluate the same targets")
    with table.open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["group", "roll_deg", "pitch_deg", *columns])
        for key in common:
            writer.writerow([*key, *(f"{errors[key]:.4f}" for errors in columns.values())])


def with_interval(values: np.ndarray) -> str:
    """Mean of ``values`` with its bootstrap interval."""
    drawn = np.random.default_rng(1).integers(len(values), size=(10_000, len(values)))
    low, high = np.percentile(values[drawn].mean(axis=1), [2.5, 97.5])
    return f"{values.mean():.3f} [{low:.3f}, {high:.3f}]"


def show(table: Path, than: str | None = None) -> None:
    """Prints the means of all groups, and the differences from the controller ``than`` (the first one where it is None)."""
    with table.open() as read:
        rows = list(csv.DictReader(read))
    names = [name for name in rows[0] if name not in ("group", "roll_deg", "pitch_deg")]
    than = than or names[0]
    if than not in names:
        raise SystemExit(f"{table} has no controller {than}; it has {', '.join(names)}")
    groups = list(dict.fromkeys(row["group"] for row in rows))
    for group in ["all", *groups]:
        own = [row for row in rows if group in ("all", row["group"])]
        first = np.array([float(row[than]) for row in own])
        print(f"\n{group}, {len(own)} targets: settled error, degrees\n")
        print(f"| controller | mean | less {than} |\n|---|---|---|")
        for name in names:
            errors = np.array([float(row[name]) for row in own])
            less = "–" if name == than else with_interval(errors - first)
            print(f"| `{name}` | {with_interval(errors)} | {less} |")


def main() -> None:
    """Reads the command line."""
    match sys.argv[1:]:
        case ["write", table, *named] if named:
            write(Path(table), named)
        case ["print", table]:
            show(Path(table))
        case ["print", table, than]:
            show(Path(table), than)
        case _:
            raise SystemExit(USAGE)


if __name__ == "__main__":
    main()
