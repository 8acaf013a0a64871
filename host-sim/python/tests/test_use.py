"""What makes it a package: types, pictures, tables of others, the notebook, the examples of the docstrings and of the page."""

from __future__ import annotations

import doctest
import importlib
import pickle
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pandas
import pyarrow
import pytest

import flexspline
from conftest import MODEL, PROJECT
from flexspline import Columns, Table

matplotlib.use("Agg")

USER = '''
import numpy as np
from numpy.typing import NDArray
import flexspline
from flexspline import Drive, PlayState, Prediction, Quality, Table

drive: Drive = Drive("HHD-95").set({"flanks.friction_coefficient": 0.08})
run = flexspline.simulate(drive, "cam", path="pitch", torque_n_m=50.0)
error: NDArray[np.float64] = run.error_arcsec
table: Table = Table.open("out/cam.fxt")
state = PlayState(direction=1)
said: Prediction = table.forward(np.linspace(0, 6, 100), 12.0, state=state)
good: NDArray[np.bool_] = said.quality == Quality.IN_RANGE
made: dict[str, Table] = flexspline.tables(drive, ["cam"])
verdict: str = flexspline.diagnose({"a": error}, model="nominal.toml", progress=False).verdict
half: float = flexspline.calibrate(["a.csv"], ratio=101).half_width_arcsec
axes = table.plot("ripple")
'''
WRONG_USER = ('flexspline.simulate(drive, "cam", mesh="corse")', 'table.forward("a", trque=1)', "flexspline.calibrate(['a'], ratio='x')")


