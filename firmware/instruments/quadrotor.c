/* The quadrotor's logger: a letter and a programme, streamed until it is over (thesis, algorithms 1 and 2). */
#include "quadrotor.h"

#include <math.h>
#include <string.h>

#include "../core/device.h"

enum { TRAPEZOID = 0, SINE = 1 };
enum { RED = 0, YELLOW = 1, GREEN = 2 };
#define RUN_OUT_US 500000u /* the motors stand, the stream goes on */

static struct {
    bool running;
    uint8_t shape, led;
    uint16_t maxima[4], now[4];
    uint32_t ramp_us, hold_us, begun_us;
    float frequency_hz;
} programme;

static void set(float share, uint8_t led) {
    for (uint8_t i = 0; i < 4; i++) programme.now[i] = (uint16_t)(share * programme.maxima[i] + 0.5f);
    quadrotor_motors(programme.now);
    programme.led = led;
    quadrotor_led(led);
}

static void stop(void) {
    programme.running = false;
    set(0, RED);
}

static uint32_t duration_us(void) {
    return programme.hold_us + (programme.shape == TRAPEZOID ? 2 * programme.ramp_us : 0);
}

static void poll(uint32_t now_us) {
    if (!programme.running) return;
    uint32_t t = now_us - programme.begun_us, end = duration_us();
    if (t > end + RUN_OUT_US) {
        stop();
        device_end_stream(COMPLETE);
    } else if (t > end) {
        set(0, RED);
    } else if (programme.shape == SINE) {
        float phase = 6.2831853f * programme.frequency_hz * ((float)t * 1e-6f);
        set(0.5f * (1 - cosf(phase)), YELLOW);
    } else if (t < programme.ramp_us) {
        set((float)t / (float)programme.ramp_us, YELLOW);
    } else if (t <= programme.ramp_us + programme.hold_us) {
        set(1, GREEN);
    } else {
        set((float)(end - t) / (float)programme.ramp_us, YELLOW);
    }
}

static bool read(uint8_t *payload) {
    for (uint8_t i = 0; i < 4; i++) put_u16(payload + 2 * i, programme.now[i]);
    put_u16(payload + 8, quadrotor_voltage_mv());
    payload[10] = programme.led;
    return true;
}

static struct answer command(uint8_t letter, const uint8_t *arguments, size_t n) {
    if (letter == 0 || !strchr("hbrpytm", letter)) return (struct answer){UNKNOWN, "there is no such command"};
    if (n != 15) return (struct answer){REFUSED, "a programme has 15 bytes"};
    if (programme.running) return (struct answer){REFUSED, "a programme is running; stop it first"};
    if (!device_watched()) return (struct answer){REFUSED, "switch the watchdog on first (K)"};
    if (arguments[0] > SINE) return (struct answer){REFUSED, "the shape is 0 (trapezoid) or 1 (sine)"};
    for (uint8_t i = 0; i < 4; i++) {
        if (get_u16(arguments + 1 + 2 * i) > 10000) return (struct answer){REFUSED, "throttle above 1"};
    }
    programme.shape = arguments[0];
    for (uint8_t i = 0; i < 4; i++) programme.maxima[i] = get_u16(arguments + 1 + 2 * i);
    programme.ramp_us = (uint32_t)get_u16(arguments + 9) * 1000;
    programme.hold_us = (uint32_t)get_u16(arguments + 11) * 1000;
    programme.frequency_hz = get_u16(arguments + 13) * 1e-3f;
    programme.begun_us = board_micros();
    programme.running = true;
    device_begin_stream();
    return (struct answer){OK, NULL};
}

const struct instrument instrument = {
    .name = "quadrotor",
    .interval_us = 20000,
    .shortest_us = 4000,
    .payload = 11,
    .has_watchdog = true,
    .read = read,
    .poll = poll,
    .stop = stop,
    .command = command,
};
