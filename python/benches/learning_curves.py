"""Errors while learning, of several trainings side by side: means over windows of environment steps.

    python python/benches/learning_curves.py results/campaign-paper.jsonl policies/true/frozen/1 regimes/simulator/1 [NAME=curve.csv …]

The first argument is a file of results (``greylag campaign gather --results``), then come its cells with a learning curve, and
curves of trainings that have not ended (``curve.csv`` in the folder of a policy). Errors are settled errors in degrees, easy and
hard targets apart, on the few targets that training is valued on. The evaluations of one training are not independent.
"""

import csv
import json
import sys
from pathlib import Path

USAGE = "give RESULTS.jsonl CELL … [NAME=curve.csv …]"
WINDOW = 100_000


def of_record(record: dict) -> list[tuple[float, float, float]]:
    """Steps, easy and hard error of each evaluation in a cell's record."""
    curve = record["curve"]
    return list(zip(curve["steps"], curve["easy_deg"], curve["hard_deg"]))


def of_table(path: Path) -> list[tuple[float, float, float]]:
    """The same of a ``curve.csv``."""
    with path.open() as table:
        return [(float(row["steps"]), float(row["easy_deg"]), float(row["hard_deg"])) for row in csv.DictReader(table)]


def mean_in(curve: list[tuple[float, float, float]], window: int) -> str:
    """Mean easy and hard error of the evaluations in the window with this number; a dash if there are none."""
    # the steps of 64 instances pass a round number by up to 64
    inside = [row for row in curve if int((row[0] - 65) // WINDOW) == window]
    if not inside:
        return "–"
    easy, hard = (sum(row[k] for row in inside) / len(inside) for k in (1, 2))
    return f"{easy:.2f} / {hard:.2f}"


def main(arguments: list[str]) -> None:
    """Prints the table."""
    if len(arguments) < 2:
        raise SystemExit(USAGE)
    results, *named = arguments
    records = [json.loads(line) for line in Path(results).read_text().splitlines()]
    cells = {record["cell"]: record for record in records if record.get("curve")}
    curves = {}
    for one in named:
        name, found, path = one.partition("=")
        if not found and name not in cells:
            raise SystemExit(f"{results} has no cell {name} with a learning curve; it has {', '.join(sorted(cells))}")
        curves[name] = of_table(Path(path)) if found else of_record(cells[name])
    print("| thousands of steps |" + "".join(f" {name}: easy / hard |" for name in curves))
    print("|---|" + "---|" * len(curves))
    last = max(int((row[0] - 65) // WINDOW) for curve in curves.values() for row in curve)
    for window in range(last + 1):
        steps = f"{window * WINDOW // 1000} to {(window + 1) * WINDOW // 1000}"
        print(f"| {steps} |" + "".join(f" {mean_in(curve, window)} |" for curve in curves.values()))


if __name__ == "__main__":
    main(sys.argv[1:])
