#!/usr/bin/env python3
"""Runs the shards of a sweep on Dask: dask_run.py DIR N [SCHEDULER]

Without a scheduler's address (tcp://host:8786) two workers are started here. Dask gives the shard of a lost worker to another one, which
resumes it. Nothing passes between the workers but the numbers of shards; DIR is on a disk that all see.
"""

import subprocess
import sys

from distributed import Client, LocalCluster, as_completed


def run(folder, shard):
    """One shard; raises where flexspline failed."""
    subprocess.run(["flexspline", "sweep", "run", folder, "--shard", shard, "--threads", "1", "-q"], check=True)
    return shard


def main(folder, count, scheduler=None):
    shards = [f"{number}/{count}" for number in range(1, int(count) + 1)]
    cluster = scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        # Not pure: a shard leaves its file, which another run may have removed meanwhile.
        futures = client.map(run, [folder] * len(shards), shards, pure=False, retries=2)
        for done in as_completed(futures):
            print(f"shard {done.result()} is done", flush=True)


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
