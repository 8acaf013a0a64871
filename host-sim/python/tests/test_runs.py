"""Runs from Python are runs of the command: the same numbers. Wrong if this fails: a notebook and a report of one drive disagree."""

from __future__ import annotations

import csv
import inspect
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pyarrow
import pytest
from sklearn.base import clone
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

import flexspline
from conftest import MODEL, PROJECT, command, read_json, same_json
from flexspline import BadInput, Drive, NotConverged, NothingGained, Table
from flexspline._inputs import log
from flexspline._runs import _OPTIONS


def read_csv(path: Path) -> dict[str, list[str]]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def same_columns(ours: flexspline.Columns, theirs: dict[str, list[str]]) -> None:
    assert list(ours) == list(theirs)
    for name, column in theirs.items():
        if column[0] in ("true", "false"):
            assert [str(value).lower() for value in ours[name].tolist()] == column, name
        elif isinstance(ours[name], list):
            assert ours[name] == column, name
        else:
            written = [float(cell) if cell else np.nan for cell in column]
            np.testing.assert_array_equal(ours[name], written, err_msg=name)


def test_simulate_is_the_command(tmp_path: Path) -> None:
    options = ("--path", "pitch", "--torque-n-m", 50, "--mesh", "coarse", "--set", "flanks.friction_coefficient=0.08")
    command("simulate", "--generator", "cam", *options, "--out", tmp_path)
    drive = Drive("HHD-95").set({"flanks.friction_coefficient": 0.08})
    told: list[tuple[int, int, str]] = []
    run = flexspline.simulate(
        drive, "cam", path="pitch", torque_n_m=50, mesh="coarse", progress=lambda *now: told.append(now)
    )
    same_columns(run, read_csv(tmp_path / "results.csv"))
    same_json(run.summary.json, read_json(tmp_path / "summary.json"))
    assert run.settled.dtype == np.bool_ and run.step.dtype == np.int64
    done = [now[0] for now in told]
    assert done == sorted(done) and 0 < done[-1] == told[-1][1], "the last that is told is the whole"


def test_a_path_from_columns_is_the_path_of_the_file(tmp_path: Path) -> None:
    path = {"generator_rad": [0.0, 0.004, 0.008, 0.004], "torque_n_m": [5.0, 5.0, 6.0, 6.0]}
    pandas.DataFrame(path).to_csv(tmp_path / "path.csv", index=False)
    of_file = flexspline.simulate("HHD-95", "cam", path=tmp_path / "path.csv", mesh="coarse", progress=False)
    for columns in (path, pandas.DataFrame(path), pyarrow.table(path)):
        run = flexspline.simulate("HHD-95", "cam", path=columns, mesh="coarse", progress=False)
        np.testing.assert_array_equal(run.error_arcsec, of_file.error_arcsec)
    assert of_file.torque_n_m.tolist() == path["torque_n_m"]
    backward = flexspline.simulate("HHD-95", "cam", path="pitch", direction=-1, torque_n_m=5, mesh="coarse")
    assert backward.generator_rad[-1] < backward.generator_rad[0]


def test_tables_are_those_of_the_command(tmp_path: Path, image: Path) -> None:
    few = ("--mesh", "coarse", "--torque-n-m", 20, "--most-nodes", 5, "--positions", 4, "--node-tolerance-arcsec", 60)
    command("tables", "--no-report", "--generator", "cam", *few, "--temperatures-c", 20, "--out", tmp_path / "theirs")
    made = flexspline.tables(
        "HHD-95", "cam", mesh="coarse", torque_n_m=20, most_nodes=5, positions=4, node_tolerance_arcsec=60, temperatures_c=[20]
    )
    assert list(made) == ["cam"]
    table = made["cam"]
    table.save(tmp_path / "ours")
    for ending in ("fxt", "rs", "h", "samples.csv"):
        ours, theirs = (tmp_path / whose / f"cam.{ending}" for whose in ("ours", "theirs"))
        # The header says which command made it.
        lines = [[line for line in one.read_bytes().splitlines() if b"flexspline tables" not in line] for one in (ours, theirs)]
        assert lines[0] == lines[1], ending
    ours, theirs = (read_json(tmp_path / whose / "cam.json") for whose in ("ours", "theirs"))
    same_json(ours, theirs)
    # Used at once.
    assert table.forward(0.1, 10.0).rows == 1

    samples = PROJECT / "tests/firmware/samples/cam.samples.csv"
    assert flexspline.table_from_samples(samples, "HHD-95", "cam").image == image.read_bytes()


