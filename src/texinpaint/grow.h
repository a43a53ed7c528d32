#ifndef TEXINPAINT_GROW_H
#define TEXINPAINT_GROW_H

#include "trace.h"
#include "vote.h"

/* ---- lines grow into the hole -----------------------------------------------------------------
   [1, II.B]: the points of the lines around the hole vote; ball tensors first, as only their places
   are known. Then, round by round, each line takes the place of most saliency ahead of it as a new
   point, whose tensor is set anew, until it is as near to another line as alpha, leaves the hole,
   has no votes left, or beta rounds are over.

   The paper joins the two lines then. Here growth and the field of votes only say how well two ends
   go together: lines that grow drift where there is a gap to bridge, and which ones meet first is
   chance.                                                                                        */

enum {
    TXI_TOKEN_STEP = 3,     /* pixels between the points of a line that vote; ours                */
    TXI_TOKENS_OF_END = 14, /* points of each line                                                */
    TXI_GROW_ROUNDS = 64    /* at most, if beta is 0                                              */
};

/* The surface at a place: the point on it, the normal, and unit tangents along the window's
   axes. Pixels that are void count as flat. */
typedef struct txi_spot {
    txm_dvec3 place, normal, ex, ey;
    int used; /* of the dense map: votes are counted here                                         */
} txi_spot;

typedef struct txi_grown {
    const txi_window *window;
    txi_fields fields;
    txi_tokens tokens;
    int *owner;        /* one per token: the end of its line                                      */
    int step;          /* pixels between the places of the dense map; a line grows as far in a
                          round                                                                  */
    int width, height; /* of the dense map, which covers the hole                                 */
    int left, top;     /* pixel of its first place                                                */
    txi_spot *spots;   /* 1 per place of the dense map                                           */
    double *votes;     /* 6 per place                                                             */
    uint8_t *met;      /* end_count squared: 1: the lines of the two ends met                     */
    int end_count;
} txi_grown;

static txi_spot txi_spot_at(const txi_window *w, double x, double y) {
    txi_spot s;
    s.used = 0;
    const int ix = txm_clampi((int)floor(x + 0.5), 0, w->width - 1);
    const int iy = txm_clampi((int)floor(y + 0.5), 0, w->height - 1);
    const size_t i = (size_t)iy * (size_t)w->width + (size_t)ix;
    txm_dvec3 e[2];
    s.place = txm_d3(x, y, 0);
    s.normal = txm_d3(0, 0, 1);
    s.ex = txm_d3(1, 0, 0);
    s.ey = txm_d3(0, 1, 0);
    if (w->state[i] == TXI_VOID) return s;
    for (int d = 0; d < 2; d++) { /* differences to the neighbours that exist                     */
        const int at = d ? iy : ix, limit = d ? w->height : w->width;
        const size_t step = d ? (size_t)w->width : 1;
        const size_t low = at > 0 && w->state[i - step] != TXI_VOID ? i - step : i;
        const size_t high = at + 1 < limit && w->state[i + step] != TXI_VOID ? i + step : i;
        const txm_vec3 p = w->place[low], q = w->place[high];
        e[d] = txm_d3((double)q.x - p.x, (double)q.y - p.y, (double)q.z - p.z);
        if (low != i && high != i) e[d] = txm_d3_scale(e[d], 0.5);
        if (low == high || txm_d3_len2(e[d]) < 1e-4 || txm_d3_len2(e[d]) > 9) return s;
    }
    const txm_vec3 p = w->place[i], n = w->normal[i];
    s.place = txm_d3(p.x, p.y, p.z);
    s.place = txm_d3_mad(txm_d3_mad(s.place, e[0], x - ix), e[1], y - iy);
    s.normal = txm_d3_unit(txm_d3(n.x, n.y, n.z));
    s.ex = txm_d3_unit(txm_d3_mad(e[0], s.normal, -txm_d3_dot(e[0], s.normal)));
    s.ey = txm_d3_unit(txm_d3_mad(e[1], s.normal, -txm_d3_dot(e[1], s.normal)));
    return s;
}

static double txi_form(const double t[6], txm_dvec3 a, txm_dvec3 b) {
    return a.x * (t[0] * b.x + t[1] * b.y + t[2] * b.z) +
           a.y * (t[1] * b.x + t[3] * b.y + t[4] * b.z) +
           a.z * (t[2] * b.x + t[4] * b.y + t[5] * b.z);
}

