/* outputs.c - the files of a run: announced before any work, written all or none; see cli.h
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: openat, linkat */
#include "cli.h"
#include "place.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

/* ---- announcing --------------------------------------------------------------------------- */

static int is_stream(const char *path) {
    return !strcmp(path, "-");
}

static int cannot_write(cli *run, const char *path, const char *why) {
    return cli_fail(run, CLI_FAILED, "cannot write '%s': %s", path, why);
}

/* Why no file can be made there; errno is of place_find. */
static int cannot_find(cli *run, const char *path) {
    const int is_folder = errno == ENOENT || errno == EACCES || errno == ENOTDIR;
    return cli_fail(run, CLI_FAILED, "cannot write '%s': %s%s", path, strerror(errno),
                    is_folder ? "; choose a folder that exists and that you may write to" : "");
}

/* Can this path be written at all? */
static int check_output(cli *run, const char *path) {
    place p;
    if (is_stream(path)) return CLI_DONE;
    if (!place_find(path, &p)) return cannot_find(run, path);
    cli_stop_hold(); /* it makes a file and removes it */
    const char *why = p.is_device && access(path, W_OK) != 0 ? strerror(errno) : place_refusal(&p);
    cli_stop_release();
    place_close(&p);
    return why ? cannot_write(run, path, why) : CLI_DONE;
}

int cli_checks_folder(cli *run, const char *path) {
    struct stat info;
    char name[CLI_MAX_PATH];
    const char *why = NULL;
    place p;
    size_t n = strlen(path);
    if (stat(path, &info) != 0 && lstat(path, &info) != 0) { /* there is no such folder yet */
        if (n >= sizeof name) return cannot_write(run, path, strerror(ENAMETOOLONG));
        memcpy(name, path, n + 1);
        while (n > 1 && name[n - 1] == '/') name[--n] = 0; /* else "new/" is in "new" */
        return check_output(run, name);
    }
    if (!place_in_folder(path, &p)) why = strerror(errno);
    cli_stop_hold();
    if (!why) why = place_refusal(&p);
    cli_stop_release();
    place_close(&p);
    if (!why) return CLI_DONE;
    return cli_fail(run, CLI_FAILED, "cannot write into '%s': %s; name another folder", path, why);
}

/* An announced file. */
typedef struct announced {
    char *path;
    int is_output;
    int is_file; /* exists or will; not a pipe or folder, which writing cannot destroy */
    place place; /* closed */
} announced;

/* A program runs one command: the list lasts until it exits. */
static announced *known;
static size_t known_count;

static void identify(announced *a) {
    place *p = &a->place;
    if (is_stream(a->path)) {
        p->folder = -1;
        a->is_file = fstat(a->is_output ? STDOUT_FILENO : STDIN_FILENO, &p->info) == 0 &&
                     S_ISREG(p->info.st_mode);
        p->exists = 1;
    } else {
        a->is_file = place_find(a->path, p) && (!p->is_device || S_ISBLK(p->info.st_mode));
        place_close(p);
    }
}

static int is_same_file(const announced *a, const announced *b) {
    if (is_stream(a->path) && is_stream(b->path)) return a->is_output == b->is_output;
    return a->is_file && b->is_file && place_is_same(&a->place, &b->place);
}

int cli_is_output(const char *path) {
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
        if (!is_same_file(a, b)) continue;
        if (a->is_output && b->is_output)
            return cli_fail(run, CLI_USAGE, "'%s' and '%s' are the same file and would be written "
                            "twice; give them different names", b->path, path);
        if (a->is_output || b->is_output)
            return cli_fail(run, CLI_USAGE, "writing '%s' would destroy '%s', which is read; give the "
                            "output another name", is_output ? path : b->path,
                            is_output ? b->path : path);
        if (is_stream(path))
            return cli_fail(run, CLI_USAGE, "'-', standard input, holds one file; name the others");
    }
    return CLI_DONE;
}

/* Where results go that are written to standard output; -1: there are none. */
static int data = -1;

