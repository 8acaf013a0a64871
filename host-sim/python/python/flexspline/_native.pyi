from collections.abc import Callable
from typing import Any, TypedDict, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drive", "PlayState", "Table", "__version__", "calibrate", "diagnose", "look", "project", "simulate", "synthesize", "tables"]

__version__: str

_Floats = NDArray[np.float64]
_Teller = Callable[[int, int, str], object] | None
_Log = str | tuple[str, bytes]
_Reading = tuple[str, float | None, float | None]
_MadeTable = tuple[str, bytes, str, str, str, str | None]

class _Header(TypedDict):
    table_id: str
    generator: str
    ratio: float
    flexspline_teeth: int
    circular_spline_teeth: int
    fixed: str
    torque_range_n_m: list[float]
    temperature_range_c: list[float]
    torque_nodes_n_m: _Floats
    temperature_nodes_c: _Floats
    dead_zone_n_m: float
    drive_hash: str
    tool_version: str
    mesh_level: str
    error_limit_rad: float
    projection_rms_rad: float
    projection_worst_rad: float

@final
class Drive:
    @staticmethod
    def built_in() -> list[str]: ...
    @staticmethod
    def named(name: str) -> Drive | None: ...
    @staticmethod
    def from_toml(file_name: str, text: str) -> Drive: ...
    def with_sets(self, sets: list[str]) -> Drive: ...
    def to_toml(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def drive_hash(self) -> str: ...
    @property
    def ratio(self) -> float: ...

@final
class PlayState:
    def __new__(cls, direction: int | None = None) -> PlayState: ...
    @staticmethod
    def restore(saved: bytes) -> PlayState: ...
    def save(self) -> bytes: ...
    def copy(self) -> PlayState: ...
    @property
    def is_known(self) -> bool: ...
    @property
    def offset_rad(self) -> float: ...
    @property
    def uncertainty_rad(self) -> float: ...

@final
class Table:
    arcsec_per_rad: float
    @staticmethod
    def check(name: str, image: bytes) -> Table: ...
    @property
    def image(self) -> bytes: ...
    def header(self) -> _Header: ...
    def forward(
        self,
        generator_rad: _Floats,
        torque_n_m: _Floats,
        temperature_c: _Floats,
        direction: NDArray[np.int8] | None,
        state: PlayState | None,
        output_rad: _Floats,
        transmission_error_rad: NDArray[np.float32],
        uncertainty_rad: NDArray[np.float32],
        quality: NDArray[np.uint8],
    ) -> None: ...
    def inverse(
        self,
        target_rad: _Floats,
        torque_n_m: _Floats,
        temperature_c: _Floats,
        direction: NDArray[np.int8] | None,
        state: PlayState | None,
        generator_rad: _Floats,
        predicted_error_rad: NDArray[np.float32],
        uncertainty_rad: NDArray[np.float32],
        quality: NDArray[np.uint8],
    ) -> None: ...
    def torque(
        self,
        generator_rad: _Floats,
        output_rad: _Floats,
        temperature_c: _Floats,
        half_width_rad: _Floats,
        direction: NDArray[np.int8] | None,
        state: PlayState | None,
        hysteresis: str | None,
        torque_n_m: _Floats,
        low_n_m: _Floats,
        high_n_m: _Floats,
    ) -> None: ...
    def replay(
        self, generator_rad: _Floats, error_arcsec: _Floats, torque_n_m: _Floats, temperature_c: _Floats
    ) -> tuple[dict[str, Any], str]: ...
    def replay_file(self, file: str, temperature_c: float) -> tuple[dict[str, Any], str]: ...

def simulate(
    drive: Drive,
    generator_name: str,
    path: str,
    points: tuple[_Floats, _Floats | None, _Floats | None] | None,
    *,
    increment_rad: float | None,
    direction: int | None,
    torque_n_m: float | None,
    temperature_c: float | None,
    mesh: str,
    solver: str,
    threads: int | None,
    progress: _Teller,
) -> tuple[dict[str, Any], str]: ...
def tables(
    drive: Drive,
    generators: list[str],
    *,
    torque_n_m: float | None,
    most_nodes: int | None,
    node_tolerance_arcsec: float | None,
    positions: int,
    temperatures_c: list[float] | None,
    mesh: str,
    solver: str,
    threads: int | None,
    progress: _Teller,
) -> list[_MadeTable]: ...
def project(
    drive: Drive,
    generator_name: str,
    file: str,
    *,
    half_width_arcsec: float | None,
    deviation_arcsec: float | None,
) -> _MadeTable: ...
def synthesize(
    known: float | str | bytes,
    drive: Drive,
    effects: list[str],
    motion: tuple[int, int, float, float],
    temperatures_c: tuple[float, float],
    noise_arcsec: tuple[float, float],
    spread: bool,
    seed: int,
) -> tuple[str, str]: ...
def look(logs: list[_Log]) -> tuple[str, str]: ...
def calibrate(
    logs: list[_Log],
    known: float | str | bytes,
    generator_name: str,
    reading: _Reading,
    split: bool,
    *,
    threads: int | None,
    progress: _Teller,
) -> tuple[str, _MadeTable, dict[str, Any]]: ...
def diagnose(
    log: _Log,
    known: float | str | bytes,
    drive: Drive,
    generator_name: str,
    reading: _Reading,
    *,
    kernels: str | None,
    explain: str | None,
    threads: int | None,
    progress: _Teller,
) -> tuple[str, str | None, _MadeTable | None, tuple[str, str] | None, dict[str, Any]]: ...
