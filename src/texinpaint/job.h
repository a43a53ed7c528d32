#ifndef TEXINPAINT_JOB_H
#define TEXINPAINT_JOB_H

#include "check.h"
#include "choose.h"
#include "layout.h"
#include "preview.h"

/* ---- jobs ------------------------------------------------------------------------------------ */

enum { TXI_PREVIEW, TXI_COARSE, TXI_FINE, TXI_GUTTER, TXI_DONE }; /* what the next step does */

struct texinpaint_job {
    texinpaint_desc desc;
    txi_domain domain;
    texinpaint_crests *crests; /* with TEXINPAINT_PRIOR_CREST                                    */
    texinpaint_info info;
    int phase, steps;
    size_t left;         /* missing texels that are not completed yet                            */
    size_t largest;      /* targets of the largest window so far                                 */
    txm_arena memory;    /* holds the job                                                        */
    txm_arena of_window; /* what is known about the current window                              */
    txi_window window;
    int is_open;         /* the window is laid out and its lines are traced, but not used yet    */
    txi_prior prior;
    txi_choice choice;
};

/* texinpaint_begin for a description that has been checked. *out is NULL, and stays so after a
   failure. */
static txm_status txi_begin(const texinpaint_desc *desc, txm_env *env, texinpaint_job **out) {
    txm_arena memory;
    texinpaint_job *job;
    txm_status status;
    size_t count, known = 0;
    txm_arena_init(&memory, env);
    job = (texinpaint_job *)txm_arena_zero(&memory, 1, sizeof *job);
    if (!job) return txi_no_memory(env);
    job->desc = *desc;
    job->memory = memory;
    txm_arena_init(&job->of_window, env);
    status = txi_domain_make(&job->domain, &job->desc, &job->memory, env);
    if (status == TXM_OK) status = txi_surface_make(&job->domain, &job->memory, env);
    if (status == TXM_OK && desc->prior == TEXINPAINT_PRIOR_CREST) {
        texinpaint_crest_desc crest;
        txi_stage stage;
        memset(&crest, 0, sizeof crest);
        crest.mesh = desc->mesh;
        txi_stage_begin(&stage, env, 0, 0); /* the steps begin at 0 */
        status = txi_stage_end(&stage, texinpaint_crest(&crest, &stage.env, &job->crests));
    }
    count = (size_t)desc->image.width * (size_t)desc->image.height;
    for (size_t i = 0; i < count && status == TXM_OK; i++) {
        if (!job->domain.covered[i]) continue;
        if (job->domain.missing[i]) job->info.missing++;
        else if (job->domain.usable[i]) known++;
    }
    job->left = job->info.missing;
    if (status == TXM_OK) status = txi_count_holes(&job->domain, env, &job->info.holes);
    if (status == TXM_OK && job->left && !known)
        status = txm_fail(env, TXM_TOO_SMALL, "no known texel to copy from: all are missing");
    if (status != TXM_OK) {
        texinpaint_free(job);
        return status;
    }
    *out = job;
    return TXM_OK;
}

TEXINPAINT_API txm_status texinpaint_begin(const texinpaint_desc *desc, txm_env *env,
                                           texinpaint_job **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    const txm_status status = txi_check(desc, env);
    return status == TXM_OK ? txi_begin(desc, env, out) : status;
}

TEXINPAINT_API void texinpaint_free(texinpaint_job *job) {
    if (!job) return;
    txm_arena memory = job->memory;
    texinpaint_crests_free(job->crests);
    txi_choice_free(&job->choice);
    txm_arena_free(&job->of_window);
    txm_arena_free(&memory);
}

/* ---- steps ----------------------------------------------------------------------------------- */

/* The targets of the window are written. */
static void txi_count_window(texinpaint_job *job) {
    const size_t count = job->window.target_count;
    job->info.windows++;
    job->info.written += count;
    job->left -= count < job->left ? count : job->left;
}

/* Lay out the next window and trace the lines at its hole, unless that has been done; *found: there
   is one. */
