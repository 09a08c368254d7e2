/* Frames as docs/wire-formats.md has them: COBS(kind, sequence, clock, payload, CRC-16) and a zero. */
#ifndef ROTORID_FRAME_H
#define ROTORID_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { KIND_START = 'S', KIND_DATA = 'D', KIND_END = 'E', KIND_ANSWER = 'A', KIND_COMMAND = 'C' };

#ifndef MAX_PAYLOAD
#define MAX_PAYLOAD 96 /* of what these boards send and take; the format allows 244 */
#endif
#define FRAME_HEAD 7
#define FRAME_TAIL 2
#define MAX_BODY (FRAME_HEAD + MAX_PAYLOAD + FRAME_TAIL)
#define MAX_WIRE (MAX_BODY + 2) /* one byte of COBS, one zero */

/* CRC-16/CCITT-FALSE of n more bytes; begin with 0xFFFF. */
uint16_t crc16(uint16_t crc, const uint8_t *bytes, size_t n);

/* Writes a frame with its zero to wire (room: MAX_WIRE) and returns its length; 0 where the payload is too long. */
size_t frame_encode(uint8_t *wire, uint8_t kind, uint16_t sequence, uint32_t clock_us, const uint8_t *payload,
                    size_t n);

/* Takes bytes as they come. After any garbage the frame behind the next zero is whole again. */
struct decoder {
    uint8_t block[MAX_WIRE];
    uint16_t length;
    bool too_long;
};

struct frame {
    uint8_t kind;
    uint16_t sequence;
    uint32_t clock_us;
    const uint8_t *payload; /* inside the decoder; valid until the next byte */
    size_t length;
};

/* True when this byte has completed an intact frame. */
bool decoder_feed(struct decoder *decoder, uint8_t byte, struct frame *frame);

void put_u16(uint8_t *to, uint16_t value);
void put_u32(uint8_t *to, uint32_t value);
uint16_t get_u16(const uint8_t *from);
uint32_t get_u32(const uint8_t *from);

#endif
