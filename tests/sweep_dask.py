#!/usr/bin/env python3
"""examples/sweep/dask_run.py with one of its two workers killed in the middle: sweep_dask.py DIR N."""

import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

from distributed import LocalCluster

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "examples" / "sweep"))
import dask_run  # noqa: E402


def kill_one(cluster, folder, killed):
    """Once there are results, the process of the first worker dies without a word."""
    while not any(folder.glob("results/*.csv")):
        time.sleep(0.02)
    process = next(iter(cluster.workers.values())).process.process
    os.kill(process.pid, signal.SIGKILL)
    killed.append(process.pid)


if __name__ == "__main__":
    folder, shards = pathlib.Path(sys.argv[1]), sys.argv[2]
    killed = []
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        threading.Thread(target=kill_one, args=(cluster, folder, killed), daemon=True).start()
        dask_run.main(str(folder), shards, cluster)
    reduced = subprocess.run(["flexspline", "sweep", "reduce", str(folder), "-q"], check=False)
    if not killed or reduced.returncode != 0:
        sys.exit("no worker was killed, or results were lost")