static txm_status txi_open_window(texinpaint_job *job, txm_env *env, int *found) {
    txi_choice *choice = &job->choice;
    *found = job->is_open;
    if (job->is_open) return TXM_OK;
    txi_choice_free(choice);
    txm_arena_free(&job->of_window);
    memset(choice, 0, sizeof *choice);
    txm_arena_init(&choice->of_lines, env);
    txm_status status =
        txi_windows_next(&job->domain, &job->of_window, env, &job->window, found);
    if (status != TXM_OK || !*found) return status;
    status = txi_trace(&job->window, &choice->of_lines, env, &choice->lines);
    job->is_open = status == TXM_OK;
    return status;
}

/* Smooth colours in all holes, and the lines through the first one. */
static txm_status txi_step_preview(texinpaint_job *job, txm_env *env) {
    int found = 0;
    txm_status status = TXM_OK;
    if (job->desc.structure != TEXINPAINT_TEXTURE) status = txi_open_window(job, env, &found);
    if (status != TXM_OK) return status;
    return txi_preview(&job->domain, found ? &job->window : NULL, &job->choice.lines, env);
}

/* Complete the next window to half its resolution. */
static txm_status txi_step_coarse(texinpaint_job *job, txm_env *env) {
    txi_domain *domain = &job->domain;
    txi_window *w = &job->window;
    txi_choice *choice = &job->choice;
    int found;
    txm_status status = txi_open_window(job, env, &found);
    if (status != TXM_OK) return status;
    if (!found) {
        job->phase = TXI_GUTTER;
        return TXM_OK;
    }
    job->is_open = 0; /* another try begins anew */
    choice->w = w;
    choice->domain = domain;
    choice->seed = txm_hash(job->desc.seed + (uint64_t)job->info.windows);
    if (job->desc.prior != TEXINPAINT_PRIOR_NONE) {
        status = txi_prior_make(domain, job->crests, w, &job->of_window, env, &job->prior);
        if (status != TXM_OK) return status;
        if (job->prior.line_count) choice->prior = &job->prior;
    }
    status = txi_choose(choice, &job->of_window, env);
    if (status == TXM_OK) status = txi_paint(domain, w, choice->tried[choice->best].preview, env);
    if (status == TXM_TOO_SMALL) { /* nothing to copy from: it stays smooth */
        txi_window_done(domain, w);
        txi_count_window(job);
        return TXM_OK;
    }
    if (status == TXM_OK) job->phase = TXI_FINE;
    return status;
}

/* Read and blend one map of the current window. */
static txm_status txi_blend_window(texinpaint_job *job, int map, const txi_copy *copies,
                                   const txi_pose *poses, float *values, txm_env *env) {
    const texinpaint_map *kind = map ? &job->desc.maps[map - 1] : NULL;
    txi_window_read(&job->domain, &job->window, map, values);
    return txi_blend_map(&job->window, copies, poses, values, job->domain.maps[map].channels,
                         kind && kind->is_label, kind && kind->is_normal, env);
}

/* Complete the current window at full resolution and write it back: all maps or none. */
static txm_status txi_step_fine(texinpaint_job *job, txm_env *env) {
    const txi_window *w = &job->window;
    txi_choice *choice = &job->choice;
    txi_hypothesis *h = &choice->tried[choice->best];
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    txm_arena arena;
    const txi_pose *poses = NULL;
    int pose_count = 0;
    float *values[TEXINPAINT_MAX_MAPS] = {NULL};
    txm_arena_init(&arena, env);
    txi_copy *copies = (txi_copy *)txm_arena_alloc(&arena, pixels, sizeof *copies);
    txm_status status = arena.failed ? txi_no_memory(env) : TXM_OK;
    if (status == TXM_OK)
        status = txi_fill_finish(choice->filler, h->curve_count ? &h->plan : NULL, &h->field,
                                 copies, &poses, &pose_count, env);
    for (int i = 0; i < job->domain.map_count && status == TXM_OK; i++)
        values[i] = (float *)txm_arena_alloc(&arena, pixels, (size_t)job->domain.maps[i].channels *
                                                                 sizeof(float));
    if (arena.failed) status = txi_no_memory(env);
    for (int i = 0; i < job->domain.map_count && status == TXM_OK; i++)
        status = txi_blend_window(job, i, copies, poses, values[i], env);
    if (status == TXM_OK) {
        for (int i = 0; i < job->domain.map_count; i++)
            txi_window_write(&job->domain, w, i, values[i]);
        txi_window_done(&job->domain, w);
        txi_count_window(job);
        job->info.line_ends += choice->lines.end_count;
        job->info.joins += h->curve_count;
        if (w->target_count >= job->largest) {
            job->largest = w->target_count;
            job->info.structure = h->structure;
        }
        job->phase = TXI_COARSE;
    }
    txm_arena_free(&arena);
    return status;
}

