/* What a board gives to the load-cell bench. */
#ifndef ROTORID_BENCH_H
#define ROTORID_BENCH_H

#include <stdbool.h>
#include <stdint.h>

bool bench_ready(void);                /* both converters answer */
bool bench_read(int32_t counts[6]);    /* cells 1 to 6, +-(2^23 - 1); false: a converter did not answer in time */

#endif
