/* cli.c - what every texkit command shares; cli.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: clock_gettime, realpath, isatty */
#include "cli.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#ifdef _OPENMP
#include <omp.h>
#endif

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
    /* a file name may hold anything; the message stays one line that no terminal acts upon */
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

/* The allocator counts what the library holds: each block is preceded by its size. */
typedef union block_head {
    size_t bytes;
    long double align_1;
    void *align_2;
} block_head;

static void *allocate(void *user, size_t bytes) {
    cli *run = (cli *)user;
    if (bytes > SIZE_MAX - sizeof(block_head)) return NULL;
    block_head *head = (block_head *)malloc(sizeof *head + bytes);
    if (!head) return NULL;
    head->bytes = bytes;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    {
        run->live_bytes += bytes;
        if (run->live_bytes > run->peak_bytes) run->peak_bytes = run->live_bytes;
    }
    return head + 1;
}

static void release(void *user, void *block) {
    cli *run = (cli *)user;
    block_head *head = (block_head *)block - 1;
#ifdef _OPENMP
#pragma omp critical(memory)
#endif
    run->live_bytes -= head->bytes;
    free(head);
}

#ifdef _OPENMP
static void parallel_for(void *user, int count, void (*body)(void *context, int index),
                         void *context) {
    const cli *run = (const cli *)user;
#pragma omp parallel for schedule(dynamic) num_threads(run->threads)
    for (int i = 0; i < count; i++) body(context, i);
}
#endif

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

static int core_count(void) {
#ifdef _OPENMP
    int n = omp_get_num_procs();
    return n > MAX_THREADS ? MAX_THREADS : n;
#else
    return 1;
#endif
}

static void make_env(cli *run) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = (int)SA_RESETHAND; /* the second Ctrl-C kills at once */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);

    run->env.allocate = allocate;
    run->env.release = release;
    run->env.memory_user = run;
    run->env.progress = progress;
    run->env.progress_user = run;
#ifdef _OPENMP
    if (run->threads > 1) {
        run->env.parallel_for = parallel_for;
        run->env.parallel_user = run;
    }
