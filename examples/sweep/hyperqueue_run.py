#!/usr/bin/env python3
"""Runs the shards of a sweep on HyperQueue: hyperqueue_run.py DIR N [SERVER_DIR]

Without the folder of a server that runs (hq server start) a server and two workers are started here. DIR is on a disk that all see.
"""

import pathlib
import sys

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig


def submit(client, folder, count):
    """One task for each shard; raises where one of them failed."""
    folder = pathlib.Path(folder).resolve()
    job = Job(default_workdir=str(folder), max_fails=0)
    for number in range(1, int(count) + 1):
        command = ["flexspline", "sweep", "run", str(folder), "--shard", f"{number}/{count}", "--threads", "1", "-q"]
        job.program(command, name=f"shard-{number}", stdout=None, stderr=str(folder / f"hyperqueue-{number}.log"))
    client.wait_for_jobs([client.submit(job)])


def main(folder, count, server=None):
    if server:
        submit(Client(server_dir=server), folder, count)
        return
    with LocalCluster() as cluster:
        for _ in range(2):
            cluster.start_worker(WorkerConfig(cores=1))
        submit(cluster.client(), folder, count)


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
