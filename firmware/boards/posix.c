/* The firmware as a program of this computer, on a pseudo-terminal: for tests of recorder and protocol core.
 *
 *   bench|rotor|quadrotor LINK BOOT_COUNT_FILE
 *
 * Its sensors give a known pattern: cell k of sample n reads 1000 n + k; the rotor turns as its throttle says.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "../core/device.h"
#include "../instruments/bench.h"
#include "../instruments/quadrotor.h"
#include "../instruments/rotor.h"
#include "pseudo_terminal.h"

const char board_firmware[] = FIRMWARE " (simulated)";
const char board_serial_number[] = "HOST-1";

static int master;
static uint8_t out[4096];
static size_t waiting;
static const char *boot_file;
static uint16_t esc;
static int32_t scans;

uint32_t board_micros(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)(now.tv_sec * 1000000ull + (uint64_t)now.tv_nsec / 1000);
}

static void flush(void) {
    ssize_t n = waiting ? write(master, out, waiting) : 0;
    if (n > 0) {
        memmove(out, out + n, waiting - (size_t)n);
        waiting -= (size_t)n;
    }
}

int board_receive(void) {
    uint8_t byte;
    return read(master, &byte, 1) == 1 ? byte : -1;
}

size_t board_room(void) { return sizeof out - waiting; }

void board_send(const uint8_t *bytes, size_t n) {
    while (n > board_room()) flush(); /* a line that nobody reads holds up a record, as a full buffer does a UART */
    memcpy(out + waiting, bytes, n);
    waiting += n;
    flush();
}

uint32_t board_boot_count(void) {
    unsigned count = 0;
    FILE *file = fopen(boot_file, "r");
    if (file) {
        if (fscanf(file, "%u", &count) != 1) count = 0;
        fclose(file);
    }
    file = fopen(boot_file, "w");
    if (file) {
        fprintf(file, "%u\n", ++count);
        fclose(file);
    }
    return count;
}

bool bench_ready(void) { return true; }

bool bench_read(int32_t counts[6]) {
    for (int i = 0; i < 6; i++) counts[i] = 1000 * (scans % 8000) + i;
    scans++;
    return true;
}

void rotor_esc(uint16_t throttle) { esc = throttle; }

bool rotor_read(struct rotor_reading *reading) {
    *reading = (struct rotor_reading){esc, esc / 10, 16000, (uint16_t)(esc / 2)};
    return true;
}

void quadrotor_motors(const uint16_t throttle[4]) { esc = throttle[0]; }
uint16_t quadrotor_voltage_mv(void) { return 16000; }
void quadrotor_led(uint8_t colour) { (void)colour; }

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "usage: %s LINK BOOT_COUNT_FILE\n", argv[0]);
        return 2;
    }
    boot_file = argv[2];
    if ((master = open_pseudo_terminal(argv[1])) < 0) return 1;
    device_boot();
    for (;;) {
        struct pollfd wait = {master, POLLIN, 0};
        flush();
        poll(&wait, 1, device_streaming() ? 1 : 20);
        device_poll();
    }
}