/* The share of the work that is done before the next step. */
static float txi_done(const texinpaint_job *job) {
    if (job->phase == TXI_PREVIEW) return 0;
    if (job->phase >= TXI_GUTTER || !job->info.missing) return 0.98f;
    const float window = (float)job->window.target_count / (float)job->info.missing;
    const float done = 1 - (float)job->left / (float)job->info.missing;
    return 0.04f + 0.94f * (done + (job->phase == TXI_FINE ? 0.6f * window : 0));
}

TEXINPAINT_API txm_status texinpaint_step(texinpaint_job *job, txm_env *env, int *more) {
    txm_status status = TXM_OK;
    txi_stage stage;
    size_t filled = 0;
    if (!job) return txm_fail(env, TXM_BAD_ARGUMENT, "job is NULL");
    const float from = txi_done(job);
    if (txm_progress(env, from, "complete")) return txi_stopped(env);
    job->of_window.failed = 0; /* when a step is tried again */
    txi_stage_begin(&stage, env, from, from);
    switch (job->phase) {
    case TXI_PREVIEW:
        status = txi_step_preview(job, &stage.env);
        if (status == TXM_OK) job->phase = TXI_COARSE;
        break;
    case TXI_COARSE: status = txi_step_coarse(job, &stage.env); break;
    case TXI_FINE: status = txi_step_fine(job, &stage.env); break;
    case TXI_GUTTER:
        txi_choice_free(&job->choice);
        txm_arena_free(&job->of_window);
        status = txi_gutter(&job->domain, &job->of_window, &stage.env, &filled);
        if (status == TXM_OK) job->info.written += filled; /* a second try fills no more */
        if (status == TXM_OK) status = txi_bleed(&job->domain, &stage.env);
        if (status != TXM_OK) break;
        txm_arena_free(&job->of_window);
        job->phase = TXI_DONE;
        break;
    default: break;
    }
    status = txi_stage_end(&stage, status);
    if (status == TXM_OK) job->steps++;
    if (status == TXM_OK && more) *more = job->phase != TXI_DONE;
    return status;
}

TEXINPAINT_API txm_status texinpaint_draw(const texinpaint_job *job, int map, txm_env *env,
                                          const txm_image *out) {
    if (!job || !out) return txm_fail(env, TXM_BAD_ARGUMENT, "job or out is NULL");
    if (job->steps == 0) return txm_fail(env, TXM_BAD_ARGUMENT, "no step has been done yet");
    if (map < 0 || map >= job->domain.map_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map must be 0 to map_count");
    const txm_image *picture = &job->domain.maps[map];
    const txm_status status = txi_check_size(out, "out", picture, env);
    if (status != TXM_OK) return status;
    if (txm_image_resolve(*out).channels != picture->channels || out->sample != picture->sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: channels and sample must be those of the map");
    txi_copy_picture(picture, out);
    return TXM_OK;
}

TEXINPAINT_API texinpaint_info texinpaint_info_of(const texinpaint_job *job) {
    return job->info;
}

TEXINPAINT_API txm_status texinpaint_complete(const texinpaint_desc *desc, txm_env *env,
                                              const txm_image *out) {
    texinpaint_job *job = NULL;
    int more = 1;
    txm_status status = txi_check(desc, env);
    if (status == TXM_OK) status = txi_check_outputs(desc, out, 1 + desc->map_count, env);
    if (status == TXM_OK) status = txi_begin(desc, env, &job);
    while (status == TXM_OK && more) status = texinpaint_step(job, env, &more);
    for (int i = 0; status == TXM_OK && i <= desc->map_count; i++)
        status = texinpaint_draw(job, i, env, &out[i]);
    texinpaint_free(job);
    return status;
}

#endif /* TEXINPAINT_JOB_H */
