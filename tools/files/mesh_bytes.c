/* mesh_bytes.c - lists that grow, and the bytes of a file in the making
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

#include <stdarg.h>
#include <stdio.h>

static const char no_memory[] = "not enough memory to write this mesh";

/* ---- lists that grow --------------------------------------------------------------------- */

list list_of(size_t size) {
    list l = {NULL, 0, 0, 0};
    l.size = size;
    return l;
}

/* Room for exactly so many items in all, or more. */
int list_reserve(list *l, size_t capacity) {
    size_t bytes;
    if (capacity <= l->capacity) return 1;
    if (!txm_mul(capacity, l->size, 1, &bytes) || bytes == 0) return 0;
    void *items = realloc(l->items, bytes);
    if (!items) return 0;
    l->items = items;
    l->capacity = capacity;
    return 1;
}

/* Room for more items at the end, to be filled; NULL if there is no memory. */
void *list_add(list *l, size_t more) {
    size_t count;
    if (!txm_add(l->count, more, &count)) return NULL;
    if ((count > l->capacity || !l->items) && !list_reserve(l, count + count / 2 + 16)) return NULL;
    void *place = (char *)l->items + l->count * l->size;
    l->count = count;
    return place;
}

void list_free(list *l) {
    free(l->items);
    l->items = NULL;
    l->count = l->capacity = 0;
}

/* ---- a file in the making ---------------------------------------------------------------- */

sink sink_new(void) {
    sink s;
    memset(&s, 0, sizeof s);
    s.bytes = list_of(1);
    s.loans = list_of(sizeof(loan));
    s.blocks = list_of(sizeof(void *));
    return s;
}

void sink_free(sink *s) {
    for (size_t i = 0; i < s->blocks.count; i++) free(((void **)s->blocks.items)[i]);
    list_free(&s->bytes);
    list_free(&s->loans);
    list_free(&s->blocks);
    s->lent = 0;
}

void sink_put(sink *s, const void *bytes, size_t n) {
    void *place = s->failed || n == 0 ? NULL : list_add(&s->bytes, n);
    if (place) memcpy(place, bytes, n);
    else if (n) s->failed = 1;
}

void sink_print(sink *s, const char *format, ...) {
    char line[256];
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    sink_put(s, line, n < 0 ? 0 : n < (int)sizeof line ? (size_t)n : sizeof line - 1);
}

/* Little-endian numbers. */
void sink_u16(sink *s, uint32_t v) {
    const unsigned char raw[2] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255)};
    sink_put(s, raw, 2);
}

void sink_u32(sink *s, uint32_t v) {
    const unsigned char raw[4] = {(unsigned char)(v & 255), (unsigned char)(v >> 8 & 255),
                                  (unsigned char)(v >> 16 & 255), (unsigned char)(v >> 24)};
    sink_put(s, raw, 4);
}

/* These bytes stand behind those that the sink has. */
static void sink_lend(sink *s, const void *bytes, size_t n) {
    loan *l = s->failed || n == 0 ? NULL : (loan *)list_add(&s->loans, 1);
    if (l) {
        l->behind = s->bytes.count;
        l->bytes.bytes = bytes;
        l->bytes.size = n;
        s->lent += n;
    } else if (n) {
        s->failed = 1;
    }
}

/* Loans and its own bytes in turn, one behind the other: at most 2 * loans + 1 of them. Returns how many. */
static int sink_extents(const sink *s, file_extent *to) {
    const loan *loans = (const loan *)s->loans.items;
    int count = 0;
    for (size_t i = 0, at = 0; i <= s->loans.count; i++) {
        const size_t end = i < s->loans.count ? loans[i].behind : s->bytes.count;
        if (end > at) {
            to[count].bytes = (const char *)s->bytes.items + at;
            to[count++].size = end - at;
        }
        if (i < s->loans.count) to[count++] = loans[i].bytes;
        at = end;
    }
    return count;
}

void sink_move(sink *s, sink *from) {
    file_extent *parts = (file_extent *)malloc((2 * from->loans.count + 1) * sizeof *parts);
    void **blocks = (void **)list_add(&s->blocks, from->blocks.count + 1);
    if (parts && blocks) {
        const int count = sink_extents(from, parts);
        for (int i = 0; i < count; i++) sink_lend(s, parts[i].bytes, parts[i].size);
        if (from->blocks.count) memcpy(blocks, from->blocks.items, from->blocks.count * sizeof *blocks);
        blocks[from->blocks.count] = from->bytes.items;
        s->failed |= from->failed;
        from->bytes.items = NULL;
        from->blocks.count = 0;
    } else {
        if (blocks) s->blocks.count -= from->blocks.count + 1;
        s->failed = 1;
    }
    free(parts);
    sink_free(from);
}

/* Are floats in memory as they are in files? */
static int floats_are_little_endian(void) {
    const float one = 1;
    const unsigned char in_file[4] = {0, 0, 0x80, 0x3f};
    unsigned char raw[4];
    memcpy(raw, &one, sizeof raw);
    return !memcmp(raw, in_file, sizeof raw);
}

void sink_lend_floats(sink *s, const float *v, size_t n) {
    if (floats_are_little_endian()) sink_lend(s, v, n * sizeof *v);
    else sink_floats(s, v, n);
}

void sink_floats(sink *s, const float *v, size_t n) {
    if (floats_are_little_endian()) {
        sink_put(s, v, n * sizeof *v);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &v[i], 4);
        sink_u32(s, bits);
    }
}

void sink_doubles(sink *s, const double *v, size_t n) {
    for (size_t i = 0; i < n; i++) {
        uint64_t bits;
        memcpy(&bits, &v[i], 8);
        sink_u32(s, (uint32_t)(bits & 0xffffffffu));
        sink_u32(s, (uint32_t)(bits >> 32));
    }
}

int sink_finish(sink *s, unsigned char **bytes, size_t *size, const char **why) {
    mesh_file file;
    *bytes = NULL;
    if (!s->failed && s->loans.count == 0) {
        *bytes = (unsigned char *)s->bytes.items;
        *size = s->bytes.count;
        return 1;
    }
    if (!sink_finish_extents(s, &file, why)) return 0;
    unsigned char *at = (unsigned char *)malloc(file.size);
    *bytes = at;
    *size = file.size;
    for (int i = 0; i < file.count && at; i++) {
        memcpy(at, file.extents[i].bytes, file.extents[i].size);
        at += file.extents[i].size;
    }
    mesh_file_free(&file);
    return *bytes ? 1 : (*why = no_memory, 0);
}

int sink_finish_extents(sink *s, mesh_file *file, const char **why) {
    memset(file, 0, sizeof *file);
    sink all = sink_new();
    const size_t size = sink_size(s);
    sink_move(&all, s);
    file_extent *extents = (file_extent *)malloc((all.loans.count + 1) * sizeof *extents);
    if (all.failed || !extents) {
        free(extents);
        sink_free(&all);
        return *why = no_memory, 0;
    }
    file->extents = extents;
    file->count = sink_extents(&all, extents);
    file->size = size;
    file->blocks = (void **)all.blocks.items;
    file->block_count = (int)all.blocks.count;
    list_free(&all.loans);
    return 1;
}

void mesh_file_free(mesh_file *file) {
    for (int i = 0; i < file->block_count; i++) free(file->blocks[i]);
    free(file->blocks);
    free(file->extents);
    memset(file, 0, sizeof *file);
}
