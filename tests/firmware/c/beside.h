// SPDX-License-Identifier: MIT OR Apache-2.0
/// @file See beside.c.

#ifndef BESIDE_H
#define BESIDE_H

#include "flexspline.h"

// So many ticks with a table; 0 and the sum of all that came of it, or the number of what is not as it should be.
int beside(const FlexsplineImages *table, int ticks, uint32_t *found);

#endif