/* Add a stick to the tokens, and its votes to the dense map. (x, y): its place in the window */
static void txi_grow_add(txi_grown *g, double x, double y, txm_dvec3 place, txm_dvec3 normal,
                         double weight, int owner) {
    const double reach = g->fields.reach / g->step, cx = (x - g->left) / g->step;
    const double cy = (y - g->top) / g->step;
    double t[6] = {0};
    if (g->tokens.count >= g->tokens.room) return;
    txi_outer(t, normal, weight);
    g->owner[g->tokens.count] = owner;
    txi_tokens_add(&g->tokens, place, t);
    /* a window is almost isometric: what is in reach on the surface is so in the window, nearly  */
    const int x0 = txm_clampi((int)(cx - reach), 0, g->width);
    const int x1 = txm_clampi((int)(cx + reach) + 2, 0, g->width);
    const int y0 = txm_clampi((int)(cy - reach), 0, g->height);
    const int y1 = txm_clampi((int)(cy + reach) + 2, 0, g->height);
    for (int j = y0; j < y1; j++) {
        for (int i = x0; i < x1; i++) {
            const size_t at = (size_t)j * (size_t)g->width + (size_t)i;
            if (g->spots[at].used)
                txi_vote_stick(&g->fields, normal, txm_d3_sub(g->spots[at].place, place), weight,
                               g->votes + 6 * at);
        }
    }
}

/* The votes at a place of the window, from the four places of the dense map around it: a tensor
   in the window's axes, xx xy yy. */
static void txi_votes_in_window(const txi_grown *g, double x, double y, double t[3]) {
    const double cx = (x - g->left) / g->step, cy = (y - g->top) / g->step;
    const int ix = txm_clampi((int)floor(cx), 0, g->width - 2);
    const int iy = txm_clampi((int)floor(cy), 0, g->height - 2);
    const double u = cx - ix < 0 ? 0 : cx - ix > 1 ? 1 : cx - ix;
    const double v = cy - iy < 0 ? 0 : cy - iy > 1 ? 1 : cy - iy;
    t[0] = t[1] = t[2] = 0;
    for (int k = 0; k < 4; k++) {
        const size_t at = (size_t)(iy + k / 2) * (size_t)g->width + (size_t)(ix + k % 2);
        const txi_spot *s = &g->spots[at];
        const double w = (k & 1 ? u : 1 - u) * (k & 2 ? v : 1 - v), *votes = g->votes + 6 * at;
        if (!s->used || w <= 0) continue;
        t[0] += w * txi_form(votes, s->ex, s->ex);
        t[1] += w * txi_form(votes, s->ex, s->ey);
        t[2] += w * txi_form(votes, s->ey, s->ey);
    }
}

/* The lines' points as tokens: balls vote, then sticks of length one in the directions found. */
static txm_status txi_grow_begin(txi_grown *g, const txi_lines *l, txm_arena *scratch,
                                 txm_env *env) {
    const int room = l->end_count * TXI_TOKENS_OF_END;
    static const double unit[6] = {1, 0, 0, 1, 0, 1};
    txi_fields balls;
    txi_tokens points;
    int *owner = (int *)txm_arena_alloc(scratch, (size_t)room, sizeof *owner);
    txm_dvec3 *normals = (txm_dvec3 *)txm_arena_alloc(scratch, (size_t)room, sizeof *normals);
    double *votes = (double *)txm_arena_alloc(scratch, (size_t)room, 6 * sizeof *votes);
    txm_vec2 *where = (txm_vec2 *)txm_arena_alloc(scratch, (size_t)room, sizeof *where);
    if (scratch->failed) return txi_no_memory(env);
    txi_fields_make(&balls, 4, 0);
    txm_status status = txi_tokens_make(&points, room, balls.reach, scratch, env);
    if (status != TXM_OK) return status;
    for (int e = 0; e < l->end_count; e++) {
        for (int i = 0; i < TXI_TOKENS_OF_END && i * TXI_TOKEN_STEP < l->ends[e].count; i++) {
            const txm_vec2 p = l->points[l->ends[e].first + i * TXI_TOKEN_STEP];
            const txi_spot s = txi_spot_at(g->window, p.x, p.y);
            normals[points.count] = s.normal;
            owner[points.count] = e;
            where[points.count] = p;
            txi_tokens_add(&points, s.place, unit);
        }
    }
    txi_vote_sparse(&balls, &points, 1, normals, votes);
    for (int i = 0; i < points.count; i++) {
        const txi_token *k = &points.at[i];
        if (k->stick <= 0) continue; /* it is alone                                               */
        txi_grow_add(g, where[i].x, where[i].y, k->place, k->normal, 1, owner[i]);
    }
    return TXM_OK;
}

