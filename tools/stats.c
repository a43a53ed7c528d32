/* stats.c - seconds of the stages and figures of the result, as --stats writes them
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: clock_gettime */
#include "cli.h"

#include <assert.h>
#include <stdio.h>
#include <time.h>

double cli_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double cli_seconds(const cli *run) {
    return cli_now() - run->started;
}

void cli_stage(cli *run, const char *name) {
    double t = cli_now();
    if (run->stage_count) run->stages[run->stage].seconds += t - run->stage_started;
    run->stage_started = t;
    if (!name) return;
    for (run->stage = 0; run->stage < run->stage_count; run->stage++)
        if (!strcmp(run->stages[run->stage].name, name)) return;
    assert(run->stage_count < CLI_MAX_STAGES);
    run->stages[run->stage_count++].name = name;
}

void cli_figure(cli *run, const char *name, double value) {
    assert(run->figure_count < CLI_MAX_FIGURES);
    run->figures[run->figure_count].name = name;
    run->figures[run->figure_count++].values[0] = value;
}

void cli_figures(cli *run, const char *name, const int *values, int count) {
    assert(run->figure_count < CLI_MAX_FIGURES && count <= CLI_MAX_LIST);
    run->figures[run->figure_count].name = name;
    for (int i = 0; i < count; i++) run->figures[run->figure_count].values[i] = values[i];
    run->figures[run->figure_count++].count = count;
}

/* The statistics as JSON. All names are literals of ours: nothing to escape. */
static size_t format_stats(const cli *run, char *text, size_t capacity) {
    size_t n = 0;
#define ADD(...) n += (size_t)snprintf(text + n, capacity - n, __VA_ARGS__)
    ADD("{\n  \"command\": \"%s\",\n", run->manual->name);
    ADD("  \"version\": \"%s\",\n  \"seed\": %llu,\n  \"threads\": %d,\n", TEXKIT_VERSION,
        (unsigned long long)run->seed, run->threads);
    ADD("  \"seconds\": {\n");
    for (int i = 0; i < run->stage_count; i++)
        ADD("    \"%s\": %.6f,\n", run->stages[i].name, run->stages[i].seconds);
    ADD("    \"total\": %.6f\n  },\n  \"peak_bytes\": %zu,\n  \"result\": {\n", cli_seconds(run),
        run->memory.peak_bytes);
    for (int i = 0; i < run->figure_count; i++) {
        const int count = run->figures[i].count;
        ADD("    \"%s\": %s%.15g", run->figures[i].name, count ? "[" : "",
            run->figures[i].values[0]);
        for (int k = 1; k < count; k++) ADD(", %.15g", run->figures[i].values[k]);
        ADD("%s%s\n", count ? "]" : "", i + 1 < run->figure_count ? "," : "");
    }
    ADD("  }\n}\n");
#undef ADD
    return n;
}

size_t cli_end(cli *run, char *text, size_t capacity) {
    cli_stage(run, NULL);
    cli_clear_bar(run);
    return run->stats ? format_stats(run, text, capacity) : 0;
}
