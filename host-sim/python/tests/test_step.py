"""The step on arrays is the core: the same bits, any way that arrays lie, from any thread. Wrong if this fails: what an analyst computes is not
what flies."""

from __future__ import annotations

import csv
import subprocess
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexspline
from conftest import PROGRAMS, command, motion, same_json
from flexspline import BadInput, PlayState, Quality, Table

SAID = np.dtype(
    [("output_rad", "<f8"), ("transmission_error_rad", "<f4"), ("uncertainty_rad", "<f4"), ("quality", "u1")]
    + [("generator_rad", "<f8"), ("predicted_error_rad", "<f4"), ("doubt_rad", "<f4"), ("trust", "u1")]
)


def same_bits(a: Any, b: Any) -> bool:
    return bool(np.asarray(a).tobytes() == np.asarray(b).tobytes())


def test_forward_and_inverse_are_the_core_bit_for_bit(table: Table, image: Path, tmp_path: Path) -> None:
    # More rows than are run between two looks for Ctrl-C.
    rows = motion(600_000)
    np.column_stack(rows).astype("<f8").tofile(tmp_path / "rows.f64")
    program = PROGRAMS / "examples/step_rows"
    subprocess.run([program, image, tmp_path / "rows.f64", tmp_path / "out.bin"], check=True, capture_output=True)
    core = np.fromfile(tmp_path / "out.bin", dtype=SAID)
    assert len(core) == 600_000
    assert set(core["quality"]) == set(Quality), "the rows should see every quality"

    said = table.forward(*rows)
    for name in ("output_rad", "transmission_error_rad", "uncertainty_rad", "quality"):
        assert same_bits(said[name], core[name]), name
    asked = table.inverse(said.output_rad, rows[1], rows[2], direction=1)
    for ours, theirs in (("generator_rad",) * 2, ("predicted_error_rad",) * 2, ("uncertainty_rad", "doubt_rad"), ("quality", "trust")):
        assert same_bits(asked[ours], core[theirs]), ours


def test_a_motion_in_two_calls_is_one_motion(table: Table) -> None:
    rows = motion(2000)
    whole, state = table.forward(*rows), PlayState()
    first = table.forward(*(column[:777] for column in rows), state=state)
    saved = PlayState.restore(state.save())
    second = table.forward(*(column[777:] for column in rows), state=state)
    again = table.forward(*(column[777:] for column in rows), state=saved)
    joined = np.concatenate([first.output_rad, second.output_rad])
    assert same_bits(joined, whole.output_rad)
    assert same_bits(second.output_rad, again.output_rad)
    # Without what is known from before, the side of the play is not known.
    assert not same_bits(table.forward(*(column[777:] for column in rows)).output_rad, second.output_rad)
    assert state.is_known and not PlayState().is_known and state.copy().is_known


def test_steady_motion_stands_row_by_row(table: Table) -> None:
    generator, torque, temperature = motion(500)
    direction = np.where(np.arange(500) % 2 == 0, 1, -1)
    said = table.forward(generator, torque, temperature, direction=direction)
    for row in range(0, 500, 50):
        state = PlayState(1 if direction[row] > 0 else -1)
        alone = table.forward(generator[row], torque[row], temperature[row], state=state)
        assert same_bits(alone.output_rad[0], said.output_rad[row])
    load = 20.0 * np.abs(np.sin(generator))
    forward, backward = (table.forward(generator, load, direction=way).error_arcsec for way in (1, -1))
    assert (forward <= backward).all(), "moving forward, the output lags"
    assert (forward < backward).any()


def test_inverse_brings_the_output_to_the_target(table: Table) -> None:
    target = np.linspace(-0.1, 0.1, 1001)
    asked = table.inverse(target, 12.0, 20.0, direction=1)
    reached = table.forward(asked.generator_rad, 12.0, 20.0, direction=1).output_rad
    assert np.abs(reached - target).max() < 1e-8
    resting = PlayState(direction=-1)
    table.forward(asked.generator_rad[::-1], 12.0, state=resting)
    from_rest = table.inverse(target[1:], 12.0, state=resting)
    assert same_bits(from_rest.generator_rad, asked.generator_rad[1:]), "targets ahead are reached forward"
    assert (table.inverse(target, 0.0).uncertain).all(), "nothing is known of the play"