static int take_stdout(cli *run, const char *output) {
    static const char *const texts[] = {".obj", ".svg", ".json", ".txt", ".ply", ""};
    const char *extension = strrchr(output, '.');
    int is_text = 0;
    for (int i = 0; texts[i][0]; i++) is_text |= extension && !strcmp(extension, texts[i]);
    if (isatty(STDOUT_FILENO) && !is_text && strcmp(output, "-") != 0)
        return cli_fail(run, CLI_USAGE, "standard output is a terminal; redirect it, or name an OUT");
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    data = dup(STDOUT_FILENO);
    if (data >= 0 && nowhere >= 0 && dup2(nowhere, STDOUT_FILENO) >= 0) return CLI_DONE;
    return cannot_write(run, "-", strerror(errno));
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
    if (!status && run->manual->makes_folder) status = cli_checks_folder(run, run->output);
    else if (!status) status = cli_writes(run, run->to_stdout ? "-" : run->output);
    if (!status) status = announce_options(run, own);
    if (!status) status = announce_options(run, common);
    if (!status && run->to_stdout) status = take_stdout(run, run->output);
    else if (!status && run->stats && is_stream(run->stats)) status = take_stdout(run, "-");
    return status;
}

/* ---- writing ---------------------------------------------------------------------------- */

typedef struct output {
    const char *path;
    file_extent whole;
    const file_extent *extents; /* &whole, or others */
    int extent_count;
    int is_stdout;
    place place;
    char temporary[PLACE_TEMPORARY]; /* the name of a file in that folder, or empty */
    char old[PLACE_TEMPORARY];       /* the same: what is replaced, by another name */
} output;

/* What must go if the program ends now. */
static output *unfinished;
static int unfinished_count;
static char new_folder[CLI_MAX_PATH];

void cli_remove_unfinished(void) {
    for (int i = 0; i < unfinished_count; i++) {
        const output *o = &unfinished[i];
        if (o->temporary[0]) unlinkat(o->place.folder, o->temporary, 0);
    }
    if (new_folder[0]) rmdir(new_folder);
}

static int write_extent(int file, const file_extent *e) {
    for (size_t done = 0; done < e->size;) {
        const ssize_t n = write(file, (const char *)e->bytes + done, e->size - done);
        if (n < 0 && errno == EINTR) continue;
        if (n == 0) errno = EIO;
        if (n <= 0) return 0;
        done += (size_t)n;
    }
    return 1;
}

static int write_extents(int file, const output *o) {
    int ok = 1;
    for (int i = 0; i < o->extent_count && ok; i++) ok = write_extent(file, &o->extents[i]);
    return ok;
}

static int write_and_close(int file, const output *o, int keep_mode) {
    if (file < 0) return 0;
    int error = write_extents(file, o) && (!keep_mode || place_keep_mode(&o->place, file)) ? 0 : errno;
    if (close(file) != 0 && !error) error = errno;
    errno = error;
    return error == 0;
}

static int write_temporary(output *o) {
    cli_stop_hold();
    const int file = place_create(&o->place, o->temporary);
    if (file < 0) o->temporary[0] = 0;
    cli_stop_release();
    return write_and_close(file, o, 1);
}

/* What cannot be taken back is written first: if it fails, nothing else has changed. */
static int write_device(const output *o) {
    if (o->is_stdout) return write_and_close(data, o, 0);
    return write_and_close(open(o->path, O_WRONLY | O_CLOEXEC), o, 0);
}

/* Two runs that write the same set of files take turns, as far as the system allows: the set is then
   that of one of them. Not for long, for a stranger may hold this lock. */
