"""python3 beckhoff_cnc.py playback.csv > achskw.lis

Compensation value list kw.ssfk of TwinCAT CNC (TF5200): position errors, actual less setpoint, in
0.0001 deg, a column for each direction. `--direction both`, 16 points to a turn or more.
Add kopf.achs_nr and kopf.log_achs_name of the axis; switch on by lr_param.ssfk 1.
Limits and signs: infosys.beckhoff.com, TF5200 308683659, P-COMP-00017 to 00025.
"""

import math

from curve import arguments

STEPS = 1440  # fewer than 1500 entries are read without kw.ssfk.max_points; 2500 units apart

(curve,) = arguments()
if curve.turns != 1 or len(curve.columns) != 2:
    curve.refuse("a list has one output turn and both directions: export with --direction both")
print(*(f"# {line}" for line in curve.comments), sep="\n")
print("# values: position error, actual less setpoint, in 0.0001 deg")
header = {"unit": 1, "interval": 3_600_000 // STEPS, "kw_startpos": 0, "kw_nr_max": STEPS + 1}
for name, value in {**header, "bilateral": 1, "modulo": 1}.items():
    print(f"kw.ssfk.{name} {value}")
for name, column in zip(("pos", "neg"), curve.columns):
    for k in range(STEPS + 1):
        error = -math.degrees(curve.at(column, math.tau * k / STEPS))
        print(f"kw.ssfk.table[{k}].{name} {round(error * 1e4)}")
