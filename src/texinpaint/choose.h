#ifndef TEXINPAINT_CHOOSE_H
#define TEXINPAINT_CHOOSE_H

#include "blend.h"
#include "fill.h"
#include "judge.h"
#include "lay.h"
#include "look.h"
#include "prior.h"
#include "whole.h"

/* ---- hypotheses -------------------------------------------------------------------------------
   Whether the lines at a hole go on through it, and how, can be seen only in the result: lines
   rescue stripes and ruin labyrinths. So a window is completed to half its resolution without
   lines, with the lines of a picture and with those of a pattern, and the one that goes on best
   where the known texture ends wins. If it has lines, its strips of texture are compared with mean
   profiles of its lines. Only the winner is completed at full resolution.                       */

enum { TXI_HYPOTHESES = 4 };
#define TXI_SHARE_LONG 0.45     /* of line ends that are long, from which there are lines at all */
#define TXI_SHARE_SMOOTH 0.15   /* the same between smooth parts, where short ends are no grain   */
#define TXI_FORESEEN 0.7        /* share of the known lines that goes on as foreseen, below which
                                   it counts less that completed ones do; ours                   */
#define TXI_MEAN_BEHIND 0.012   /* what mean profiles must be better by: they are smoother; ours  */
#define TXI_ENERGY_WEIGHT 0.12  /* share of ends that must go on for patches that cost twice as
                                   much                                                          */
#define TXI_GRAIN_TEXTURE 0.08  /* grain without lines, above which a window is mere texture     */
#define TXI_GRAIN_NO_PATTERN 0.28 /* grain with lines, above which patterns are not tried        */

/* A hypothesis at half resolution. */
typedef struct txi_hypothesis {
    int structure;      /* TEXINPAINT_TEXTURE .. TEXINPAINT_PATTERN                              */
    int is_mean;        /* mean profiles along the lines instead of strips of texture             */
    txi_curve *curves;
    int curve_count;
    uint64_t hash;      /* of the curves                                                         */
    txi_plan plan;
    txi_field field;
    uint8_t *preview;   /* 4 per window pixel                                                    */
    double detail, score;
    txm_arena memory;   /* of all this; empty if a better one has been found                     */
} txi_hypothesis;

/* What is known about a window that is being completed. */
typedef struct txi_choice {
    const txi_window *w;
    const txi_domain *domain;
    const txi_prior *prior; /* or NULL */
    uint64_t seed;
    txi_lines lines;
    double foreseen;    /* share of the known lines that goes on as foreseen                      */
    txm_arena of_lines; /* memory of lines; empty at the end                                     */
    txi_style style;
    txi_filler *filler;
    txi_hypothesis tried[TXI_HYPOTHESES];
    int count, best;
    int can_be_mean;    /* mean profiles are tried, too                                          */
} txi_choice;

static void txi_choice_free(txi_choice *c) {
    for (int i = 0; i < TXI_HYPOTHESES; i++) txm_arena_free(&c->tried[i].memory);
    txm_arena_free(&c->of_lines);
}

/* Which hypotheses to try, and how strongly detail is asked for. */
static void txi_choose_style(txi_choice *c, double grain) {
    const double least = grain > TXI_GRAIN_TEXTURE ? TXI_SHARE_LONG : TXI_SHARE_SMOOTH;
    const int has_lines = c->lines.end_count > 0 && (double)c->lines.share_long >= least;
    const int forced = c->domain->desc->structure;
    memset(&c->style, 0, sizeof c->style);
    c->style.is_picture = c->domain->surface == NULL;
    if (!has_lines && grain > TXI_GRAIN_TEXTURE) {
        c->style.detail_offset = 0;
        c->style.detail_clamp = 6;
        c->style.detail_weight = 1.5f;
        c->style.start = 10;
        c->style.poses = c->style.is_picture ? 1 : 0; /* grain stays sharp if it is not turned */
    } else if (has_lines && grain > TXI_GRAIN_NO_PATTERN) {
        c->style.detail_offset = 0.35f;
        c->style.detail_clamp = 4;
        c->style.detail_weight = 1.2f;
        c->style.start = 14;
    } else {
        c->style.detail_offset = 0.7f;
        c->style.detail_clamp = 3;
        c->style.detail_weight = 1;
        c->style.start = 14;
    }
    if (TXI_LEFT_OUT & TXI_TURNS) c->style.poses = 1;
    if (TXI_LEFT_OUT & TXI_DETAIL) c->style.detail_weight = 0;
    /* means have no grain                                                                        */
    c->can_be_mean = grain <= TXI_GRAIN_TEXTURE && !(TXI_LEFT_OUT & TXI_STRIPS);
    c->count = 0;
    if (forced != TEXINPAINT_AUTO) {
        c->tried[c->count++].structure = forced;
        return;
    }
    c->tried[c->count++].structure = TEXINPAINT_TEXTURE;
    if (has_lines || c->prior) c->tried[c->count++].structure = TEXINPAINT_PICTURE;
    if (has_lines && grain <= TXI_GRAIN_NO_PATTERN)
        c->tried[c->count++].structure = TEXINPAINT_PATTERN;
}

