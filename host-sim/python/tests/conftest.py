"""What the tests share: the command and the Rust loop that they compare with, tables, a log.

FLEXSPLINE_PROGRAMS is the folder of the programs (`target/release`), FLEXSPLINE_PROJECT the top of the project; `tests/run python` sets both.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import flexspline

PROGRAMS = Path(os.environ["FLEXSPLINE_PROGRAMS"])
PROJECT = Path(os.environ["FLEXSPLINE_PROJECT"])
MODEL = PROJECT / "examples/own_drive/rt1_25.toml"


def command(*words: object, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Runs the command quietly."""
    said = subprocess.run([PROGRAMS / "flexspline", *map(str, words), "-q"], capture_output=True, text=True, check=False)
    assert not check or said.returncode == 0, said.stderr
    return said


def read_json(path: Path) -> dict[str, Any]:
    value = json.loads(path.read_text())
    assert isinstance(value, dict)
    return value


def same_json(ours: dict[str, Any], theirs: dict[str, Any]) -> None:
    """The same but for the command line and the time that it took."""
    differing = {"command", "wall_s", "processor_s"}

    def without(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: without(of) for name, of in value.items() if name not in differing}
        return [without(of) for of in value] if isinstance(value, list) else value

    assert without(ours) == without(theirs)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("shared")


@pytest.fixture(scope="session")
def image(shared: Path) -> Path:
    """The table of the cam from the samples that contact FEM made, by the command."""
    samples = PROJECT / "tests/firmware/samples/cam.samples.csv"
    command("tables", "--no-report", "--generator", "cam", "--from-samples", samples, "--out", shared)
    return shared / "cam.fxt"


@pytest.fixture(scope="session")
def table(image: Path) -> flexspline.Table:
    return flexspline.Table.open(image)


@pytest.fixture(scope="session")
def log_file(shared: Path) -> Path:
    """A log of a catalogue drive with an eccentric encoder in it."""
    effect = "output_encoder_eccentricity:amplitude_arcsec=25"
    command("synthesize", "--model", MODEL, "--effect", effect, "--seed", 1, "--out", shared / "log")
    return shared / "log/data.csv"


def motion(rows: int, seed: int = 7) -> list[NDArray[np.float64]]:
    """Generator angle, torque and temperature: back and forth, with loads and temperatures beyond the table too, and some that are none."""
    random = np.random.default_rng(seed)
    generator = np.cumsum(random.normal(0.0, 0.05, rows)) + 40.0 * np.sin(np.linspace(0.0, 20.0, rows))
    torque = random.uniform(-250.0, 250.0, rows)
    torque[:: 5] = random.uniform(-0.05, 0.05, torque[::5].size)
    temperature = random.uniform(-70.0, 90.0, rows)
    torque[11::1013] = np.nan
    temperature[17::1019] = np.inf
    return [generator, torque, temperature]
