/* cli.c - options, messages, progress, timing; cli.h tells how they are used
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: clock_gettime, isatty, sigaction */
#include "cli.h"

#include <ctype.h>
#include <errno.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <time.h>
#include <unistd.h>

enum { MAX_THREADS = 256, BAR_WIDTH = 30 };

/* ---- messages --------------------------------------------------------------------------- */

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void clear_bar(cli *run) {
    if (run->bar_is_on) fprintf(stderr, "\r%*s\r", BAR_WIDTH + 30, "");
    run->bar_is_on = 0;
}

int cli_fail(cli *run, int status, const char *format, ...) {
    char line[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    /* a file name may hold control characters; the message must stay one harmless line */
    for (char *c = line; *c; c++) {
        if (iscntrl((unsigned char)*c)) *c = '?';
    }
    clear_bar(run);
    fprintf(stderr, "texkit %s: %s\n", run->manual->name, line);
    return status;
}

/* ---- options ---------------------------------------------------------------------------- */

/* A whole decimal number within min..max, nothing before or after it. */
static int parse_int(const char *text, int min, int max, int *value) {
    char *end;
    if (!isdigit((unsigned char)text[text[0] == '-'])) return 0;
    errno = 0;
    long v = strtol(text, &end, 10);
    if (errno || *end || v < min || v > max) return 0;
    *value = (int)v;
    return 1;
}

static int parse_seed(const char *text, uint64_t *value) {
    char *end;
    if (!isdigit((unsigned char)text[0])) return 0;
    errno = 0;
    unsigned long long v = strtoull(text, &end, 10);
    if (errno || *end) return 0;
    *value = v;
    return 1;
}

static int parse_extent(const char *text, int min, int max, int value[2]) {
    char width[16];
    const char *x = strchr(text, 'x');
    if (!x || (size_t)(x - text) >= sizeof width) return 0;
    memcpy(width, text, (size_t)(x - text));
    width[x - text] = 0;
    int w, h;
    if (!parse_int(width, min, max, &w) || !parse_int(x + 1, min, max, &h)) return 0;
    value[0] = w;
    value[1] = h;
    return 1;
}

static int set_option(cli *run, const cli_option *o, const char *text) {
    switch (o->kind) {
    case CLI_FLAG:
        *(int *)o->target = 1;
        return CLI_DONE;
    case CLI_TEXT:
    case CLI_INPUT:
    case CLI_INPUTS:
    case CLI_GROUPS:
    case CLI_TILES:
    case CLI_OUTPUT:
        if (text[0] == 0) break;
        *(const char **)o->target = text;
        return CLI_DONE;
    case CLI_INT:
        if (parse_int(text, o->min, o->max, (int *)o->target)) return CLI_DONE;
        return cli_fail(run, CLI_USAGE, "%s '%s': give a whole number from %d to %d", o->name, text,
                        o->min, o->max);
    case CLI_SEED:
        if (parse_seed(text, (uint64_t *)o->target)) return CLI_DONE;
        return cli_fail(run, CLI_USAGE, "%s '%s': give a whole number from 0 to 2^64 - 1", o->name,
                        text);
    case CLI_EXTENT:
        if (parse_extent(text, o->min, o->max, (int *)o->target)) return CLI_DONE;
        return cli_fail(run, CLI_USAGE,
                        "%s '%s': give width and height in pixels, 1 to %d each, such as 512x512",
                        o->name, text, o->max);
    case CLI_END: break;
    }
    return cli_fail(run, CLI_USAGE, "%s is empty; give %s", o->name, o->value);
}

/* The option that the argument names, either "--size 9x9" or "--size=9x9"; *text is its value in
   the second form, else NULL. */
static const cli_option *find_option(const cli_option *table, const char *argument,
                                     const char **text) {
    for (; table->kind != CLI_END; table++) {
        size_t length = strlen(table->name);
        if (strncmp(argument, table->name, length) != 0) continue;
        *text = argument[length] == '=' ? argument + length + 1 : NULL;
        if (argument[length] == 0 || *text) return table;
    }
    return NULL;
}

static void print_options(const cli_option *table) {
    for (; table->kind != CLI_END; table++) {
        char left[32];
        snprintf(left, sizeof left, "%s %s", table->name, table->value ? table->value : "");
        printf("  %-20s %s\n", left, table->help);
    }
}

static void print_manual(const cli_manual *m, const cli_option *own, const cli_option *common) {
    printf("texkit %s %s\n%s.\n\n%s\nOptions, anywhere after the command:\n", m->name, m->usage,
           m->summary, m->details);
    print_options(own);
    print_options(common);
    printf("\nExample:\n%s", m->example);
}

/* ---- the environment -------------------------------------------------------------------- */

static volatile sig_atomic_t interrupted;

static void on_signal(int signal_number) {
    (void)signal_number;
    interrupted = 1;
}

/* Draws the bar, and cancels the work when the user has pressed Ctrl-C. */
static int progress(void *user, float fraction, const char *stage) {
    cli *run = (cli *)user;
    double t = now();
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

static void make_env(cli *run) {
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

/* ---- the command line -------------------------------------------------------------------- */

static int add_input(cli *run, int *count, const char *argument) {
    if (*count == run->manual->inputs)
        return cli_fail(run, CLI_USAGE, "unexpected argument '%s'; see 'texkit %s --help'",
                        argument, run->manual->name);
    run->inputs[(*count)++] = argument;
    return CLI_DONE;
}

int cli_begin(cli *run, const cli_manual *manual, const cli_option *options, int argc, char **argv,
              int *status) {
    int help = 0, version = 0, count = 0, only_inputs = 0;
    memset(run, 0, sizeof *run);
    run->manual = manual;
    run->seed = 1;
    run->threads = env_cores() < MAX_THREADS ? env_cores() : MAX_THREADS;
    run->started = run->stage_started = now();
    const cli_option common[] = {
        {CLI_TEXT, "-o", "PATH", "where to write the result", &run->output, 0, 0},
        {CLI_SEED, "--seed", "N", "a different seed gives a different result; default 1",
         &run->seed, 0, 0},
        {CLI_INT, "--threads", "N", "default: all cores; the result does not depend on it",
         &run->threads, 1, MAX_THREADS},
        {CLI_OUTPUT, "--stats", "FILE", "write seconds, memory and figures of the result as JSON",
         &run->stats, 0, 0},
        {CLI_FLAG, "--quiet", NULL, "no progress bar, no summary", &run->quiet, 0, 0},
        {CLI_FLAG, "-h", NULL, "or --help: this text", &help, 0, 0},
        {CLI_FLAG, "--version", NULL, "the versions of the tool and the headers", &version, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };

    for (int i = 0; i < argc; i++) {
        const char *text = NULL, *argument = argv[i];
        *status = CLI_DONE;
        if (only_inputs || argument[0] != '-' || argument[1] == 0) {
            *status = add_input(run, &count, argument);
        } else if (strcmp(argument, "--") == 0) {
            only_inputs = 1;
        } else if (strcmp(argument, "--help") == 0) {
            help = 1;
        } else {
            const cli_option *o = find_option(options, argument, &text);
            if (!o) o = find_option(common, argument, &text);
            if (!o) {
                *status = cli_fail(run, CLI_USAGE, "unknown option '%s'; see 'texkit %s --help'",
                                   argument, manual->name);
            } else if (o->kind == CLI_FLAG && text) {
                *status = cli_fail(run, CLI_USAGE, "%s takes no value", o->name);
            } else if (o->kind != CLI_FLAG && !text &&
                       (i + 1 == argc || strncmp(argv[i + 1], "--", 2) == 0)) {
                *status = cli_fail(run, CLI_USAGE, "%s needs a value: %s %s", o->name, o->name,
                                   o->value);
            } else {
                *status = set_option(run, o, text || o->kind == CLI_FLAG ? text : argv[++i]);
            }
        }
        if (*status != CLI_DONE) return 1;
    }

    if (help || version) {
        if (help) print_manual(manual, options, common);
        else printf("texkit %s\n", cli_versions);
        *status = fflush(stdout) == 0 ? CLI_DONE : CLI_FAILED;
        return 1;
    }
    if (count < manual->inputs) {
        *status = cli_fail(run, CLI_USAGE, "no %s given; see 'texkit %s --help'", manual->input,
                           manual->name);
    } else if (!run->output) {
        *status = cli_fail(run, CLI_USAGE, "no output given; add -o PATH");
    } else {
        *status = cli_announce(run, options, common);
    }
    if (*status != CLI_DONE) return 1;
    make_env(run);
    return 0;
}

/* ---- timing and figures ------------------------------------------------------------------ */

double cli_seconds(const cli *run) {
    return now() - run->started;
}

void cli_stage(cli *run, const char *name) {
    double t = now();
    if (run->stage_count) run->stages[run->stage_count - 1].seconds = t - run->stage_started;
    run->stage_started = t;
    if (name && run->stage_count < CLI_MAX_STAGES) run->stages[run->stage_count++].name = name;
}

void cli_figure(cli *run, const char *name, double value) {
    if (run->figure_count == CLI_MAX_FIGURES) return;
    run->figures[run->figure_count].name = name;
    run->figures[run->figure_count++].values[0] = value;
}

void cli_figures(cli *run, const char *name, const int *values, int count) {
    if (run->figure_count == CLI_MAX_FIGURES || count > CLI_MAX_LIST) return;
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
    clear_bar(run);
    return run->stats ? format_stats(run, text, capacity) : 0;
}
