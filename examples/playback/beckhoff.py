"""python3 beckhoff.py playback.csv > flexspline_compensation.TcGVL.st

Table of MC_TableBasedPositionCompensation (TwinCAT NC, Tc2_MC2): Compensation is added to Position,
degrees, equidistant. One value for all directions of the CSV: their mean, so where the joint always
comes from one side, export with --direction + or - and set TableParameter.Direction so.
Limits and signs: infosys.beckhoff.com, Tc2_MC2 17316396939, 12929471627.
"""

import math

from curve import arguments

MOST = 20_000  # entries that a PLC program is still edited with: a guess

(curve,) = arguments()
if curve.turns != 1:
    curve.refuse(f"the correction repeats after {curve.turns} output turns; a modulo axis has one")
points = len(curve.both)
if points >= MOST:
    most = MOST // round(abs(curve.ratio))
    curve.refuse(f"{points + 1} entries; allowed: {MOST}; export with --points-per-turn {most} or less")
print("(*", *(f"  {line}" for line in curve.comments), "*)", sep="\n")
print("{attribute 'qualified_only'}\nVAR_GLOBAL")
print(
    "    FlexsplineParameter : ST_PositionCompensationTableParameter := (MinPosition := 0.0, "
    f"MaxPosition := 360.0, NoOfTableElements := {points + 1}, Modulo := TRUE);"
)
print(f"    FlexsplineTable : ARRAY [0..{points}] OF ST_PositionCompensationTableElement := [")
for k in range(points + 1):  # the last entry repeats the first
    position, value = 360 * k / points, math.degrees(curve.both[k % points])
    comma = "," if k < points else ""
    print(f"        (Position := {position:.9f}, Compensation := {value:.9f}){comma}")
print("    ];\nEND_VAR")
