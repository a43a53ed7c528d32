/* names.c - lists of file names, which may hold commas themselves
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: stat */
#include "cli.h"

#include <sys/stat.h>

static int is_file(const char *path) {
    struct stat info;
    return stat(path, &info) == 0 && !S_ISDIR(info.st_mode);
}

static int is_one_of(char c, const char *separators) {
    return c && strchr(separators, c) != NULL;
}

/* Append to the name what stands before the next separator. 0: too long. */
static int take_part(const char **at, const char *separators, char name[CLI_MAX_PATH], size_t *n) {
    const char *c = *at;
    while (*c && !is_one_of(*c, separators)) {
        if (*n + 1 == CLI_MAX_PATH) return 0;
        c += *c == '\\' && *separators && is_one_of(c[1], ",;");
        name[(*n)++] = *c++;
    }
    name[*n] = 0;
    *at = c;
    return 1;
}

int cli_take_name(const char **list, const char *separators, char name[CLI_MAX_PATH]) {
    const char *at = *list, *rest = NULL;
    size_t n = 0, end = 0;
    for (int parts = 0; take_part(&at, separators, name, &n); parts++) {
        const int is_whole = is_file(name);
        if (parts == 0 || is_whole) {
            end = n;
            rest = *at ? at + 1 : NULL;
        }
        if (is_whole || *at == 0 || n == 0 || n + 1 == CLI_MAX_PATH) break;
        name[n++] = *at++; /* it may belong to the name */
    }
    name[end] = 0;
    *list = rest;
    return end > 0;
}
