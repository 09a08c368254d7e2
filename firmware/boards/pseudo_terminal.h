/* A port of this computer for a firmware that runs on it. */
#ifndef PSEUDO_TERMINAL_H
#define PSEUDO_TERMINAL_H
#include <fcntl.h>
#include <pty.h>
#include <stdio.h>
#include <termios.h>
#include <unistd.h>

/* Opens a pseudo-terminal without line editing whose other end is found under `link`; says "ready" when it can be
 * opened. Returns the firmware's end, which never blocks, or -1 after saying what failed. */
static int open_pseudo_terminal(const char *link) {
    int master, slave;
    struct termios raw;
    if (openpty(&master, &slave, NULL, NULL, NULL)) {
        perror("openpty");
        return -1;
    }
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    fcntl(master, F_SETFL, O_NONBLOCK);
    unlink(link);
    if (symlink(ttyname(slave), link)) {
        perror(link);
        return -1;
    }
    printf("ready\n");
    fflush(stdout);
    return master;
}
#endif
