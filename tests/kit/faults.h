/* faults.h - failing allocations and cancelled reports, each in turn
   SPDX-License-Identifier: MIT OR Unlicense

   WHAT IT DOES
     Environments that misbehave on purpose: an allocator that counts, poisons and fails at a chosen
     call, a progress callback that cancels at a chosen call; and sweeps over all such calls.

   HOW TO USE IT
     A call under faults is one function and one line for each kind of fault; the function releases
     what it made, and whatever it must not touch after a failure is named:

       static txm_status make(void *context, txm_env *env) {
           texsyn_model *model = (texsyn_model *)env; // any pointer that is not NULL
           const txm_status status = texsyn_learn((const texsyn_learn_desc *)context, env, &model);
           if (status != TXM_OK) assert_null(model);
           texsyn_model_free(model);
           return status;
       }

       assert_true(tk_sweep(make, &desc, TK_ALLOCATION) > 10); // one allocation fails, each in turn
       assert_true(tk_sweep(make, &desc, TK_ONWARD) > 10);     // that one and all later ones
       assert_true(tk_sweep(make, &desc, TK_CANCEL) > 4);      // one report cancels, each in turn
       const tk_output outputs[1] = {{pixels, sizeof pixels}};
       assert_true(tk_sweep_outputs(draw, &job, TK_CANCEL, outputs, 1) > 4);

     Tried are calls 1, 2, 3, 5, 8, 13, ... and the last. With FULL=1 in the environment, as
     `make check` has it, they are counted by themselves for each place in the code, which is the
     chain of callers: of all places that allocate or report, the first times that they are reached.
     So the cost does not grow with the square of what a loop repeats, and no place is left out.
     Where a call may be tried again after a fault (steps of a job), see tk_places. */
#ifndef FAULTS_H
#define FAULTS_H

#include "texmath.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32 /* golden programs are all that runs there, and they have no use for it */
static inline int backtrace(void **callers, int most) {
    (void)callers;
    (void)most;
    return 0;
}
#else
#include <execinfo.h>
#endif

/* ---- places in the code ------------------------------------------------------------------ */

enum { TK_CALLERS = 48, TK_MOST_CALLS = 1 << 16 };

/* Which place in the code each call of a hook came from; those after TK_MOST_CALLS are not noted. */
typedef struct tk_trace {
    uint64_t from[TK_MOST_CALLS]; /* a hash of the addresses of all callers                    */
    long count;
} tk_trace;

static inline void tk_note(tk_trace *trace) {
    void *caller[TK_CALLERS];
    uint64_t hash = 0;
    if (!trace || trace->count >= TK_MOST_CALLS) return;
    for (int n = backtrace(caller, TK_CALLERS); n > 0; n--)
        hash = (hash ^ (uint64_t)(uintptr_t)caller[n - 1]) * UINT64_C(0x9e3779b97f4a7c15);
    trace->from[trace->count++] = hash;
}

/* 1, 2, 3, 5, 8, 13, ...: the first of these numbers that is above n. */
static inline long tk_above(long n) {
    long a = 1, b = 2;
    while (a <= n) {
        const long next = a + b;
        a = b;
        b = next;
    }
    return a;
}

/* The call after `call` that is for its place in the code the 1st, 2nd, 3rd, 5th ...; the last is one,
   and so are those that are not noted. 0 behind the last. */
static inline long tk_next_traced(const tk_trace *trace, long call, long last) {
    while (++call < last && call <= trace->count) {
        long nth = 0;
        for (long i = 0; i < call; i++) nth += trace->from[i] == trace->from[call - 1];
        if (tk_above(nth - 1) == nth) return call;
    }
    return call <= last ? call : 0;
}

/* ---- memory ----------------------------------------------------------------------------- */

/* An allocator that counts. All zero = never fails. For one thread at a time. */
typedef struct tk_memory {
    long fail_at;       /* the call of this number fails, from 1; 0 = none                     */
    int fail_onward;    /* non-zero: every later call fails too                                */
    size_t limit;       /* bytes: requests that take live_bytes above this fail; 0 = none      */
    tk_trace *trace;    /* where the calls came from is noted there; or NULL                   */
    long calls;         /* out: allocations asked for, the failed ones too                     */
    long failed;        /* out: allocations refused                                            */
    long blocks;        /* out: blocks not yet released                                        */
    size_t live_bytes;  /* out: bytes not yet released                                         */
    size_t peak_bytes;  /* out: highest live_bytes so far                                      */
    size_t total_bytes; /* out: sum over all granted requests                                  */
    long errors;        /* out: releases of blocks that are not ours, or overrun at either end */
} tk_memory;

