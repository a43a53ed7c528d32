#ifndef TEXINPAINT_FILL_H
#define TEXINPAINT_FILL_H

#include "assemble.h"
#include "anneal.h"

/* ---- texture completion of a window ---------------------------------------------------------- */

/* How the texture is treated, chosen from what it is like. */
typedef struct txi_style {
    float detail_weight; /* of missing detail in the costs of patches                          */
    float detail_clamp;  /* a pixel's detail counts up to its square times the median          */
    float detail_offset; /* expected detail: standard deviations below the mean of the known   */
    int start;           /* pixels: about the width of the hole at the coarsest level          */
    int starts;          /* at the coarsest level; 1: without annealing; 0 = 2                 */
    uint32_t poses; /* which sources, one bit each, the lowest for the window as it is; 0 = all */
    int is_picture; /* sources: 0 = turned over the full circle, 1 = little, and mirrored */
} txi_style;

enum {
    TXI_MOST_ROUNDS = 12, /* of searches and a vote, at the coarsest level                     */
    TXI_ANNEAL_MOST = 4000, /* anchors of the coarsest level; where there are more, in a long thin
                           hole, it is not annealed: the onion fills that well                 */
    TXI_LEAST_ROUNDS = 2, /* at the finest                                                     */
    TXI_GUIDE_MOST = 100, /* of the guide channel where there is a line                        */
    TXI_ASSEMBLY_LABELS = 1000,
    TXI_ASSEMBLY_REACH = 10, /* pixels that a piece may grow by in one move                    */
    TXI_ASSEMBLY_PASSES = 2,
    TXI_ASSEMBLY_REPORT = 64, /* moves from one report of progress to the next                 */
    TXI_FIRST_STARTS = 2, /* at the coarsest level: the onion's result, and annealed ones       */
    TXI_JUDGE_WIDTH = 10, /* pixels: least width of the hole where a field is judged           */
    TXI_JUDGE_SWEEPS = 8,
    TXI_REPEAT_REACH = 2, /* half widths of the hole: sources that near cost more               */
    TXI_POSE_SHARE = 20 /* the finest level has the poses of at least 1 / 20 of all anchors   */
};

/* What all hypotheses of a window share. */
typedef struct txi_filler {
    const txi_window *window;
    txi_style style;
    uint64_t seed;
    txm_arena *arena;
    int level_count, pose_count;
    const txi_plan *plan; /* whose guide the levels have                                       */
    txi_level level[TXI_MAX_LEVELS];
    txi_pose *pose; /* pose_count, then those of the last plan that was finished               */
    uint16_t outlier[TXI_OUTLIER_BINS];
} txi_filler;

/* A completion down to half resolution (the full one, if there is only one level). */
typedef struct txi_field {
    int level;
    txi_match *match; /* one per anchor                                                        */
    uint8_t *color;   /* 4 per pixel of the level                                              */
    double energy;    /* geometric mean over the levels of the mean cost of a patch            */
} txi_field;

/* Make a level: everything but its sources. */
static int txi_filler_level(txi_filler *f, int k, txm_env *env) {
    txi_level *l = &f->level[k];
    txm_arena scratch;
    const int scale = 1 << k;
    if (!txi_level_make(l, (f->window->width + scale - 1) / scale,
                        (f->window->height + scale - 1) / scale, f->arena))
        return 0;
    if (k) txi_level_halve(&f->level[k - 1], l);
    else txi_level_load(l, f->window);
    txm_arena_init(&scratch, env);
    const int ok = txi_level_taps(l, k == 0, &scratch) && txi_level_depth(l, &scratch) &&
                   txi_level_lists(l, f->arena) &&
                   txi_level_detail(l, f->style.detail_clamp, f->style.detail_offset, 1, &scratch);
    txm_arena_free(&scratch);
    return ok;
}

/* Grain of a window: (median + 1/2) / (mean + 1/2) of the detail of its known pixels, 0..1. Large
   in stochastic textures, small where there are edges between smooth parts. Below 0: no memory. */
