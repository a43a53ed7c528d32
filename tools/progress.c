/* progress.c - the progress bar
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: isatty */
#include "cli.h"

#include <stdio.h>
#include <unistd.h>

enum { BAR_WIDTH = 30 };

void cli_clear_bar(cli *run) {
    if (run->bar_is_on) fprintf(stderr, "\r%*s\r", CLI_BAR_COLUMNS, "");
    run->bar_is_on = 0;
}

/* Draws the bar. It never cancels the work: signals end the whole program, see stop.c. */
static int progress(void *user, float fraction, const char *stage) {
    cli *run = (cli *)user;
    double t = cli_now();
    if (run->no_bar || !isatty(STDERR_FILENO)) return 0;
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
    env_fill(&run->env, &run->memory, &run->threads);
    run->env.progress = progress;
    run->env.progress_user = run;
}