/* Before and after each block: the guards tell an overrun and a foreign or repeated release. */
enum { TK_HEAD = 16, TK_TAIL = 8, TK_GUARD = 0x5a, TK_FRESH = 0xa5, TK_DEAD = 0xdd };

/* allocate hook; fills with a pattern, so that nobody may count on zeros */
static inline void *tk_allocate(void *user, size_t bytes) {
    tk_memory *m = (tk_memory *)user;
    m->calls++;
    tk_note(m->trace);
    int refuse =
        m->fail_at && (m->calls == m->fail_at || (m->fail_onward && m->calls > m->fail_at));
    if (m->limit && (bytes > m->limit || m->live_bytes > m->limit - bytes)) refuse = 1;
    unsigned char *p = NULL;
    if (!refuse && bytes <= SIZE_MAX - TK_HEAD - TK_TAIL)
        p = (unsigned char *)malloc(TK_HEAD + bytes + TK_TAIL);
    if (!p) {
        m->failed++;
        return NULL;
    }
    memset(p, TK_GUARD, TK_HEAD);
    memcpy(p, &bytes, sizeof bytes);
    memset(p + TK_HEAD, TK_FRESH, bytes);
    memset(p + TK_HEAD + bytes, TK_GUARD, TK_TAIL);
    m->blocks++;
    m->live_bytes += bytes;
    m->total_bytes += bytes;
    if (m->live_bytes > m->peak_bytes) m->peak_bytes = m->live_bytes;
    return p + TK_HEAD;
}

/* release hook */
static inline void tk_release(void *user, void *block) {
    tk_memory *m = (tk_memory *)user;
    if (!block) { /* the contract of txm_env: never with NULL */
        m->errors++;
        return;
    }
    unsigned char *p = (unsigned char *)block - TK_HEAD;
    size_t bytes, i;
    memcpy(&bytes, p, sizeof bytes);
    for (i = sizeof bytes; i < TK_HEAD; i++) {
        if (p[i] != TK_GUARD) { /* the size cannot be trusted: leave it alone */
            m->errors++;
            return;
        }
    }
    for (i = 0; i < TK_TAIL; i++) m->errors += p[TK_HEAD + bytes + i] != TK_GUARD;
    m->blocks--;
    m->live_bytes -= bytes;
    memset(p, TK_DEAD, TK_HEAD + bytes);
    free(p);
}

/* 0 if everything allocated was released, once, intact */
static inline long tk_leaks(const tk_memory *m) {
    return m->errors ? -m->errors : m->blocks;
}

/* ---- progress --------------------------------------------------------------------------- */

/* A progress callback that watches its contract and cancels at a chosen call. All zero = never. */
typedef struct tk_progress {
    long cancel_at; /* the call of this number, and all later ones, cancel; from 1; 0 = none   */
    tk_trace *trace; /* where the calls came from is noted there; or NULL                      */
    long calls;     /* out: calls so far                                                       */
    long late;      /* out: calls after the one that cancelled; a good module makes none       */
    long errors;    /* out: fractions outside 0..1 (NaN too), falling ones, missing stage names */
    float last;     /* out: the last fraction                                                  */
} tk_progress;

static inline int tk_report(void *user, float fraction, const char *stage) {
    tk_progress *p = (tk_progress *)user;
    p->late += p->cancel_at && p->calls >= p->cancel_at;
    p->calls++;
    tk_note(p->trace);
    if (!(fraction >= p->last && fraction <= 1.0f) || !stage || !stage[0]) p->errors++;
    p->last = fraction;
    return p->cancel_at && p->calls >= p->cancel_at;
}

/* ---- environments ----------------------------------------------------------------------- */

/* An env with these hooks; each may be NULL. Add .parallel_for afterwards if wanted. */
static inline txm_env tk_env(tk_memory *memory, tk_progress *progress) {
    txm_env env;
    memset(&env, 0, sizeof env);
    if (memory) {
        env.allocate = tk_allocate;
        env.release = tk_release;
        env.memory_user = memory;
    }
    if (progress) {
        env.progress = tk_report;
        env.progress_user = progress;
    }
    return env;
}

/* ---- sweeps over faults ------------------------------------------------------------------ */

typedef enum tk_kind {
    TK_ALLOCATION, /* one allocation fails                 */
    TK_ONWARD,     /* one and all later ones fail          */
    TK_CANCEL      /* one progress report asks for the end */
} tk_kind;

