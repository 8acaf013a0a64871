"""python3 eqmod.py playback.csv [STEPS_PER_TURN [MOTOR_ZERO]] > eqmod_pec.txt

Periodic error curve of EQMOD (EQASCOM): second, motor position, error in arcsec along the tracking,
for each second of a generator turn (its worm). A rate begins half a second late on average, and the
curve is made for that. Made for the direction of the CSV (--direction + or -), northern hemisphere,
gain 1, threshold 0; EQMOD's worm has to be StepsPerWorm. MOTOR_ZERO is the mount's counter at the
generator's zero.
Limits and signs: JPhilC/EQMOD-VB6-To-C- 3da9e78b PEC.bas.
"""

import math

from curve import ARCSEC, arguments, refuse

SIDEREAL = 15.041067  # arcsec/s
DAY_S = 86_164.0905

curve, *given = arguments(float, int, optional=2)
steps, zero = (given + [9_024_000, 0][len(given) :])  # EQ6
if steps <= 0:
    refuse(f"found {steps} steps of a turn; allowed: above 0")
worm = round(steps / abs(curve.ratio))
period = int(DAY_S * worm / steps + 0.5)
if not 30 <= period <= 32_000:
    curve.refuse(f"a generator turn takes {period} s; allowed: 30 to 32000")
turns = round(abs(curve.ratio) * curve.turns)
mean = lambda second: curve.sign * sum(  # of the correction this long after all zeros of the generator
    curve.at(curve.columns[0], curve.sign * (t + second / period) / abs(curve.ratio) * math.tau) for t in range(turns)
) / turns / ARCSEC
start = mean(0) / SIDEREAL  # at the generator's zero the correction there was added already
values = [mean(k + 0.5 - start) for k in range(period)]
# EQMOD takes out the line from the first to the last value.
slope = (values[-1] - values[0]) / (period - 1)
print(*(f"# {line}" for line in curve.comments), sep="\n")
print(f"!WormPeriod={period}\n!StepsPerWorm={worm}\n# time - motor - smoothed PE")
for k, value in enumerate(values):
    motor = (int(SIDEREAL * k * steps / 1_296_000) + zero) % worm
    print(f"{k} {motor} {slope * k - value:.4f}")
