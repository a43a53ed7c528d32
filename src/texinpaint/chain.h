#ifndef TEXINPAINT_CHAIN_H
#define TEXINPAINT_CHAIN_H

#include "cover.h"

/* ---- the graph of all patches -------------------------------------------------------------------
   The patches of a strip are a chain. Where strips meet or cross, patches of one are linked with
   those of the other. */

enum {
    TXI_MEETING_SAMPLES = 32, /* most places that two patches are compared at                     */
    TXI_MEETING_STEP = 2,     /* pixels between them                                              */
    TXI_MEETINGS_MOST = 4096
};

/* The strips of a window, and the graph of their patches. */
typedef struct txi_strips {
    const txi_window *w;
    txi_strip *strips;
    int count;
    int *order;        /* strips, the one that is on top first                                    */
    int node_count, link_count;
    int *counts, *ends; /* of the graph                                                          */
    size_t *firsts;
    int32_t *unary;
    int *link_strip;   /* which strip a link belongs to; -1 - k: it is meeting k                  */
    struct txi_meeting *meetings; /* where strips meet                                            */
    int meeting_count;
    uint8_t *late;     /* per link: a meeting                                                     */
    int *labels;       /* per node: the index of the label chosen                                 */
    int *cuts;         /* rows_most per node: the column from which on the next patch counts      */
    float *offsets;    /* 3 * TXI_STRIP_ROWS per node: added to its colours                       */
} txi_strips;

