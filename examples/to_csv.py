#!/usr/bin/env python3
"""Parquet, MATLAB, TDMS and MCAP files as CSV, for `flexspline look` and `flexspline calibrate`.

    examples/to_csv.py bench.parquet > bench.csv
    examples/to_csv.py run.mat --only motor,joint,torque > run.csv

One column for each one-dimensional series of numbers, named as in the file; series of TDMS are group.channel, of MCAP topic.field (JSON
messages), each message a row at its time. All series of a TDMS or MATLAB file must have one length and one clock; pick them with --only.
Needs pyarrow, scipy, nptdms, or mcap, each for its own format.
"""

import argparse
import csv
import json
import sys


def parquet(path):
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path)
    return {name: table.column(name).to_pylist() for name in table.column_names}


def matlab(path):
    import scipy.io

    series = {}
    try:
        content = scipy.io.loadmat(path, squeeze_me=True)
    except NotImplementedError:
        sys.exit(f"{path}: a file of MATLAB 7.3; allowed: one saved with -v7")
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if getattr(value, "ndim", 0) == 1 and value.dtype.kind in "iufb":
            series[name] = value.tolist()
        elif getattr(value, "ndim", 0) == 2 and value.dtype.kind in "iufb":
            for place in range(value.shape[1]):
                series[f"{name}_{place + 1}"] = value[:, place].tolist()
    return series


def tdms(path):
    import nptdms

    series = {}
    for group in nptdms.TdmsFile.read(path).groups():
        for channel in group.channels():
            name = f"{group.name}.{channel.name}"
            if "wf_increment" in channel.properties and "time_s" not in series:
                series["time_s"] = channel.time_track().tolist()
            series[name] = channel[:].tolist()
    return series


def mcap(path):
    from mcap.reader import make_reader

    rows = []
    with open(path, "rb") as source:
        for _, channel, message in make_reader(source).iter_messages():
            if channel.message_encoding != "json":
                sys.exit(f"{path}: {channel.topic} is encoded as {channel.message_encoding}; allowed: json")
            fields = json.loads(message.data)
            numbers = {f"{channel.topic.strip('/')}.{k}": v for k, v in fields.items() if isinstance(v, (int, float))}
            rows.append({"time_s": message.log_time * 1e-9, **numbers})
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name, "") for row in rows] for name in names}


READERS = {"parquet": parquet, "mat": matlab, "tdms": tdms, "mcap": mcap}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file")
    parser.add_argument("--only", help="series to write, separated by commas")
    options = parser.parse_args()
    kind = options.file.rsplit(".", 1)[-1].lower()
    if kind not in READERS:
        sys.exit(f"{options.file}: found .{kind}, allowed: {', '.join('.' + kind for kind in READERS)}")
    try:
        series = READERS[kind](options.file)
    except ImportError as error:
        sys.exit(f"{options.file}: needs the Python package {error.name}: pip install {error.name}")
    if options.only:
        wanted = options.only.split(",")
        missing = [name for name in wanted if name not in series]
        if missing:
            sys.exit(f"{options.file}: no series {', '.join(missing)}; there are: {', '.join(series)}")
        series = {name: series[name] for name in wanted}
    if not series:
        sys.exit(f"{options.file}: no series of numbers")
    lengths = {name: len(values) for name, values in series.items()}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{name} {length}" for name, length in lengths.items())
        sys.exit(f"{options.file}: series of different lengths ({said}); allowed: one length, choose with --only")
    rows = max(lengths.values())
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(series)
    for row in range(rows):
        out.writerow([values[row] for values in series.values()])


if __name__ == "__main__":
    main()
