"""Pictures: one call each, axes back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ._errors import BadInput

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._runs import Calibration, Diagnosis, Simulation
    from ._table import Replay, Table

_CURVES = 5
"""Torques of a ripple picture, where none are given."""
_PITCHES = 2
_POINTS = 400


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from None
    return pyplot.subplots(layout="constrained")[1]


def _labelled(ax: Axes, x: str, y: str, title: str, legend: bool = True) -> Axes:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.set_title(title)
    ax.grid(alpha=0.3)
    if legend:
        ax.legend()
    return ax


def simulation(run: Simulation, ax: Axes | None) -> Axes:
    ax = _axes(ax)
    ax.plot(run.generator_rad, run.error_arcsec)
    load = run.summary.torque_n_m
    at = "" if load is None else f", {load:g} N·m"
    title = f"{run.summary.drive}, {run.summary.generator}, path {run.summary.path}{at}"
    return _labelled(ax, "generator angle, rad", "transmission error, arcsec", title, legend=False)


def replay(rows: Replay, ax: Axes | None) -> Axes:
    ax = _axes(ax)
    ax.plot(rows.generator_rad, rows.measured_arcsec, ".", markersize=2, label="as measured")
    ax.plot(rows.generator_rad, rows.residual_arcsec, ".", markersize=2, label="residual")
    return _labelled(ax, "generator angle, rad", "error at the output, arcsec", f"table {rows.summary.table_id}")


def table(
    of: Table, what: str, torques_n_m: Sequence[float] | None, temperature_c: float | None, ax: Axes | None
) -> Axes:
    nodes = of.temperature_nodes_c
    temperature = float(nodes[len(nodes) // 2]) if temperature_c is None else temperature_c
    title = f"{of.generator}, table {of.table_id}, {temperature:g} °C"
    if what == "wind-up":
        ax = _axes(ax)
        torque = np.linspace(*of.torque_range_n_m, _POINTS)
        for direction, name in ((1, "forward"), (-1, "backward")):
            ax.plot(torque, of.forward(0.0, torque, temperature, direction=direction).error_arcsec, label=name)
        return _labelled(ax, "load at the output, N·m", "transmission error, arcsec", title)
    if what == "ripple":
        ax = _axes(ax)
        pitch = 2 * np.pi / (of.flexspline_teeth if of.fixed == "flexspline" else of.circular_spline_teeth)
        generator = np.linspace(0, _PITCHES * pitch, _POINTS)
        torques = np.linspace(*of.torque_range_n_m, _CURVES) if torques_n_m is None else torques_n_m
        for load in torques:
            error = of.forward(generator, float(load), temperature, direction=1).error_arcsec
            ax.plot(generator, error - error.mean(), label=f"{load:g} N·m")
        return _labelled(ax, "generator angle, rad", "ripple about its mean, arcsec", title)
    raise BadInput(f"what: found {what!r}, allowed: 'wind-up', 'ripple'")


def calibration(made: Calibration, ax: Axes | None) -> Axes:
    ax = _axes(ax)
    output = np.degrees(made.shown.output_rad)
    ax.plot(output, made.shown.measured_arcsec, ".", markersize=2, label="as measured")
    ax.plot(output, made.shown.left_arcsec, ".", markersize=2, label="residual")
    return _labelled(ax, "output angle, deg", "error at the output, arcsec", f"calibration, table {made.table.table_id}")


def diagnosis(found: Diagnosis, ax: Axes | None) -> Axes:
    ax = _axes(ax)
    rows = found.rows
    timed = bool(np.isfinite(rows.time_s).all())
    x = rows.time_s if timed else np.arange(rows.rows)
    ax.plot(x, rows.error_arcsec - rows.recalibrated_arcsec, ".", markersize=2, label="residual of the nominal model")
    if found.causes:
        ax.plot(x, rows.error_arcsec - rows.extended_arcsec, ".", markersize=2, label="left with the causes")
    named = ", ".join(cause.name for cause in found.causes) or found.finding.replace("_", " ")
    return _labelled(ax, "time, s" if timed else "row", "error at the output, arcsec", named)
