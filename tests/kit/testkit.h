/* testkit.h - what the unit tests of every texkit header share
   SPDX-License-Identifier: MIT OR Unlicense

   Include the four headers cmocka wants, cmocka.h, then this file. Everything is static inline. Run
   tests from the root folder. faults.h has failing allocations and cancelled reports, threads.h
   parallel-for hooks. */
#ifndef TESTKIT_H
#define TESTKIT_H

#include "faults.h"
#include "threads.h"

/* First in a test that takes long and tries what shorter ones try as well: it is left to `make check`. */
#define tk_wide() \
    do { \
        if (!tk_full()) skip(); \
    } while (0)

/* ---- comparing -------------------------------------------------------------------------- */

/* FNV-1a over bytes: one number that stands for a whole output; chain by passing the last one
   as start, first 0. */
static inline uint64_t tk_hash(uint64_t start, const void *bytes, size_t count) {
    const unsigned char *p = (const unsigned char *)bytes;
    uint64_t h = start ? start : 14695981039346656037u;
    for (size_t i = 0; i < count; i++) h = (h ^ p[i]) * 1099511628211u;
    return h;
}

#endif /* TESTKIT_H */