/* The line of another end that has come within alpha of a place, or -1. */
static int txi_grow_meets(const txi_grown *g, int end, txm_dvec3 place, double alpha) {
    const txi_tokens *k = &g->tokens;
    const int64_t cx = txi_cell(k, place.x), cy = txi_cell(k, place.y), cz = txi_cell(k, place.z);
    int best = -1;
    double least = alpha * alpha;
    for (int i = 0; i < 27; i++) {
        const int64_t x = cx + i % 3 - 1, y = cy + i / 3 % 3 - 1, z = cz + i / 9 - 1;
        for (int j = k->bucket[txi_bucket(k, x, y, z)]; j >= 0; j = k->at[j].next) {
            const double d = txm_d3_dist2(k->at[j].place, place);
            if (g->owner[j] == end || d > least || (d >= least && j > best)) continue;
            least = d;
            best = j;
        }
    }
    return best < 0 ? -1 : g->owner[best];
}

/* One round of the line of an end: a step in that of seven directions, up to 45 degrees to
   either side, which has the most votes for a line in this direction. 0: it has stopped. */
static int txi_grow_step(txi_grown *g, int end, double least, txm_vec2 *tip, txm_vec2 *heading) {
    const txi_window *w = g->window;
    double best = least, bx = 0, by = 0, hx = 0, hy = 0;
    for (int i = 0; i < 7; i++) {
        const int k = i & 1 ? (i + 1) / 2 : -(i / 2); /* straight on first                        */
        double sine, cosine, t[3];
        txm_sincos(k * (TXM_PI / 12), &sine, &cosine);
        const double dx = heading->x * cosine - heading->y * sine;
        const double dy = heading->x * sine + heading->y * cosine;
        const double x = tip->x + g->step * dx, y = tip->y + g->step * dy;
        txi_votes_in_window(g, x, y, t);
        const double across = dy * dy * t[0] - 2 * dx * dy * t[1] + dx * dx * t[2];
        const double along = dx * dx * t[0] + 2 * dx * dy * t[1] + dy * dy * t[2];
        if (across - along <= best) continue;
        best = across - along;
        bx = x;
        by = y;
        hx = dx;
        hy = dy;
    }
    if (best <= least) return 0;
    const ptrdiff_t at = txi_pixel(w->width, w->height, bx, by);
    if (at < 0 || w->state[at] != TXI_HOLE) return 0;
    *tip = txm_v2(txm_float(bx), txm_float(by));
    *heading = txi_unit(heading->x + hx, heading->y + hy);
    const txi_spot s = txi_spot_at(w, bx, by);
    const txm_dvec3 across = txm_d3_mad(txm_d3_scale(s.ex, -(double)heading->y), s.ey, heading->x);
    txi_grow_add(g, bx, by, s.place, txm_d3_unit(across), 0.8, end);
    return 1;
}

/* The dense map: places in the hole and next to it, without votes. */
static txm_status txi_grow_map(txi_grown *g, const txi_lines *l, txm_arena *scratch, txm_env *env) {
    const txi_window *w = g->window;
    int x0 = w->width, x1 = -1, y0 = w->height, y1 = -1;
    for (int y = 0; y < w->height; y++) {
        for (int x = 0; x < w->width; x++) {
            if (w->state[(size_t)y * (size_t)w->width + (size_t)x] != TXI_HOLE) continue;
            x0 = x < x0 ? x : x0;
            x1 = x > x1 ? x : x1;
            y0 = y < y0 ? y : y0;
            y1 = y > y1 ? y : y1;
        }
    }
    if (x1 < 0) x0 = x1 = y0 = y1 = 0;
    g->left = x0;
    g->top = y0;
    g->width = (x1 - x0) / g->step + 2;
    g->height = (y1 - y0) / g->step + 2;
    const size_t count = (size_t)g->width * (size_t)g->height;
    g->spots = (txi_spot *)txm_arena_alloc(scratch, count, sizeof *g->spots);
    g->votes = (double *)txm_arena_zero(scratch, count, 6 * sizeof *g->votes);
    if (scratch->failed) return txi_no_memory(env);
    for (int j = 0; j < g->height; j++) {
        for (int i = 0; i < g->width; i++) {
            const int x = g->left + i * g->step, y = g->top + j * g->step;
            txi_spot *s = &g->spots[(size_t)j * (size_t)g->width + (size_t)i];
            *s = txi_spot_at(w, x, y);
            s->used = x < w->width && y < w->height &&
                      l->away[(size_t)y * (size_t)w->width + (size_t)x] <= 4 * g->step * g->step;
        }
    }
    return TXM_OK;
}

