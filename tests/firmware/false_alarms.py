"""Counts the channels in which `greylag compare` states an error of a model that is exact: false alarms.

    python3 tests/firmware/false_alarms.py --greylag target/release/greylag --model params/x8/jsbsim.toml LOG...

The model must be that of the aircraft that flew. Each log is compared by itself; a channel counts where its sentence names an
error with an interval. Prints the sentences and a line for each log, then the sum.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path


def sentences(greylag, model, log):
    """What `compare` says of each channel."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "comparison.json"
        command = [greylag, "compare", "--model", model, "--log", log, "--json", out]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode != 0:
            sys.exit(f"{log}: {ended.stderr.strip()}")
        [judged] = json.loads(out.read_text())["models"]
        return judged["sentences"]


def main():
    """Prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--greylag", required=True)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    asked = parser.parse_args()
    alarms = channels = 0
    for log in asked.logs:
        said = [s for s in sentences(asked.greylag, asked.model, log) if "forecast without aerodynamics" not in s]
        wrong = [s for s in said if " ± " in s]
        print(f"{log}: {len(wrong)} of {len(said)}")
        for sentence in wrong:
            print(f"    {sentence}")
        alarms, channels = alarms + len(wrong), channels + len(said)
    print(f"{alarms} false alarms in {channels} channels")


if __name__ == "__main__":
    main()
