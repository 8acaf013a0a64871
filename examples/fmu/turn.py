#!/usr/bin/env python3
"""A slow turn of the joint of docs/how-to/fmu.md under 10 N.m, without and with compensation: its error, by FMPy."""

import numpy as np
from fmpy import simulate_fmu

time = np.arange(0.0, 6.0, 1e-3)
names = ["output_angle_command", "output_rate_command", "load_torque"]
inputs = np.zeros(len(time), dtype=[(name, float) for name in ["time", *names]])
inputs["time"], inputs["load_torque"] = time, 10.0
inputs["output_angle_command"], inputs["output_rate_command"] = 0.01 * time, 0.01
for compensate in (False, True):
    run = simulate_fmu("out/fmu/flexspline_joint.fmu", stop_time=6.0, step_size=1e-3, output_interval=1e-3, input=inputs,
                       start_values={"compensate": compensate}, output=["output_angle"])
    error = np.degrees(run["output_angle"] - 0.01 * run["time"])[3000:] * 3600.0
    print(f"compensate {compensate}: {np.sqrt(np.mean(error**2)):.2f} arcsec rms")
