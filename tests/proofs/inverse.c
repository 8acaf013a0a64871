/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Enumeration: forward after inverse, for every STRIDE-th of the 2^32 angles of a generator turn, both directions, at torques of the table.
 *
 * inverse STRIDE TABLE.fxt: 0 if each output is within what the table states (error of the inverse, and 8 counts of rounding) of its target. */
#include READER
#include <stdio.h>
#include <stdlib.h>

static uint8_t image[100000];

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
    const float middle = 0.5f * (info.temperature_range_c[0] + info.temperature_range_c[1]);
    const float torques[3] = {info.torque_range_n_m[0], 0.3f * info.torque_range_n_m[1], info.torque_range_n_m[1]};
    int64_t worst = 0;
    uint64_t angles = 0, outside = 0;
    for (uint64_t angle = 0; angle < (UINT64_C(1) << 32); angle += stride) {
        const int64_t target = nominal_output(&table, (int64_t)angle);
        /* The torques take turns. */
        const float torque = torques[angles % 3u];
        for (int side = 0; side < 2; side++) {
            const fxt_direction direction = side == 0 ? FXT_FORWARD : FXT_BACKWARD;
            const fxt_command command = fxt_inverse(&table, target, torque, middle, direction);
            fxt_play play = fxt_play_after(direction);
            const fxt_prediction now = fxt_forward(&table, &play, command.generator, torque, middle);
            const int64_t off = minus(now.output, target), size = off < 0 ? -off : off;
            worst = size > worst ? size : worst;
            outside += size > table.hold || now.quality == FXT_DISABLED || command.quality == FXT_DISABLED ? 1u : 0u;
        }
        angles++;
    }
    printf("%llu angles, both directions: at most %lld counts from the target, %d stated, %llu outside\n", (unsigned long long)angles,
           (long long)worst, table.hold, (unsigned long long)outside);
    return angles > 0u && outside == 0u ? 0 : 1;
}
