"""python3 moteus.py playback.csv [SOURCE] > moteus.cfg

Encoder compensation of moteus for the source (0 to 2) on the generator: 256 int8 over a generator
turn, in 127ths of a scale in turns, added to the reading. It holds what repeats every generator
turn. Write it with moteus_tool --write-config, then `conf write`; the zero of the source has to be
the generator's. Every line is a command to the device, so there is no comment.
Limits and signs: mjbots/moteus db1a7623 fw/motor_position.h.
"""

import math

from curve import arguments, refuse

SIZE = 256  # kCompensationSize; values hold at the left edge of their bin
SAMPLES = 4096  # of a generator turn, at least: 16 to a bin

curve, *given = arguments(int, optional=1)
source = given[0] if given else 0
if source not in (0, 1, 2):
    refuse(f"found source {source}; allowed: 0, 1, 2")
sums, weights = [0.0] * SIZE, [0.0] * SIZE
between = math.ceil(SAMPLES * abs(curve.ratio) * curve.turns / len(curve.both))  # samples to a point
for k in range(len(curve.both) * between):
    output = k * curve.step_rad / between
    correction = curve.at(curve.both, output)
    # The generator stands at the corrected command, and there the output errs by minus the correction.
    generator = (output + correction) * curve.ratio / math.tau
    turns = -correction * curve.ratio / math.tau
    place, share = divmod(generator % 1 * SIZE, 1)
    for bin, weight in ((int(place) % SIZE, 1 - share), ((int(place) + 1) % SIZE, share)):
        sums[bin] += weight * turns
        weights[bin] += weight
values = [total / weight for total, weight in zip(sums, weights)]
scale = max(map(abs, values)) or 1.0
name = f"conf set motor_position.sources.{source}.compensation"
for k, value in enumerate(values):
    print(f"{name}_table.{k} {round(value / scale * 127)}")
print(f"{name}_scale {scale:.9g}")
