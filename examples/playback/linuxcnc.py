"""python3 linuxcnc.py playback.csv FROM_DEG TO_DEG > flexspline.comp

Screw compensation of LinuxCNC, COMP_FILE_TYPE = 1: nominal position, trim forward, trim backward;
degrees; trims are added to the command, linear between triplets, at most 256 for a joint.
The joint's zero and positive direction are those of the table's output. `--direction both`.
Limits and signs: LinuxCNC/linuxcnc 5c41560e src/emc/motion.
"""

import math

from curve import arguments, refuse

MOST = 256  # EMCMOT_COMP_SIZE

curve, first, last = arguments(float, float)
if len(curve.columns) != 2:
    curve.refuse("a triplet has both directions: export with --direction both")
if not 0 < last - first <= 360:
    refuse(f"found {first} to {last} deg; allowed: up to 360, the second above the first")
step = math.degrees(curve.step_rad)
points = min(MOST, math.ceil((last - first) / step) + 1)
wide = (last - first) / (points - 1)
if wide > 360 / abs(curve.ratio) / 6:
    refuse(f"{MOST} triplets over {last - first} deg are fewer than 6 to a generator turn")
for k in range(points):
    nominal = first + k * wide
    trims = (math.degrees(curve.at(column, math.radians(nominal))) for column in curve.columns)
    print(f"{nominal:.9f}", *(f"{trim:.9f}" for trim in trims))
# LinuxCNC stops reading at the first line that is no triplet: comments stand at the end.
print(*(f"# {line}" for line in curve.comments), sep="\n")
print("# [JOINT_n] COMP_FILE = flexspline.comp, COMP_FILE_TYPE = 1")
