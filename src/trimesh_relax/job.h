#ifndef TRIMESH_RELAX_JOB_H
#define TRIMESH_RELAX_JOB_H

#include "mend_all.h"
#include "density.h"
#include "ridges.h"
#include "pieces.h"
#include "repel.h"
#include "retile.h"
#include "finer.h"

/* ---- retiling step by step ----------------------------------------------------------------- */

#define TMR_FLAT_VOLUME 1e-6 /* ours: thickness of what has no inside, in diagonals               */

enum tmr_stage {
    TMR_STAGE_MEND,
    TMR_STAGE_SAMPLE,
    TMR_STAGE_JOIN,
    TMR_STAGE_REPEL,
    TMR_STAGE_LATTICE,
    TMR_STAGE_SUBDIVIDE,
    TMR_STAGE_FINISH,
    TMR_STAGE_DONE
};

struct trimesh_job {
    trimesh_desc desc;
    txm_env env;           /* hooks of the current call; progress goes through rising          */
    tmr_rising rising;
    trimesh_report report;
    txm_status status;     /* of the first failure                                             */
    int stage;             /* next to be done                                                  */
    int shown;             /* the last one done                                                */
    int round, rounds;     /* of repulsion: done; at most                                      */
    double mean, largest;  /* movement in the last one                                         */
    int plain;             /* strips are left as they are: ridges.h                              */
    int retries;           /* with shorter edges so far                                         */
    uint64_t wanted;       /* after TXM_TOO_SMALL: how many vertices may do                     */
    uint8_t crosses[2];    /* the surface crosses, or touches itself: 0 = not known, 1 = no, 2 = yes */
    int is_trial;          /* to find out whether so many vertices do: one attempt, no hint      */
    int cut; /* how often the number is quartered, then triangles cut in four          */
    tmr_surface s;
    tmr_lines l;
    tmr_work w;
    tmr_sampling t;
    txm_arena input;       /* surface and lines                                                */
    txm_arena first;       /* the mesh, including the surface's vertices                       */
    txm_arena second;      /* the mesh, compact                                                */
    txm_arena scratch;     /* of the current stage                                             */
    txm_arena view;        /* what the state points to                                         */
};