#endif
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
    run->threads = core_count();
    run->started = run->stage_started = now();
    const cli_option common[] = {
        {CLI_TEXT, "-o", "PATH", "where to write the result", &run->output, 0, 0},
        {CLI_SEED, "--seed", "N", "another seed, another result; default 1", &run->seed, 0, 0},
        {CLI_INT, "--threads", "N", "default: all cores; the result does not depend on it",
         &run->threads, 1, MAX_THREADS},
        {CLI_TEXT, "--stats", "FILE", "write seconds, memory and figures of the result as JSON",
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
    } else if (run->stats && strcmp(run->stats, run->output) == 0) {
        *status = cli_fail(run, CLI_USAGE, "-o and --stats name the same file '%s'", run->stats);
    } else {
        *status = manual->makes_folder ? cli_check_folder(run, run->output)
                                       : cli_check_output(run, run->output);
        if (*status == CLI_DONE && run->stats) *status = cli_check_output(run, run->stats);
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
        run->peak_bytes);
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

/* ---- output ------------------------------------------------------------------------------ */

/* An output on its way: written whole to a temporary file beside its place, then renamed. */
typedef struct output {
    const char *path;
    const void *bytes;
    size_t size;
    char place[PATH_MAX];      /* where it goes: the path, symbolic links followed */
    char temporary[PATH_MAX + 24];
    int is_device;             /* /dev/null, a pipe: written in place              */
} output;

static int find_place(output *o) {
    struct stat info;
    if (!realpath(o->path, o->place)) {
        if (errno != ENOENT || strlen(o->path) >= sizeof o->place) return 0;
        memcpy(o->place, o->path, strlen(o->path) + 1);
    } else if (stat(o->place, &info) == 0) {
        if (S_ISDIR(info.st_mode)) {
            errno = EISDIR;
            return 0;
        }
        o->is_device = !S_ISREG(info.st_mode);
    }
    snprintf(o->temporary, sizeof o->temporary, "%s.%ld.tmp", o->place, (long)getpid());
    return 1;
}

int cli_check_output(cli *run, const char *path) {
    output o = {0};
    char folder[PATH_MAX] = ".";
    o.path = path;
    if (!find_place(&o))
        return cli_fail(run, CLI_FAILED, "cannot write '%s': %s", path, strerror(errno));
    if (o.is_device) return CLI_DONE;
    const char *slash = strrchr(o.place, '/');
    if (slash) snprintf(folder, sizeof folder, "%.*s/", (int)(slash - o.place), o.place);
    if (access(folder, W_OK | X_OK) == 0) return CLI_DONE;
    return cli_fail(run, CLI_FAILED,
                    "cannot write '%s': %s; choose a folder that exists and is yours", path,
                    strerror(errno));
}

int cli_check_folder(cli *run, const char *path) {
    struct stat info;
    char place[PATH_MAX + 2];
    size_t n = strlen(path);
    if (stat(path, &info) == 0) {
        if (!S_ISDIR(info.st_mode)) errno = ENOTDIR;
        else if (access(path, W_OK | X_OK) == 0) return CLI_DONE;
        return cli_fail(run, CLI_FAILED, "cannot write into '%s': %s; name a folder of yours", path,
                        strerror(errno));
    }
    if (n > PATH_MAX) return cli_fail(run, CLI_FAILED, "the path is too long");
    memcpy(place, path, n + 1);
    while (n > 1 && place[n - 1] == '/') place[--n] = 0; /* "new/" would be looked for in itself */
    return cli_check_output(run, place);
}

static int write_all(const char *path, const output *o, int flags) {
    int file = open(path, flags, 0666);
    size_t done = 0;
    if (file < 0) return 0;
    while (done < o->size) {
        ssize_t n = write(file, (const char *)o->bytes + done, o->size - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) break;
        done += (size_t)n;
    }
    int error = done < o->size ? errno : 0;
    if (close(file) != 0 && !error) error = errno;
    errno = error;
    return error == 0;
}

/* Write all outputs, and the statistics behind them, or none. There must be room for one more. */
static int finish(cli *run, output *outputs, int count) {
    char text[4096];
    int i, written = 0, status = CLI_DONE;
    cli_stage(run, NULL);
    clear_bar(run);
    if (run->stats) {
        outputs[count].path = run->stats;
        outputs[count].bytes = text;
        outputs[count].size = format_stats(run, text, sizeof text);
        count++;
    }

    for (i = 0; i < count; i++) {
        output *o = &outputs[i];
        if (!find_place(o)) break;
        if (o->is_device) continue;
        written = i + 1;
        if (!write_all(o->temporary, o, O_WRONLY | O_CREAT | O_EXCL)) break;
    }
    for (int k = count - 1; i == count && k >= 0; k--) {
        output *o = &outputs[k];
        if (o->is_device ? !write_all(o->place, o, O_WRONLY) : rename(o->temporary, o->place) != 0)
            i = k;
    }
    if (i < count) {
        status = cli_fail(run, CLI_FAILED, "cannot write '%s': %s", outputs[i].path,
                          strerror(errno));
        for (int k = 0; k < written; k++) unlink(outputs[k].temporary);
    }
    return status;
}

int cli_finish(cli *run, const void *bytes, size_t size) {
    output outputs[2] = {{0}, {0}};
    outputs[0].path = run->output;
    outputs[0].bytes = bytes;
    outputs[0].size = size;
    return finish(run, outputs, 1);
}

int cli_finish_files(cli *run, const cli_file *files, int count) {
    output *outputs = (output *)calloc((size_t)count + 1, sizeof *outputs);
    if (!outputs) return cli_fail(run, CLI_FAILED, "out of memory");
    for (int i = 0; i < count; i++) {
        outputs[i].path = files[i].name;
        outputs[i].bytes = files[i].bytes;
        outputs[i].size = files[i].size;
    }
    const int status = finish(run, outputs, count);
    free(outputs);
    return status;
}

int cli_finish_folder(cli *run, const cli_file *files, int count) {
    cli_file *inside = (cli_file *)calloc((size_t)count, sizeof *inside);
    char *paths = (char *)calloc((size_t)count, PATH_MAX);
    int status = CLI_DONE, made = 0;
    if (!inside || !paths) status = cli_fail(run, CLI_FAILED, "out of memory");
    for (int i = 0; i < count && !status; i++) {
        char *path = paths + (size_t)i * PATH_MAX;
        inside[i] = files[i];
        inside[i].name = path;
        if (snprintf(path, PATH_MAX, "%s/%s", run->output, files[i].name) >= PATH_MAX)
            status = cli_fail(run, CLI_FAILED, "'%s': the path is too long", files[i].name);
    }
    if (!status) {
        made = mkdir(run->output, 0777) == 0;
        if (!made && errno != EEXIST)
            status = cli_fail(run, CLI_FAILED, "cannot make the folder '%s': %s", run->output,
                              strerror(errno));
    }
    if (!status) status = cli_finish_files(run, inside, count);
    if (status && made) rmdir(run->output);
    free(paths);
    free(inside);
    return status;
}