def frame_of(path: Path) -> pandas.DataFrame:
    return pandas.read_csv(path)


def test_diagnose_is_the_command(log_file: Path, tmp_path: Path) -> None:
    command("diagnose", log_file, "--model", MODEL, "--no-report", "--out", tmp_path)
    theirs = read_json(tmp_path / "diagnosis.json")
    found = flexspline.diagnose(log_file, model=MODEL, explain="flexspline_runout")
    same_json(found.json, theirs)
    assert found.causes[0].name == "output_encoder_eccentricity" and found.verdict == "explained"
    assert abs(found.causes[0].parameters.amplitude_arcsec.value - 25.0) < 4.0
    left = found.rows.error_arcsec - found.rows.extended_arcsec
    before = found.rows.error_arcsec - found.rows.recalibrated_arcsec
    assert np.std(left) < 0.7 * np.std(before)
    assert found.explanation is not None and "flexspline_runout" in found.explanation
    assert "output_encoder_eccentricity" in repr(found) and "verdict" in found._repr_html_()

    # What the command wrote, less its first line, which names the command.
    assert found.drive_toml is not None
    assert (tmp_path / "drive-extended.toml").read_text().split("\n", 1)[1] == found.drive_toml
    written = found.save(tmp_path / "ours")
    assert sorted(path.name for path in written) == sorted(
        ["diagnosis.json", *(name for name in theirs["extension"]["files"])]
    )
    if found.extended_table is not None:
        assert found.extended_table.image == (tmp_path / found.table.file).read_bytes()
    again = flexspline.diagnose(log_file, model=tmp_path / "ours/drive-extended.toml")
    assert again.finding == "nothing_found", "the extended model holds the cause"
    by_ratio = flexspline.diagnose(log_file, ratio=-100)
    assert by_ratio.table.file is not None and by_ratio.json["held_out"]["rms_before_arcsec"] > 0


def test_columns_in_memory_are_the_file(log_file: Path) -> None:
    of_file = flexspline.diagnose(log_file, model=MODEL).json
    frame = frame_of(log_file)
    assert flexspline.diagnose(frame, model=MODEL).json == of_file
    for data in (pyarrow.Table.from_pandas(frame), dict(frame.items())):
        assert log(data) == log(frame), "from here on they are the same"
    renamed = frame.rename(columns={"generator_rad": "motor"}).assign(motor=lambda f: f["motor"] / (2 * np.pi), note="text")
    mapped = flexspline.diagnose(renamed, model=MODEL, columns={"generator": "motor:turn"})
    assert [cause.name for cause in mapped.causes] == [cause["name"] for cause in of_file["causes"]]


def test_missing_values_and_times_are_taken_as_they_are(log_file: Path, tmp_path: Path) -> None:
    frame = frame_of(log_file).head(4000)
    frame.loc[100:110, "output_rad"] = np.nan
    frame.to_csv(tmp_path / "gaps.csv", index=False)
    of_file = flexspline.diagnose(tmp_path / "gaps.csv", model=MODEL)
    assert [fault.name for fault in of_file.data_faults] == ["missing_samples"]
    assert flexspline.diagnose(frame, model=MODEL).json == of_file.json
    dated = frame.assign(time_s=pandas.Timestamp("2026-01-01") + pandas.to_timedelta((frame["time_s"] * 1e6).round(), unit="us"))
    assert flexspline.diagnose(dated, model=MODEL).data_faults == of_file.data_faults
    nullable = frame.convert_dtypes(dtype_backend="numpy_nullable")
    assert flexspline.diagnose(nullable, model=MODEL).json == of_file.json