/* Check a descriptor except its surface. */
static txm_status tmr_check_desc(const trimesh_desc *desc, txm_env *env) {
    if (!desc) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a trimesh_desc");
    if (desc->vertices < 4)
        return txm_fail(env, TXM_TOO_SMALL, "vertices must be 4 or more");
    if (desc->vertices > TRIMESH_MAX_VERTICES || desc->vertices > TMR_MOST)
        return txm_fail(env, TXM_TOO_LARGE, "vertices: more than TRIMESH_MAX_VERTICES");
    if (desc->method != TRIMESH_LATTICE && desc->method != TRIMESH_REPEL)
        return txm_fail(env, TXM_BAD_ARGUMENT, "method must be TRIMESH_LATTICE or TRIMESH_REPEL");
    if (!(desc->adapt >= 0 && desc->adapt <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "adapt must be 0 to 1");
    if (!(desc->crease_angle >= 0 && desc->crease_angle <= 180))
        return txm_fail(env, TXM_BAD_ARGUMENT, "crease_angle must be 0 to 180 degrees");
    if (!(desc->line_spacing >= 0.25f && desc->line_spacing <= 4) &&
        !(desc->line_spacing >= 0 && desc->line_spacing <= 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "line_spacing must be 0.25 to 4, or 0");
    if (!(desc->drop_below >= 0 && desc->drop_below <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "drop_below must be 0 to 1");
    if (desc->iterations < 0 || desc->iterations > 1000)
        return txm_fail(env, TXM_BAD_ARGUMENT, "iterations must be 0 to 1000");
    return TXM_OK;
}

/* spacing of the result where the scale is 1, in scaled units */
static double tmr_job_spacing(const trimesh_job *job) {
    return tmr_spacing(&job->s, (double)job->desc.vertices);
}

/* ---- the stages: each sets the next one ----------------------------------------------------- */

/* Find the lines, and see whether the vertices are enough for them. */
static txm_status tmr_job_lines(trimesh_job *job, float angle) {
    const size_t vertices = job->desc.vertices;
    double least = 0;
    const txm_status status =
        tmr_settle_lines(&job->s, &job->desc, (double)vertices, angle, tmr_job_spacing(job),
                         &job->input, &job->scratch, &job->report, &job->l, &least);
    if (status != TXM_OK || (double)vertices >= least) return status;
    job->wanted = (uint64_t)least;
    return txm_fail_numbers(&job->env, TXM_TOO_SMALL,
                            "# vertices are too few for the pieces of the surface, their creases and "
                            "borders", vertices, 0);
}

/* Mend the surface, find its lines. */
static txm_status tmr_job_mend(trimesh_job *job) {
    const float angle = job->desc.crease_angle > 0 ? job->desc.crease_angle : TMR_CREASE_ANGLE;
    txm_status status =
        tmr_surface_build(&job->desc, &job->env, &job->input, &job->report, &job->s);
    if (status != TXM_OK) return status;
    tmr_normalize_scale(&job->s);
    if (job->desc.adapt > 0)
        status = tmr_adapt_scale(&job->s, tmr_job_spacing(job), job->desc.adapt, &job->input,
                                 &job->scratch);
    if (status == TXM_OK && !job->plain)
        status = tmr_make_ridges(&job->s, angle, tmr_job_spacing(job), &job->env, &job->input,
                                 &job->scratch);
    if (status == TXM_OK) status = tmr_job_lines(job, angle);
    if (status == TXM_OK) status = tmr_find_fans(&job->s, &job->input, &job->scratch);
    if (status != TXM_OK) return status;
    job->w.s = &job->s;
    job->w.l = &job->l;
    job->w.desc = &job->desc;
    job->w.env = &job->env;
    job->w.line_scale = job->desc.line_spacing > 0 ? job->desc.line_spacing : 1;
    double lines = 0; /* with more than half of the vertices on lines space these more widely */
    for (int32_t i = 0; i < job->l.line_count; i++) lines += job->l.length[i];
    job->w.line_scale = fmax(job->w.line_scale, lines / tmr_job_spacing(job) /
                                                    (0.5 * (double)job->desc.vertices));
    job->w.pull = 1;
    job->w.step = 1;
    /* closed: V - E + F with a ghost for each loop */
    const double euler = (double)job->report.euler + (double)job->report.loops;
    if (job->desc.vertices >= TMR_CUT_FROM && (double)job->desc.vertices + 3 * euler > 1000)
        job->cut = job->desc.vertices >= 4 * TMR_CUT_FROM ? 2 : 1;
    job->stage = job->desc.method == TRIMESH_REPEL ? TMR_STAGE_SAMPLE : TMR_STAGE_LATTICE;
    return TXM_OK;
}

static txm_status tmr_job_sample(trimesh_job *job) {
    const double room = tmr_sampling_room((double)job->desc.vertices);
    const txm_status status = tmr_copy_surface(&job->w, room, &job->first);
    if (status != TXM_OK) return status;
    job->stage = TMR_STAGE_JOIN;
    const txm_status sampled = tmr_sample(&job->t, &job->w, &job->desc, &job->scratch);
    if (sampled != TXM_TOO_SMALL) return sampled;
    txm_arena_free(&job->first); /* no room for lines: the lattice adapts them */
    memset(&job->w.m, 0, sizeof job->w.m);
    job->stage = TMR_STAGE_LATTICE;
    return TXM_OK;
}

/* Join the points; then copy the mesh without the slots of the surface's own vertices. */
static txm_status tmr_job_join(trimesh_job *job) {
    txm_status status = tmr_join_points(&job->t, &job->scratch);
    if (status != TXM_OK) return status;
    if ((status = tmr_rebuild(&job->w, 0, &job->second, &job->scratch)) != TXM_OK) return status;
    txm_arena_free(&job->first);
    job->rounds = job->desc.iterations > 0 ? job->desc.iterations : TMR_ROUNDS;
    job->stage = TMR_STAGE_REPEL;
    return TXM_OK;
}

static txm_status tmr_job_repel(trimesh_job *job) {
    tmr_repel_round(&job->w, tmr_repel_force(job->round, job->rounds), &job->mean, &job->largest);
    job->round++;
    if (job->round < job->rounds && job->mean >= TMR_CALM) return TXM_OK;
    job->stage = TMR_STAGE_FINISH;
    return tmr_improve(&job->w, &tmr_after_repulsion);
}

static txm_status tmr_job_lattice(trimesh_job *job) {
    const double euler = (double)job->report.euler + (double)job->report.loops;
    const double target = (double)job->desc.vertices;
    int32_t aim = (int32_t)target;
    for (int k = 0; k < job->cut; k++) aim = (int32_t)floor((aim + 3 * euler) / 4);
    /* room for three vertices per one aimed at, or as many as the surface has, and a quarter more */
    const double closed = (double)job->s.vertex_count + job->s.loop_count;
    const double most = fmax(closed, 3.0 * aim);
    job->w.length = tmr_job_spacing(job) * sqrt(target / aim);
    txm_status status = tmr_copy_surface(&job->w, most + floor(most / 4) + 1000 - closed, &job->first);
    if (status != TXM_OK) return status;
    status = tmr_make_lattice(&job->w, aim, job->desc.seed);
    if (status != TXM_OK) return status;
    job->stage = TMR_STAGE_SUBDIVIDE;
    if (!job->cut || tmr_may_subdivide(&job->w)) return TXM_OK;
    job->cut--; /* too coarse: try again with four times the number */
    job->stage = TMR_STAGE_LATTICE;
    txm_arena_free(&job->first);
    memset(&job->w.m, 0, sizeof job->w.m);
    return TXM_OK;
}

static txm_status tmr_job_subdivide(trimesh_job *job) {
    tmr_work *w = &job->w;
    for (int left = job->cut;; left--) {
        txm_status status = tmr_rebuild(w, left > 0, &job->second, &job->scratch);
        if (status != TXM_OK) return status;
        txm_arena_free(&job->first);
        txm_arena_free(&job->scratch);
        job->first = job->second;
        txm_arena_init(&job->second, &job->env);
        if (left) status = tmr_improve(w, &tmr_after_cut);
        if (status != TXM_OK) return status;
        if (left <= 1) break;
    }
    job->stage = TMR_STAGE_FINISH;
    return TXM_OK;
}

/* Does the surface cross itself? Then the result may, too. what: as tmr_count_crossings has it. */
static txm_status tmr_surface_crosses(trimesh_job *job, int what, int *crosses) {
    uint8_t *known = &job->crosses[what == TMR_ANY_TOUCHING];
    tmr_work w = job->w;
    txm_arena arena;
    long found = 0;
    *crosses = *known == 2;
    if (*known) return TXM_OK;
    txm_arena_init(&arena, &job->env);
    txm_status status = tmr_copy_surface(&w, 0, &arena);
    if (status == TXM_OK) status = tmr_count_crossings(&w, NULL, what, &arena, &found);
    txm_arena_free(&arena);
    if (status != TXM_OK) return status;
    *crosses = found > 0;
    *known = (uint8_t)(1 + *crosses);
    return TXM_OK;
}

/* Is the surface closed, but without an inside? Then it lies on itself however dense the mesh is. */
static int tmr_is_flat(const tmr_surface *s) {
    return s->loop_count == 0 && fabs(s->volume) <= TMR_FLAT_VOLUME * s->area;
}

/* Want shorter edges: first where the mesh, which has the number of vertices if it is exact, is not sound;
   then wherever the surface bends, too. */
static txm_status tmr_job_shorten(trimesh_job *job, int exact) {
    txm_status status = TXM_OK;
    if (exact) status = tmr_halve_at_spots(&job->w, &job->s, &job->input);
    if (status == TXM_OK && (job->retries || !exact))
        status = tmr_adapt_scale(&job->s, tmr_job_spacing(job), 1, &job->input, &job->scratch);
    job->retries++;
    return status;
}

/* Prepare another attempt: with denser lines, then with the full number if it was a quarter, then
   with shorter edges. *again receives 0 if nothing is left to try. */
static txm_status tmr_job_retry(trimesh_job *job, int exact, int *again) {
    const int quartered = job->desc.method == TRIMESH_LATTICE && job->cut;
    txm_status status = TXM_OK;
    *again = !job->is_trial && (job->w.line_scale > 1 || quartered || job->retries < 2);
    if (!*again) return TXM_OK;
    if (job->w.line_scale > 1) job->w.line_scale = 1; /* lines were too coarse for the inside */
    else if (quartered) job->cut--;
    else status = tmr_job_shorten(job, exact);
    txm_arena_free(&job->first);
    txm_arena_free(&job->second);
    memset(&job->w.m, 0, sizeof job->w.m);
    job->stage = TMR_STAGE_LATTICE;
    return status;
}

/* Prepare another attempt from the beginning, without lines instead of strips. */
static txm_status tmr_job_without_ridges(trimesh_job *job) {
    txm_arena_free(&job->first);
    txm_arena_free(&job->second);
    txm_arena_free(&job->input);
    memset(&job->s, 0, sizeof job->s);
    memset(&job->l, 0, sizeof job->l);
    memset(&job->w, 0, sizeof job->w);
    job->plain = 1;
    job->cut = job->retries = 0;
    job->crosses[0] = job->crosses[1] = 0;
    job->stage = TMR_STAGE_MEND;
    return TXM_OK;
}

/* Finish, and check that no triangle is inverted or crosses another one: a result that is not sound
   is never returned. */
static txm_status tmr_job_finish(trimesh_job *job) {
    int again, crosses = 0;
    txm_status status = tmr_polish(&job->w, (int32_t)job->desc.vertices, &job->scratch);
    if (status != TXM_OK && status != TXM_TOO_SMALL) return status;
    const int exact = status == TXM_OK;
    if (exact) {
        long faults;
        job->stage = TMR_STAGE_DONE;
        status = tmr_mend_spots(&job->w, &faults);
        if (status != TXM_OK || faults == 0) return status;
        status = tmr_surface_crosses(job, TMR_ANY_CROSSING, &crosses);
        if (status != TXM_OK || crosses) return status;
        if (50 * faults > (long)job->w.m.live_faces || tmr_is_flat(&job->s)) { /* sheets lie on each other */
            status = tmr_surface_crosses(job, TMR_ANY_TOUCHING, &crosses);
            if (status != TXM_OK || crosses) return status;
        }
    }
    status = tmr_job_retry(job, exact, &again);
    if (status != TXM_OK || again) return status;
    if (exact) { /* as the last resort: sheets that touch may be meant to cross */
        status = tmr_surface_crosses(job, TMR_ANY_TOUCHING, &crosses);
        if (status != TXM_OK || crosses) return status;
    }
    if (job->s.section) return tmr_job_without_ridges(job);
    job->wanted = 2 * (uint64_t)job->desc.vertices;
    return txm_fail_numbers(&job->env, TXM_TOO_SMALL,
                            "the surface has parts too thin or too fine for # vertices without "
                            "crossings", job->desc.vertices, 0);
}

static const char *tmr_stage_name(int stage) {
    static const char *const names[] = {"mend",    "sample",    "join",   "repel",
                                        "lattice", "subdivide", "finish", "finish"};
    return names[stage];
}

/* how much of the work is done, roughly */
static float tmr_job_fraction(const trimesh_job *job) {
    static const float from[] = {0, 0.05f, 0.15f, 0.3f, 0.05f, 0.5f, 0.7f, 1};
    const float part = job->stage == TMR_STAGE_REPEL ? (float)job->round / (float)job->rounds : 0;
    return txm_maxf(job->rising.fraction, from[job->stage] + 0.4f * part);
}

static txm_status tmr_begin(const trimesh_desc *desc, txm_env *env, int is_trial,
                            trimesh_job **job);

/* Would so many vertices be enough? */
static txm_status tmr_job_try(const trimesh_job *job, size_t vertices) {
    trimesh_desc desc = job->desc;
    txm_env env = job->env; /* whose message stays */
    trimesh_job *trial = NULL;
    int more = 1;
    desc.vertices = vertices;
    desc.report = NULL;
    txm_status status = tmr_begin(&desc, &env, 1, &trial);
    while (status == TXM_OK && more) status = trimesh_step(trial, &env, &more);
    trimesh_free(trial);
    return status;
}

/* After TXM_TOO_SMALL: say how many vertices are enough, which was tried before it is said. */
static txm_status tmr_job_hint(trimesh_job *job) {
    static const double part[] = {1, 1.5, 2, 4}; /* ours: of job->wanted */
    char text[sizeof job->env.message];
    size_t tried = 0;
    memcpy(text, job->env.message, sizeof text);
    for (int k = 0; k < 4; k++) {
        const double vertices = ceil(part[k] * (double)job->wanted);
        if (vertices > TRIMESH_MAX_VERTICES || vertices > (double)TMR_MOST) break;
        tried = (size_t)vertices;
        const txm_status status = tmr_job_try(job, tried);
        if (status == TXM_OUT_OF_MEMORY || status == TXM_CANCELLED) return status;
        if (status == TXM_OK) {
            snprintf(job->env.message, sizeof text, "%.110s; give %lu", text, (unsigned long)tried);
            return TXM_TOO_SMALL;
        }
    }
    snprintf(job->env.message, sizeof text, "%.100s; %lu are too few, too", text,
             (unsigned long)tried);
    return TXM_TOO_SMALL;
}

/* One stage or round. A job that has failed stays failed. */
static txm_status tmr_job_advance(trimesh_job *job) {
    txm_status status = TXM_OK;
    if (job->status != TXM_OK) return txm_fail(&job->env, job->status, "the job has failed before");
    const int stage = job->stage;
    if (stage == TMR_STAGE_DONE) return TXM_OK;
    if (txm_progress(&job->env, tmr_job_fraction(job), tmr_stage_name(stage)))
        status = TXM_CANCELLED;
    else if (stage == TMR_STAGE_MEND) status = tmr_job_mend(job);
    else if (stage == TMR_STAGE_SAMPLE) status = tmr_job_sample(job);
    else if (stage == TMR_STAGE_JOIN) status = tmr_job_join(job);
    else if (stage == TMR_STAGE_REPEL) status = tmr_job_repel(job);
    else if (stage == TMR_STAGE_LATTICE) status = tmr_job_lattice(job);
    else if (stage == TMR_STAGE_SUBDIVIDE) status = tmr_job_subdivide(job);
    else status = tmr_job_finish(job);
    if (status == TXM_TOO_SMALL && !job->is_trial && job->wanted) status = tmr_job_hint(job);
    if (job->stage != TMR_STAGE_JOIN) txm_arena_free(&job->scratch); /* its marks lie there */
    job->shown = stage;
    job->status = status;
    if (status == TXM_OUT_OF_MEMORY)
        txm_fail(&job->env, status, "no memory to retile the surface");
    if (status == TXM_CANCELLED) txm_fail(&job->env, status, "cancelled while retiling");
    return status;
}

/* ---- what a viewer sees --------------------------------------------------------------------- */

/* is vertex v of the mesh one of the points? Before they are joined only the samples are. */
static int tmr_is_point(const trimesh_job *job, int32_t v) {
    const tmr_mesh *m = &job->w.m;
    if (m->corner[v] < 0 || tmr_is_ghost(m, v)) return 0;
    return job->stage != TMR_STAGE_JOIN || job->t.keep[v];
}

static txm_status tmr_fill_points(trimesh_job *job, int32_t *number, trimesh_state *state) {
    const tmr_mesh *m = &job->w.m;
    size_t n = 0;
    for (int32_t v = 0; v < m->vertex_count; v++)
        number[v] = tmr_is_point(job, v) ? (int32_t)n++ : -1;
    if (n == 0) return TXM_OK;
    float *p = (float *)txm_arena_alloc(&job->view, n, 3 * sizeof(float));
    if (!p) return TXM_OUT_OF_MEMORY;
    state->points = n;
    state->positions = p;
    for (int32_t v = 0; v < m->vertex_count; v++) {
        if (number[v] < 0) continue;
        const txm_dvec3 at = txm_d3_add(txm_d3_scale(m->p[v], job->s.diagonal), job->s.centre);
        *p++ = txm_float(at.x);
        *p++ = txm_float(at.y);
        *p++ = txm_float(at.z);
    }
    return TXM_OK;
}

static txm_status tmr_fill_triangles(trimesh_job *job, const int32_t *number,
                                     trimesh_state *state) {
    const tmr_mesh *m = &job->w.m;
    size_t n = 0;
    for (int32_t f = 0; f < m->face_count; f++) n += !tmr_is_dead(m, f) && !tmr_is_ghost_face(m, f);
    if (n == 0) return TXM_OK;
    uint32_t *indices = (uint32_t *)txm_arena_alloc(&job->view, n, 3 * sizeof(uint32_t));
    if (!indices) return TXM_OUT_OF_MEMORY;
    state->triangles = n;
    state->indices = indices;
    for (int32_t f = 0; f < m->face_count; f++) {
        if (tmr_is_dead(m, f) || tmr_is_ghost_face(m, f)) continue;
        for (int k = 0; k < 3; k++) *indices++ = (uint32_t)number[m->vertex[3 * f + k]];
    }
    return TXM_OK;
}

static txm_status tmr_fill_state(trimesh_job *job, trimesh_state *state) {
    const tmr_mesh *m = &job->w.m;
    state->stage = tmr_stage_name(job->shown);
    state->round = job->round;
    state->mean = txm_float(job->mean);
    state->largest = txm_float(job->largest);
    if (job->status != TXM_OK || m->vertex_count == 0) return TXM_OK;
    int32_t *number =
        (int32_t *)txm_arena_alloc(&job->view, (size_t)m->vertex_count, sizeof(int32_t));
    if (!number) return TXM_OUT_OF_MEMORY;
    txm_status status = tmr_fill_points(job, number, state);
    if (status == TXM_OK && job->stage != TMR_STAGE_JOIN)
        status = tmr_fill_triangles(job, number, state);
    return status;
}

/* ---- jobs: public --------------------------------------------------------------------------- */

/* Use the hooks of this call, but the allocator of trimesh_begin, which made the blocks. */
static void tmr_job_enter(trimesh_job *job, const txm_env *env) {
    const txm_env old = job->env;
    memset(&job->env, 0, sizeof job->env);
    if (env) job->env = *env;
    job->env.allocate = old.allocate;
    job->env.release = old.release;
    job->env.memory_user = old.memory_user;
    job->env.message[0] = 0;
    tmr_rise_in(&job->rising, &job->env);
}

/* Hand the message to the caller. */
static txm_status tmr_job_leave(const trimesh_job *job, txm_env *env, txm_status status) {
    return status == TXM_OK ? TXM_OK : txm_fail(env, status, job->env.message);
}

static txm_status tmr_begin(const trimesh_desc *desc, txm_env *env, int is_trial,
                            trimesh_job **job) {
    if (desc && desc->report) memset(desc->report, 0, sizeof *desc->report);
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    *job = NULL;
    txm_status status = tmr_check_desc(desc, env);
    if (status != TXM_OK) return status;
    trimesh_job *j = (trimesh_job *)txm_alloc(env, sizeof *j);
    if (!j) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for a job");
    memset(j, 0, sizeof *j);
    if (env) j->env = *env;
    tmr_job_enter(j, env);
    j->desc = *desc;
    j->is_trial = is_trial;
    txm_arena_init(&j->input, env);
    txm_arena_init(&j->first, env);
    txm_arena_init(&j->second, env);
    txm_arena_init(&j->scratch, env);
    txm_arena_init(&j->view, env);
    status = tmr_job_advance(j);
    if (desc->report) *desc->report = j->report;
    tmr_job_leave(j, env, status);
    if (status != TXM_OK) trimesh_free(j);
    else *job = j;
    return status;
}

TRIMESH_API txm_status trimesh_begin(const trimesh_desc *desc, txm_env *env, trimesh_job **job) {
    return tmr_begin(desc, env, 0, job);
}

TRIMESH_API txm_status trimesh_step(trimesh_job *job, txm_env *env, int *more) {
    if (more) *more = 0;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    tmr_job_enter(job, env);
    txm_arena_free(&job->view);
    const txm_status status = tmr_job_advance(job);
    if (more) *more = status == TXM_OK && job->stage != TMR_STAGE_DONE;
    return tmr_job_leave(job, env, status);
}

TRIMESH_API txm_status trimesh_get_state(trimesh_job *job, txm_env *env, trimesh_state *state) {
    if (state) memset(state, 0, sizeof *state);
    if (!job || !state) return txm_fail(env, TXM_BAD_ARGUMENT, "job or state is NULL");
    tmr_job_enter(job, env);
    txm_arena_free(&job->view);
    const txm_status status = tmr_fill_state(job, state);
    if (status != TXM_OK) {
        txm_arena_free(&job->view);
        memset(state, 0, sizeof *state);
        txm_fail(&job->env, status, "no memory for the state; the job can go on");
    }
    return tmr_job_leave(job, env, status);
}

TRIMESH_API txm_status trimesh_get_mesh(trimesh_job *job, txm_env *env, trimesh_mesh **mesh) {
    if (mesh) *mesh = NULL;
    if (!job || !mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "job or mesh is NULL");
    tmr_job_enter(job, env);
    txm_status status = job->status;
    if (status != TXM_OK) txm_fail(&job->env, status, "the job has failed before");
    else if (job->stage != TMR_STAGE_DONE)
        status = txm_fail(&job->env, TXM_BAD_ARGUMENT, "the job is not done; call trimesh_step");
    else if ((status = tmr_write(&job->w, mesh)) != TXM_OK)
        txm_fail(&job->env, status, "no memory for the mesh");
    return tmr_job_leave(job, env, status);
}

TRIMESH_API void trimesh_free(trimesh_job *job) {
    if (!job) return;
    const txm_env env = job->env;
    txm_arena_free(&job->input);
    txm_arena_free(&job->first);
    txm_arena_free(&job->second);
    txm_arena_free(&job->scratch);
    txm_arena_free(&job->view);
    txm_free(&env, job);
}

TRIMESH_API txm_status trimesh_retile(const trimesh_desc *desc, txm_env *env, trimesh_mesh **mesh) {
    trimesh_job *job;
    int more = 1;
    if (mesh) *mesh = NULL;
    if (!mesh) return txm_fail(env, TXM_BAD_ARGUMENT, "mesh is NULL");
    txm_status status = trimesh_begin(desc, env, &job);
    while (status == TXM_OK && more) status = trimesh_step(job, env, &more);
    if (status == TXM_OK) status = trimesh_get_mesh(job, env, mesh);
    trimesh_free(job);
    return status;
}

#endif /* TRIMESH_RELAX_JOB_H */
