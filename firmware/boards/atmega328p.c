/* Arduino UNO (ATmega328P, 16 MHz): UART with rings in both directions, a clock of 0.5 us, boots counted in EEPROM. */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "../core/device.h"

#define RX_RING 128 /* powers of two */
#define TX_RING 256

const char board_firmware[] = FIRMWARE;
const char board_serial_number[] = SERIAL_NUMBER;

static volatile uint8_t rx[RX_RING], tx[TX_RING];
static volatile uint8_t rx_head, rx_tail, tx_head, tx_tail;
static volatile uint32_t overflows;

void board_setup(void); /* of the instrument's own pins */

/* ---- clock: timer 1 at 2 MHz, free-running ---- */

ISR(TIMER1_OVF_vect) { overflows++; }

uint32_t board_micros(void) {
    uint16_t low;
    uint32_t high;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        low = TCNT1;
        high = overflows;
        if ((TIFR1 & _BV(TOV1)) && low < 0x8000) high++; /* it ran over and nobody has counted yet */
    }
    return high << 15 | low >> 1; /* 2^17 rounds of 32.768 ms are 2^32 us */
}

/* ---- UART ---- */

ISR(USART_RX_vect) {
    uint8_t byte = UDR0, next = (uint8_t)(rx_head + 1) & (RX_RING - 1);
    if (next == rx_tail) return; /* a host that sends without waiting loses a command, and asks again */
    rx[rx_head] = byte;
    rx_head = next;
}

ISR(USART_UDRE_vect) {
    if (tx_head == tx_tail) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UDR0 = tx[tx_tail];
    tx_tail = (uint8_t)(tx_tail + 1); /* a ring of 256 closes by itself */
}

int board_receive(void) {
    if (rx_head == rx_tail) return -1;
    uint8_t byte = rx[rx_tail];
    rx_tail = (uint8_t)(rx_tail + 1) & (RX_RING - 1);
    return byte;
}

size_t board_room(void) { return (uint8_t)(tx_tail - tx_head - 1); }

void board_send(const uint8_t *bytes, size_t n) {
    while (n--) {
        while (!board_room()) {}
        tx[tx_head] = *bytes++;
        tx_head = (uint8_t)(tx_head + 1);
        UCSR0B |= _BV(UDRIE0);
    }
}

/* ---- boots: two places written in turn, each with its complement, so that a cut while writing loses none ---- */

struct boots {
    uint32_t count, complement;
};
static struct boots EEMEM stored[2];

uint32_t board_boot_count(void) {
    struct boots slot[2];
    uint32_t best = 0;
    eeprom_read_block(slot, stored, sizeof slot);
    for (uint8_t i = 0; i < 2; i++) {
        if (slot[i].count == ~slot[i].complement && slot[i].count > best) best = slot[i].count;
    }
    best++;
    struct boots now = {best, ~best};
    eeprom_update_block(&now, &stored[best & 1], sizeof now);
    return best;
}

int main(void) {
    MCUSR = 0;
    wdt_enable(WDTO_500MS); /* a program that hangs leaves no motor running: the reset takes its pulses away */
    TCCR1A = 0;
    TCCR1B = _BV(CS11);
    TIMSK1 = _BV(TOIE1);
    UCSR0A = _BV(U2X0);
    UBRR0 = 16; /* 115,200 baud, 2.1 % fast, as the UNO's own boot loader */
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
    board_setup();
    sei();
    device_boot();
    for (;;) {
        wdt_reset();
        device_poll();
    }
}
