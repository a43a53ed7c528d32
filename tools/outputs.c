/* outputs.c - the files of a run: announced before any work, written all or none; see cli.h
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: realpath, S_ISBLK */
#include "cli.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

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

int cli_checks_folder(cli *run, const char *path) {
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

int cli_announce(cli *run, const cli_option *own, const cli_option *common) {
    int status = CLI_DONE;
    for (int i = 0; i < run->manual->inputs && run->inputs[i] && !status; i++)
        status = cli_reads(run, run->inputs[i]);
    if (!status)
        status = run->manual->makes_folder ? cli_checks_folder(run, run->output)
                                           : cli_writes(run, run->output);
    if (!status) status = announce_options(run, own);
    return status ? status : announce_options(run, common);
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
    const size_t size = cli_end(run, text, sizeof text);
    if (run->stats) {
        outputs[count].path = run->stats;
        outputs[count].bytes = text;
        outputs[count++].size = size;
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

int cli_makes_folder(cli *run, const char *path, int *made) {
    *made = mkdir(path, 0777) == 0;
    if (*made || errno == EEXIST) return CLI_DONE;
    return cli_fail(run, CLI_FAILED, "cannot make the folder '%s': %s", path, strerror(errno));
}

void cli_removes_folder(const char *path) {
    rmdir(path);
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
    if (!status) status = cli_makes_folder(run, run->output, &made);
    if (!status) status = cli_finish_files(run, inside, count);
    if (status && made) cli_removes_folder(run->output);
    free(paths);
    free(inside);
    return status;
}
