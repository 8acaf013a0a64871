#!/usr/bin/env python3
"""Runs the shards of a campaign on HyperQueue: hyperqueue_run.py DIR [SERVER_DIR]

Without the folder of a server that runs (hq server start) a server and two workers are started here. DIR is on a disk that all see.
"""

import json
import pathlib
import sys

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig


def submit(client, folder):
    """One task for each shard; raises where one of them failed."""
    folder = pathlib.Path(folder).resolve()
    shards = json.loads((folder / "plan.json").read_text())["shards"]
    job = Job(default_workdir=str(folder), max_fails=0)
    for shard in range(shards):
        command = ["flexspline", "campaign", "run", str(folder), "--shard", str(shard), "--threads", "1", "-q"]
        job.program(command, name=f"shard-{shard}", stdout=None, stderr=str(folder / f"hyperqueue-{shard}.log"))
    client.wait_for_jobs([client.submit(job)])


def main(folder, server=None):
    if server:
        submit(Client(server_dir=server), folder)
        return
    with LocalCluster() as cluster:
        for _ in range(2):
            cluster.start_worker(WorkerConfig(cores=1))
        submit(cluster.client(), folder)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
