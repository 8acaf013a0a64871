/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Enumeration: forward after inverse, for every STRIDE-th of the 2^32 angles of an output turn. Both directions, three torques of the table, a
 * temperature node and a place between nodes take turns.
 *
 * inverse STRIDE TABLE.fxt: 0 if each output is within what the table states (error of the inverse, and 8 counts of rounding) of its target. */
#include READER
#include <stdio.h>
#include <stdlib.h>

static uint8_t image[100000];

/* How far forward after inverse is from a target, counts; more than any table states where there is no answer. */
static int64_t missed(const fxt_table *table, const point *at, int64_t target, bool backward)
{
    const fxt_command command = aim_moving(table, at, target, backward);
    const fxt_play before = fxt_play_after(backward ? FXT_BACKWARD : FXT_FORWARD);
    play_state play = state_of(&before);
    const fxt_prediction now = follow(table, at, &play, command.generator);
    const int64_t off = minus(now.output, target);
    return now.quality == FXT_DISABLED || command.quality == FXT_DISABLED ? INT32_MAX : off < 0 ? -off : off;
}

int main(int count, char **arguments)
{
    FILE *file = count == 3 ? fopen(arguments[2], "rb") : NULL;
    if (file == NULL) {
        return 2;
    }
    const uint64_t stride = strtoull(arguments[1], NULL, 10);
    const size_t length = fread(image, 1, sizeof image, file);
    (void)fclose(file);
    fxt_table table;
    if (stride == 0u || fxt_open(&table, image, length).reason != FXT_OK) {
        return 2;
    }
    const fxt_info info = fxt_tell(&table);
    const float cold = info.temperature_range_c[0], between = cold + 0.3f * (info.temperature_range_c[1] - cold);
    point places[6];
    for (uint32_t i = 0u; i < 6u; i++) {
        const float torque = i % 3u == 0u ? info.torque_range_n_m[0] : info.torque_range_n_m[1] * (i % 3u == 1u ? 0.3f : 1.0f);
        places[i] = locate(&table, torque, i < 3u ? cold : between);
    }
    int64_t worst = 0;
    uint64_t angles = 0, outside = 0;
    for (uint64_t angle = 0; angle < (UINT64_C(1) << 32); angle += stride) {
        const int64_t size = missed(&table, &places[angles % 6u], (int64_t)angle, angles % 12u >= 6u);
        worst = size > worst ? size : worst;
        outside += size > table.hold ? 1u : 0u;
        angles++;
    }
    printf("%llu angles: at most %lld counts from the target, %d stated, %llu outside\n", (unsigned long long)angles, (long long)worst,
           table.hold, (unsigned long long)outside);
    return angles > 0u && outside == 0u ? 0 : 1;
}
