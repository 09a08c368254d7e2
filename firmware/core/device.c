#include "device.h"

#include <string.h>

static struct {
    struct decoder decoder;
    uint32_t boot_id;
    uint32_t interval_us;
    uint32_t due_us;
    uint32_t sent, skipped;
    uint32_t heard_us, patience_us; /* the watchdog; patience 0: off */
    uint16_t sequence;
    bool streaming, starting;
} device;

static void send_frame(uint8_t kind, uint32_t clock_us, const uint8_t *payload, size_t n) {
    uint8_t wire[MAX_WIRE];
    size_t length = frame_encode(wire, kind, device.sequence, clock_us, payload, n);
    if (!length) return;
    device.sequence++;
    board_send(wire, length);
}

static size_t put_text(uint8_t *to, const char *text, size_t room) {
    size_t n = strlen(text);
    if (n > room) n = room;
    memcpy(to, text, n);
    return n;
}

static void send_start(uint8_t reason) {
    uint8_t p[MAX_PAYLOAD];
    size_t n = 9;
    put_u32(p, device.boot_id);
    put_u32(p + 4, device.interval_us);
    p[8] = reason;
    n += put_text(p + n, instrument.name, 24);
    p[n++] = 0;
    n += put_text(p + n, board_firmware, 32);
    p[n++] = 0;
    n += put_text(p + n, board_serial_number, MAX_PAYLOAD - n);
    send_frame(KIND_START, board_micros(), p, n);
}

static void send_answer(uint8_t letter, struct answer answer) {
    uint8_t p[MAX_PAYLOAD] = {letter, answer.status};
    size_t n = 2;
    if (answer.text) n += put_text(p + n, answer.text, MAX_PAYLOAD - n);
    send_frame(KIND_ANSWER, board_micros(), p, n);
}

bool device_watched(void) { return device.patience_us != 0; }

bool device_streaming(void) { return device.streaming; }

void device_begin_stream(void) { device.starting = true; }

static void begin_stream(void) {
    device.starting = false;
    device.streaming = true;
    device.sent = device.skipped = 0;
    send_start(STREAMING);
    device.due_us = board_micros();
}

void device_end_stream(uint8_t reason) {
    uint8_t p[9];
    device.patience_us = 0;
    if (!device.streaming) return;
    device.streaming = false;
    put_u32(p, device.sent);
    put_u32(p + 4, device.skipped);
    p[8] = reason;
    send_frame(KIND_END, board_micros(), p, sizeof p);
}

static struct answer refuse(const char *why) { return (struct answer){REFUSED, why}; }

static struct answer go(const uint8_t *arguments, size_t n) {
    if (!instrument.starts_with_g) return refuse("this device starts with a programme, not with G");
    if (n != 4) return refuse("G takes 4 bytes: the interval in us, 0 for its own");
    uint32_t interval_us = get_u32(arguments);
    if (device.streaming) { /* asked again because an answer was lost: the stream goes on as it is */
        if (interval_us == 0 || interval_us == device.interval_us) return (struct answer){OK, NULL};
        return refuse("a stream of another interval is running; stop it first");
    }
    if (interval_us && interval_us < instrument.shortest_us) return refuse("the interval is shorter than it can do");
    if (interval_us > 0x7FFFFFFF) return refuse("the interval is too long");
    if (instrument.moves_while_streaming && !device_watched()) return refuse("switch the watchdog on first (K)");
    if (instrument.start) {
        struct answer answer = instrument.start();
        if (answer.status != OK) return answer;
    }
    device.interval_us = interval_us ? interval_us : instrument.interval_us;
    device_begin_stream();
    return (struct answer){OK, NULL};
}

static void obey(uint8_t letter, const uint8_t *arguments, size_t n) {
    struct answer answer = {UNKNOWN, "there is no such command"};
    device.heard_us = board_micros();
    switch (letter) {
    case '?':
        send_start(ASKED);
        return;
    case 'G':
        answer = go(arguments, n);
        break;
    case 'X':
        if (instrument.stop) instrument.stop();
        send_answer(letter, (struct answer){OK, NULL});
        device_end_stream(STOPPED);
        return;
    case 'K':
        if (!instrument.has_watchdog) break;
        if (n != 2 || get_u16(arguments) == 0) {
            answer = refuse("K takes 2 bytes: 1 to 65535 ms");
        } else {
            device.patience_us = (uint32_t)get_u16(arguments) * 1000;
            answer = (struct answer){OK, NULL};
        }
        break;
    default:
        if (instrument.command) answer = instrument.command(letter, arguments, n);
    }
    send_answer(letter, answer);
    if (device.starting) begin_stream();
}

static void watch(void) {
    if (!device.patience_us || board_micros() - device.heard_us <= device.patience_us) return;
    if (instrument.stop) instrument.stop();
    device.patience_us = 0;
    device_end_stream(UNHEARD);
}

static void sample(void) {
    uint32_t late_us = board_micros() - device.due_us;
    if (late_us & 0x80000000) return;             /* not yet due */
    while (late_us >= device.interval_us) {       /* whole intervals have passed: these samples are gone */
        late_us -= device.interval_us;
        device.due_us += device.interval_us;
        device.skipped++;
    }
    uint8_t payload[MAX_PAYLOAD];
    uint32_t clock_us = board_micros();
    device.due_us += device.interval_us;
    if (!instrument.read(payload) || board_room() < (size_t)instrument.payload + FRAME_HEAD + FRAME_TAIL + 2) {
        device.skipped++; /* no reading, or the line is behind: rather say so than hold up the next one */
        return;
    }
    device.sent++;
    send_frame(KIND_DATA, clock_us, payload, instrument.payload);
}

void device_boot(void) {
    memset(&device, 0, sizeof device);
    device.boot_id = board_boot_count();
    device.interval_us = instrument.interval_us;
    if (instrument.stop) instrument.stop();
    send_start(BOOTED);
}

void device_poll(void) {
    struct frame frame;
    int byte;
    /* one command a turn: an answer to each must find room */
    while ((byte = board_receive()) >= 0) {
        if (decoder_feed(&device.decoder, (uint8_t)byte, &frame) && frame.kind == KIND_COMMAND && frame.length) {
            obey(frame.payload[0], frame.payload + 1, frame.length - 1);
            break;
        }
    }
    watch();
    if (instrument.poll) instrument.poll(board_micros());
    if (device.streaming) sample();
}