/* What is swept: does its work, releases what it made, returns the status of the work. */
typedef txm_status tk_call(void *context, txm_env *env);

/* Bytes that must be as they were after a call has failed. They are filled before each call. */
typedef struct tk_output {
    void *bytes;
    size_t count;
} tk_output;

enum { TK_UNTOUCHED = 0x6b };

/* Are all places in the code tried (FULL=1), or a sample? */
static inline int tk_full(void) {
    const char *full = getenv("FULL");
    return full && strcmp(full, "1") == 0;
}

/* The place after `place` that a sweep over 1..last tries, beginning with place 0; 0 behind the last.
   Everything with FULL=1, else 1, 2, 3, 5, 8, 13, ... and last. */
static inline long tk_places(long place, long last) {
    if (place >= last) return 0;
    const long next = tk_full() ? place + 1 : tk_above(place);
    return next < last ? next : last;
}

/* The place after `place` that a sweep tries: with FULL=1 of those that tk_next_traced names every
   stride-th and the last. 0 behind the last. */
static inline long tk_next_place(const tk_trace *trace, long place, long last, int stride) {
    long next = place;
    if (!tk_full()) return tk_places(place, last);
    for (int i = 0; i < stride && next < last; i++) next = tk_next_traced(trace, next, last);
    return next > place ? next : 0;
}

/* tk_sweep with outputs that must be left alone. A stride above 1 thins out what FULL=1 tries: for
   calls of which each run takes long, if other tests sweep what they stand on. */
static inline long tk_sweep_thinned(tk_call *call, void *context, tk_kind kind,
                                    const tk_output *outputs, int output_count, int stride) {
    static const char *const names[3] = {"allocation", "allocations from", "report"};
    static tk_trace trace;
    long last = 0, place = 0;
    do {
        tk_memory memory;
        tk_progress progress;
        const char *wrong = NULL;
        memset(&memory, 0, sizeof memory);
        memset(&progress, 0, sizeof progress);
        if (kind == TK_CANCEL) progress.cancel_at = place;
        else memory.fail_at = place;
        memory.fail_onward = kind == TK_ONWARD && place > 0;
        if (place == 0 && tk_full()) {
            trace.count = 0;
            *(kind == TK_CANCEL ? &progress.trace : &memory.trace) = &trace;
        }
        txm_env env = tk_env(&memory, &progress);
        for (int i = 0; i < output_count; i++)
            memset(outputs[i].bytes, TK_UNTOUCHED, outputs[i].count);
        const txm_status status = call(context, &env);
        const txm_status wanted = place == 0          ? TXM_OK
                                  : kind == TK_CANCEL ? TXM_CANCELLED
                                                      : TXM_OUT_OF_MEMORY;
        if (status != wanted) wrong = "another status";
        else if (place && !env.message[0]) wrong = "no message";
        else if (tk_leaks(&memory) != 0) wrong = "a leak, or a block damaged";
        else if (progress.errors) wrong = "a report without stage, or a fraction that is wrong";
        else if (progress.late) wrong = "a report after the one that cancelled";
        for (int i = 0; i < output_count && place && !wrong; i++) {
            const unsigned char *bytes = (const unsigned char *)outputs[i].bytes;
            for (size_t k = 0; k < outputs[i].count && !wrong; k++)
                if (bytes[k] != TK_UNTOUCHED) wrong = "an output is touched";
        }
        if (wrong) {
            printf("# sweep, %s %ld of %ld: %s (status %d: %s)\n", names[kind], place, last, wrong,
                   (int)status, env.message);
            return -1;
        }
        if (place == 0) last = kind == TK_CANCEL ? progress.calls : memory.calls;
        place = tk_next_place(&trace, place, last, stride);
    } while (place);
    return last;
}

static inline long tk_sweep_outputs(tk_call *call, void *context, tk_kind kind,
                                    const tk_output *outputs, int output_count) {
    return tk_sweep_thinned(call, context, kind, outputs, output_count, 1);
}

/* First undisturbed, then with a fault at each place of a kind in turn, or at a sample of them (see
   above).
   Whatever goes wrong is printed.

   return  how many places of this kind the undisturbed call has: demand as many as the work must
           have at least. -1: undisturbed it fails; or after a fault it has another status than
           TXM_OUT_OF_MEMORY or TXM_CANCELLED, no message, a leak, a touched output, or it reports
           again after it was cancelled                                                          */
static inline long tk_sweep(tk_call *call, void *context, tk_kind kind) {
    return tk_sweep_outputs(call, context, kind, NULL, 0);
}

#endif /* FAULTS_H */
