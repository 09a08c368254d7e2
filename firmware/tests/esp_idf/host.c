/* What boards/esp32.c asks of ESP-IDF, done by this computer: its UART is a pseudo-terminal, its NVS a file, and the
 * pulses of its motors and its lamp are lines of another file.
 *
 *   esp32 LINK NVS_FILE PULSES_FILE
 *
 * Calls that the board would not survive (a pulse on a channel that was not set up, a full UART written to from a task
 * that may not wait) end the program.
 */
#define _GNU_SOURCE
#include <assert.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "../../boards/pseudo_terminal.h"
#include "idf.h"

void app_main(void);

static int master;
static const char *nvs_file;
static FILE *pulses;
static uint8_t out[8192];
static size_t waiting, tx_ring, rx_ring;
static uint32_t boots, duty[4], told[4], lamp;
static bool timer_set, channel_set[4], line_set, analog_set, nvs_ready, watched;
static int opened;

int64_t esp_timer_get_time(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

void vTaskDelay(TickType_t ticks) { /* CONFIG_FREERTOS_HZ=1000 */
    const struct timespec pause = {ticks / 1000, (long)(ticks % 1000) * 1000000};
    nanosleep(&pause, NULL);
}

esp_err_t esp_task_wdt_add(TaskHandle_t task) {
    watched = task == NULL;
    return ESP_OK;
}

esp_err_t esp_task_wdt_reset(void) {
    assert(watched);
    return ESP_OK;
}

esp_err_t esp_efuse_mac_get_default(uint8_t *mac) {
    memcpy(mac, "\x24\x0A\xC4\x00\x01\x02", 6);
    return ESP_OK;
}

/* ---- UART ---- */

static void drain(void) {
    ssize_t n = waiting ? write(master, out, waiting) : 0;
    if (n > 0) {
        memmove(out, out + n, waiting - (size_t)n);
        waiting -= (size_t)n;
    }
}

esp_err_t uart_driver_install(uart_port_t port, int rx, int tx, int queue_size, QueueHandle_t *queue, int flags) {
    assert(port == UART_NUM_0 && rx > 128 && tx > 128 && tx <= (int)sizeof out); /* more than the chip's own 128 */
    assert(queue_size == 0 && queue == NULL && flags == 0);
    rx_ring = (size_t)rx;
    tx_ring = (size_t)tx;
    return ESP_OK;
}

esp_err_t uart_param_config(uart_port_t port, const uart_config_t *config) {
    assert(port == UART_NUM_0 && tx_ring && config->baud_rate == 115200 && config->data_bits == UART_DATA_8_BITS);
    line_set = true;
    return ESP_OK;
}

int uart_read_bytes(uart_port_t port, void *buffer, uint32_t length, TickType_t wait) {
    assert(port == UART_NUM_0 && line_set && wait == 0);
    drain();
    ssize_t n = read(master, buffer, length);
    if (n > 0) return (int)n;
    struct pollfd line = {master, POLLIN, 0};
    poll(&line, 1, 1); /* leaves the computer to others */
    return 0;
}

esp_err_t uart_get_tx_buffer_free_size(uart_port_t port, size_t *size) {
    assert(port == UART_NUM_0 && line_set);
    *size = tx_ring - waiting;
    return ESP_OK;
}

int uart_write_bytes(uart_port_t port, const void *bytes, size_t n) {
    assert(port == UART_NUM_0 && line_set && n <= tx_ring);
    while (waiting + n > tx_ring) { /* the driver waits as well */
        drain();
        vTaskDelay(1);
    }
    memcpy(out + waiting, bytes, n);
    waiting += n;
    drain();
    return (int)n;
}

/* ---- NVS: one number ---- */

esp_err_t nvs_flash_init(void) {
    nvs_ready = access(nvs_file, F_OK) == 0; /* an empty flash has to be erased first, as a new partition */
    return nvs_ready ? ESP_OK : -1;
}

esp_err_t nvs_flash_erase(void) {
    FILE *file = fopen(nvs_file, "w");
    assert(file && !fclose(file));
    return ESP_OK;
}

esp_err_t nvs_open(const char *space, nvs_open_mode_t mode, nvs_handle_t *store) {
    assert(nvs_ready && strlen(space) < 16 && mode == NVS_READWRITE); /* its names have 15 letters */
    *store = 1;
    opened++;
    return ESP_OK;
}

esp_err_t nvs_get_u32(nvs_handle_t store, const char *key, uint32_t *value) {
    FILE *file = fopen(nvs_file, "r");
    assert(store == 1 && opened && strlen(key) < 16 && file);
    int found = fscanf(file, "%u", value);
    fclose(file);
    return found == 1 ? ESP_OK : -1;
}

esp_err_t nvs_set_u32(nvs_handle_t store, const char *key, uint32_t value) {
    assert(store == 1 && opened && strlen(key) < 16);
    boots = value;
    return ESP_OK;
}

esp_err_t nvs_commit(nvs_handle_t store) {
    FILE *file = fopen(nvs_file, "w");
    assert(store == 1 && opened && file);
    fprintf(file, "%u\n", boots);
    fclose(file);
    return ESP_OK;
}

void nvs_close(nvs_handle_t store) {
    assert(store == 1);
    opened--;
}

/* ---- motors, lamp, battery ---- */

static void write_pulses(void) {
    fprintf(pulses, "%lld %u %u %u %u %u\n", (long long)esp_timer_get_time(), duty[0], duty[1], duty[2], duty[3], lamp);
    fflush(pulses);
}

esp_err_t ledc_timer_config(const ledc_timer_config_t *config) {
    assert(config->freq_hz == 50 && config->duty_resolution == LEDC_TIMER_14_BIT);
    timer_set = true;
    return ESP_OK;
}

esp_err_t ledc_channel_config(const ledc_channel_config_t *config) {
    assert(timer_set && config->channel < 4 && config->gpio_num < 34); /* 34 and above are inputs */
    channel_set[config->channel] = true;
    duty[config->channel] = told[config->channel] = config->duty;
    write_pulses();
    return ESP_OK;
}

esp_err_t ledc_set_duty(ledc_mode_t mode, ledc_channel_t channel, uint32_t steps) {
    assert(mode == LEDC_LOW_SPEED_MODE && channel < 4 && channel_set[channel] && steps < 1u << 14);
    told[channel] = steps;
    return ESP_OK;
}

esp_err_t ledc_update_duty(ledc_mode_t mode, ledc_channel_t channel) {
    assert(mode == LEDC_LOW_SPEED_MODE && channel < 4 && channel_set[channel]);
    duty[channel] = told[channel];
    write_pulses();
    return ESP_OK;
}

esp_err_t gpio_reset_pin(gpio_num_t pin) {
    assert(pin < 34);
    return ESP_OK;
}

esp_err_t gpio_set_direction(gpio_num_t pin, gpio_mode_t mode) {
    assert(pin < 34 && mode == GPIO_MODE_OUTPUT);
    return ESP_OK;
}

esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level) {
    if (level && lamp != (uint32_t)pin) {
        lamp = pin;
        write_pulses();
    }
    return ESP_OK;
}