/* A number that differs for curves that differ. */
static uint64_t txi_hash_curves(const txi_curve *curves, int count) {
    uint64_t hash = (uint64_t)count;
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < curves[i].count; k++) {
            uint64_t bits = 0;
            memcpy(&bits, &curves[i].points[k], sizeof bits);
            hash = txm_hash(hash ^ bits);
        }
    }
    return hash;
}

/* Join the lines of a hypothesis. *known: an earlier one has the same. */
static txm_status txi_join_hypothesis(const txi_choice *c, txi_hypothesis *h, txm_env *env,
                                      int *known) {
    const texinpaint_desc *desc = c->domain->desc;
    *known = 0;
    if (h->structure == TEXINPAINT_TEXTURE || h->curves) return TXM_OK;
    txm_status status = txi_join(c->w, &c->lines, c->prior, h->structure, desc->alpha, desc->beta,
                                 c->seed, &h->memory, env, &h->curves, &h->curve_count);
    if (status == TXM_OK && h->structure == TEXINPAINT_PICTURE)
        status = txi_whole_strokes(c->w, &c->lines, &h->memory, env, &h->curves, &h->curve_count);
    if (status != TXM_OK) return status;
    h->hash = txi_hash_curves(h->curves, h->curve_count);
    for (const txi_hypothesis *o = c->tried; o < h; o++)
        *known |= o->curve_count == h->curve_count && o->hash == h->hash;
    return TXM_OK;
}

/* What the lines of a hypothesis say. */
static txm_status txi_plan_hypothesis(const txi_choice *c, txi_hypothesis *h, txm_env *env) {
    if (h->curve_count == 0) return TXM_OK;
    if (h->is_mean || (TXI_LEFT_OUT & TXI_STRIPS) != 0)
        return txi_cartoon(c->w, &c->lines, h->curves, h->curve_count, &h->memory, env, &h->plan);
    return txi_plan_make(c->w, &c->lines, h->curves, h->curve_count, c->seed, &h->memory, env,
                         &h->plan);
}

/* Complete one hypothesis to half resolution. */
static txm_status txi_fill_hypothesis(txi_choice *c, txi_hypothesis *h, txm_env *env) {
    const size_t pixels = (size_t)c->w->width * (size_t)c->w->height;
    txm_status status = txi_plan_hypothesis(c, h, env);
    const txi_plan *plan = h->curve_count ? &h->plan : NULL;
    h->preview = (uint8_t *)txm_arena_alloc(&h->memory, pixels, 4);
    if (!h->preview || !txi_field_make(c->filler, &h->memory, &h->field)) return txi_no_memory(env);
    if (status == TXM_OK) status = txi_fill_coarse(c->filler, plan, env, &h->field);
    if (status != TXM_OK) return status;
    memcpy(h->preview, c->w->color, 4 * pixels);
    h->detail = txi_look_at(c->filler, &h->field, plan, h->preview, env);
    return TXM_OK;
}

/* How well a hypothesis goes on; `plain` is the one without lines, or the first. */
static txm_status txi_judge(const txi_choice *c, const txi_hypothesis *plain, txi_hypothesis *h,
                            txm_env *env) {
    const int is_picture = c->style.is_picture;
    const double ratio = (h->field.energy + 1) / (plain->field.energy + 1);
    double score = 0;
    const txm_status status = txi_continued(c->w, &c->lines, h->preview, env, &score);
    /* labyrinths have lines, but it cannot be foreseen where they go                             */
    if (c->foreseen < TXI_FORESEEN) score *= c->foreseen / TXI_FORESEEN;
    if (h->structure == TEXINPAINT_TEXTURE) score += is_picture ? 0.03 : 0.01;
    /* relative to the detail that there is: where all is smooth all patches fit                  */
    score -= TXI_ENERGY_WEIGHT * (log(ratio) - (h->detail - plain->detail)) / log(2.0);
    if (h->is_mean) score -= TXI_MEAN_BEHIND;
    if (h->detail < -0.3) score -= 0.4 * (-h->detail - 0.3);
    if (is_picture && h->curve_count > 0) {
        score += 0.15 * txi_straight_share(&c->lines, h->curves, h->curve_count);
        score -= 0.08 * txi_mean_bend(h->curves, h->curve_count);
    }
    h->score = txm_float(score); /* rounded: the same choice with any C library */
    return status;
}

