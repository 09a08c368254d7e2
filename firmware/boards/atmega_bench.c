/* The load-cell bench: two ADS1256 on one SPI, cells 1, 3, 5 on the first and 2, 4, 6 on the second, each on the
 * input pairs 0-1, 2-3 and 4-5, gain 64. Both convert at the same time: three conversions give six cells.
 *
 *   D13 SCK   D12 MISO   D11 MOSI   D10 CS of the first   D9 CS of the second   D2, D3 DRDY of the two
 */
#include <avr/io.h>
#include <util/delay.h>

#include "../core/device.h"
#include "../instruments/bench.h"

#define CS1 _BV(PB2)
#define CS2 _BV(PB1)
#define DRDY1 _BV(PD2)
#define DRDY2 _BV(PD3)

enum { WAKEUP = 0x00, RDATA = 0x01, RREG = 0x10, WREG = 0x50, SDATAC = 0x0F, SYNC = 0xFC, RESET_CHIP = 0xFE };
enum { STATUS = 0, MUX = 1, ADCON = 2, DRATE = 3 };
#define GAIN_64 0x06
#define RATE_1000 0xA1 /* samples a second; settled 1.18 ms after SYNC (data sheet, table 13) */
#define CHIP_ID 0x30
#define PATIENCE_US 3000

static const uint8_t select[2] = {CS1, CS2};

static uint8_t transfer(uint8_t byte) {
    SPDR = byte;
    while (!(SPSR & _BV(SPIF))) {}
    return SPDR;
}

static void begin(uint8_t chip) { PORTB &= (uint8_t)~select[chip]; }
static void end(uint8_t chip) { PORTB |= select[chip]; }

static void tell(uint8_t chip, uint8_t command) {
    begin(chip);
    transfer(command);
    _delay_us(4); /* 24 periods of its clock before the next command */
    end(chip);
}

static void set(uint8_t chip, uint8_t place, uint8_t value) {
    begin(chip);
    transfer(WREG | place);
    transfer(0); /* one register */
    transfer(value);
    end(chip);
}

static uint8_t get(uint8_t chip, uint8_t place) {
    begin(chip);
    transfer(RREG | place);
    transfer(0);
    _delay_us(7); /* 50 periods between command and data */
    uint8_t value = transfer(0xFF);
    end(chip);
    return value;
}

void board_setup(void) {
    PORTB |= CS1 | CS2;
    DDRB |= CS1 | CS2 | _BV(PB3) | _BV(PB5);
    SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPHA) | _BV(SPR0); /* mode 1, 1 MHz: a quarter of 7.68 MHz is the limit */
}

bool bench_ready(void) {
    for (uint8_t chip = 0; chip < 2; chip++) {
        tell(chip, SDATAC);
        if ((get(chip, STATUS) & 0xF0) != CHIP_ID) return false;
        set(chip, ADCON, GAIN_64);
        set(chip, DRATE, RATE_1000);
    }
    return true;
}

static bool ready(void) {
    uint32_t begun = board_micros();
    while (PIND & (DRDY1 | DRDY2)) {
        if (board_micros() - begun > PATIENCE_US) return false;
    }
    return true;
}

static int32_t value(uint8_t chip) {
    begin(chip);
    transfer(RDATA);
    _delay_us(7);
    uint32_t bits = 0;
    for (uint8_t i = 0; i < 3; i++) bits = bits << 8 | transfer(0xFF);
    end(chip);
    return bits & 0x800000 ? (int32_t)(bits | 0xFF000000) : (int32_t)bits;
}

bool bench_read(int32_t counts[6]) {
    for (uint8_t pair = 0; pair < 3; pair++) {
        for (uint8_t chip = 0; chip < 2; chip++) {
            set(chip, MUX, (uint8_t)(2 * pair << 4 | (2 * pair + 1)));
            tell(chip, SYNC);
            tell(chip, WAKEUP);
        }
        if (!ready()) return false;
        for (uint8_t chip = 0; chip < 2; chip++) {
            int32_t count = value(chip);
            counts[2 * pair + chip] = count < -8388607 ? -8388607 : count; /* the format is symmetric */
        }
    }
    return true;
}
