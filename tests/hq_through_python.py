"""`hq submit --wait --array A-B … -- COMMAND` on the HyperQueue of the PyPI package, which has no program `hq`.

Only what the launcher of `greylag campaign` asks for. Each call has a server and a worker of its own.
"""

import argparse
import os
import sys
import tempfile

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig


def main():
    ours, command = sys.argv[1 : sys.argv.index("--")], sys.argv[sys.argv.index("--") + 1 :]
    parser = argparse.ArgumentParser()
    parser.add_argument("submit", choices=["submit"])
    parser.add_argument("--wait", action="store_true")
    for name in ["--name", "--array", "--crash-limit", "--stdout", "--stderr"]:
        parser.add_argument(name)
    parser.add_argument("--env", action="append", default=[])
    asked = parser.parse_args(ours)
    first, last = map(int, asked.array.split("-"))
    env = dict(pair.split("=", 1) for pair in asked.env)
    with tempfile.TemporaryDirectory() as folder, LocalCluster(folder, WorkerConfig(cores=2)) as cluster:
        # by default a job of this interface ends, and cancels its other tasks, when a second task fails
        job = Job(name=asked.name, max_fails=None)
        for task in range(first, last + 1):
            # HyperQueue counts the tasks of such a job from 0, whatever the environment says
            words = [word.replace("$HQ_TASK_ID", str(task)) for word in command]
            paths = {k: getattr(asked, k).replace("%{TASK_ID}", str(task)) for k in ["stdout", "stderr"]}
            job.program(words, env={**env, "PATH": os.environ["PATH"]}, **paths)
        client = cluster.client()
        client.wait_for_jobs([client.submit(job)])


main()