def test_synthesize_is_the_command(tmp_path: Path) -> None:
    effect = "gravity_torque:torque_n_m=3"
    command("synthesize", "--model", MODEL, "--effect", effect, "--seed", 5, "--rows", 400, "--out", tmp_path)
    made = flexspline.synthesize(effect, model=MODEL, seed=5, rows=400)
    theirs = read_csv(tmp_path / "data.csv")
    assert list(made) == list(theirs)
    for name, column in theirs.items():
        np.testing.assert_array_equal(made[name], np.array(column, dtype=float))
    assert [one.json for one in made.effects] == read_json(tmp_path / "truth.json")["effects"]
    assert flexspline.calibrate(made, model=MODEL).held_out.rms_before_arcsec > 0
    with pytest.raises(BadInput, match="speed_rad_s: found 0"):
        flexspline.synthesize(model=MODEL, speed_rad_s=0)
    with pytest.raises(BadInput, match="effects: .*gravity_torque"):
        flexspline.synthesize("gravity_torqe", model=MODEL)


def test_look_is_the_command(log_file: Path) -> None:
    assert flexspline.look(log_file).json == json.loads(command("look", log_file, "--json").stdout)
    of_frame = flexspline.look([frame_of(log_file)])
    assert of_frame.ratio_proposed == flexspline.look(log_file).ratio_proposed
    assert "ratio" in repr(of_frame)
    with pytest.raises(BadInput, match="found none"):
        flexspline.look([])


def test_calibrate_is_the_command(log_file: Path, tmp_path: Path) -> None:
    command("calibrate", log_file, "--model", MODEL, "--no-report", "--out", tmp_path)
    made = flexspline.calibrate(log_file, model=MODEL)
    same_json(made.json, read_json(tmp_path / "calibration.json"))
    assert made.table.image == (tmp_path / "calibrated.fxt").read_bytes()
    assert made.held_out.rms_after_arcsec < made.held_out.rms_before_arcsec
    of_frame = flexspline.calibrate([frame_of(log_file)], model=str(MODEL))
    assert of_frame.table.image == made.table.image
    assert {path.name for path in made.save(tmp_path / "ours")} == {
        "calibrated.fxt", "calibrated.json", "calibrated.rs", "calibrated.h", "calibration.json"
    }  # fmt: skip
    by_ratio = flexspline.calibrate(log_file, ratio=made.ratio)
    assert by_ratio.table.generator == "cam" and by_ratio.json["parts"][0]["name"]
    from_table = flexspline.calibrate(log_file, table=made.table)
    assert from_table.table.ratio == made.ratio
    held = made.held_out
    assert f"{held.rms_before_arcsec:.3g} -> {held.rms_after_arcsec:.3g} arcsec" in repr(made)


def test_a_calibrator_fits_predicts_and_scores(log_file: Path) -> None:
    frame = frame_of(log_file)
    calibrator = flexspline.Calibrator(model=MODEL)
    with pytest.raises(BadInput, match="not fitted yet"):
        calibrator.predict(frame)
    made = calibrator.fit(frame).calibration_
    replayed = made.table.replay(frame)
    unmeasured = frame.drop(columns="output_rad")
    np.testing.assert_allclose(calibrator.predict(unmeasured), replayed.predicted_arcsec, atol=1e-3)
    assert replayed.predicted_arcsec.std() > 1.0
    with pytest.raises(BadInput, match="generator_rad and one of"):
        calibrator.score(unmeasured)
    left = replayed.summary.rms_residual_arcsec / replayed.summary.rms_measured_arcsec
    assert calibrator.score(frame) == pytest.approx(1.0 - left**2, abs=1e-6)
    assert 0.0 < calibrator.score(frame) <= 1.0
    # A unit whose error has the opposite sign is worse off with this table than with none.
    opposite = 2.0 * frame["generator_rad"] / made.ratio - frame["output_rad"]
    assert calibrator.score(frame.assign(output_rad=opposite)) < 0.0
    assert "arcsec rms held out" in repr(calibrator)


def test_a_calibrator_is_an_estimator_of_scikit_learn(log_file: Path) -> None:
    frame = frame_of(log_file)
    calibrator = flexspline.Calibrator(model=MODEL)
    twin = clone(calibrator)
    assert twin is not calibrator and twin.get_params() == {"model": MODEL}
    assert twin.set_params(threads=1).get_params() == {"model": MODEL, "threads": 1} and calibrator.get_params() == {"model": MODEL}
    with pytest.raises(BadInput, match="found ratios, allowed: ratio, model"):
        twin.set_params(ratios=101)
    scores = cross_val_score(calibrator, frame, cv=3)
    assert scores.shape == (3,) and (scores > 0.0).all()
    piped = make_pipeline(FunctionTransformer(), calibrator).fit(frame)
    assert piped.score(frame) == calibrator.score(frame)
    assert set(inspect.signature(flexspline.calibrate).parameters) == {"logs", *_OPTIONS}


