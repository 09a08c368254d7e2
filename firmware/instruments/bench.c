/* The load-cell bench: six counts of 24 bits, sign-extended. */
#include "bench.h"

#include "../core/device.h"

static bool read(uint8_t *payload) {
    int32_t counts[6];
    if (!bench_read(counts)) return false;
    for (uint8_t i = 0; i < 6; i++) put_u32(payload + 4 * i, (uint32_t)counts[i]);
    return true;
}

static struct answer start(void) {
    if (!bench_ready()) return (struct answer){REFUSED, "a converter does not answer; check its supply and wires"};
    return (struct answer){OK, NULL};
}

const struct instrument instrument = {
    .name = "bench",
    .interval_us = 20000,
    .shortest_us = 3800, /* three conversions of 1.18 ms; what their commands take beyond is counted as skipped */
    .payload = 24,
    .starts_with_g = true,
    .read = read,
    .start = start,
};
