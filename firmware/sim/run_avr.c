/* An ATmega328P that runs the firmware, its UART on a pseudo-terminal, with two ADS1256 on its SPI.
 *
 *   run_avr FIRMWARE.elf LINK [SPEED]      SPEED: simulated seconds a second at most; 0: as fast as it goes
 *
 * Cell k (1 to 6) of scan n reads 1000 (n mod 8000) + k - 1. Lines on standard input: `reset`, `brownout` (half a
 * second without supply, whatever is on the line is lost), `quit`. EEPROM lasts as long as this program.
 */
#define _GNU_SOURCE
#include <avr_eeprom.h>
#include <avr_ioport.h>
#include <avr_spi.h>
#include <avr_uart.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <sim_avr.h>
#include <sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define SETTLED_US 1180

static avr_t *avr;
static int master;
static uint8_t to_host[65536], to_avr[4096];
static size_t to_host_n, to_avr_n;
static int paused; /* the UART's own buffer is full */

/* ---- ADS1256 ---- */

struct converter {
    int number, selected, place; /* place in the present command */
    uint8_t command, registers[16];
    uint32_t scans;
    uint32_t value;
};
static struct converter converters[2] = {{.number = 0, .registers = {0x30}}, {.number = 1, .registers = {0x30}}};

static void data_ready(int number, int level) {
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2 + number), level);
}

static avr_cycle_count_t settled(avr_t *unused, avr_cycle_count_t when, void *param) {
    struct converter *c = param;
    int pair = c->registers[1] >> 5;
    c->value = 1000 * (c->scans % 8000) + 2 * pair + c->number;
    if (pair == 2) c->scans++;
    data_ready(c->number, 0);
    (void)unused;
    (void)when;
    return 0;
}

static uint8_t exchange(struct converter *c, uint8_t byte) {
    int place = c->place++;
    if (place == 0) {
        c->command = byte;
        if (byte == 0xFC) data_ready(c->number, 1);
        if (byte == 0x00) avr_cycle_timer_register_usec(avr, SETTLED_US, settled, c);
        return 0;
    }
    switch (c->command & 0xF0) {
    case 0x10: /* RREG: register, count, data */
        return place >= 2 ? c->registers[(c->command & 15) + place - 2] : 0;
    case 0x50: /* WREG */
        if (place >= 2) c->registers[((c->command & 15) + place - 2) & 15] = byte;
        return 0;
    case 0x00:
        if (c->command == 0x01 && place <= 3) return (uint8_t)(c->value >> 8 * (3 - place));
    }
    return 0;
}

static void on_spi(struct avr_irq_t *irq, uint32_t byte, void *unused) {
    uint8_t reply = 0xFF;
    for (int i = 0; i < 2; i++) {
        if (converters[i].selected) reply = exchange(&converters[i], (uint8_t)byte);
    }
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_SPI_GETIRQ(0), SPI_IRQ_INPUT), reply);
    (void)irq;
    (void)unused;
}

static void on_select(struct avr_irq_t *irq, uint32_t level, void *param) {
    struct converter *c = param;
    c->selected = !level;
    c->place = 0;
    (void)irq;
}

/* ---- UART ---- */

static void on_byte(struct avr_irq_t *irq, uint32_t byte, void *unused) {
    if (to_host_n < sizeof to_host) to_host[to_host_n++] = (uint8_t)byte;
    (void)irq;
    (void)unused;
}

static void on_xon(struct avr_irq_t *irq, uint32_t value, void *unused) {
    paused = 0;
    (void)irq, (void)value, (void)unused;
}

static void on_xoff(struct avr_irq_t *irq, uint32_t value, void *unused) {
    paused = 1;
    (void)irq, (void)value, (void)unused;
}

static void line(void) {
    ssize_t n = to_host_n ? write(master, to_host, to_host_n) : 0;
    if (n > 0) {
        memmove(to_host, to_host + n, to_host_n - (size_t)n);
        to_host_n -= (size_t)n;
    }
    n = read(master, to_avr + to_avr_n, sizeof to_avr - to_avr_n);
    if (n > 0) to_avr_n += (size_t)n;
    size_t done = 0;
    for (; done < to_avr_n && done < 8 && !paused; done++) { /* 8 a step: less than the line carries */
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), to_avr[done]);
    }
    memmove(to_avr, to_avr + done, to_avr_n - done);
    to_avr_n -= done;
}

static void restart(void) {
    avr_reset(avr);
    to_avr_n = 0;
    paused = 0;
    data_ready(0, 1);
    data_ready(1, 1);
}

static int obey(void) {
    char word[64];
    ssize_t n = read(0, word, sizeof word - 1);
    if (n <= 0) return 1;
    word[n] = 0;
    if (strstr(word, "quit")) return 0;
    if (strstr(word, "brownout")) {
        to_host_n = 0;
        usleep(500000);
        restart();
        printf("brownout\n");
    } else if (strstr(word, "reset")) {
        restart();
        printf("reset\n");
    }
    fflush(stdout);
    return 1;
}

static double now_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv) {
    elf_firmware_t firmware = {0};
    struct termios raw;
    int slave;
    if (argc < 3 || elf_read_firmware(argv[1], &firmware) || openpty(&master, &slave, NULL, NULL, NULL)) {
        fprintf(stderr, "usage: %s FIRMWARE.elf LINK [SPEED]\n", argv[0]);
        return 2;
    }
    double speed = argc > 3 ? atof(argv[3]) : 1.0;
    strcpy(firmware.mmcu, "atmega328p");
    firmware.frequency = 16000000;
    avr = avr_make_mcu_by_name(firmware.mmcu);
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    fcntl(master, F_SETFL, O_NONBLOCK);
    fcntl(0, F_SETFL, O_NONBLOCK);
    unlink(argv[2]);
    if (symlink(ttyname(slave), argv[2])) {
        perror(argv[2]);
        return 1;
    }
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), on_xon, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), on_xoff, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_SPI_GETIRQ(0), SPI_IRQ_OUTPUT), on_spi, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 2), on_select, &converters[0]);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 1), on_select, &converters[1]);
    data_ready(0, 1);
    data_ready(1, 1);
    printf("ready\n");
    fflush(stdout);
    double begun = now_s();
    avr_cycle_count_t origin = avr->cycle;
    for (;;) {
        avr_cycle_count_t until = avr->cycle + 16000; /* a millisecond */
        while (avr->cycle < until) {
            int state = avr_run(avr);
            if (state == cpu_Done || state == cpu_Crashed) {
                fprintf(stderr, "the processor stopped\n");
                return 1;
            }
        }
        line();
        if (!obey()) break;
        if (speed > 0) {
            double ahead = (double)(avr->cycle - origin) / 16e6 / speed - (now_s() - begun);
            if (ahead > 0.002) usleep((useconds_t)(ahead * 1e6));
            if (ahead < -0.5) { /* starved of time: go on from here, never race to catch up */
                begun = now_s();
                origin = avr->cycle;
            }
        }
    }
    return 0;
}