/* Show what was tried. */
static txm_status txi_show_hypothesis(const txi_choice *c, const txi_hypothesis *h, txm_env *env) {
    static const char *const lines[] = {"", "lines-texture", "lines-picture", "lines-pattern"};
    static const char *const strips[] = {"", "strips-texture", "strips-picture", "strips-pattern"};
    static const char *const names[] = {"", "half-texture", "half-picture", "half-pattern"};
    enum { SCALE = 3 };
    const txi_window *w = c->w;
    if (!c->domain->desc->show) return TXM_OK;
    uint8_t *rgb =
        (uint8_t *)txm_alloc(env, (size_t)w->width * (size_t)w->height * 3 * SCALE * SCALE);
    if (!rgb) return txi_no_memory(env);
    txi_draw_lines(w, &c->lines, h->curves, h->curve_count, SCALE, rgb);
    txi_show(c->domain, lines[h->structure], rgb, w->width * SCALE, w->height * SCALE, 3);
    if (h->plan.color) {
        txi_draw_strips(w, &h->plan, rgb);
        txi_show(c->domain, strips[h->structure], rgb, w->width, w->height, 3);
    }
    for (size_t p = 0; p < (size_t)w->width * (size_t)w->height; p++) {
        const uint8_t *from = (w->state[p] == TXI_HOLE ? h->preview : w->color) + 4 * p;
        for (int k = 0; k < 3; k++) rgb[3 * p + (size_t)k] = from[k];
    }
    txi_show(c->domain, names[h->structure], rgb, w->width, w->height, 3);
    txm_free(env, rgb);
    return TXM_OK;
}

/* Complete hypothesis i to half resolution; of it and the best so far keep the better one. */
static txm_status txi_try_one(txi_choice *c, int i, txm_env *env) {
    txi_hypothesis *h = &c->tried[i], *best = &c->tried[c->best];
    int known;
    txm_status status = txi_join_hypothesis(c, h, env, &known);
    if (status == TXM_OK && !known) status = txi_fill_hypothesis(c, h, env);
    if (status == TXM_OK && !known) status = txi_judge(c, &c->tried[0], h, env);
    if (status == TXM_OK && !known) status = txi_show_hypothesis(c, h, env);
    if (status != TXM_OK || i == c->best) return status;
    if (!known && h->score > best->score) c->best = i;
    else best = h;
    txm_arena_free(&best->memory);
    best->curves = NULL;
    if (h->is_mean) h->curves = NULL; /* they were those of the other one */
    return TXM_OK;
}

/* Complete all hypotheses to half resolution one after the other, and keep the best; then its lines
   with mean profiles instead of strips. */
static txm_status txi_try_all(txi_choice *c, txm_env *env) {
    txi_stage stage;
    txm_status status = TXM_OK;
    const float share = 0.9f / (float)(c->count + 1);
    for (int i = 0; i <= c->count && i < TXI_HYPOTHESES && status == TXM_OK; i++) {
        txi_hypothesis *h = &c->tried[i];
        if (i == c->count) {
            const txi_hypothesis *best = &c->tried[c->best];
            if (best->curve_count == 0 || !c->can_be_mean) break;
            h->structure = best->structure;
            h->is_mean = 1;
            h->curves = best->curves;
            h->curve_count = best->curve_count;
        }
        txi_stage_begin(&stage, env, 0.1f + share * (float)i, 0.1f + share * (float)(i + 1));
        status = txi_stage_end(&stage, txi_try_one(c, i, &stage.env));
    }
    return status;
}

/* Complete a window to half its resolution.
   c      w, domain, prior, seed and the lines with their memory are set, the rest is 0;
          txi_choice_free frees what is not the arena's                                        */
static txm_status txi_choose(txi_choice *c, txm_arena *arena, txm_env *env) {
    txi_stage stage;
    for (int i = 0; i < TXI_HYPOTHESES; i++) txm_arena_init(&c->tried[i].memory, env);
    c->foreseen = txi_foreseen(&c->lines);
    const double grain = txi_grain(c->w, env);
    if (grain < 0) return txi_no_memory(env);
    txi_choose_style(c, grain);
    txi_stage_begin(&stage, env, 0, 0.1f);
    txm_status status = txi_stage_end(
        &stage, txi_filler_make(c->w, &c->style, c->seed, arena, &stage.env, &c->filler));
    if (status == TXM_OK) status = txi_try_all(c, env);
    txm_arena_free(&c->of_lines);
    return status;
}

#endif /* TEXINPAINT_CHOOSE_H */
