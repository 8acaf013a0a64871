"""Strain wave (harmonic) drives: contact FEM, compensation tables, calibration and diagnosis, and the core's step on numpy arrays.

Angles are rad, torque N·m at the output (positive turns it forward), temperature °C, lengths mm; errors are arc-seconds (``_arcsec``) at
the output, positive when it leads. The unit is the end of a name. What needs matplotlib, pandas or pyarrow says so.

>>> Table.open("out/cam.fxt").forward([0.0, 0.1, 0.2], 12.0).error_arcsec  # doctest: +SKIP
"""

from ._columns import Columns
from ._drive import Drive
from ._errors import BadInput, FlexsplineError, NotConverged, NothingGained
from ._fields import Fields
from ._native import __version__
from ._runs import (
    GENERATORS,
    Calibration,
    Calibrator,
    Diagnosis,
    Look,
    Simulation,
    Synthesized,
    calibrate,
    diagnose,
    look,
    simulate,
    synthesize,
    table_from_samples,
    tables,
)
from ._table import ARCSEC_PER_RAD, Answer, Command, PlayState, Prediction, Quality, Replay, Table, WindUp

__all__ = [
    "ARCSEC_PER_RAD",
    "GENERATORS",
    "Answer",
    "BadInput",
    "Calibration",
    "Calibrator",
    "Columns",
    "Command",
    "Diagnosis",
    "Drive",
    "Fields",
    "FlexsplineError",
    "Look",
    "NotConverged",
    "NothingGained",
    "PlayState",
    "Prediction",
    "Quality",
    "Replay",
    "Simulation",
    "Synthesized",
    "Table",
    "WindUp",
    "__version__",
    "calibrate",
    "diagnose",
    "look",
    "simulate",
    "synthesize",
    "table_from_samples",
    "tables",
]
