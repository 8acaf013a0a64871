/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * The reader beside the vectors, then the core from its static library with both images: 0 if all is well. */
#include "flexspline.h"
#include "flexspline_cam.h"
#include "flexspline_table.h"

int flexspline_check(void);
int run(void);

int run(void)
{
    static FlexsplineStore store;
    static FlexsplineJoint joint;
    static const FlexsplineSettings settings = {
        .flexspline_teeth = 188,
        .circular_spline_teeth = 190,
        .overrun = 2,
        .fade_ticks = 50,
        .patience = 5,
        .tick_s = 1e-3f,
        .rate_rad_s = 0.05f,
        .acceleration_rad_s2 = 5.0f,
        .generator_rate_rad_s = 600.0f,
    };
    const FlexsplineImages images = {
        .first = flexspline_cam_table,
        .first_bytes = sizeof flexspline_cam_table,
        .second = flexspline_cam_table_second,
        .second_bytes = sizeof flexspline_cam_table_second,
    };
    FlexsplineStoreReport report;
    fxt_table table;
    if (flexspline_check() != 0)
        return 1;
    if (flexspline_self_test() || flexspline_store_init(&store) || flexspline_joint_init(&joint, &settings))
        return 2;
    if (flexspline_store_activate(&store, &joint, &images, 20.0f) || flexspline_store_report(&store, &report))
        return 3;
    if (fxt_open(&table, images.first, images.first_bytes).reason != FXT_OK)
        return 4;
    const fxt_info info = fxt_tell(&table);
    for (int i = 0; i < 8; i++)
        if (info.table_id[i] != report.table_id[i])
            return 5;
    return 0;
}

#ifdef FIRMWARE
/* What a compiler may call for a structure, and a C library has. */
void *memset(void *to, int value, size_t count);
void *memcpy(void *to, const void *from, size_t count);

__attribute__((weak)) void *memset(void *to, int value, size_t count)
{
    for (volatile uint8_t *at = to; count > 0; count--)
        *at++ = (uint8_t)value;
    return to;
}

__attribute__((weak)) void *memcpy(void *to, const void *from, size_t count)
{
    const uint8_t *source = from;
    for (volatile uint8_t *at = to; count > 0; count--)
        *at++ = *source++;
    return to;
}
#else
int main(void)
{
    return run();
}
#endif
