/* place.c - where the path of an output leads; place.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#define _GNU_SOURCE /* O_PATH: a folder that may not be listed can be written to */
#include "place.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#ifndef O_PATH
#define O_PATH O_RDONLY
#endif

enum {
    MAX_LINKS = 40,    /* symbolic links that are followed, as Linux does */
    MAX_TRIES = 100,   /* names tried for a temporary file */
    MODE_BITS = 07777, /* what chmod sets */
    ANY_MAY_WRITE = 0222
};

/* ---- where a path leads --------------------------------------------------------------------- */

static int open_folder(int at, const char *path) {
    return openat(at, path, O_PATH | O_DIRECTORY | O_CLOEXEC);
}

/* Opens the folder of a path that is relative to another one, and takes over the name in it. */
static int enter(place *p, char *path) {
    char *slash = strrchr(path, '/');
    const char *name = slash ? slash + 1 : path;
    const int at = p->folder;
    if (*name == 0 || strlen(name) > NAME_MAX) {
        errno = *name ? ENAMETOOLONG : EISDIR;
        return 0;
    }
    memcpy(p->name, name, strlen(name) + 1);
    if (slash) slash[1] = 0;
    const int folder = open_folder(at < 0 ? AT_FDCWD : at, slash ? path : ".");
    if (folder < 0) return 0;
    if (at >= 0) close(at);
    p->folder = folder;
    return 1;
}

/* Follows the links that a path of a regular file, or of none, ends in. */
static int follow(place *p, char path[PATH_MAX]) {
    for (int links = 0; links < MAX_LINKS; links++) {
        if (!enter(p, path)) return 0;
        if (fstatat(p->folder, p->name, &p->info, AT_SYMLINK_NOFOLLOW) != 0)
            return errno == ENOENT && fstat(p->folder, &p->info) == 0;
        if (S_ISDIR(p->info.st_mode)) {
            errno = EISDIR;
            return 0;
        }
        p->exists = 1;
        if (!S_ISLNK(p->info.st_mode)) return 1;
        const ssize_t n = readlinkat(p->folder, p->name, path, PATH_MAX);
        if (n < 0) return 0;
        if (n == PATH_MAX) break;
        path[n] = 0;
        p->exists = 0;
    }
    errno = ELOOP;
    return 0;
}

int place_find(const char *path, place *p) {
    char rest[PATH_MAX];
    memset(p, 0, sizeof *p);
    p->folder = -1;
    if (stat(path, &p->info) == 0) {
        p->exists = 1;
        p->is_device = !S_ISREG(p->info.st_mode) && !S_ISDIR(p->info.st_mode);
        if (S_ISDIR(p->info.st_mode)) errno = EISDIR;
        if (!S_ISREG(p->info.st_mode)) return p->is_device;
    } else if (errno != ENOENT) return 0;
    p->exists = 0;
    if (strlen(path) >= sizeof rest) {
        errno = ENAMETOOLONG;
        return 0;
    }
    memcpy(rest, path, strlen(path) + 1);
    if (follow(p, rest)) return 1;
    const int error = errno;
    place_close(p);
    errno = error;
    return 0;
}

int place_in_folder(const char *path, place *p) {
    memset(p, 0, sizeof *p);
    p->folder = open_folder(AT_FDCWD, path);
    return p->folder >= 0 && fstat(p->folder, &p->info) == 0;
}

void place_close(place *p) {
    if (p->folder >= 0) close(p->folder);
    p->folder = -1;
}

int place_is_same(const place *a, const place *b) {
    return a->info.st_dev == b->info.st_dev && a->info.st_ino == b->info.st_ino &&
           a->exists == b->exists && (a->exists || !strcmp(a->name, b->name));
}

/* ---- writing there --------------------------------------------------------------------------- */

int place_create(const place *p, char temporary[PLACE_TEMPORARY]) {
    static unsigned count;
    for (int i = 0; i < MAX_TRIES; i++) {
        struct timespec t;
        clock_gettime(CLOCK_REALTIME, &t);
        const unsigned mixed = (unsigned)t.tv_nsec * 2654435761u ^ (unsigned)getpid() * 40503u;
        snprintf(temporary, PLACE_TEMPORARY, ".texkit-%08x.tmp", mixed + count++);
        const int file = openat(p->folder, temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
                                p->exists ? 0600 : 0666);
        if (file >= 0 || errno != EEXIST) return file;
    }
    return -1;
}

int place_keep_mode(const place *p, int file) {
    struct stat info;
    if (!p->exists) return 1;
    if (fstat(file, &info) != 0) return 0;
    if (info.st_uid != p->info.st_uid || info.st_gid != p->info.st_gid) {
        /* only root may give files away; the group can be kept by its members */
        const int is_kept = fchown(file, p->info.st_uid, p->info.st_gid) == 0 ||
                            fchown(file, (uid_t)-1, p->info.st_gid) == 0;
        (void)is_kept;
    }
    return fchmod(file, p->info.st_mode & MODE_BITS) == 0;
}

/* In a folder such as /tmp, only who owns a file, or the folder, can replace it. */
static int belongs_to_others(const place *p) {
    struct stat folder;
    const uid_t user = geteuid();
    return user != 0 && user != p->info.st_uid && fstat(p->folder, &folder) == 0 &&
           (folder.st_mode & S_ISVTX) && folder.st_uid != user;
}

const char *place_refusal(const place *p) {
    char temporary[PLACE_TEMPORARY];
    if (p->is_device) return NULL;
    if (p->exists && (!(p->info.st_mode & ANY_MAY_WRITE) ||
                      faccessat(p->folder, p->name, W_OK, 0) != 0))
        return "it is read-only; make it writable or choose another name";
    if (p->exists && belongs_to_others(p)) return "it belongs to another user; choose another name";
    const int file = place_create(p, temporary); /* what else can be wrong shows if it is tried */
    int error = file < 0 ? errno : 0;
    if (file >= 0) {
        if (write(file, "", 1) != 1) error = errno;
        close(file);
        unlinkat(p->folder, temporary, 0);
    }
    return error ? strerror(error) : NULL;
}