@pytest.fixture(scope="session")
def cache(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What mypy has seen of numpy, which takes most of its time."""
    return str(tmp_path_factory.mktemp("mypy"))


def mypy(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, cwd=cwd, check=False)


def test_a_strictly_typed_program_passes_and_a_wrong_one_does_not(tmp_path: Path, cache: str) -> None:
    (tmp_path / "user.py").write_text(USER)
    said = mypy("mypy", "--strict", "--cache-dir", cache, "user.py", cwd=tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr
    (tmp_path / "user.py").write_text(USER + "\n".join(WRONG_USER))
    said = mypy("mypy", "--strict", "--cache-dir", cache, "user.py", cwd=tmp_path)
    assert said.returncode != 0 and f"Found {len(WRONG_USER)} errors" in said.stdout, said.stdout


def test_stub_and_module_agree(tmp_path: Path) -> None:
    said = mypy("mypy.stubtest", "flexspline._native", cwd=tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr


def test_the_package_is_strictly_typed_itself(tmp_path: Path, cache: str) -> None:
    settings = PROJECT / "host-sim/python/pyproject.toml"
    said = mypy("mypy", "--config-file", str(settings), "--cache-dir", cache, "-p", "flexspline", cwd=tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr


def test_examples_of_the_docstrings_hold(image: Path) -> None:
    tried = 0
    for name in ("", "._drive", "._runs", "._table", "._columns", "._fields"):
        result = doctest.testmod(importlib.import_module(f"flexspline{name}"))
        assert result.failed == 0
        tried += result.attempted
    assert tried >= 3


def test_all_that_is_public_is_explained() -> None:
    for name in flexspline.__all__:
        value = getattr(flexspline, name)
        if callable(value):
            assert value.__doc__, name
            members = vars(value) if isinstance(value, type) else {}
            told = [m for m in members if not m.startswith("_") and (callable(members[m]) or isinstance(members[m], property))]
            assert all(getattr(value, member).__doc__ for member in told), name


def test_pictures_have_axes_with_units(table: Table, log_file: Path) -> None:
    run = flexspline.simulate("HHD-95", "cam", path="pitch", torque_n_m=20, mesh="coarse")
    replayed = table.replay(generator_rad=np.linspace(0, 1, 100), error_arcsec=np.zeros(100))
    drawn = {
        "generator angle, rad / transmission error, arcsec": [run.plot()],
        "load at the output, N·m / transmission error, arcsec": [table.plot(), table.plot(temperature_c=60)],
        "generator angle, rad / ripple about its mean, arcsec": [table.plot("ripple", torques_n_m=[10, 20])],
        "generator angle, rad / error at the output, arcsec": [replayed.plot()],
        "output angle, deg / error at the output, arcsec": [flexspline.calibrate(log_file, model=MODEL).plot()],
        "time, s / error at the output, arcsec": [flexspline.diagnose(log_file, model=MODEL).plot()],
    }
    for labels, axes in drawn.items():
        for ax in axes:
            assert f"{ax.get_xlabel()} / {ax.get_ylabel()}" == labels
            assert ax.get_title() and any(len(line.get_xdata()) for line in ax.lines)  # type: ignore[arg-type]
    ax = run.plot()
    assert run.plot(ax=ax) is ax and len(ax.lines) == 2
    matplotlib.pyplot.close("all")


def test_columns_go_to_pandas_and_arrow() -> None:
    columns = Columns({"a_rad": np.array([1.0, 2.0]), "settled": np.array([True, False]), "word": ["x", "y"]})
    frame, arrow = columns.to_pandas(), columns.to_arrow()
    assert list(frame.columns) == list(columns) == arrow.column_names
    assert frame["a_rad"].tolist() == arrow["a_rad"].to_pylist() == [1.0, 2.0]
    assert pyarrow.table(columns).equals(arrow), "by the C interface"
    assert pandas.DataFrame(dict(columns)).equals(frame)
    assert columns.rows == 2 and columns.a_rad[1] == 2.0 and "a_rad" in columns._repr_html_()
    with pytest.raises(AttributeError, match="has no column 'b'; it has a_rad, settled, word"):
        _ = columns.b


def test_fields_are_attributes_all_the_way_down() -> None:
    fields = flexspline.Fields({"a": {"b_arcsec": 1.5}, "list": [{"c": 2}], "none": None})
    assert fields.a.b_arcsec == 1.5 and fields.list[0].c == 2 and fields.none is None
    assert flexspline.Fields(fields.to_json()) == fields and "a" in fields and "b_arcsec" in dir(fields.a)
    with pytest.raises(AttributeError, match="has no field 'd'; it has a, list, none"):
        _ = fields.d


def test_what_goes_to_other_processes_arrives(table: Table) -> None:
    made = flexspline.table_from_samples(PROJECT / "tests/firmware/samples/cam.samples.csv")
    state = flexspline.PlayState()
    said = table.forward(np.linspace(0, 1, 50), 12.0, state=state)
    for one in (table, made, said, state, flexspline.PlayState(), flexspline.Drive("CUP-95")):
        again = pickle.loads(pickle.dumps(one))
        assert repr(again) == repr(one) and type(again) is type(one)
    assert pickle.loads(pickle.dumps(made)).info == made.info
    assert pickle.loads(pickle.dumps(said)).output_rad.tobytes() == said.output_rad.tobytes()


def test_what_is_optional_is_only_asked_for_where_it_is_needed(image: Path) -> None:
    program = """
import sys
for name in ("matplotlib", "pandas", "pyarrow", "tqdm"):
    sys.modules[name] = None
import flexspline
table = flexspline.Table.open(sys.argv[1])
assert dict(table.forward([0.0, 1.0]))["quality"].size == 2
flexspline.simulate("HHD-95", "cam", path="pitch", torque_n_m=5, mesh="coarse", progress=True)
for call in (table.plot, table.forward(0.0).to_pandas, table.forward(0.0).to_arrow):
    try:
        call()
    except ImportError:
        continue
    raise SystemExit(f"{call} needs nothing")
"""
    said = subprocess.run([sys.executable, "-c", program, image], capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr


def test_the_notebook_runs_and_is_stripped(tmp_path: Path) -> None:
    import nbclient
    import nbformat

    notebook = nbformat.read(PROJECT / "examples/python/first_steps.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(cells) >= 4 and not any(cell.outputs or cell.execution_count for cell in cells)
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": tmp_path}}).execute()
    shown = [output for cell in cells for output in cell.outputs]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert not any(output.output_type == "error" for output in shown)


def test_the_python_of_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, image: Path, log_file: Path) -> None:
    """Block after block, as they stand there, in a folder with the table and the log that the page speaks of."""
    page = (PROJECT / "docs/how-to/python.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 6
    (tmp_path / "out/log").mkdir(parents=True)
    (tmp_path / "out/log/data.csv").write_bytes(log_file.read_bytes())
    (tmp_path / "examples").symlink_to(PROJECT / "examples")
    (tmp_path / "tests").symlink_to(PROJECT / "tests")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "docs/how-to/python.md", "exec"), names)
    for name in flexspline.__all__:
        kind = getattr(flexspline, name)
        if callable(kind) and not isinstance(kind, type):
            assert f"{name}(" in page, f"{name} has no example"
    matplotlib.pyplot.close("all")
