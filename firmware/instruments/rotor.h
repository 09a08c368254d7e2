/* What a board gives to the thrust tester. */
#ifndef ROTORID_ROTOR_H
#define ROTORID_ROTOR_H

#include <stdbool.h>
#include <stdint.h>

struct rotor_reading {
    uint16_t speed_rpm;
    int32_t thrust_mn;
    uint16_t voltage_mv;
    uint16_t current_ma;
};

void rotor_esc(uint16_t throttle);                   /* 0 to 10000 */
bool rotor_read(struct rotor_reading *reading);

#endif
