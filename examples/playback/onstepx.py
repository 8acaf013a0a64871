"""python3 onstepx.py playback.csv STEPS_PER_DEGREE > onstepx_pec.txt

Periodic error commands of OnStepX: an int8 of motor steps for each sidereal second of a generator
turn (its worm). A second plays the entry before its own. Made for tracking in the direction of the
CSV (--direction + or -), the worm index at the generator's zero. Config.h needs the two settings
that are printed on standard error; `:$QZ+#` starts it.
Limits and signs: hjd1964/OnStepX 89c9ca4c src/telescope/mount/pec.
"""

import math
import sys

from curve import arguments, refuse

curve, steps_per_degree = arguments(float)
if steps_per_degree <= 0:
    refuse(f"found {steps_per_degree} steps; allowed: above 0")
steps_per_turn = steps_per_degree * 360
rate = steps_per_turn / 86_400  # motor steps in a sidereal second
worm = round(steps_per_turn / abs(curve.ratio))
entries = round(worm / rate)
if not 61 <= entries <= 30_000:
    curve.refuse(f"a generator turn takes {entries} sidereal seconds; allowed: 61 to 30000")
left = worm / rate - entries  # this rest plays an entry that a whole second plays too: both are 0
free, first = entries - (abs(left) > 1e-9), int(left > 1e-9)
turns = round(abs(curve.ratio) * curve.turns)
mean = lambda second: curve.sign * sum(  # of the correction this long after all zeros of the generator
    curve.at(curve.columns[0], curve.sign * (t / abs(curve.ratio) + second / 86_400) * math.tau) for t in range(turns)
) / turns * steps_per_turn / math.tau
start = mean(0) / rate  # at the generator's zero the correction there was added already
nodes = [round(mean(first + k - start)) for k in range(free)]
buffer = [0] * entries
for k in range(free):
    buffer[(first + k - 1) % entries] = nodes[(k + 1) % free] - nodes[k]
if max(map(abs, buffer)) > min(127, round(rate)):
    curve.refuse(f"{max(map(abs, buffer))} steps in a second; allowed: {min(127, round(rate))}")
print(":$QZZ#", *(f":WR{k},{steps}#" for k, steps in enumerate(buffer)), ":$QZ!#", sep="\n")
room = math.ceil(entries / 16) * 16
print(f"PEC_STEPS_PER_WORM_ROTATION {worm}, PEC_BUFFER_SIZE_LIMIT {room} or more", file=sys.stderr)
