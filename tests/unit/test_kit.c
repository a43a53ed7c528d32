/* test_kit.c - the sweep of testkit.h notices what it is there for
   SPDX-License-Identifier: MIT OR Unlicense                                                      */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "testkit.h"

/* Work with 30 allocations and as many reports, and one way in which it may be wrong. */
typedef enum fault { NONE, SWALLOWED, SILENT, LEAKING, LATE, TOUCHING, STAGELESS, FAILING } fault;

static unsigned char out[8];
static void *leaked[16]; /* what tk_memory shall miss and a leak checker shall not */
static int leaked_count;

static txm_status work(void *context, txm_env *env) {
    const fault wrong = *(const fault *)context;
    txm_status status = wrong == FAILING ? TXM_BAD_ARGUMENT : TXM_OK;
    void *kept = NULL;
    for (int i = 0; i < 30 && status == TXM_OK; i++) {
        void *block = txm_alloc(env, 8);
        if (!block) {
            if (wrong == SWALLOWED) break;
            status = txm_fail(env, TXM_OUT_OF_MEMORY, wrong == SILENT ? "" : "no memory");
        } else if (txm_progress(env, (float)i / 30, wrong == STAGELESS ? "" : "work")) {
            if (wrong == LATE) txm_progress(env, 1, "work");
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
        }
        if (wrong == TOUCHING) out[3] = 1;
        if (wrong == LEAKING && i == 5 && status == TXM_OK) kept = block;
        else txm_free(env, block);
    }
    if (status == TXM_OK) txm_free(env, kept);
    else if (kept) leaked[leaked_count++ % 16] = kept;
    if (status == TXM_OK) memset(out, 1, sizeof out);
    return status;
}

static long sweep(fault wrong, tk_kind kind) {
    const tk_output outputs[1] = {{out, sizeof out}};
    return tk_sweep_outputs(work, &wrong, kind, outputs, 1);
}

static void test_sweep(void **state) {
    (void)state;
    for (int kind = TK_ALLOCATION; kind <= TK_CANCEL; kind++) {
        const int cancels = kind == TK_CANCEL;
        assert_int_equal(sweep(NONE, (tk_kind)kind), 30);
        assert_int_equal(sweep(SWALLOWED, (tk_kind)kind), cancels ? 30 : -1);
        assert_int_equal(sweep(SILENT, (tk_kind)kind), cancels ? 30 : -1);
        assert_int_equal(sweep(LEAKING, (tk_kind)kind), -1);
        assert_int_equal(sweep(LATE, (tk_kind)kind), cancels ? -1 : 30);
        assert_int_equal(sweep(TOUCHING, (tk_kind)kind), -1);
        assert_int_equal(sweep(STAGELESS, (tk_kind)kind), -1);
        assert_int_equal(sweep(FAILING, (tk_kind)kind), -1);
    }
}

/* A sample has the first places and the last; with FULL=1 it is all of them. */
static void test_places(void **state) {
    static const long sample[9] = {1, 2, 3, 5, 8, 13, 21, 30, 0};
    const char *full = getenv("FULL");
    const int was_full = tk_full();
    (void)state;
    setenv("FULL", "0", 1);
    long place = 0;
    for (int i = 0; i < 9; i++) assert_int_equal(place = tk_places(place, 30), sample[i]);
    assert_int_equal(tk_places(0, 1), 1);
    assert_int_equal(tk_places(0, 0), 0);
    setenv("FULL", "1", 1);
    for (place = 0; place < 30; place++) assert_int_equal(tk_places(place, 30), place + 1);
    assert_int_equal(tk_places(30, 30), 0);
    if (full) setenv("FULL", was_full ? "1" : "0", 1);
    else unsetenv("FULL");
}

/* Of two places in the code, reached in turn with calls 1 and 2, 3 and 4 ..., both are tried the 1st, 2nd,
   3rd, 5th ... time that they are reached. */
static void test_traced_places(void **state) {
    static const long tried[12] = {1, 2, 3, 4, 5, 6, 9, 10, 15, 16, 20, 0};
    static tk_trace trace;
    (void)state;
    trace.count = 19;
    for (long i = 0; i < trace.count; i++) trace.from[i] = 7 + (uint64_t)i % 2;
    long call = 0;
    for (int i = 0; i < 12; i++) assert_int_equal(call = tk_next_traced(&trace, call, 20), tried[i]);
    assert_int_equal(tk_next_traced(&trace, 0, 0), 0);
    const char *full = getenv("FULL");
    const int was_full = tk_full();
    setenv("FULL", "1", 1);
    static const long thinned[4] = {4, 10, 20, 0};
    call = 0;
    for (int i = 0; i < 4; i++) assert_int_equal(call = tk_next_place(&trace, call, 20, 4), thinned[i]);
    if (full) setenv("FULL", was_full ? "1" : "0", 1);
    else unsetenv("FULL");
    assert_int_equal(tk_next_traced(&trace, 21, 22), 22); /* not noted */
}

static void call_once(tk_trace *trace) {
    tk_memory memory = {.trace = trace};
    tk_release(&memory, tk_allocate(&memory, 1));
}

/* A place in the code is told by its callers. */
static void test_trace(void **state) {
    static tk_trace trace;
    (void)state;
    for (int i = 0; i < 2; i++) call_once(&trace);
    call_once(&trace);
    assert_int_equal(trace.count, 3);
    assert_true(trace.from[0] == trace.from[1] && trace.from[1] != trace.from[2]);
}

/* A release of a foreign block, one of a block twice, and an overrun are counted. */
static void test_memory(void **state) {
    tk_memory memory;
    (void)state;
    memset(&memory, 0, sizeof memory);
    txm_env env = tk_env(&memory, NULL);
    unsigned char *block = (unsigned char *)txm_alloc(&env, 5), *other;
    assert_int_equal(tk_leaks(&memory), 1);
    txm_free(&env, block);
    assert_int_equal(tk_leaks(&memory), 0);
    other = (unsigned char *)txm_alloc(&env, 5);
    other[5] = 0; /* inside the guard */
    txm_free(&env, other);
    assert_true(tk_leaks(&memory) < 0);
    memset(&memory, 0, sizeof memory);
    static unsigned char foreign[64];
    unsigned char *volatile inside = foreign + 32; /* so that no compiler sees through it */
    tk_release(&memory, inside);
    assert_true(tk_leaks(&memory) < 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sweep),
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_traced_places),
        cmocka_unit_test(test_trace),
        cmocka_unit_test(test_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