static int lock_folder(const output *o) {
    enum { TRIES = 100 };
    const struct timespec pause = {0, 10000000}; /* 10 ms */
    const int file = openat(o->place.folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    for (int i = 0; i < TRIES && file >= 0 && flock(file, LOCK_EX | LOCK_NB) != 0; i++)
        if (errno != EWOULDBLOCK || nanosleep(&pause, NULL) != 0) break;
    return file;
}

/* Give the file that will be replaced a second name, from which it can be restored. Without it, as on
   systems without hard links, the rest is done all the same. */
static void keep_old(output *o) {
    for (unsigned i = 0; i < 100 && o->place.exists; i++) {
        snprintf(o->old, sizeof o->old, ".texkit-old%08x", (unsigned)getpid() * 100 + i);
        if (linkat(o->place.folder, o->place.name, o->place.folder, o->old, 0) == 0) return;
        if (errno != EEXIST) break;
    }
    o->old[0] = 0;
}

static void restore(output *o) {
    const int folder = o->place.folder;
    if (o->old[0]) renameat(folder, o->old, folder, o->place.name);
    else if (!o->place.exists) unlinkat(folder, o->place.name, 0);
    o->old[0] = 0;
}

/* Rename the temporary files, all or none; returns the index of one that failed, or count. */
static int rename_all(output *outputs, int count) {
    int error = 0, failed = count, done = count;
    const int lock = count > 1 && outputs[0].temporary[0] ? lock_folder(&outputs[0]) : -1;
    for (int k = count - 1; k >= 0 && failed == count; k--) {
        output *o = &outputs[k];
        if (!o->temporary[0]) continue;
        if (count > 1) keep_old(o);
        if (renameat(o->place.folder, o->temporary, o->place.folder, o->place.name) != 0) {
            error = errno;
            failed = k;
        } else {
            o->temporary[0] = 0;
            done = k;
        }
    }
    for (int k = done; k < count && failed < count; k++)
        if (!outputs[k].place.is_device && !outputs[k].is_stdout) restore(&outputs[k]);
    for (int k = 0; k < count; k++)
        if (outputs[k].old[0]) unlinkat(outputs[k].place.folder, outputs[k].old, 0);
    if (lock >= 0) close(lock);
    errno = error;
    return failed;
}

/* Write all outputs, or none: returns the index of one that failed, with errno set, or count. */
static int write_outputs(output *outputs, int count) {
    for (int i = 0; i < count; i++) {
        output *o = &outputs[i];
        if (!o->is_stdout && !place_find(o->path, &o->place)) return i;
        if (!o->is_stdout && !o->place.is_device && !write_temporary(o)) return i;
    }
    for (int i = 0; i < count; i++)
        if ((outputs[i].is_stdout || outputs[i].place.is_device) && !write_device(&outputs[i])) return i;
    cli_stop_hold();
    const int failed = rename_all(outputs, count);
    if (failed < count) cli_stop_release(); /* else it is too late to stop */
    return failed;
}

/* The bytes of an output are in one block. */
static void set_bytes(output *o, const void *bytes, size_t size) {
    o->whole.bytes = bytes;
    o->whole.size = size;
    o->extents = &o->whole;
    o->extent_count = 1;
}

/* Write all outputs and the statistics, or none. outputs must have room for one more. */
static int finish(cli *run, output *outputs, int count) {
    char text[8192];
    const size_t size = cli_end(run, text, sizeof text);
    if (run->stats) {
        outputs[count].path = run->stats;
        set_bytes(&outputs[count++], text, size);
    }
    for (int i = 0; i < count; i++) {
        outputs[i].place.folder = -1;
        outputs[i].is_stdout = is_stream(outputs[i].path) ||
                               (run->to_stdout && !strcmp(outputs[i].path, run->output));
        assert(outputs[i].is_stdout || cli_is_output(outputs[i].path));
    }
    unfinished = outputs;
    unfinished_count = count;
    const int failed = write_outputs(outputs, count);
    const char *why = failed < count ? strerror(errno) : NULL;
    cli_stop_hold();
    if (why) cli_remove_unfinished();
    unfinished_count = 0;
    new_folder[0] = 0;
    if (why) cli_stop_release();
    for (int i = 0; i < count; i++) place_close(&outputs[i].place);
    return why ? cannot_write(run, outputs[failed].path, why) : CLI_DONE;
}

int cli_finish(cli *run, const void *bytes, size_t size) {
    output outputs[2] = {{0}, {0}};
    outputs[0].path = run->output;
    set_bytes(&outputs[0], bytes, size);
    return finish(run, outputs, 1);
}

int cli_finish_files(cli *run, const cli_file *files, int count) {
    output *outputs = (output *)calloc((size_t)count + 1, sizeof *outputs);
    if (!outputs) return cli_fail(run, CLI_FAILED, "out of memory");
    for (int i = 0; i < count; i++) {
        outputs[i].path = files[i].name;
        set_bytes(&outputs[i], files[i].bytes, files[i].size);
        if (!files[i].extents) continue;
        outputs[i].extents = files[i].extents;
        outputs[i].extent_count = files[i].extent_count;
    }
    const int status = finish(run, outputs, count);
    free(outputs);
    return status;
}

int cli_makes_folder(cli *run, const char *path, int *made) {
    const size_t n = strlen(path);
    cli_stop_hold();
    *made = mkdir(path, 0777) == 0;
    const int error = *made || errno == EEXIST ? 0 : errno;
    if (*made && n < sizeof new_folder) memcpy(new_folder, path, n + 1);
    cli_stop_release();
    if (!error) return CLI_DONE;
    return cli_fail(run, CLI_FAILED, "cannot make the folder '%s': %s", path, strerror(error));
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
