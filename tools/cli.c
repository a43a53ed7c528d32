/* cli.c - what every texkit command shares; cli.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: clock_gettime, realpath, isatty */
#include "cli.h"

#include <assert.h>
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

/* ---- the files of a run ------------------------------------------------------------------- */

/* An output: written to a temporary file in its folder, then renamed. */
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

/* Can this path be written at all? */
static int check_output(cli *run, const char *path) {
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
                    "cannot write '%s': %s; choose a folder that exists and that you may write to",
                    path, strerror(errno));
}

/* The same for a folder: is it there and writable, or can it be made? */
static int check_folder(cli *run, const char *path) {
    struct stat info;
    char place[PATH_MAX + 2];
    size_t n = strlen(path);
    if (stat(path, &info) == 0) {
        if (!S_ISDIR(info.st_mode)) errno = ENOTDIR;
        else if (access(path, W_OK | X_OK) == 0) return CLI_DONE;
        return cli_fail(run, CLI_FAILED, "cannot write into '%s': %s; name another folder", path,
                        strerror(errno));
    }
    if (n > PATH_MAX) return cli_fail(run, CLI_FAILED, "the path is too long");
    memcpy(place, path, n + 1);
    while (n > 1 && place[n - 1] == '/') place[--n] = 0; /* else "new/" is in "new" */
    return check_output(run, place);
}

/* An announced file. Paths lead to the same file if device, inode and name are equal. */
typedef struct announced {
    char *path;
    int is_output;
    int is_file;      /* exists or will; not a pipe or folder, which writing cannot destroy  */
    dev_t device;
    ino_t inode;      /* of the file if it exists, else of the folder that it will be in     */
    const char *name; /* in that folder; empty if the file exists                            */
} announced;

/* A program runs one command: the list lasts until it exits. */
static announced *known;
static size_t known_count;

static void identify(announced *a) {
    struct stat info;
    a->name = "";
    if (stat(a->path, &info) == 0) {
        a->is_file = S_ISREG(info.st_mode) || S_ISBLK(info.st_mode);
    } else {
        char folder[PATH_MAX] = ".";
        const char *slash = strrchr(a->path, '/');
        if (slash) snprintf(folder, sizeof folder, "%.*s/", (int)(slash - a->path), a->path);
        if (stat(folder, &info) != 0) return;
        a->name = slash ? slash + 1 : a->path;
        a->is_file = 1;
    }
    a->device = info.st_dev;
    a->inode = info.st_ino;
}

static int is_same_file(const announced *a, const announced *b) {
    return a->is_file && b->is_file && a->device == b->device && a->inode == b->inode &&
           !strcmp(a->name, b->name);
}

static int is_output(const char *path) {
    for (size_t i = 0; i < known_count; i++)
        if (known[i].is_output && !strcmp(known[i].path, path)) return 1;
    return 0;
}

static int announce(cli *run, const char *path, int is_output) {
    const size_t size = strlen(path) + 1;
    announced *list = (announced *)realloc(known, (known_count + 1) * sizeof *known);
    char *copy = list ? (char *)malloc(size) : NULL;
    if (list) known = list;
    if (!copy) return cli_fail(run, CLI_FAILED, "out of memory");
    memcpy(copy, path, size);
    announced *a = &known[known_count++];
    memset(a, 0, sizeof *a);
    a->path = copy;
    a->is_output = is_output;
    identify(a);
    for (const announced *b = known; b < a; b++) {
        if (!(a->is_output || b->is_output) || !is_same_file(a, b)) continue;
        if (a->is_output && b->is_output)
            return cli_fail(run, CLI_USAGE, "'%s' and '%s' are the same file and would be written "
                            "twice; give them different names", b->path, path);
        return cli_fail(run, CLI_USAGE, "writing '%s' would destroy '%s', which is read; give the "
                        "output another name", is_output ? path : b->path,
                        is_output ? b->path : path);
    }
    return CLI_DONE;
}

