/* cli.c - options and messages; cli.h tells how they are used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "cli.h"

#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>

enum { MAX_THREADS = 256 };

/* ---- messages --------------------------------------------------------------------------- */

/* One line on stderr. A file name may hold control characters; they must not reach the terminal. */
static void print_line(cli *run, const char *mark, const char *format, va_list arguments) {
    char line[1024];
    vsnprintf(line, sizeof line, format, arguments);
    for (char *c = line; *c; c++) {
        if (iscntrl((unsigned char)*c)) *c = '?';
    }
    cli_clear_bar(run);
    fprintf(stderr, "texkit %s: %s%s\n", run->manual->name, mark, line);
}

int cli_fail(cli *run, int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    print_line(run, "", format, arguments);
    va_end(arguments);
    return status;
}

void cli_warn(cli *run, const char *format, ...) {
    va_list arguments;
    if (run->quiet) return;
    va_start(arguments, format);
    print_line(run, "warning: ", format, arguments);
    va_end(arguments);
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

/* ---- the command line -------------------------------------------------------------------- */

static int add_input(cli *run, int *count, const char *argument) {
    if (*count == run->manual->inputs)
        return cli_fail(run, CLI_USAGE, "unexpected argument '%s'; see 'texkit %s --help'",
                        argument, run->manual->name);
    run->inputs[(*count)++] = argument;
    return CLI_DONE;
}

/* -o - or, to choose the format, -o png:-: give the output a name with that extension. */
static int take_stream(cli *run) {
    const char *format = run->manual->stream ? run->manual->stream + 1 : "png";
    const size_t n = strspn(run->output, "abcdefghijklmnopqrstuvwxyz");
    int length = (int)strlen(format);
    if (strcmp(run->output + n, n ? ":-" : "-") != 0 || n > 5) return CLI_DONE;
    if (run->manual->makes_folder)
        return cli_fail(run, CLI_USAGE, "-o %s: several files are written; name a folder for them",
                        run->output);
    if (n) {
        format = run->output;
        length = (int)n;
    }
    snprintf(run->stream_name, sizeof run->stream_name, "-.%.*s", length, format);
    run->output = run->stream_name;
    run->to_stdout = 1;
    return CLI_DONE;
}

int cli_begin(cli *run, const cli_manual *manual, const cli_option *options, int argc, char **argv,
              int *status) {
    int help = 0, version = 0, count = 0, only_inputs = 0;
    memset(run, 0, sizeof *run);
    run->manual = manual;
    run->seed = 1;
    run->threads = env_cores() < MAX_THREADS ? env_cores() : MAX_THREADS;
    run->started = run->stage_started = cli_now();
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

    run->no_bar = run->quiet;
    if (help || version) {
        if (help) print_manual(manual, options, common);
        else printf("texkit %s\n", cli_versions);
        *status = fflush(stdout) == 0 ? CLI_DONE : CLI_FAILED;
        return 1;
    }
    cli_stop_by_signals(run);
    if (count < manual->inputs && manual->input) {
        *status = cli_fail(run, CLI_USAGE, "no %s given; see 'texkit %s --help'", manual->input,
                           manual->name);
    } else if (!run->output) {
        *status = cli_fail(run, CLI_USAGE, "no output given; add -o PATH");
    } else {
        *status = take_stream(run);
        if (*status == CLI_DONE) *status = cli_announce(run, options, common);
    }
    if (*status != CLI_DONE) return 1;
    cli_make_env(run);
    return 0;
}
