/* stop.c - Ctrl-C and other signals that end the work: at once, leaving nothing behind
   SPDX-License-Identifier: MIT OR Unlicense

   The library can be cancelled whenever it reports progress; decoders and the system's calls cannot.
   A process can simply end: the system takes back its memory and threads. Only files need care, so
   these are removed first, with nothing but calls that a signal handler may make.                 */
#define _XOPEN_SOURCE 700 /* POSIX: sigaction */
#include "cli.h"

#include <signal.h>
#include <stdio.h>
#include <unistd.h>

static char message[128];
static size_t message_size;
static volatile sig_atomic_t is_held, is_pending;

static void end_now(void) {
    cli_remove_unfinished();
    const ssize_t n = write(STDERR_FILENO, message, message_size);
    (void)n;
    _exit(CLI_FAILED);
}

static void on_signal(int signal_number) {
    (void)signal_number;
    if (is_held) is_pending = 1;
    else end_now();
}

static void handle(int signal_number, void (*handler)(int)) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = handler;
    action.sa_flags = SA_RESTART;
    sigaction(signal_number, &action, NULL);
}

void cli_stop_by_signals(const cli *run) {
    struct sigaction before;
    const int bar = run->no_bar || !isatty(STDERR_FILENO) ? 0 : CLI_BAR_COLUMNS;
    const int n = snprintf(message, sizeof message, "%s%*s%stexkit %s: stopped; nothing was written\n",
                           bar ? "\r" : "", bar, "", bar ? "\r" : "", run->manual->name);
    message_size = n > 0 && n < (int)sizeof message ? (size_t)n : 0;
    handle(SIGINT, on_signal);
    handle(SIGTERM, on_signal);
    if (sigaction(SIGHUP, NULL, &before) == 0 && before.sa_handler != SIG_IGN) /* no nohup */
        handle(SIGHUP, on_signal);
    handle(SIGPIPE, SIG_IGN); /* then writing fails, with a message */
    handle(SIGXFSZ, SIG_IGN);
}

void cli_stop_hold(void) {
    is_held = 1;
}

void cli_stop_release(void) {
    is_held = 0;
    if (is_pending) end_now();
}