struct adc_oneshot_unit_ctx_t {
    adc_unit_t unit;
};

esp_err_t adc_oneshot_new_unit(const adc_oneshot_unit_init_cfg_t *config, adc_oneshot_unit_handle_t *unit) {
    static struct adc_oneshot_unit_ctx_t only;
    only.unit = config->unit_id;
    *unit = &only;
    return ESP_OK;
}

esp_err_t adc_oneshot_config_channel(adc_oneshot_unit_handle_t unit, adc_channel_t channel,
                                     const adc_oneshot_chan_cfg_t *config) {
    assert(unit->unit == ADC_UNIT_1 && channel == ADC_CHANNEL_6 && config->atten == ADC_ATTEN_DB_12);
    analog_set = true;
    return ESP_OK;
}

esp_err_t adc_oneshot_read(adc_oneshot_unit_handle_t unit, adc_channel_t channel, int *count) {
    assert(unit->unit == ADC_UNIT_1 && channel == ADC_CHANNEL_6 && analog_set);
    *count = 1921; /* 16.0 V behind a divider of 11 */
    return ESP_OK;
}

int main(int argc, char **argv) {
    if (argc != 4 || !(pulses = fopen(argv[3], "w"))) {
        fprintf(stderr, "usage: %s LINK NVS_FILE PULSES_FILE\n", argv[0]);
        return 2;
    }
    nvs_file = argv[2];
    if ((master = open_pseudo_terminal(argv[1])) < 0) return 1;
    app_main();
}