def test_a_measurement_that_is_none_is_refused_and_never_scored(log_file: Path) -> None:
    frame = frame_of(log_file).head(4000)
    calibrator = flexspline.Calibrator(model=MODEL).fit(frame)
    for name in ("output_rad", "error_arcsec"):
        holed = frame.assign(error_arcsec=1.0) if name == "error_arcsec" else frame.copy()
        holed = holed if name == "output_rad" else holed.drop(columns="output_rad")
        holed.loc[100:110, name] = np.nan
        for run in (calibrator.score, calibrator.calibration_.table.replay):
            with pytest.raises(BadInput, match=rf"{name}\[100\]: found nan and in 10 other rows"):
                run(holed)
    assert np.isfinite(calibrator.score(frame))
    with pytest.raises(BadInput, match="the same error in every row"):
        calibrator.score(holed.dropna())


def test_a_drive_is_what_its_file_says(tmp_path: Path) -> None:
    drive = Drive("HHD-95")
    friction = [
        drive.set({"flanks.friction_coefficient": 0.08}),
        drive.set({"flanks": {"friction_coefficient": np.float64(0.08)}}),
        drive.set("flanks.friction_coefficient=0.08"),
        drive.set(flanks__friction_coefficient=0.08),
    ]
    assert len(set(friction)) == 1 and friction[0] != drive
    assert friction[0].fields["flanks"]["friction_coefficient"] == 0.08
    friction[0].save(tmp_path / "d.toml")
    assert Drive(tmp_path / "d.toml") == friction[0] == Drive.from_toml(friction[0].to_toml())
    assert Drive.BUILT_IN[0] == "HHD-95" and drive.ratio == 95.0 and "HHD-95" in drive._repr_html_()


WRONG: list[tuple[Any, str]] = [
    (lambda: Drive("HHD95"), "drive: found 'HHD95', which cannot be read as a file"),
    (lambda: Drive.from_toml("flexspline = 3"), "drive.toml"),
    (lambda: Drive().set(flanks__frction=1), "set flanks.frction=1: flanks.frction: unknown key"),
    (lambda: Drive().set({"flanks.friction_coefficient": object()}), "flanks.friction_coefficient: found object"),
    (lambda: flexspline.simulate("HHD-95", "camm"), 'generator: generator "camm" is not known'),
    (lambda: flexspline.simulate("HHD-95", "cam", path="pich"), 'path: found "pich", which cannot be read as a file'),
    (lambda: flexspline.simulate("HHD-95", "cam", path={"angle": [1]}), "path: found columns angle, required: generator_rad"),
    (lambda: flexspline.simulate("HHD-95", "cam", torque_n_m=1e9), "torque: found 1000000000, allowed: -100000 to 100000"),
    (lambda: flexspline.simulate("HHD-95", "cam", direction=1), "direction: the path has its own"),
    (lambda: flexspline.simulate("HHD-95", "cam", mesh="corse"), 'mesh level "corse": allowed are coarse'),  # type: ignore[arg-type]
    (lambda: flexspline.simulate("HHD-95", "cam", path={"generator_rad": [0], "torque_n_m": [1]}, torque_n_m=2), "torque_n_m: found 2, but the path"),
    (lambda: flexspline.simulate("HHD-95", "cam", threads=0), "threads: found 0, allowed: 1 to 1024"),
    (lambda: flexspline.tables("HHD-95", []), "generators: found none"),
    (lambda: flexspline.tables("HHD-95", "cam", positions=2), "positions: found 2, allowed: 4 to 32"),
    (lambda: flexspline.tables("HHD-95", "cam", torque_n_m=-1), "torque_n_m: found -1; allowed: more than"),
    (lambda: flexspline.calibrate("absent.csv", ratio=101), "absent.csv: No such file"),
    (lambda: flexspline.calibrate([], ratio=101), "logs: found none"),
    (lambda: flexspline.calibrate("a.csv"), "found none of ratio, model, table, allowed: one of"),
    (lambda: flexspline.calibrate("a.csv", ratio=1.0), "ratio: found 1, allowed: 2 to 10000"),
    (lambda: flexspline.calibrate({"a": [1.0, 2.0], "b": [1.0]}, ratio=101), "data: found columns of {'a': 2, 'b': 1} rows"),
    (lambda: flexspline.calibrate({"a": ["x", "y"]}, ratio=101), "data: found no column of numbers"),
    (lambda: flexspline.diagnose({"generator_rad": np.arange(50.0)}, model=MODEL), "data"),
    (lambda: flexspline.diagnose("a.csv", model=MODEL, columns="generator"), "columns: "),
    (lambda: flexspline.diagnose("a.csv", model=MODEL, explain="runout"), "explain: "),
    (lambda: flexspline.diagnose("a.csv", model="absent.toml"), "absent.toml"),
]


