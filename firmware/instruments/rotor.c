/* The thrust tester: a throttle that holds for a time, and never without the watchdog. */
#include "rotor.h"

#include "../core/device.h"

static uint16_t throttle;
static uint32_t until_us;

static void set(uint16_t value) {
    throttle = value;
    rotor_esc(value);
}

static void stop(void) { set(0); }

static void poll(uint32_t now_us) {
    if (throttle && (int32_t)(now_us - until_us) >= 0) stop();
}

static bool read(uint8_t *payload) {
    struct rotor_reading reading;
    if (!rotor_read(&reading)) return false;
    put_u16(payload, throttle);
    put_u16(payload + 2, reading.speed_rpm);
    put_u32(payload + 4, (uint32_t)reading.thrust_mn);
    put_u16(payload + 8, reading.voltage_mv);
    put_u16(payload + 10, reading.current_ma);
    return true;
}

static struct answer command(uint8_t letter, const uint8_t *arguments, size_t n) {
    if (letter != 'T') return (struct answer){UNKNOWN, "there is no such command"};
    if (n != 4) return (struct answer){REFUSED, "T takes 4 bytes: throttle in 1e-4, hold in ms"};
    uint16_t value = get_u16(arguments);
    if (value > 10000) return (struct answer){REFUSED, "throttle above 1"};
    if (value && !device_watched()) return (struct answer){REFUSED, "switch the watchdog on first (K)"};
    if (value && !device_streaming()) return (struct answer){REFUSED, "start the stream first (G)"};
    until_us = board_micros() + (uint32_t)get_u16(arguments + 2) * 1000;
    set(get_u16(arguments + 2) ? value : 0);
    return (struct answer){OK, NULL};
}

const struct instrument instrument = {
    .name = "rotor",
    .interval_us = 20000,
    .shortest_us = 4000,
    .payload = 12,
    .starts_with_g = true,
    .has_watchdog = true,
    .read = read,
    .poll = poll,
    .stop = stop,
    .command = command,
};
