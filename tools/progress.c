/* progress.c - the progress bar, and Ctrl-C that ends the work
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: isatty, sigaction */
#include "cli.h"

#include <signal.h>
#include <stdio.h>
#include <unistd.h>

enum { BAR_WIDTH = 30 };

void cli_clear_bar(cli *run) {
    if (run->bar_is_on) fprintf(stderr, "\r%*s\r", BAR_WIDTH + 30, "");
    run->bar_is_on = 0;
}

static volatile sig_atomic_t interrupted;

static void on_signal(int signal_number) {
    (void)signal_number;
    interrupted = 1;
}

/* Draws the bar, and cancels the work when the user has pressed Ctrl-C. */
static int progress(void *user, float fraction, const char *stage) {
    cli *run = (cli *)user;
    double t = cli_now();
    if (interrupted) return 1;
    if (run->quiet || !isatty(STDERR_FILENO)) return 0;
    if (t - run->started < 1 || t - run->shown < 0.1) return 0;
    int filled = (int)(fraction * (float)BAR_WIDTH + 0.5f);
    fprintf(stderr, "\r%-16.16s [", stage);
    for (int i = 0; i < BAR_WIDTH; i++) fputc(i < filled ? '#' : '.', stderr);
    fprintf(stderr, "] %3d %%", (int)(100 * fraction));
    fflush(stderr);
    run->shown = t;
    run->bar_is_on = 1;
    return 0;
}

void cli_make_env(cli *run) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = (int)SA_RESETHAND; /* the second Ctrl-C kills at once */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);

    env_fill(&run->env, &run->memory, &run->threads);
    run->env.progress = progress;
    run->env.progress_user = run;
}
