#!/usr/bin/env python3
"""examples/campaign/dask_run.py with one of its two workers killed in the middle: campaign_dask.py DIR."""

import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

from distributed import LocalCluster

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "examples" / "campaign"))
import dask_run  # noqa: E402


def kill_one(cluster, folder, killed):
    """Once a shard is there, the process of the first worker dies without a word, whatever it is at."""
    while not any(folder.glob("shards/*.parquet")):
        time.sleep(0.02)
    process = next(iter(cluster.workers.values())).process.process
    os.kill(process.pid, signal.SIGKILL)
    killed.append(process.pid)


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1])
    (folder / "shards").mkdir(exist_ok=True)
    killed = []
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        threading.Thread(target=kill_one, args=(cluster, folder, killed), daemon=True).start()
        dask_run.main(str(folder), cluster)
    again = subprocess.run(
        ["flexspline", "campaign", "run", str(folder), "--shard", "all", "--json"], check=True, capture_output=True, text=True
    )
    print(killed, again.stdout)
    if not killed or '"computed": [],' not in again.stdout:
        sys.exit("no worker was killed, or a shard was lost")