static double txi_grain(const txi_window *w, txm_env *env) {
    txi_level l;
    txm_arena arena;
    txm_arena_init(&arena, env);
    double grain = -1;
    if (txi_level_make(&l, w->width, w->height, &arena)) {
        txi_level_load(&l, w);
        if (txi_level_detail(&l, 3, 0, 0, &arena)) grain = l.grain;
    }
    txm_arena_free(&arena);
    return grain;
}

/* Prepare the completion of a window's hole.
   w      outlives *out
   arena  receives all memory
   return TXM_OK; TXM_TOO_SMALL: no patch of 8x8 pixels may be copied, or no pixel is missing, as
          all missing texels lie between pixels; TXM_OUT_OF_MEMORY                              */
static txm_status txi_filler_make(const txi_window *w, const txi_style *style, uint64_t seed,
                                  txm_arena *arena, txm_env *env, txi_filler **out) {
    txi_filler *f = (txi_filler *)txm_arena_zero(arena, 1, sizeof *f);
    uint8_t all[TXI_MAX_POSES];
    if (!f) return txi_no_memory(env);
    f->window = w;
    f->style = *style;
    f->seed = seed;
    f->arena = arena;
    f->pose_count = style->is_picture ? TXI_PICTURE_POSES : TXI_MESH_POSES;
    txi_outlier_table(f->outlier);
    f->pose = (txi_pose *)txm_arena_alloc(arena, (size_t)f->pose_count, sizeof(txi_pose));
    if (!f->pose) return txi_no_memory(env);
    for (int k = 0; k < f->pose_count; k++) {
        txi_source s;
        txi_pose_axes(style->is_picture, k, &s);
        f->pose[k].a = (float)s.a / (float)TXI_UNIT;
        f->pose[k].b = (float)s.b / (float)TXI_UNIT;
        f->pose[k].c = (float)s.c / (float)TXI_UNIT;
        f->pose[k].d = (float)s.d / (float)TXI_UNIT;
    }
    for (int k = 0; k < TXI_MAX_POSES; k++) all[k] = style->poses == 0 || (style->poses >> k & 1);
    for (int k = 0; k < TXI_MAX_LEVELS; k++) {
        uint8_t wanted[TXI_MAX_POSES];
        txi_level *l = &f->level[k];
        int patches = 0;
        if (!txi_filler_level(f, k, env)) return txi_no_memory(env);
        const int is_last =
            k == TXI_MAX_LEVELS - 1 || txi_level_hole_width(l) * 10 < style->start * 14;
        memcpy(wanted, all, sizeof all);
        /* the finest level's others are made once it is known which are used */
        for (int i = 1; i < TXI_MAX_POSES && k == 0 && !is_last; i++) wanted[i] = 0;
        if (!txi_level_sources(l, style->is_picture, f->pose_count, wanted, arena, env))
            return txi_no_memory(env);
        for (int pose = 0; pose < f->pose_count; pose++)
            patches += l->source[pose].color ? txi_source_patches(&l->source[pose]) : 0;
        if (k == 0 && (patches == 0 || l->hole_count == 0))
            return txm_fail(env, TXM_TOO_SMALL,
                            "too little known texture around a hole: no 8x8 texels to copy");
        if (k && patches < TXI_LEAST_PATCHES) break;
        f->level_count = k + 1;
        if (is_last) break;
    }
    if (f->level_count == 1 &&
        !txi_level_sources(&f->level[0], style->is_picture, f->pose_count, all, arena, env))
        return txi_no_memory(env);
    *out = f;
    return TXM_OK;
}

/* ---- the plan ----------------------------------------------------------------------------- */

