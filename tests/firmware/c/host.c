// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file beside.c on this machine: prints the sum that the target has to find.

#include "beside.h"
#include "cam.h"

#include <stdio.h>
#include <string.h>

int main(void)
{
    static uint8_t second[sizeof flexspline_cam_table];
    memcpy(second, flexspline_cam_table, sizeof second);
    const FlexsplineImages table = {flexspline_cam_table, sizeof flexspline_cam_table, second, sizeof second};
    uint32_t found = 0;
    const int failed = beside(&table, 2000, &found);
    if (failed)
        fprintf(stderr, "beside: %d\n", failed);
    else
        printf("c-beside: %lu\n", (unsigned long)found);
    return failed;
}