@pytest.mark.parametrize(("wrong", "message"), WRONG, ids=[message for _, message in WRONG])
def test_every_wrong_input_gets_one_clear_error(wrong: Any, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput) as raised:
        wrong()
    assert str(raised.value).startswith(message)
    assert "--" not in str(raised.value), "options of the command have no place here"


def test_a_run_that_fails_says_so() -> None:
    with pytest.raises(NotConverged, match="without load and without drag nothing holds the output") as raised:
        flexspline.simulate(Drive().set(output__drag_torque_n_m=0), "cam", path="pitch", mesh="coarse")
    assert isinstance(raised.value, RuntimeError)


def test_logs_without_anything_to_gain_say_so() -> None:
    random = np.random.default_rng(3)
    generator = np.tile(np.concatenate([np.linspace(0.0, 60.0, 2000), np.linspace(60.0, 0.0, 2000)]), 2)
    aimless = {
        "time_s": 0.01 * np.arange(generator.size),
        "generator_rad": generator,
        "output_rad": generator / 101 + random.normal(0.0, 5e-6, generator.size),
    }
    with pytest.raises(NothingGained, match="no table is better than none"):
        flexspline.calibrate(aimless, ratio=101)


def test_a_table_of_another_drive_is_refused(log_file: Path, table: Table) -> None:
    with pytest.raises(BadInput, match="the table was made from the drive with BLAKE3"):
        flexspline.diagnose(log_file, table=table, drive="HHD-95-typical")


def test_an_exception_of_the_progress_ends_the_run() -> None:
    class Enough(Exception):
        pass

    def tell(done: int, total: int, note: str) -> None:
        if done > 2:
            raise Enough(f"{done} of {total}")

    with pytest.raises(Enough, match="of"):
        flexspline.simulate("HHD-95", "cam", path="turn", mesh="coarse", progress=tell)


LONG_RUNS = {
    "simulate": "flexspline.simulate('HHD-95-typical', 'cam', path='turn', mesh='fine')",
    "tables": "flexspline.tables('HHD-95-typical', mesh='fine')",
    "step": "[t.forward(rows, direction=1) for t in [flexspline.Table.open(sys.argv[1])] for rows in [np.zeros(60_000_000)]]",
}


@pytest.mark.skipif(os.name == "nt", reason="signals of a terminal")
@pytest.mark.parametrize("run", LONG_RUNS.values(), ids=LONG_RUNS)
def test_ctrl_c_ends_a_long_run_within_a_second(run: str, image: Path) -> None:
    program = f"""
import signal, sys, time
import numpy as np
import flexspline
# Who is started in the background of a shell has Ctrl-C turned off.
signal.signal(signal.SIGINT, signal.default_int_handler)
print("begun", flush=True)
try:
    {run}
except KeyboardInterrupt:
    print("stopped", flush=True)
    # Whole: the next run is as if nothing had been.
    again = flexspline.simulate("HHD-95", "cam", path={{"generator_rad": [0.0, 0.01]}}, torque_n_m=5, mesh="coarse")
    print("again", again.rows, flush=True)
"""
    with subprocess.Popen([sys.executable, "-c", program, image], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        # Never longer than this, whatever goes wrong.
        watch = threading.Timer(60.0, child.kill)
        watch.daemon = True
        watch.start()
        assert child.stdout.readline() == "begun\n"
        time.sleep(1.0)
        child.send_signal(signal.SIGINT)
        asked = time.monotonic()
        assert child.stdout.readline() == "stopped\n"
        took = time.monotonic() - asked
        assert child.stdout.read() == "again 2\n"
        assert child.wait(20) == 0
    # The machine may be busy.
    assert took < 3.0, f"{took:.1f} s"