/* The plan at the finest level, from the window's raster. */
static void txi_plan_load(const txi_plan *plan, const txi_window *w, txi_level *l) {
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            const size_t from = (size_t)y * (size_t)w->width + (size_t)x;
            const size_t to = (size_t)(y + TXI_EDGE) * (size_t)l->width + (size_t)(x + TXI_EDGE);
            if (plan->color)
                l->guide[to] = (uint8_t)(plan->color[4 * from + 3] * TXI_GUIDE_MOST / 255);
            if (!plan->pull || !plan->color || l->state[to] != TXI_HOLE) continue;
            l->pull[to] = plan->pull[from];
            memcpy(l->strip + 4 * to, plan->color + 4 * from, 3);
        }
    }
}

/* The plan at half resolution: the strongest guide, so that lines stay; the mean of the strips. */
static void txi_plan_halve(const txi_level *f, txi_level *l) {
    for (int y = TXI_EDGE; y < l->height - TXI_EDGE; y++) {
        for (int x = TXI_EDGE; x < l->width - TXI_EDGE; x++) {
            const size_t to = (size_t)y * (size_t)l->width + (size_t)x;
            int pull = 0, sum[3] = {0, 0, 0};
            for (int k = 0; k < 4; k++) {
                const int fx = 2 * x - TXI_EDGE + (k & 1), fy = 2 * y - TXI_EDGE + (k >> 1);
                if (fx >= f->width || fy >= f->height) continue;
                const size_t from = (size_t)fy * (size_t)f->width + (size_t)fx;
                if (f->guide[from] > l->guide[to]) l->guide[to] = f->guide[from];
                pull += f->pull[from];
                for (int c = 0; c < 3; c++)
                    sum[c] += f->pull[from] * f->strip[4 * from + (size_t)c];
            }
            if (l->state[to] != TXI_HOLE || !pull) continue;
            l->pull[to] = (uint8_t)(pull / 4);
            for (int c = 0; c < 3; c++)
                l->strip[4 * to + (size_t)c] = (uint8_t)((sum[c] + pull / 2) / pull);
        }
    }
}

/* The guide becomes the fourth byte of a source. */
static void txi_source_guide(const txi_level *l, txi_source *s) {
    for (int j = 0; j < s->height; j++) {
        for (int i = 0; i < s->width; i++) {
            const size_t q = (size_t)j * (size_t)s->width + (size_t)i;
            int32_t x, y;
            if (!s->usable[q]) continue;
            txi_source_place(s, i, j, &x, &y);
            const size_t p = (size_t)((y + TXI_UNIT / 2) / TXI_UNIT) * (size_t)l->width +
                             (size_t)((x + TXI_UNIT / 2) / TXI_UNIT);
            s->color[4 * q + 3] = l->guide[p];
        }
    }
}

/* Give the levels a plan's guide and strips, or take them away. */
static txm_status txi_filler_plan(txi_filler *f, const txi_plan *plan, txm_env *env) {
    if (plan == f->plan) return TXM_OK;
    for (int k = 0; k < f->level_count; k++) {
        txi_level *l = &f->level[k];
        const size_t n = (size_t)l->width * (size_t)l->height;
        if (!l->guide) {
            l->guide = (uint8_t *)txm_arena_alloc(f->arena, n, 6);
            if (!l->guide) return txi_no_memory(env);
            l->pull = l->guide + n;
            l->strip = l->guide + 2 * n;
        }
        memset(l->guide, 0, 6 * n);
        if (plan && k == 0) txi_plan_load(plan, f->window, l);
        if (plan && k) txi_plan_halve(&f->level[k - 1], l);
        for (size_t p = 0; p < n; p++) {
            if (l->state[p] != TXI_VOID) l->color[4 * p + 3] = l->guide[p];
        }
        for (int i = 0; i < l->built_count; i++) txi_source_guide(l, &l->source[l->built[i]]);
    }
    f->plan = plan;
    return TXM_OK;
}

/* ---- levels --------------------------------------------------------------------------------- */