/* Let the lines grow.
   alpha  pixels; lines as near as that have met; at most, and with 0, a step
   beta   rounds at most; 0: 64
   cost   O(tokens * places of the map in reach)                                                */
static txm_status txi_grow(txi_grown *g, const txi_window *w, const txi_lines *l, float alpha,
                           int beta, txm_arena *scratch, txm_env *env) {
    const int ends = l->end_count;
    int rounds = beta > 0 ? beta : TXI_GROW_ROUNDS;
    memset(g, 0, sizeof *g);
    g->window = w;
    g->end_count = ends;
    /* far enough for votes to bridge the hole                                                    */
    txi_fields_make(&g->fields, txm_clampf(0.25f * l->width, 6, 30), 0);
    g->step = txm_clampi((int)(g->fields.sigma / 5), 2, 6);
    const double meet = alpha > 0 && alpha < (float)g->step ? (double)alpha : g->step;
    if (rounds > 1 + (int)(l->width / (float)g->step))
        rounds = 1 + (int)(l->width / (float)g->step);
    const int room = ends * (TXI_TOKENS_OF_END + rounds);
    txm_status status = txi_tokens_make(&g->tokens, room, g->step + 1.0, scratch, env);
    if (status == TXM_OK) status = txi_grow_map(g, l, scratch, env);
    if (status != TXM_OK) return status;
    g->owner = (int *)txm_arena_alloc(scratch, (size_t)room, sizeof *g->owner);
    g->met = (uint8_t *)txm_arena_zero(scratch, (size_t)ends, (size_t)ends);
    txm_vec2 *tips = (txm_vec2 *)txm_arena_alloc(scratch, (size_t)ends, 2 * sizeof *tips);
    uint8_t *going = (uint8_t *)txm_arena_alloc(scratch, (size_t)ends, 1);
    if (scratch->failed) return txi_no_memory(env);
    txm_vec2 *headings = tips + ends;
    status = txi_grow_begin(g, l, scratch, env);
    if (status != TXM_OK) return status;
    for (int e = 0; e < ends; e++) {
        tips[e] = l->ends[e].place;
        headings[e] = l->ends[e].heading;
        going[e] = 1;
    }
    for (int round = 0; round < rounds; round++) {
        for (int e = 0; e < ends; e++) {
            if (!going[e]) continue;
            going[e] = (uint8_t)txi_grow_step(g, e, 0.05, &tips[e], &headings[e]);
            if (!going[e] || round < 2) continue;
            const int other =
                txi_grow_meets(g, e, txi_spot_at(w, tips[e].x, tips[e].y).place, meet);
            if (other < 0) continue;
            g->met[(size_t)e * (size_t)ends + (size_t)other] = 1;
            g->met[(size_t)other * (size_t)ends + (size_t)e] = 1;
        }
    }
    return TXM_OK;
}

/* How far the votes agree with a line in direction (dx, dy) at a place, -1..1: (across - along)
   / sum; 0 where there are no votes. */
static double txi_votes_agree(const txi_grown *g, double x, double y, double dx, double dy) {
    double t[3];
    if (TXI_LEFT_OUT & TXI_VOTES) return 0;
    txi_votes_in_window(g, x, y, t);
    const double across = dy * dy * t[0] - 2 * dx * dy * t[1] + dx * dx * t[2];
    const double along = dx * dx * t[0] + 2 * dx * dy * t[1] + dy * dy * t[2];
    return t[0] + t[2] > 1e-3 ? (across - along) / (t[0] + t[2]) : 0;
}

#endif /* TEXINPAINT_GROW_H */