def test_the_torque_that_winds_up_is_found(table: Table) -> None:
    low, high = table.torque_range_n_m
    generator = np.linspace(0.0, 300.0, 400)
    torque = np.where(np.arange(400) % 2, 0.6 * high, 0.6 * low)
    for way in (1, -1):
        output = table.forward(generator, torque, direction=way).output_rad
        said = table.torque(generator, output, direction=way, half_width_arcsec=1.0)
        assert np.abs(said.torque_n_m - torque).max() < 1e-3 * (high - low)
        assert ((said.low_n_m < torque) & (torque < said.high_n_m)).all()
    # In their order, from anywhere in the play; a load that stays says where the output rests.
    output = table.forward(generator, 0.6 * high).output_rad
    assert np.abs(table.torque(generator, output).torque_n_m[50:] - 0.6 * high).max() < 1e-3 * (high - low)
    # Inside the clearance any torque between its ends may be.
    idle = table.torque(1.0, table.forward(1.0).output_rad)
    assert idle.low_n_m[0] <= 0.0 <= idle.high_n_m[0]
    assert np.isnan(table.torque([0.0, 1.0], [np.nan, 0.0]).torque_n_m).tolist() == [True, False]


def test_replay_is_the_command(table: Table, image: Path, tmp_path: Path) -> None:
    generator, torque, temperature = (column[:4000] for column in motion(4000))
    # A load, and no noise about zero: that would count as none.
    torque, temperature = np.sort(np.nan_to_num(torque)), np.nan_to_num(temperature, posinf=20.0)
    output = generator / table.ratio + 1e-4 * np.sin(generator)
    columns = {"generator_rad": generator, "output_rad": output, "torque_n_m": torque, "temperature_c": temperature}
    with (tmp_path / "data.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True))
    command("replay", "--tables", image, tmp_path / "data.csv", "--out", tmp_path)
    with (tmp_path / "replay.csv").open() as file:
        theirs = list(csv.DictReader(file))
    words = {"in range": 0, "uncertain": 1, "extrapolated": 2, "disabled": 3}

    of_file, of_columns = table.replay(tmp_path / "data.csv"), table.replay(columns)
    said = flexspline.Fields((tmp_path / "summary.json").read_text()).json
    # The torque moves nothing here: who reads the file notes that it is none of this output.
    assert any("torque" in note for note in said["notes"])
    for ours, notes in ((of_file, said["notes"]), (of_columns, [])):
        assert list(ours) == list(theirs[0])
        for name in ours:
            written = [words[row[name]] if name == "quality" else float(row[name]) for row in theirs]
            assert ours[name].tolist() == written, name
        same_json(ours.summary.json, {**said, "notes": notes})
    said = table.forward(generator, torque, temperature)
    assert same_bits(said.error_arcsec, of_file.predicted_arcsec)


def test_arrays_lie_as_they_like(table: Table) -> None:
    generator, torque, temperature = motion(3000)
    whole = table.forward(generator, torque, temperature)
    spread_out = np.zeros((3000, 5))
    spread_out[:, 2] = generator
    assert same_bits(table.forward(spread_out[:, 2], torque, temperature).output_rad, whole.output_rad)
    backward = table.forward(generator[::-1][::-1], list(torque), temperature.astype(">f8"))
    assert same_bits(backward.output_rad, whole.output_rad)
    counted = table.forward(np.arange(5), 3, np.float32(20.0))
    assert same_bits(counted.output_rad, table.forward(np.arange(5.0), 3.0, 20.0).output_rad)
    masked = np.ma.masked_array(np.full(3, 5.0), mask=[False, True, False])
    assert table.forward(0.0, masked).disabled.tolist() == [False, True, False]
    assert table.forward(0.0, [1.0, 2.0, 1e3]).extrapolated.tolist() == [False, False, True]
    assert table.forward([]).rows == 0


def test_results_are_written_where_they_are_wanted(table: Table) -> None:
    rows = motion(100)
    first = table.forward(*rows)
    before, arrays = first.output_rad.copy(), list(first.columns.values())
    again = table.forward(rows[0] + 1.0, *rows[1:], out=first)
    assert all(a is b for a, b in zip(arrays, again.columns.values(), strict=True))
    assert not same_bits(again.output_rad, before)
    fresh = table.forward(rows[0] + 1.0, *rows[1:])
    assert same_bits(again.output_rad, fresh.output_rad)
    command_first = table.inverse(before)
    assert table.inverse(before, out=command_first).generator_rad is command_first.generator_rad


WRONG: list[tuple[Callable[[Table], object], str]] = [
    (lambda t: t.forward([0.0, np.nan]), "generator_rad[1]: found NaN, allowed: a finite angle"),
    (lambda t: t.forward(1e12), "generator_rad[0]: found 1000000000000, allowed"),
    (lambda t: t.inverse([0.0, -np.inf]), "output_rad[1]: found -inf"),
    (lambda t: t.forward(np.zeros((2, 3))), "generator_rad: found an array of shape (2, 3), allowed: one number"),
    (lambda t: t.forward(["a"]), "generator_rad: found values of type <U1, allowed: real numbers"),
    (lambda t: t.forward(1j), "generator_rad: found values of type complex128"),
    (lambda t: t.forward([True]), "generator_rad: found values of type bool"),
    (lambda t: t.forward([None]), "generator_rad: found values of type object"),
    (lambda t: t.forward(np.zeros(3), np.zeros(2)), "torque_n_m: found 2 values, allowed: one, or 3 as there are rows"),
    (lambda t: t.forward(0.0, direction=0), "direction: found 0, allowed: 1 or -1"),
    (lambda t: t.forward(0.0, direction=1, state=PlayState()), "direction: found it beside state"),
    (lambda t: t.forward(np.zeros(3), out=t.forward(np.zeros(2))), "out.output_rad: found float64 of shape (2,), allowed: float64 of shape (3,)"),
    (lambda t: t.forward(0.0, out=t.inverse(0.0)), "out: found columns generator_rad"),
    (lambda t: (lambda p: t.forward(p.output_rad, out=p))(t.forward(np.zeros(2))), "out.output_rad: found memory of an input"),
    (lambda t: t.replay(generator_rad=[0.0]), "replay: generator_rad and one of output_rad and error_arcsec"),
    (lambda t: t.replay(7), "data: found int, allowed: the path of a log, a DataFrame"),
    (lambda t: t.replay("absent.csv"), "absent.csv: No such file"),
    (lambda t: t.plot("ripples"), "what: found 'ripples', allowed: 'wind-up', 'ripple'"),  # type: ignore[arg-type]
    (lambda t: PlayState.restore(b"x" * 28), "play state: found 28 bytes that are no whole saved state"),
    (lambda t: Table.open("absent.fxt"), "absent.fxt: No such file"),
    (lambda t: Table.open(b"FXT"), "image: 3 bytes, an image has at least"),
    (lambda t: Table.open(t.image[:-1]), "image: "),
]


@pytest.mark.parametrize(("wrong", "message"), WRONG, ids=[message for _, message in WRONG])
def test_every_wrong_call_gets_one_clear_error(table: Table, wrong: Callable[[Table], object], message: str) -> None:
    with pytest.raises(BadInput) as raised:
        wrong(table)
    assert str(raised.value).startswith(message)
    assert isinstance(raised.value, ValueError)


def test_what_is_refused_leaves_the_state_as_it_was(table: Table) -> None:
    state = PlayState(direction=1)
    before = state.save()
    with pytest.raises(BadInput):
        table.forward([0.0, 1.0, np.nan], state=state)
    assert state.save() == before


def test_a_flipped_byte_is_refused(image: Path) -> None:
    content = bytearray(image.read_bytes())
    content[len(content) // 2] ^= 1
    with pytest.raises(BadInput, match="image: "):
        Table.open(content)


def test_threads_run_beside_each_other(table: Table) -> None:
    rows = motion(400_000)
    expected = table.forward(*rows).output_rad
    found: list[Any] = [None] * 4

    def run(k: int) -> None:
        found[k] = table.forward(*rows).output_rad

    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    # Python goes on while the rows are computed: with the lock held it would not get here more than a few times.
    turns = 0
    while any(thread.is_alive() for thread in threads):
        threads[turns % 4].join(1e-4)
        turns += 1
    assert turns > 10
    assert all(same_bits(one, expected) for one in found)


def test_a_table_says_what_it_is(table: Table, image: Path, tmp_path: Path) -> None:
    info = flexspline.Fields(image.with_suffix(".json").read_text())
    assert (table.table_id, table.generator) == (info.table_id, info.generator)
    assert table.torque_nodes_n_m.tolist() == pytest.approx(info.torque_nodes_n_m, rel=1e-6)
    assert table.torque_range_n_m == (-200.0, 200.0) and table.temperature_range_c == (-60.0, 80.0)
    assert (table.ratio, table.flexspline_teeth, table.fixed) == (95.0, 188, "flexspline")
    assert table.drive_hash == info.drive_blake3 == flexspline.Drive("HHD-95").drive_hash
    assert table.image == image.read_bytes()
    assert Table.open(table.save(tmp_path / "again.fxt")[0]).table_id == table.table_id
    assert table.table_id in table._repr_html_() and table.table_id in repr(table)