/* Strips of all curves; the sides of a stroke are one. */
static txm_status txi_strips_make(const txi_window *w, const txi_curve *curves, int count,
                                  txi_strips *all, txm_arena *arena, txm_env *env) {
    all->w = w;
    all->strips = (txi_strip *)txm_arena_zero(arena, (size_t)count, sizeof *all->strips);
    all->order = (int *)txm_arena_alloc(arena, (size_t)count, sizeof *all->order);
    txi_ribbon *lines = (txi_ribbon *)txm_arena_zero(arena, (size_t)count, sizeof *lines);
    uint8_t *done = (uint8_t *)txm_arena_zero(arena, (size_t)count, 1);
    int *partners = (int *)txm_arena_alloc(arena, (size_t)count, sizeof *partners);
    int *is_open = (int *)txm_arena_zero(arena, (size_t)count, sizeof *is_open);
    float *widths = (float *)txm_arena_alloc(arena, (size_t)count, (size_t)count * sizeof *widths);
    if (arena->failed) return txi_no_memory(env);
    int most = 1;
    txi_find_strokes(w, curves, count, partners, widths);
    for (int i = 0; i < count; i++) {
        if (curves[i].count < 2) continue;
        const size_t room = (size_t)curves[i].count + TXI_STRIP_ONWARD;
        most = (int)room > most ? (int)room : most;
        txm_vec2 *points = (txm_vec2 *)txm_arena_alloc(arena, room, sizeof *points);
        if (!points) return txi_no_memory(env);
        const int n = txi_curve_onward(w, &curves[i], points, &is_open[i]);
        txm_status status = txi_ribbon_make(points, n, arena, &lines[i], env);
        if (status == TXM_OK) status = txi_ribbon_register(w, &lines[i], arena, env);
        if (status != TXM_OK) return status;
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    float *width = (float *)txm_arena_alloc(arena, (size_t)most, sizeof *width);
    if (!width) return txi_no_memory(env);
    for (int i = 0; i < count; i++) {
        const int p = partners[i];
        txi_strip *s = &all->strips[all->count];
        if (done[i] || lines[i].count < 2) continue;
        s->curve = i;
        s->partner = -1;
        s->tail = curves[i].ends[1] < 0;
        s->is_open = is_open[i];
        s->line = lines[i];
        const int even = p >= 0 && curves[i].partner == p && lines[i].count == curves[i].count &&
                         curves[p].count == curves[i].count;
        if (p >= 0 && !done[p] && lines[p].count >= 2 &&
            (even
                 ? txi_ribbon_widen_even(&s->line, curves[i].points, curves[p].points, width)
                 : txi_ribbon_widen(&s->line, &lines[p], curves[i].first, curves[i].last, width))) {
            double sum = 0;
            for (int k = 0; k < s->line.count; k++) sum += 2 * (double)s->line.half[k];
            s->inside = txm_clampi((int)(sum / s->line.count + 0.5), 1, TXI_STRIP_INSIDE);
            s->partner = p;
            done[p] = 1;
        }
        done[i] = 1;
        s->rows = 2 * TXI_STRIP_MARGIN + 1 + s->inside;
        const txm_status status = txi_strip_sample(w, s, arena, env);
        if (status != TXM_OK) return status;
        if (s->last >= 0) all->count++; /* else there is nothing to complete */
        else memset(s, 0, sizeof *s);
    }
    return TXM_OK;
}

/* The order in which strips cover each other, as far as is not seen which lies on top: strokes that
   cross others first, of these the narrower and stronger ones; strokes over single lines, lines
   that go through over those that end in the hole, then the stronger ones. */
static uint32_t txi_strip_rank(const txi_strip *s, const txi_curve *c) {
    const uint32_t strength = (uint32_t)(txm_clampf(c->strength, 0, 1e6f) * 16.0f);
    const uint32_t through = c->ends[0] >= 0 && c->ends[1] >= 0 ? 1u << 28 : 0;
    if (s->is_bare) return (1u << 30) + through + strength / (uint32_t)(s->inside + 1);
    return (s->partner >= 0 ? 1u << 29 : 0) + through + strength;
}

/* The strips from top to bottom. Of those that nothing else that is left lies on (if there is none,
   of all) the one of the highest rank comes next. */
static txm_status txi_strips_order(txi_strips *all, const txi_curve *curves, txm_arena *arena,
                                   txm_env *env) {
    const size_t count = (size_t)all->count;
    uint8_t *above = (uint8_t *)txm_arena_zero(arena, count, count);
    uint8_t *placed = (uint8_t *)txm_arena_zero(arena, count, 1);
    if (arena->failed) return txi_no_memory(env);
    const txm_status status =
        txi_cover_find(all->w, all->strips, curves, all->count, above, arena, env);
    for (int n = 0; n < all->count; n++) {
        int best = -1, best_under = 0;
        uint32_t best_rank = 0;
        for (int i = 0; i < all->count; i++) {
            int under = 0;
            if (placed[i]) continue;
            for (int j = 0; j < all->count; j++)
                under |= !placed[j] && above[(size_t)j * count + (size_t)i];
            const uint32_t rank = txi_strip_rank(&all->strips[i], &curves[all->strips[i].curve]);
            if (best >= 0 && (under > best_under || (under == best_under && rank <= best_rank)))
                continue;
            best = i;
            best_under = under;
            best_rank = rank;
        }
        placed[best] = 1;
        all->order[n] = best;
    }
    return status;
}

/* ---- where strips meet ---- */

/* Two patches of different strips that overlap, and where their colours are compared: near the line
   on which one strip gives way to the other. */
typedef struct txi_meeting {
    int strip[2], patch[2], count;
    int8_t offset[TXI_MEETING_SAMPLES][2];  /* columns from the centre of each patch              */
    uint8_t row[TXI_MEETING_SAMPLES][2];
} txi_meeting;

/* The middle of a patch. */
static txm_vec2 txi_patch_centre(const txi_strip *s, int patch) {
    const int column = s->first + patch * s->hop;
    return s->line.place[column < s->line.count ? column : s->line.count - 1];
}

/* Where a place lies in a patch: column offset and row, and its distance from the stroke. 0:
   outside. */
static int txi_patch_locate(const txi_strip *s, int patch, double x, double y, int *offset,
                            int *row, double *away) {
    const int at = s->first + patch * s->hop;
    const int column = at < s->line.count ? at : s->line.count - 1;
    const txm_vec2 t = s->line.along[column], p = s->line.place[column];
    const double dx = x - (double)p.x, dy = y - (double)p.y, half = s->line.half[column];
    const double ahead = dx * t.x + dy * t.y + (column - at), across = dy * t.x - dx * t.y;
    *away = (across < 0 ? -across : across) - half;
    if (ahead < -s->reach || ahead > s->reach || *away > (double)TXI_STRIP_MARGIN) return 0;
    *offset = (int)(ahead + s->reach + 0.5) - s->reach;
    *row = txm_clampi((int)(txi_offset_row(across, s->inside, half) + 0.5), 0, s->rows - 1);
    return 1;
}

/* Fill in the places at which two patches are compared. */
static void txi_meeting_make(const txi_strips *all, txi_meeting *m) {
    const txi_strip *a = &all->strips[m->strip[0]], *b = &all->strips[m->strip[1]];
    const txm_vec2 p = txi_patch_centre(a, m->patch[0]), q = txi_patch_centre(b, m->patch[1]);
    const double mx = 0.5 * ((double)p.x + q.x), my = 0.5 * ((double)p.y + q.y);
    m->count = 0;
    for (int k = 0; k < 13 * 13 && m->count < TXI_MEETING_SAMPLES; k++) {
        const int right = k % 13 - 6, down = k / 13 - 6;
        const double x = mx + TXI_MEETING_STEP * right, y = my + TXI_MEETING_STEP * down;
        int offset[2], row[2];
        double away[2];
        if (!txi_patch_locate(a, m->patch[0], x, y, &offset[0], &row[0], &away[0]) ||
            !txi_patch_locate(b, m->patch[1], x, y, &offset[1], &row[1], &away[1]))
            continue;
        if (away[0] < 2 || away[1] < 2 || away[0] - away[1] > 3 || away[1] - away[0] > 3) continue;
        for (int e = 0; e < 2; e++) {
            m->offset[m->count][e] = (int8_t)offset[e];
            m->row[m->count][e] = (uint8_t)row[e];
        }
        m->count++;
    }
}

/* Eq. 4 for patches of two strips: squared differences at the places, as if at all pixels. */
static int32_t txi_meeting_cost(const txi_strips *all, const txi_meeting *m, int a, int b) {
    const txi_strip *s = &all->strips[m->strip[0]], *t = &all->strips[m->strip[1]];
    int32_t sum = 0;
    for (int k = 0; k < m->count; k++) {
        const int p = (s->labels[a] + m->offset[k][0]) * s->rows + m->row[k][0];
        const int q = (t->labels[b] + m->offset[k][1]) * t->rows + m->row[k][1];
        const uint8_t *u = s->source_color + 3 * p, *v = t->source_color + 3 * q;
        for (int c = 0; c < 3; c++) sum += (u[c] - v[c]) * (u[c] - v[c]);
    }
    return sum * TXI_MEETING_STEP * TXI_MEETING_STEP / 4; /* rows off the lines count a quarter */
}

/* All pairs of patches of different strips whose centres are close: of each patch the nearest one
   of each other strip. */
static txm_status txi_meetings_find(txi_strips *all, txm_arena *arena, txm_env *env) {
    all->meetings =
        (txi_meeting *)txm_arena_alloc(arena, TXI_MEETINGS_MOST, sizeof *all->meetings);
    if (!all->meetings) return txi_no_memory(env);
    for (int i = 0; i < all->count; i++) {
        const txi_strip *a = &all->strips[i];
        for (int j = i + 1; j < all->count; j++) {
            const txi_strip *b = &all->strips[j];
            for (int k = 0; k < a->node_count; k++) {
                const txm_vec2 p = txi_patch_centre(a, k);
                double least = a->reach + b->reach;
                txi_meeting *m = &all->meetings[all->meeting_count];
                if (all->meeting_count == TXI_MEETINGS_MOST) return TXM_OK;
                m->patch[1] = -1;
                for (int n = 0; n < b->node_count; n++) {
                    const double d = txi_distance(txi_patch_centre(b, n), p);
                    if (d < least) least = d, m->patch[1] = n;
                }
                if (m->patch[1] < 0) continue;
                m->strip[0] = i;
                m->strip[1] = j;
                m->patch[0] = k;
                txi_meeting_make(all, m);
                all->meeting_count += m->count > 0;
            }
        }
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    return TXM_OK;
}

/* ---- choosing patches ---- */

static int32_t txi_strips_pair(const void *context, int link, int a, int b) {
    const txi_strips *all = (const txi_strips *)context;
    const int of = all->link_strip[link];
    if (of < 0) return txi_meeting_cost(all, &all->meetings[-1 - of], a, b);
    const txi_strip *s = &all->strips[of];
    const int p = s->labels[a] + s->hop - s->reach, q = s->labels[b] - s->reach;
    return s->overlap[(size_t)p * (size_t)s->source_count + (size_t)q];
}

/* The costs of a strip: the table of overlaps and the unary costs of its patches. */
static void txi_strips_body(void *context, int index) {
    const txi_strips *all = (const txi_strips *)context;
    txi_strip *s = &all->strips[index];
    int16_t feature[TXI_STRIP_FEATURES], mask[TXI_STRIP_FEATURES];
    int32_t values[TXI_STRIP_COLUMNS];
    if (!s->node_count) return;
    for (int i = 0; i < s->features; i++) mask[i] = -1;
    txi_strip_overlaps(s, mask, values);
    for (int k = 0; k < s->node_count; k++)
        txi_strip_unary(s, k, feature, mask, all->unary + all->firsts[s->node + k]);
}

/* The sources of all strips, and the graph of all patches. profiles: there are to be none; strips
   without patches get profiles. */
static txm_status txi_strips_graph(txi_strips *all, int profiles, const txi_lines *lines,
                                   const txi_curve *curves, txm_arena *arena, txm_env *env) {
    size_t labels = 0;
    int room = TXI_STRIP_COLUMNS;
    while (room > TXI_STRIP_COLUMNS_LEAST && room * room > TXI_STRIP_CELLS / (all->count + 1))
        room -= 16;
    for (int i = 0; i < all->count; i++) {
        txi_strip *s = &all->strips[i];
        s->room = room;
        txm_status status =
            profiles ? TXM_OK : txi_strip_sources(all->w, lines, &curves[s->curve], s, arena, env);
        if (status == TXM_OK && !profiles) txi_strip_labels(s);
        if (status == TXM_OK && !s->node_count) status = txi_strip_profile(s, arena, env);
        if (status != TXM_OK) return status;
        s->node = all->node_count;
        all->node_count += s->node_count;
        all->link_count += s->node_count ? s->node_count - 1 : 0;
        labels += (size_t)s->node_count * (size_t)s->label_count;
        if (s->node_count)
            s->overlap = (int32_t *)txm_arena_alloc(arena, (size_t)s->source_count,
                                                    (size_t)s->source_count * sizeof *s->overlap);
        if (txm_progress(env, 0, "strips")) return txi_stopped(env);
    }
    const txm_status status = txi_meetings_find(all, arena, env);
    if (status != TXM_OK) return status;
    all->link_count += all->meeting_count;
    const size_t nodes = (size_t)all->node_count, links = (size_t)all->link_count;
    all->counts = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *all->counts);
    all->firsts = (size_t *)txm_arena_alloc(arena, nodes + 1, sizeof *all->firsts);
    all->unary = (int32_t *)txm_arena_alloc(arena, labels + 1, sizeof *all->unary);
    all->ends = (int *)txm_arena_alloc(arena, links + 1, 2 * sizeof *all->ends);
    all->link_strip = (int *)txm_arena_alloc(arena, links + 1, sizeof *all->link_strip);
    all->late = (uint8_t *)txm_arena_zero(arena, links + 1, 1);
    all->labels = (int *)txm_arena_alloc(arena, nodes + 1, sizeof *all->labels);
    if (arena->failed) return txi_no_memory(env);
    size_t first = 0;
    int link = 0;
    for (int i = 0; i < all->count; i++) {
        const txi_strip *s = &all->strips[i];
        for (int k = 0; k < s->node_count; k++) {
            const int node = s->node + k;
            all->counts[node] = s->label_count;
            all->firsts[node] = first;
            first += (size_t)s->label_count;
            if (k == 0) continue;
            all->ends[2 * link] = node - 1;
            all->ends[2 * link + 1] = node;
            TXM_ASSERT(link < all->link_count);
            all->link_strip[link++] = i;
        }
    }
    for (int k = 0; k < all->meeting_count; k++, link++) {
        const txi_meeting *m = &all->meetings[k];
        for (int e = 0; e < 2; e++)
            all->ends[2 * link + e] = all->strips[m->strip[e]].node + m->patch[e];
        all->link_strip[link] = -1 - k;
        all->late[link] = 1;
    }
    txm_parallel_for(env, all->count, txi_strips_body, all);
    return TXM_OK;
}

static txm_status txi_strips_choose(txi_strips *all, uint64_t seed, txm_arena *arena,
                                    txm_env *env) {
    txi_graph g;
    memset(&g, 0, sizeof g);
    g.node_count = all->node_count;
    g.link_count = all->link_count;
    g.counts = all->counts;
    g.firsts = all->firsts;
    g.unary = all->unary;
    g.ends = all->ends;
    g.late = all->late;
    g.pair = txi_strips_pair;
    g.context = all;
    const txm_status status = txi_belief(&g, TXI_STRIP_KEEP, seed, arena, all->labels, NULL, env);
    for (int i = 0; i < all->count && status == TXM_OK; i++) {
        txi_strip *s = &all->strips[i];
        s->chosen = all->labels + s->node;
        for (int k = 0; k < s->node_count; k++) s->chosen[k] = s->labels[s->chosen[k]];
    }
    return status;
}

#endif /* TEXINPAINT_CHAIN_H */