/* Memory for the work on a level. */
static int txi_canvas_make(const txi_filler *f, int level, txi_canvas *t, txm_arena *arena) {
    const txi_level *l = &f->level[level];
    const size_t n = (size_t)l->width * (size_t)l->height, anchors = (size_t)l->anchor_count;
    memset(t, 0, sizeof *t);
    t->level = l;
    t->color = (uint8_t *)txm_arena_alloc(arena, n, 4);
    t->match = (txi_match *)txm_arena_zero(arena, anchors, sizeof(txi_match));
    t->old = (txi_match *)txm_arena_alloc(arena, anchors, sizeof(txi_match));
    t->weight = (uint16_t *)txm_arena_alloc(arena, anchors, sizeof(uint16_t));
    t->use = (uint16_t *)txm_arena_zero(arena, n, sizeof *t->use);
    t->chosen = (int32_t *)txm_arena_alloc(arena, (size_t)l->hole_count, sizeof *t->chosen);
    if (arena->failed) return 0;
    memcpy(t->color, l->color, 4 * n);
    t->price = (uint32_t)((double)f->style.detail_weight * l->clamp * (double)TXI_PATCH_AREA /
                          (double)TXI_WORTH_MOST * 65536);
    /* beside lines a copy from near by is what continues them */
    t->reach = f->plan ? 1 : 1 + txi_level_hole_width(l) * TXI_REPEAT_REACH / 2;
    t->toll = (uint32_t)(TXI_REPEAT_WEIGHT * l->clamp * (double)TXI_PATCH_AREA /
                         (double)TXI_WORTH_MOST * 65536);
    t->seed = txm_hash(f->seed * 16 + (uint64_t)level);
    t->radius = l->width < l->height ? l->width : l->height;
    if (level == 0 && f->level_count > 1) t->radius = 16;
    return 1;
}

/* How strongly the plan's strips pull, 0..256. They are real texture, so they pull at all levels;
   the strips of mere averages would have to fade. */
static int txi_pull_at(int level) {
    return level > 1 ? 230 : level ? 200 : 170;
}

static int txi_rounds(int level, int level_count) {
    if (level_count == 1) return TXI_MOST_ROUNDS;
    return TXI_LEAST_ROUNDS + (TXI_MOST_ROUNDS - TXI_LEAST_ROUNDS) * level / (level_count - 1);
}

/* A ballot on a level, and pairs for its weights. 0: there is no memory. */
static int txi_ballot_make(const txi_filler *f, int level, txi_canvas *t, txm_arena *arena,
                           txi_ballot *ballot, txm_pair **pairs) {
    const txi_level *l = t->level;
    const size_t n = (size_t)l->width * (size_t)l->height, anchors = (size_t)l->anchor_count;
    memset(ballot, 0, sizeof *ballot);
    ballot->canvas = t;
    ballot->outlier = f->outlier;
    ballot->pull = txi_pull_at(level);
    ballot->scratch =
        (uint32_t *)txm_arena_alloc(arena, n, TXI_BALLOT_SCRATCH * sizeof *ballot->scratch);
    *pairs = (txm_pair *)txm_arena_alloc(arena, anchors, 2 * sizeof **pairs);
    return !arena->failed;
}

