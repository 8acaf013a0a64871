"""python3 odrive.py playback.csv AXIS FROM_DEG TO_DEG STEP_DEG > positions.txt

ODrive holds no map of positions (its anticogging map is a torque), so the host corrects what it
asks for: `p AXIS TURNS` of the ASCII protocol, for a motor encoder on the generator, along a motion
of the output. The correction is that of the direction of the motion.
Limits and signs: odriverobotics/ODrive f9b5419c controller.cpp.
"""

import math

from curve import arguments, refuse

curve, axis, start, end, step = arguments(int, float, float, float)
if axis not in (0, 1) or step <= 0:
    refuse(f"found axis {axis}, step {step}; allowed: 0 or 1, more than 0 deg")
sign = 1 if end >= start else -1
if len(curve.columns) == 1 and sign != curve.sign:
    curve.refuse("the CSV is made for the other direction; export with --direction both")
column = curve.columns[-1 if sign < 0 else 0]
for k in range(int(abs(end - start) / step + 1e-9) + 1):
    asked = math.radians(start + sign * k * step)
    turns = (asked + curve.at(column, asked)) * curve.ratio / math.tau
    print(f"p {axis} {turns:.9f}")
