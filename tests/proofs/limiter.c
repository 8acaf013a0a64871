/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Enumeration: the limiter from no correction through every state that it can come to, whatever goals within a range it is given, for small limits
 * in each combination; and the part of a fade, for each length and tick of it. READER is the reader, or one with a planted bug.
 *
 * 0 if the correction never leaves the range of its goals, no tick is beyond rate or acceleration, and no part is beyond 0 to 1. */
#include READER
#include <stdio.h>
#include <string.h>

enum { MOST_GOAL = 24, MOST_SPEED = 13 };

static bool seen[2 * MOST_GOAL + 1][2 * MOST_SPEED + 1];
static unsigned long states, moves, wrong;

/* Goals from `least` to `most`, 0 between them. */
static void walk(int32_t rate, int32_t acceleration, int32_t least, int32_t most)
{
    static int32_t left[(2 * MOST_GOAL + 1) * (2 * MOST_SPEED + 1)][2];
    unsigned count = 1;
    memset(seen, 0, sizeof seen);
    seen[MOST_GOAL][MOST_SPEED] = true;
    left[0][0] = left[0][1] = 0;
    while (count > 0u) {
        const int32_t correction = left[--count][0], speed = left[count][1];
        states++;
        for (int32_t goal = least; goal <= most; goal++) {
            fxt_joint joint = {.rate = rate, .acceleration = acceleration, .correction = correction, .speed = speed};
            const int32_t wanted = stoppable(acceleration, goal - correction), found = moved_by(&joint, wanted, MOST_GOAL);
            const int32_t change = joint.speed - speed;
            moves++;
            if (found < least || found > most || joint.speed < -rate || joint.speed > rate || change < -acceleration || change > acceleration ||
                joint.speed != found - correction) {
                wrong++;
                continue;
            }
            bool *is_seen = &seen[found + MOST_GOAL][joint.speed + MOST_SPEED];
            if (!*is_seen) {
                *is_seen = true;
                left[count][0] = found;
                left[count++][1] = joint.speed;
            }
        }
    }
}

static void fade(uint32_t ticks)
{
    const float step = 1.0f / (float)ticks;
    float before = 2.0f;
    for (uint32_t above = ticks; above > 0u; above--) {
        const float part = (float)above * step;
        if (!(part > 0.0f && part <= 1.0f && part < before)) {
            wrong++;
        }
        before = part;
    }
}

int main(void)
{
    static const int32_t rates[6] = {1, 2, 3, 5, 8, MOST_SPEED};
    for (int i = 0; i < 6; i++) {
        for (int32_t acceleration = 1; acceleration <= 2 * rates[i] + 1; acceleration++) {
            for (int32_t least = -MOST_GOAL; least <= 0; least += 4) {
                for (int32_t most = 0; most <= MOST_GOAL; most += 3) {
                    walk(rates[i], acceleration, least, most);
                }
            }
        }
    }
    for (uint32_t ticks = 1; ticks <= UINT16_MAX; ticks++) {
        fade(ticks);
    }
    printf("%lu states, %lu moves, %lu wrong\n", states, moves, wrong);
    return states > 10000u && wrong == 0u ? 0 : 1;
}
