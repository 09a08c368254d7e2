/* What every instrument does: start and end records, commands, the stream, the watchdog. One device a program. */
#ifndef ROTORID_DEVICE_H
#define ROTORID_DEVICE_H

#include "frame.h"

enum { BOOTED = 0, ASKED = 1, STREAMING = 2 };               /* why a start record is sent */
enum { STOPPED = 0, COMPLETE = 1, FAULT = 2, UNHEARD = 3 };  /* why a stream ended */
enum { OK = 0, REFUSED = 1, UNKNOWN = 2 };                   /* how a command was taken */

/* What a board gives. Nothing here may wait, but for the sensors in instrument.read. */
uint32_t board_micros(void);                         /* free-running, rolls over at 2^32 */
int board_receive(void);                             /* a byte, or -1 */
size_t board_room(void);                             /* bytes that board_send takes without waiting */
void board_send(const uint8_t *bytes, size_t n);     /* n <= board_room(), or it waits */
uint32_t board_boot_count(void);                     /* one more after every power-up; asked once */
extern const char board_firmware[];                  /* e.g. "bench 2.0" */
extern const char board_serial_number[];

struct answer {
    uint8_t status;
    const char *text; /* why not; may be NULL */
};

/* What an instrument gives. */
struct instrument {
    const char *name;
    uint32_t interval_us;     /* its own */
    uint32_t shortest_us;     /* the shortest it can do */
    uint8_t payload;          /* bytes of a sample */
    bool starts_with_g;       /* false: one of its own commands starts the stream */
    bool has_watchdog;        /* moves something: K is a command of it */
    bool moves_while_streaming;               /* G itself sets it in motion */
    bool (*read)(uint8_t *payload);           /* a sample; false: could not be taken */
    void (*poll)(uint32_t now_us);            /* called all the time; may be NULL */
    void (*stop)(void);                       /* stop whatever moves; may be NULL */
    struct answer (*command)(uint8_t letter, const uint8_t *arguments, size_t n); /* its own; may be NULL */
    struct answer (*start)(void);             /* asked before G starts the stream; may be NULL */
};

extern const struct instrument instrument;

void device_boot(void);
void device_poll(void); /* call it for ever */

/* For instruments. */
bool device_watched(void);       /* whether the watchdog is on */
bool device_streaming(void);
void device_begin_stream(void);  /* after the answer to the present command has gone */
void device_end_stream(uint8_t reason);

#endif
