/* What a board gives to the quadrotor's logger. */
#ifndef ROTORID_QUADROTOR_H
#define ROTORID_QUADROTOR_H

#include <stdint.h>

void quadrotor_motors(const uint16_t throttle[4]); /* 0 to 10000 each */
uint16_t quadrotor_voltage_mv(void);
void quadrotor_led(uint8_t colour); /* 0 red, 1 yellow, 2 green */

#endif
