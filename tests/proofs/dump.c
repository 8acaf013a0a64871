/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * A table that fxt_open accepts as sources of C, for a prover: dump TABLE.fxt. */
#include "flexspline_table.c"
#include <stdio.h>
static uint8_t d[100000];
int main(int c,char**a){ (void)c; FILE*f=fopen(a[1],"rb"); size_t n=fread(d,1,sizeof d,f); fxt_table t; if(fxt_open(&t,d,n).reason) return 1;
printf("static const uint8_t image[%zu] = {",n); for(size_t i=0;i<n;i++) printf("%u,",d[i]);
printf("};\nstatic const fxt_table table = {{%lluu, %uu, 0u}, {%lluu, %uu, 0u}, {%lluu, %uu, 0u}, {%lluu, %uu, 0u}, %uu, %uu, %uu, %uu, %af, %d, %d, %d, %uu, %uu, %uu, {%uu, %uu, %uu}, {%af, %af, %af, %af, %af, %af}, %af, %uu, %uu, image, image};\n",
(unsigned long long)t.to_output.fraction,t.to_output.whole,(unsigned long long)t.to_generator.fraction,t.to_generator.whole,(unsigned long long)t.generator_rate.periods,t.generator_rate.rest,(unsigned long long)t.tooth_rate.periods,t.tooth_rate.rest,t.bytes,t.body_bytes,t.ripple_order,t.reversed,t.cell_width,t.ripple_cells,t.limit,t.hold,t.ripple_nodes,t.ripple_unit,t.iterations,t.curves[0],t.curves[1],t.curves[2],t.bounds[0],t.bounds[1],t.bounds[2],t.bounds[3],t.bounds[4],t.bounds[5],t.inverse_error_rad,t.ratio_sum,t.sum); return 0;}
