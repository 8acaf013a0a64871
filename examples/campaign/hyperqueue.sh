#!/bin/bash
# Runs the shards of a campaign on HyperQueue: hyperqueue.sh DIR. A server must run (hq server start), and workers (hq worker start).
set -euo pipefail
folder=${1:?folder of the campaign}
shards=$(python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["shards"])' "$folder/plan.json")
# A task whose worker is lost goes to another one.
hq submit --array "0-$((shards - 1))" --cpus 1 --crash-limit 5 --wait --stdout none --stderr "$folder/hq-%{TASK_ID}.log" -- \
    bash -c 'exec flexspline campaign run "$0" --shard "$HQ_TASK_ID" --threads 1 -q' "$folder"
