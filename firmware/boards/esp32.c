/* ESP32 (quadrotor's logger) on ESP-IDF 5: UART0 by the board's USB bridge at 115,200 baud, esp_timer as the clock,
 * boots counted in NVS, four ESCs by the LED PWM controller.
 *
 *   ESC of motors 1 to 4   GPIO 25, 26, 27, 33 (50 pulses a second, 1 to 2 ms)
 *   battery voltage        GPIO 34 (ADC1 channel 6) behind a divider of 11
 *   lamp                   GPIO 16 red, 17 yellow, 18 green (modules with PSRAM need 16 and 17 themselves: take others)
 *
 * Build: cd firmware/esp32 && idf.py set-target esp32 && idf.py -p PORT flash   (ESP-IDF 5.2 or newer)
 *
 * Without Espressif's tools: `make -C firmware esp32-xtensa` compiles it by Debian's Xtensa GCC, `make -C firmware
 * host` makes a program of this computer of it, both against tests/esp_idf. It has not been on a board.
 */
#include <inttypes.h>
#include <stdio.h>

#include "driver/gpio.h"
#include "driver/ledc.h"
#include "driver/uart.h"
#include "esp_adc/adc_oneshot.h"
#include "esp_mac.h"
#include "esp_task_wdt.h"
#include "esp_timer.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "nvs.h"
#include "nvs_flash.h"

#include "../core/device.h"
#include "../instruments/quadrotor.h"

#define PORT UART_NUM_0
#define RX_RING 1024
#define TX_RING 4096
#define PULSE_HZ 50
#define PULSE_BITS 14                                  /* a step is 1.2 us of 20 ms */
#define STEPS_PER_MS ((1u << PULSE_BITS) * PULSE_HZ / 1000u)
#define VOLTAGE_DIVIDER 11u
#define FULL_SCALE_MV 3100u                            /* at 12 dB of attenuation, uncalibrated: within some percent */

static const int esc_pins[4] = {25, 26, 27, 33};
static const gpio_num_t lamp_pins[3] = {GPIO_NUM_16, GPIO_NUM_17, GPIO_NUM_18};
static uint32_t pulse_steps[4]; /* as the controller has them */
static adc_oneshot_unit_handle_t adc;
static char serial_number[13];

const char board_firmware[] = FIRMWARE;
/* The core wants the array itself: filled before device_boot() reads it. */
extern const char board_serial_number[sizeof serial_number] __attribute__((alias("serial_number")));

uint32_t board_micros(void) { return (uint32_t)esp_timer_get_time(); }

int board_receive(void) {
    uint8_t byte;
    return uart_read_bytes(PORT, &byte, 1, 0) == 1 ? byte : -1;
}

size_t board_room(void) {
    size_t room = 0;
    uart_get_tx_buffer_free_size(PORT, &room);
    return room;
}

void board_send(const uint8_t *bytes, size_t n) { uart_write_bytes(PORT, bytes, n); }

uint32_t board_boot_count(void) {
    uint32_t count = 0;
    nvs_handle_t store;
    if (nvs_open("rotorid", NVS_READWRITE, &store) != ESP_OK) return 0;
    nvs_get_u32(store, "boots", &count); /* absent at first: stays 0 */
    count++;
    nvs_set_u32(store, "boots", count);
    nvs_commit(store); /* NVS writes a new entry before it drops the old one: a cut loses neither */
    nvs_close(store);
    return count;
}

void quadrotor_motors(const uint16_t throttle[4]) {
    for (int i = 0; i < 4; i++) {
        uint32_t steps = STEPS_PER_MS + STEPS_PER_MS * throttle[i] / 10000u;
        if (steps == pulse_steps[i]) continue; /* this is asked far oftener than a pulse comes */
        pulse_steps[i] = steps;
        ledc_set_duty(LEDC_LOW_SPEED_MODE, (ledc_channel_t)i, steps);
        ledc_update_duty(LEDC_LOW_SPEED_MODE, (ledc_channel_t)i);
    }
}

uint16_t quadrotor_voltage_mv(void) {
    int count = 0;
    if (adc_oneshot_read(adc, ADC_CHANNEL_6, &count) != ESP_OK) return 0;
    return (uint16_t)((uint32_t)count * FULL_SCALE_MV / 4095u * VOLTAGE_DIVIDER);
}

void quadrotor_led(uint8_t colour) {
    for (uint8_t i = 0; i < 3; i++) gpio_set_level(lamp_pins[i], i == colour);
}

static void set_up_motors(void) {
    const ledc_timer_config_t timer = {
        .speed_mode = LEDC_LOW_SPEED_MODE,
        .duty_resolution = (ledc_timer_bit_t)PULSE_BITS,
        .timer_num = LEDC_TIMER_0,
        .freq_hz = PULSE_HZ,
        .clk_cfg = LEDC_AUTO_CLK,
    };
    ESP_ERROR_CHECK(ledc_timer_config(&timer));
    for (int i = 0; i < 4; i++) {
        const ledc_channel_config_t channel = {
            .gpio_num = esc_pins[i],
            .speed_mode = LEDC_LOW_SPEED_MODE,
            .channel = (ledc_channel_t)i,
            .timer_sel = LEDC_TIMER_0,
            .duty = STEPS_PER_MS, /* zero throttle from the first pulse on */
        };
        ESP_ERROR_CHECK(ledc_channel_config(&channel));
        pulse_steps[i] = STEPS_PER_MS;
    }
}

static void set_up(void) {
    const uart_config_t line = {
        .baud_rate = 115200,
        .data_bits = UART_DATA_8_BITS,
        .parity = UART_PARITY_DISABLE,
        .stop_bits = UART_STOP_BITS_1,
        .flow_ctrl = UART_HW_FLOWCTRL_DISABLE,
    };
    const adc_oneshot_unit_init_cfg_t unit = {.unit_id = ADC_UNIT_1};
    const adc_oneshot_chan_cfg_t input = {.atten = ADC_ATTEN_DB_12, .bitwidth = ADC_BITWIDTH_12};
    uint8_t mac[6] = {0};
    set_up_motors(); /* first: an ESC without pulses beeps, one with a stray pulse turns */
    for (uint8_t i = 0; i < 3; i++) {
        ESP_ERROR_CHECK(gpio_reset_pin(lamp_pins[i]));
        ESP_ERROR_CHECK(gpio_set_direction(lamp_pins[i], GPIO_MODE_OUTPUT));
    }
    if (nvs_flash_init() != ESP_OK) { /* a full or old partition */
        ESP_ERROR_CHECK(nvs_flash_erase());
        ESP_ERROR_CHECK(nvs_flash_init());
    }
    ESP_ERROR_CHECK(adc_oneshot_new_unit(&unit, &adc));
    ESP_ERROR_CHECK(adc_oneshot_config_channel(adc, ADC_CHANNEL_6, &input));
    ESP_ERROR_CHECK(uart_driver_install(PORT, RX_RING, TX_RING, 0, NULL, 0));
    ESP_ERROR_CHECK(uart_param_config(PORT, &line));
    ESP_ERROR_CHECK(esp_efuse_mac_get_default(mac));
    snprintf(serial_number, sizeof serial_number, "%02X%02X%02X%02X%02X%02X", mac[0], mac[1], mac[2], mac[3], mac[4],
             mac[5]);
}

void app_main(void) {
    set_up();
    ESP_ERROR_CHECK(esp_task_wdt_add(NULL)); /* a program that hangs is reset, and its pulses end */
    device_boot();
    for (;;) {
        esp_task_wdt_reset();
        device_poll();
        if (!device_streaming()) vTaskDelay(1);
    }
}
