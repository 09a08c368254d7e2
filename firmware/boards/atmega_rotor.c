/* The thrust tester: ESC on D9 (50 pulses a second, 1 to 2 ms), thrust by an HX711 on D4 (data) and D5 (clock),
 * revolutions on D2 (one pulse each), battery voltage on A0 (divider of 11), current on A1 (40 mV/A).
 *
 * The numbers below are those of the parts; set them for yours.
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/delay.h>

#include "../core/device.h"
#include "../instruments/rotor.h"

#define HX711_COUNTS_PER_N 45000L
#define VOLTAGE_DIVIDER 11UL
#define SHUNT_MV_PER_A 40UL
#define REFERENCE_MV 5000UL
#define PULSE_TICKS 2000u    /* 1 ms at 2 MHz: the ESC's zero */
#define PERIOD_TICKS 40000u  /* 20 ms */

static volatile uint16_t width = PULSE_TICKS;
static volatile uint32_t last_pulse_us, turn_us;
static int32_t thrust_mn;

/* The timer sets and clears D9 itself at the moments written here, so that no interrupt can bend the pulse. */
ISR(TIMER1_COMPA_vect) {
    if (TCCR1A & _BV(COM1A0)) { /* it was set just now */
        TCCR1A = _BV(COM1A1);
        OCR1A += width;
    } else {
        TCCR1A = _BV(COM1A1) | _BV(COM1A0);
        OCR1A += PERIOD_TICKS - width;
    }
}

ISR(INT0_vect) {
    uint32_t now = board_micros();
    turn_us = now - last_pulse_us;
    last_pulse_us = now;
}

void board_setup(void) {
    DDRB |= _BV(PB1);
    DDRD |= _BV(PD5);
    PORTD |= _BV(PD2);
    EICRA = _BV(ISC01);
    EIMSK = _BV(INT0);
    ADMUX = _BV(REFS0);
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
    OCR1A = PERIOD_TICKS;
    TCCR1A = _BV(COM1A1) | _BV(COM1A0);
    TIMSK1 |= _BV(OCIE1A);
}

void rotor_esc(uint16_t throttle) {
    uint16_t ticks = PULSE_TICKS + throttle / 5; /* 10000: 1 ms more */
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { width = ticks; }
}

static uint32_t millivolts(uint8_t channel) {
    ADMUX = _BV(REFS0) | channel;
    ADCSRA |= _BV(ADSC);
    while (ADCSRA & _BV(ADSC)) {}
    return ADC * REFERENCE_MV / 1023;
}

static void read_thrust(void) {
    if (PIND & _BV(PD4)) return; /* nothing new: ten or eighty readings a second, the last one holds */
    uint32_t bits = 0;
    for (uint8_t i = 0; i < 25; i++) { /* the 25th pulse asks for channel A, gain 128 */
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { /* a pulse longer than 60 us would switch it off */
            PORTD |= _BV(PD5);
            _delay_us(1);
            if (i < 24) bits = bits << 1 | (PIND >> PD4 & 1);
            PORTD &= (uint8_t)~_BV(PD5);
        }
        _delay_us(1);
    }
    int32_t count = bits & 0x800000 ? (int32_t)(bits | 0xFF000000) : (int32_t)bits;
    thrust_mn = (int32_t)((int64_t)count * 1000 / HX711_COUNTS_PER_N);
}

bool rotor_read(struct rotor_reading *reading) {
    uint32_t turn, last;
    read_thrust();
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        turn = turn_us;
        last = last_pulse_us;
    }
    bool turning = turn && board_micros() - last < 500000;
    reading->speed_rpm = turning && turn > 915 ? (uint16_t)(60000000UL / turn) : turning ? 0xFFFF : 0;
    reading->thrust_mn = thrust_mn;
    reading->voltage_mv = (uint16_t)(millivolts(0) * VOLTAGE_DIVIDER);
    reading->current_ma = (uint16_t)(millivolts(1) * 1000 / SHUNT_MV_PER_A);
    return true;
}
