#!/usr/bin/env python3
"""Runs the shards of a campaign on Dask: dask_run.py DIR [SCHEDULER]

Without a scheduler's address (tcp://host:8786) two workers are started here. A worker that is lost loses its shard with it: Dask gives that
to another one, which writes the same bytes. Nothing passes between the workers but the numbers of shards; DIR is on a disk that all see.
"""

import json
import pathlib
import subprocess
import sys

from distributed import Client, LocalCluster, as_completed


def run(folder, shard):
    """One shard; raises where flexspline says that it failed."""
    subprocess.run(["flexspline", "campaign", "run", folder, "--shard", str(shard), "--threads", "1", "-q"], check=True)
    return shard


def main(folder, scheduler=None):
    shards = json.loads(pathlib.Path(folder, "plan.json").read_text())["shards"]
    cluster = scheduler or LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with Client(cluster) as client:
        # Not pure: what a shard leaves is its file, which another run may have removed meanwhile.
        futures = client.map(run, [folder] * shards, range(shards), pure=False, retries=2)
        for done in as_completed(futures):
            print(f"shard {done.result()} is there", flush=True)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