/* Rounds of searches and votes at a level whose matches are given. */
static txm_status txi_refine(const txi_filler *f, int level, txi_canvas *t, txm_env *env) {
    const size_t anchors = (size_t)t->level->anchor_count;
    const int rounds = txi_rounds(level, f->level_count);
    txm_status status = TXM_OK;
    txm_arena scratch;
    txi_ballot ballot;
    txm_pair *pairs;
    txm_arena_init(&scratch, env);
    if (!txi_ballot_make(f, level, t, &scratch, &ballot, &pairs)) status = txi_no_memory(env);
    for (int round = 0; round < rounds && status == TXM_OK; round++) {
        const int sweeps = round == 0 ? 4 : 2;
        for (int k = 0; k < sweeps; k++) txi_search(t, env);
        txi_weigh(t, 0.08, pairs, pairs + anchors);
        txi_vote(&ballot, env);
        if (txm_progress(env, 0, "filling")) status = txi_stopped(env);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Start a level from the next coarser one: its matches, and a first vote. */
static txm_status txi_descend(const txi_filler *f, int level, const txi_match *from, txi_canvas *t,
                              txm_env *env) {
    const size_t anchors = (size_t)t->level->anchor_count;
    txm_arena scratch;
    txi_ballot ballot;
    txm_pair *pairs;
    txm_status status = TXM_OK;
    txm_arena_init(&scratch, env);
    if (!txi_ballot_make(f, level, t, &scratch, &ballot, &pairs)) status = txi_no_memory(env);
    if (status == TXM_OK) {
        txi_upsample(&f->level[level + 1], from, t);
        txi_weigh(t, 0.08, pairs, pairs + anchors);
        txi_vote(&ballot, env);
    }
    txm_arena_free(&scratch);
    return status;
}

/* mean cost of the canvas' patches */
static double txi_mean_cost(const txi_canvas *t) {
    double sum = 0;
    int count = 0;
    for (int a = 0; a < t->level->anchor_count; a++) {
        if (t->match[a].cost == UINT32_MAX) continue;
        sum += t->match[a].cost;
        count++;
    }
    return count ? sum / count : 0;
}

/* The coarsest level: rounds from the onion as it is, and from labellings annealed from it; the one
   with the smallest costs is kept. */
static txm_status txi_first_level(const txi_filler *f, int level, txi_canvas *t, txm_env *env) {
    const txi_level *l = t->level;
    const size_t bytes = 4 * (size_t)l->width * (size_t)l->height;
    const size_t matches = (size_t)l->anchor_count * sizeof(txi_match);
    const uint64_t seed = t->seed;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    uint8_t *color = (uint8_t *)txm_arena_alloc(&scratch, bytes, 2);
    txi_match *match = (txi_match *)txm_arena_alloc(&scratch, matches, 2);
    txm_status status = scratch.failed ? txi_no_memory(env) : TXM_OK;
    double least = 0;
    if (status == TXM_OK) {
        memcpy(color, t->color, bytes);
        memcpy(match, t->match, matches);
    }
    const int wanted = f->style.starts ? f->style.starts : TXI_FIRST_STARTS;
    const int starts = l->anchor_count > TXI_ANNEAL_MOST ? 1 : wanted;
    for (int k = 0; k < starts && status == TXM_OK; k++) {
        memcpy(t->color, color, bytes);
        memcpy(t->match, match, matches);
        memset(t->use, 0, (size_t)l->width * (size_t)l->height * sizeof *t->use);
        t->fresh = 0;
        t->seed = seed + (uint64_t)k;
        if (k) status = txi_anneal_labels(t, env);
        if (status == TXM_OK) status = txi_refine(f, level, t, env);
        const double cost = txi_mean_cost(t);
        if (status != TXM_OK || (k && cost >= least)) continue;
        least = cost;
        memcpy(color + bytes, t->color, bytes);
        memcpy((uint8_t *)match + matches, t->match, matches);
    }
    if (status == TXM_OK) {
        memcpy(t->color, color + bytes, bytes);
        memcpy(t->match, (uint8_t *)match + matches, matches);
    }
    t->seed = seed;
    txm_arena_free(&scratch);
    return status;
}

/* ---- the calls ------------------------------------------------------------------------------ */

/* Memory for a field. 0: there is none. */
static int txi_field_make(const txi_filler *f, txm_arena *arena, txi_field *field) {
    field->level = f->level_count > 1 ? 1 : 0;
    const txi_level *l = &f->level[field->level];
    field->match = (txi_match *)txm_arena_zero(arena, (size_t)l->anchor_count, sizeof(txi_match));
    field->color = (uint8_t *)txm_arena_zero(arena, (size_t)l->width * (size_t)l->height, 4);
    return !arena->failed;
}

/* How like the known part a field is, at its own level and at the coarser ones, whose patches see
   larger parts of it. */
static txm_status txi_field_judge(const txi_filler *f, txi_field *field, txm_env *env) {
    double sum = 0;
    int count = 0;
    txm_arena memory[2];
    txi_canvas canvas[2];
    txm_status status = TXM_OK;
    txm_arena_init(&memory[0], env);
    txm_arena_init(&memory[1], env);
    for (int level = field->level; level < f->level_count && status == TXM_OK; level++) {
        txi_canvas *t = &canvas[level & 1], *fine = &canvas[!(level & 1)];
        const txi_level *l = &f->level[level];
        txm_arena_free(&memory[level & 1]);
        if (level > field->level && txi_level_hole_width(l) < TXI_JUDGE_WIDTH) break;
        if (!txi_canvas_make(f, level, t, &memory[level & 1])) {
            status = txi_no_memory(env);
            break;
        }
        if (level == field->level) {
            memcpy(t->color, field->color, 4 * (size_t)l->width * (size_t)l->height);
            memcpy(t->match, field->match, (size_t)l->anchor_count * sizeof *t->match);
        } else {
            txi_color_halve(&f->level[level - 1], fine->color, l, t->color);
            for (int a = 0; a < l->anchor_count; a++) t->match[a].pose = -1;
            for (int k = 0; k < TXI_JUDGE_SWEEPS; k++) txi_search(t, env);
        }
        sum += log(txi_mean_cost(t) + 64);
        count++;
        if (txm_progress(env, 0, "judging")) status = txi_stopped(env);
    }
    field->energy = txm_float(exp(sum / (count ? count : 1)));
    txm_arena_free(&memory[0]);
    txm_arena_free(&memory[1]);
    return status;
}

/* Complete the hole at all levels from the coarsest to that of the field.
   plan   lines to follow, or NULL
   field  from txi_field_make
   return TXM_OK, TXM_OUT_OF_MEMORY, TXM_CANCELLED                                              */
static txm_status txi_fill_coarse(txi_filler *f, const txi_plan *plan, txm_env *env,
                                  txi_field *field) {
    txm_arena memory[2];
    txi_canvas canvas[2];
    txm_status status = txi_filler_plan(f, plan, env);
    if (status != TXM_OK) return status;
    txm_arena_init(&memory[0], env);
    txm_arena_init(&memory[1], env);
    const int first = f->level_count - 1;
    for (int level = first; level >= field->level && status == TXM_OK; level--) {
        const int now = level & 1;
        txi_canvas *t = &canvas[now];
        txm_arena_free(&memory[now]);
        if (!txi_canvas_make(f, level, t, &memory[now])) status = txi_no_memory(env);
        else if (level == first) status = txi_onion_peel(t, env);
        else status = txi_descend(f, level, canvas[!now].match, t, env);
        if (status == TXM_OK && level == first) status = txi_first_level(f, level, t, env);
        else if (status == TXM_OK) status = txi_refine(f, level, t, env);
        if (status == TXM_OK && level == field->level) {
            const txi_level *l = t->level;
            memcpy(field->match, t->match, (size_t)l->anchor_count * sizeof *t->match);
            memcpy(field->color, t->color, 4 * (size_t)l->width * (size_t)l->height);
        }
    }
    txm_arena_free(&memory[0]);
    txm_arena_free(&memory[1]);
    return status == TXM_OK ? txi_field_judge(f, field, env) : status;
}

/* Make those sources of the finest level that enough of the field's matches use. */
static txm_status txi_finest_sources(txi_filler *f, const txi_field *field, txm_env *env) {
    txi_level *l = &f->level[0];
    int uses[TXI_MAX_POSES];
    uint8_t wanted[TXI_MAX_POSES];
    const int anchors = f->level[field->level].anchor_count, before = l->built_count;
    memset(uses, 0, sizeof uses);
    for (int a = 0; a < anchors; a++) {
        if (field->match[a].pose >= 0) uses[field->match[a].pose]++;
    }
    for (int k = 0; k < TXI_MAX_POSES; k++) wanted[k] = uses[k] * TXI_POSE_SHARE > anchors;
    if (!txi_level_sources(l, f->style.is_picture, f->pose_count, wanted, f->arena, env))
        return txi_no_memory(env);
    for (int k = before; k < l->built_count && f->plan; k++)
        txi_source_guide(l, &l->source[l->built[k]]);
    return TXM_OK;
}

/* the plan's copy for pixel p of the finest level, if it is to be kept */
static const txi_copy *txi_plan_copy(const txi_plan *plan, const txi_window *w, const txi_level *l,
                                     int p) {
    if (!plan || !plan->copies || !plan->pull || !plan->color) return NULL;
    const int x = p % l->width - TXI_EDGE, y = p / l->width - TXI_EDGE;
    const size_t at = (size_t)y * (size_t)w->width + (size_t)x;
    const int is_kept = plan->copies[at].piece >= 0 && plan->pull[at] >= TXI_PULL_KEPT;
    return is_kept ? &plan->copies[at] : NULL;
}

/* The filler's poses and those of the plan after them. */
static int txi_finish_poses(txi_filler *f, const txi_plan *plan) {
    const int more = plan && plan->copies ? plan->pose_count : 0;
    if (!more) return 1;
    txi_pose *all =
        (txi_pose *)txm_arena_alloc(f->arena, (size_t)(f->pose_count + more), sizeof *all);
    if (!all) return 0;
    memcpy(all, f->pose, (size_t)f->pose_count * sizeof *all);
    memcpy(all + f->pose_count, plan->poses, (size_t)more * sizeof *all);
    f->pose = all;
    return 1;
}

/* The labels of the vote's choices; TXI_LABEL_STRIP where the plan's strips are kept. */
static void txi_finish_labels(const txi_filler *f, const txi_canvas *t, const txi_plan *plan,
                              int32_t *label) {
    const int32_t *chosen = t->chosen;
    const txi_level *l = &f->level[0];
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i];
        if (txi_plan_copy(plan, f->window, l, p)) label[p] = TXI_LABEL_STRIP;
        if (chosen[i] < 0 || label[p] == TXI_LABEL_STRIP) continue;
        const txi_match *m = &t->match[chosen[i]];
        const int corner = l->anchor[chosen[i]];
        label[p] = txi_label(m->pose, m->x - corner % l->width, m->y - corner / l->width);
    }
}

