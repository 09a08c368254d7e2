/* Random and half-random bytes for decoder and device: whatever comes, no undefined behaviour (the sanitizers look),
 * every frame sent is intact and in sequence, and nothing turns without the watchdog.
 *
 *   fuzz SECONDS [SEED]
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "../core/device.h"
#include "../instruments/rotor.h"

const char board_firmware[] = "rotor 2.0 (simulated)";
const char board_serial_number[] = "FUZZ";

static uint64_t state;
static uint32_t now_us;
static uint8_t in[512];
static size_t in_n, in_at;
static struct decoder back;
static uint16_t expected;
static uint16_t esc;
static unsigned long sent, obeyed, ends[4];

static uint32_t rnd(void) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return (uint32_t)(state >> 16);
}

static void fail(const char *what) {
    fprintf(stderr, "fuzz: %s\n", what);
    abort();
}

uint32_t board_micros(void) { return now_us += rnd() % 40; }
int board_receive(void) { return in_at < in_n ? in[in_at++] : -1; }
size_t board_room(void) { return rnd() % 300; }
uint32_t board_boot_count(void) { return rnd(); }
void rotor_esc(uint16_t throttle) { esc = throttle; }

bool rotor_read(struct rotor_reading *reading) {
    memset(reading, (int)rnd(), sizeof *reading);
    return rnd() % 16 != 0;
}

void board_send(const uint8_t *bytes, size_t n) {
    struct frame frame;
    for (size_t i = 0; i < n; i++) {
        bool whole = decoder_feed(&back, bytes[i], &frame);
        if (whole != (i == n - 1)) fail("a frame that is none");
    }
    if (frame.sequence != expected) fail("a sequence number is missing");
    expected++;
    sent++;
    if (frame.kind == KIND_END) ends[frame.payload[8] & 3]++;
    if (frame.kind == KIND_ANSWER && frame.payload[1] == OK) obeyed++;
}

static void feed(void) {
    uint8_t payload[MAX_PAYLOAD];
    in_at = 0;
    if (rnd() % 4 == 0) { /* noise */
        in_n = rnd() % sizeof in;
        for (size_t i = 0; i < in_n; i++) in[i] = (uint8_t)rnd();
        return;
    }
    static const char letters[] = "?GXKTKGT\1";
    size_t n = 1 + rnd() % (rnd() % 8 ? 6 : MAX_PAYLOAD - 1);
    payload[0] = (uint8_t)letters[rnd() % (sizeof letters - 1)];
    for (size_t i = 1; i < n; i++) payload[i] = (uint8_t)(rnd() % 3 ? 0 : rnd());
    if (payload[0] == 'G' || payload[0] == 'T') n = rnd() % 8 ? 5 : n;
    if (payload[0] == 'K') n = rnd() % 8 ? 3 : n;
    for (size_t i = 1; i < n; i++) payload[i] = (uint8_t)(rnd() % 3 ? 0 : rnd());
    in[0] = 0;
    in_n = 1 + frame_encode(in + 1, KIND_COMMAND, (uint16_t)rnd(), rnd(), payload, n);
    if (rnd() % 8 == 0) in[rnd() % in_n] ^= (uint8_t)(1u << rnd() % 8);
    if (rnd() % 8 == 0) in_n = rnd() % in_n;
}

int main(int argc, char **argv) {
    time_t until = time(NULL) + (argc > 1 ? atoi(argv[1]) : 5);
    unsigned long turns = 0;
    state = argc > 2 ? strtoull(argv[2], NULL, 10) : 88172645463325252ull;
    device_boot();
    while ((turns & 0xFFFF) || time(NULL) < until) {
        if (rnd() % 3 == 0 || in_at >= in_n) feed();
        device_poll();
        if (rnd() % 64 == 0) now_us += rnd() % 3000000;
        if (esc && !device_watched()) fail("the motor turns without a watchdog");
        if (rnd() % 100000 == 0) {
            expected = 0;
            device_boot();
            if (esc) fail("the motor turns after power-up");
        }
        turns++;
    }
    printf("%lu turns, %lu frames sent, %lu commands obeyed, streams ended: %lu stopped, %lu unheard\n", turns, sent,
           obeyed, ends[STOPPED], ends[UNHEARD]);
    return !(obeyed && ends[STOPPED] && ends[UNHEARD]);
}