int cli_reads(cli *run, const char *path) {
    return announce(run, path, 0);
}

int cli_writes(cli *run, const char *path) {
    const int status = announce(run, path, 1);
    return status ? status : check_output(run, path);
}

/* The path of a file in a folder; an exit status. */
static int path_inside(cli *run, const char *folder, const char *name, char path[CLI_MAX_PATH]) {
    if (snprintf(path, CLI_MAX_PATH, "%s/%s", folder, name) < CLI_MAX_PATH) return CLI_DONE;
    return cli_fail(run, CLI_USAGE, "'%s': the path is too long", folder);
}

int cli_writes_inside(cli *run, const char *name) {
    char path[CLI_MAX_PATH];
    int status = path_inside(run, run->output, name, path);
    if (!status) status = announce(run, path, 1);
    if (!status && access(run->output, F_OK) == 0) status = check_output(run, path);
    return status;
}

int cli_take_name(const char **list, const char *separators, char name[CLI_MAX_PATH]) {
    const size_t length = strcspn(*list, separators);
    const char *from = *list;
    *list = from[length] ? from + length + 1 : NULL;
    if (length == 0 || length >= CLI_MAX_PATH) return 0;
    memcpy(name, from, length);
    name[length] = 0;
    return 1;
}

/* Announce the files that the value of an option names. */
static int announce_option(cli *run, const cli_option *o) {
    static const char *const tiles[] = {"tiles.json", "atlas.png"}; /* what of a set is read */
    char path[CLI_MAX_PATH];
    const char *value = *(const char *const *)o->target;
    int status = CLI_DONE;
    if (o->kind == CLI_INPUT) return cli_reads(run, value);
    if (o->kind == CLI_OUTPUT) return cli_writes(run, value);
    for (int i = 0; i < 2 && !status && o->kind == CLI_TILES; i++) {
        status = path_inside(run, value, tiles[i], path);
        if (!status) status = cli_reads(run, path);
    }
    for (const char *at = value; at && !status && o->kind != CLI_TILES;) {
        status = cli_take_name(&at, o->kind == CLI_GROUPS ? ",;" : ",", path)
                     ? cli_reads(run, path)
                     : cli_fail(run, CLI_USAGE, "%s '%s': a name is empty or too long", o->name,
                                value);
    }
    return status;
}

static int announce_options(cli *run, const cli_option *table) {
    int status = CLI_DONE;
    for (; table->kind != CLI_END && !status; table++) {
        const int is_path = table->kind >= CLI_INPUT && table->kind <= CLI_OUTPUT;
        if (is_path && *(const char *const *)table->target) status = announce_option(run, table);
    }
    return status;
}

/* Announce the files that the command line names. */
static int announce_files(cli *run, const cli_option *own, const cli_option *common) {
    int status = CLI_DONE;
    for (int i = 0; i < run->manual->inputs && !status; i++) status = cli_reads(run, run->inputs[i]);
    if (!status)
        status = run->manual->makes_folder ? check_folder(run, run->output)
                                           : cli_writes(run, run->output);
    if (!status) status = announce_options(run, own);
    return status ? status : announce_options(run, common);
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
        *status = announce_files(run, options, common);
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

/* ---- writing ---------------------------------------------------------------------------- */

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

/* Write all outputs and the statistics, or none. outputs must have room for one more. */
static int finish(cli *run, output *outputs, int count) {
    char text[4096];
    int i, written = 0, status = CLI_DONE;
    for (i = 0; i < count; i++) assert(is_output(outputs[i].path));
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
    char(*paths)[CLI_MAX_PATH] = (char(*)[CLI_MAX_PATH])calloc((size_t)count, CLI_MAX_PATH);
    int status = CLI_DONE, made = 0;
    if (!inside || !paths) status = cli_fail(run, CLI_FAILED, "out of memory");
    for (int i = 0; i < count && !status; i++) {
        inside[i] = files[i];
        inside[i].name = paths[i];
        status = path_inside(run, run->output, files[i].name, paths[i]);
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