/* Improve the labels by expansion moves.
   labels, pairs  room for one per hole pixel, and for two
   cost           O(labels in use * hole pixels)                                               */
static txm_status txi_finish_expand(txi_assembly *t, int32_t *labels, txm_pair *pairs,
                                    txm_env *env) {
    const int kinds = txi_labels_used(t, labels, TXI_ASSEMBLY_LABELS, pairs);
    const int passes = TXI_LEFT_OUT & TXI_PIECES ? 0 : TXI_ASSEMBLY_PASSES;
    for (int pass = 0, changed = 1; pass < passes && changed; pass++) {
        changed = 0;
        for (int k = 0; k < kinds; k++) {
            if (k % TXI_ASSEMBLY_REPORT == 0 && txm_progress(env, 0, "joining"))
                return txi_stopped(env);
            changed += txi_expand(t, labels[k], TXI_ASSEMBLY_REACH);
        }
    }
    return TXM_OK;
}

/* Where each pixel of the window is copied from, by the labels and their pieces. */
static void txi_finish_copies(const txi_filler *f, const txi_plan *plan, const int32_t *label,
                              const int32_t *piece, int pieces, txi_copy *copies) {
    const txi_level *l = &f->level[0];
    const txi_window *w = f->window;
    for (size_t k = 0; k < (size_t)w->width * (size_t)w->height; k++) {
        memset(&copies[k], 0, sizeof copies[k]);
        copies[k].piece = -1;
    }
    for (int i = 0; i < l->hole_count; i++) {
        const int p = l->hole[i], x = p % l->width, y = p / l->width;
        txi_copy *copy = &copies[(y - TXI_EDGE) * w->width + x - TXI_EDGE];
        const txi_copy *strip = txi_plan_copy(plan, w, l, p);
        if (strip) {
            *copy = *strip;
            copy->pose += f->pose_count;
            copy->piece += pieces;
        }
        if (label[p] < 0) continue;
        int32_t px, py;
        txi_source_place(&l->source[txi_label_pose(label[p])], x + txi_label_dx(label[p]),
                         y + txi_label_dy(label[p]), &px, &py);
        copy->x = (float)px / (float)TXI_UNIT - (float)TXI_EDGE;
        copy->y = (float)py / (float)TXI_UNIT - (float)TXI_EDGE;
        copy->pose = txi_label_pose(label[p]);
        copy->piece = piece[p];
    }
}

