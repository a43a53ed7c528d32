/* starve.c - preloaded into a program, fails its allocation number STARVE_AT
   SPDX-License-Identifier: MIT OR Unlicense

   Counted are the calls of malloc, calloc and realloc by the program itself, not those of its
   libraries. Their number goes to the file STARVE_COUNT at the end, if that is set. For glibc. */
#define _GNU_SOURCE /* dl_iterate_phdr */
#include <link.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

void *__libc_malloc(size_t bytes);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t bytes);

static long calls, fail_at;
static uintptr_t begins, ends; /* where the program lies; 0 until that is known, so none is its own */

/* The program comes first. */
static int find_program(struct dl_phdr_info *info, size_t size, void *user) {
    (void)size, (void)user;
    begins = info->dlpi_addr;
    for (int k = 0; k < info->dlpi_phnum; k++) {
        const uintptr_t end = begins + info->dlpi_phdr[k].p_vaddr + info->dlpi_phdr[k].p_memsz;
        if (info->dlpi_phdr[k].p_type == PT_LOAD && end > ends) ends = end;
    }
    return 1;
}

__attribute__((constructor)) static void begin(void) {
    const char *at = getenv("STARVE_AT");
    fail_at = at ? atol(at) : 0;
    dl_iterate_phdr(find_program, NULL);
}

__attribute__((destructor)) static void end(void) {
    const char *path = getenv("STARVE_COUNT");
    FILE *file = path ? fopen(path, "w") : NULL;
    if (!file) return;
    fprintf(file, "%ld\n", calls);
    fclose(file);
}

static int fails(void *caller) {
    return (uintptr_t)caller >= begins && (uintptr_t)caller < ends && ++calls == fail_at;
}

void *malloc(size_t bytes) {
    return fails(__builtin_return_address(0)) ? NULL : __libc_malloc(bytes);
}
void *calloc(size_t count, size_t size) {
    return fails(__builtin_return_address(0)) ? NULL : __libc_calloc(count, size);
}
void *realloc(void *block, size_t bytes) {
    return fails(__builtin_return_address(0)) ? NULL : __libc_realloc(block, bytes);
}