/* Labels from the vote's choices, improved; then where each pixel is copied from. Where the plan's
   strips pull by more than half they are kept. */
static txm_status txi_finish_pieces(const txi_filler *f, const txi_canvas *t, const txi_plan *plan,
                                    txi_copy *copies, txm_env *env) {
    const txi_level *l = &f->level[0];
    const size_t n = (size_t)l->width * (size_t)l->height, holes = (size_t)l->hole_count;
    txm_arena scratch;
    txi_assembly assembly;
    txm_arena_init(&scratch, env);
    int32_t *piece = (int32_t *)txm_arena_alloc(&scratch, n, sizeof(int32_t));
    int32_t *queue = (int32_t *)txm_arena_alloc(&scratch, holes, sizeof(int32_t));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, holes, 2 * sizeof(txm_pair));
    txm_status status = TXM_OK;
    if (!txi_assembly_make(&assembly, l, &scratch)) status = txi_no_memory(env);
    if (status == TXM_OK) {
        assembly.color = t->color;
        assembly.window = f->window;
        txi_finish_labels(f, t, plan, assembly.label);
        status = txi_finish_expand(&assembly, queue, pairs, env);
    }
    if (status == TXM_OK) {
        const int pieces = txi_assembly_pieces(&assembly, piece, queue);
        txi_finish_copies(f, plan, assembly.label, piece, pieces, copies);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Complete the finest level, and say where each hole pixel is copied from.
   copies  one per pixel of the window
   poses   receives the filler's poses and after them the plan's, which copies[].pose counts; they
           live as long as the filler */
static txm_status txi_fill_finish(txi_filler *f, const txi_plan *plan, const txi_field *field,
                                  txi_copy *copies, const txi_pose **poses, int *pose_count,
                                  txm_env *env) {
    txi_canvas t;
    txm_arena memory;
    txm_arena_init(&memory, env);
    txm_status status = txi_filler_plan(f, plan, env);
    if (status == TXM_OK && field->level) status = txi_finest_sources(f, field, env);
    const txi_level *l = &f->level[0];
    if (status == TXM_OK && !txi_canvas_make(f, 0, &t, &memory)) status = txi_no_memory(env);
    if (status == TXM_OK && field->level) {
        status = txi_descend(f, 0, field->match, &t, env);
    } else if (status == TXM_OK) {
        memcpy(t.match, field->match, (size_t)l->anchor_count * sizeof *t.match);
        memcpy(t.color, field->color, 4 * (size_t)l->width * (size_t)l->height);
    }
    if (status == TXM_OK) status = txi_refine(f, 0, &t, env);
    if (status == TXM_OK) status = txi_finish_pieces(f, &t, plan, copies, env);
    if (status == TXM_OK && !txi_finish_poses(f, plan)) status = txi_no_memory(env);
    *poses = f->pose;
    *pose_count = f->pose_count + (plan && plan->copies ? plan->pose_count : 0);
    txm_arena_free(&memory);
    return status;
}

#endif /* TEXINPAINT_FILL_H */
