#ifndef TEXTILES_FRAME_H
#define TEXTILES_FRAME_H

#include "search.h"

/* ---- corners and edges ------------------------------------------------------------------- */

enum {
    TXT_LOCK = 2,         /* texels on either side of a joint that all tiles share             */
    TXT_NEAR = 4,         /* texels from the vertex where the piece of a corner may end ...    */
    TXT_FAR = 12,         /* ... and where it must have ended; less in small tiles             */
    TXT_ACROSS = 6,       /* half width of the strip in which such a cut is sought             */
    TXT_CORNERS = 160,    /* random places that are rated for each corner                      */
    TXT_SAME_PLACE = 300  /* gray levels for a strip that another colour shows already         */
};
#define TXT_END 8             /* texels of a joint that show the corner, about; less in small tiles */

static int txt_near(const txt_build *b) {
    return b->set->size / 8 < TXT_NEAR ? b->set->size / 8 : TXT_NEAR;
}

static int txt_end(const txt_build *b) {
    return b->set->size / 4 < TXT_END ? b->set->size / 4 : TXT_END;
}

static int txt_zone_end(const txt_build *b) {
    return b->set->size / 4 < TXT_FAR ? b->set->size / 4 : TXT_FAR;
}

/* Strip coordinates (a, u) as a shift on the sheet. */
static void txt_along(const txt_build *b, int axis, int a, int u, int *i, int *j) {
    if (b->is_triangle) { /* a counts from where row u meets the joint's normal, roughly */
        *i = a - txt_half(u);
        *j = u;
    } else {
        *i = axis ? u : a;
        *j = axis ? a : u;
    }
}

/* What a strip shows at (a, u) by piece w of it (0 and count + 1: the corners). */
static int32_t txt_strip_shows(const txt_build *b, const txt_seam_strip *s, int w, int a, int u) {
    int i, j, sheet, si, sj;
    if (w >= 1 && w <= s->count) {
        sheet = s->segment[w - 1].sheet;
        si = s->segment[w - 1].i;
        sj = s->segment[w - 1].j;
        txt_along(b, s->axis, a, u, &i, &j);
    } else { /* a corner: its vertex lies at the end of the strip */
        const int c = s->corner[w != 0];
        sheet = b->corner[c].sheet;
        si = b->corner[c].i;
        sj = b->corner[c].j;
        txt_along(b, s->axis, w ? a - b->set->size : a, u, &i, &j);
        if (b->is_triangle && w) { /* seen from the other end */
            i = -i;
            j = -j;
        }
    }
    return txt_number(b, sheet, si + i, sj + j);
}

/* The cost of a line of texels as a joint, in search units. A good joint has typical roughness,
   across (the most visible) and along, typical colour, and nothing conspicuous on it. The weights,
   in gray levels, are ours, found by measuring and by eye. */
static int txt_line_cost(const txt_build *b, int axis, double wanted, int sheet, int x, int y,
                         int n) {
    const double step = txt_line_mean(b, &b->cross[axis], axis, sheet, x, y, n) / wanted;
    const double salience = txt_line_mean(b, &b->salience[axis], axis, sheet, x, y, n);
    const double along = txt_line_mean(b, &b->along[axis], axis, sheet, x, y, n);
    const double off = fabs(step - 1), excess = salience - 1;
    double cost = 100 * off + (off > 0.05 ? 200 * (off - 0.05) : 0) + 20 * fabs(along - 1);
    if (excess > 0) cost += 6 * excess;
    for (int c = 0; c < b->set->maps[0].channels; c++) {
        const double color = txt_line_mean(b, &b->color[axis][c], axis, sheet, x, y, n);
        cost += 0.7 * b->color[axis][c].mean * fabs(color - 1) / b->set->maps[0].channels;
    }
    return (int)fmin(cost * TXT_SCALE, 65535);
}

/* A table of these costs for lines of n texels from every texel on. */
static void txt_fill_line_costs(txt_build *b, int axis, int n, double wanted) {
    if (b->line_length[axis] == n && fabs(b->line_step[axis] - wanted) < 0.002) return;
    b->line_length[axis] = n;
    b->line_step[axis] = wanted;
    for (int e = 0; e < b->sheet_count; e++) {
        const txt_sheet *s = &b->sheets[e];
        for (int y = 0; y < s->height; y++) {
            for (int x = 0; x < s->width; x++)
                b->line_cost[axis][s->first + y * s->width + x] =
                    (uint16_t)txt_line_cost(b, axis, wanted, e, x, y, n);
        }
    }
}

/* The extra cost of the places of a row for a segment over a = from to from + length. */
typedef struct txt_strip_query {
    const txt_build *b;
    const txt_seam_strip *strips; /* those of the same axis so far */
    int strip_count, axis, from, length;
} txt_strip_query;

static void txt_strip_extra(const void *context, int sheet, int i, int j, int n, uint32_t *cost) {
    const txt_strip_query *q = (const txt_strip_query *)context;
    const txt_build *b = q->b;
    int di, dj;
    txt_along(b, q->axis, q->from, 0, &di, &dj);
    for (int k = 0; k < n; k++) {
        const int y = j + dj, x = i + k + di + (b->is_triangle ? txt_half(y) : 0);
        const txt_sheet *in = &b->sheets[sheet];
        cost[k] += b->line_cost[q->axis][in->first + txm_clampi(y, 0, in->height - 1) * in->width +
                                         txm_clampi(x, 0, in->width - 1)];
        for (int s = 0; s < q->strip_count; s++) { /* keep away from the other strips */
            const txt_seam_strip *other = &q->strips[s];
            if (other->axis != q->axis) continue;
            for (int g = 0; g < other->count; g++) {
                if (other->segment[g].sheet != sheet) continue;
                int oi = other->segment[g].i, oj = other->segment[g].j;
                int across = q->axis ? abs(oi - (i + k)) : abs(oj - j);
                int along = q->axis ? abs(oj - j) : abs(oi + txt_half(oj * b->is_triangle) -
                                                        (i + k + txt_half(j * b->is_triangle)));
                if (across == 0 && along == 0) cost[k] += TXT_SAME_PLACE * TXT_SCALE;
                if (across < 16 && along < q->length)
                    cost[k] += (uint32_t)((16 - across) * (q->length - along) * 30 / q->length *
                                          TXT_SCALE / 16);
            }
        }
    }
}

/* Samples at the ends of segment w. at_start: what the segment before shows around a = from, for
   the first segment the corner; at_end: what the corner at the end of the strip shows. */
static void txt_end_samples(const txt_build *b, txt_query *q, const txt_seam_strip *s, int w, int from,
                            int at_start, int at_end) {
    const int size = b->set->size, zone = txt_zone_end(b) + 1;
    q->count = 0;
    for (int u = -6; u <= 6; u += 2) {
        for (int k = 0; k < zone; k += 2) {
            int i, j;
            if (at_start) {
                int a = from + k;
                if (w > 1) a -= zone / 2; /* the overlap with the segment before */
                else if (!b->is_triangle) a += txt_near(b) - 1;
                txt_along(b, s->axis, a, u, &i, &j);
                if (!b->is_triangle || w > 1 || k <= 6)
                    txt_sample_add(b, q, i, j, txt_strip_shows(b, s, w - 1, a, u));
            }
            if (at_end) {
                int a = size - k;
                if (!b->is_triangle) a -= txt_near(b) - 1;
                txt_along(b, s->axis, a, u, &i, &j);
                if (!b->is_triangle || k <= 6)
                    txt_sample_add(b, q, i, j, txt_strip_shows(b, s, s->count + 1, a, u));
            }
        }
    }
}

/* number of segments of a strip, each so short that a sheet has several places for it */
static int txt_segment_count(const txt_build *b, int axis, int only_sheet) {
    int length = 0;
    for (int e = 0; e < b->sheet_count; e++) {
        const int l = axis ? b->sheets[e].height : b->sheets[e].width;
        if ((only_sheet < 0 || e == only_sheet) && l > length) length = l;
    }
    const int size = b->set->size;
    if (size + 24 <= length) return 1;
    int count = (size + 2 * TXT_FAR) / (length * 3 / 5 > 12 ? length * 3 / 5 : 12) + 1;
    return count > TXT_MAX_SEGMENTS ? TXT_MAX_SEGMENTS : count;
}

/* The mean step that a strip should have between its ends, TXT_END texels each that show the
   corners, so that the whole joint has b->wanted_step. */
static double txt_wanted_step(const txt_build *b, const txt_seam_strip *s) {
    const int size = b->set->size, axis = s->axis, length = txt_end(b);
    double ends = 0;
    if (b->is_triangle || !b->corners_are_final) return b->wanted_step;
    for (int end = 0; end < 2; end++) {
        const int c = s->corner[end], back = end ? length : 0;
        ends += txt_line_mean(b, &b->cross[axis], axis, b->corner[c].sheet,
                              b->corner[c].i - (axis ? 0 : back),
                              b->corner[c].j - (axis ? back : 0), length);
    }
    const double rest = (b->wanted_step * size - length * ends) / (size - 2 * length);
    return fmin(fmax(rest, 0.75), 1.25);
}

/* Choose the segments of a strip one after the other. Returns the cost, or UINT32_MAX if nothing
   fits. only_sheet: -1 = any. */
static uint32_t txt_choose_strip(txt_build *b, txt_seam_strip *s, const txt_seam_strip *others,
                                 int other_count, int only_sheet, txt_query *q, txt_scratch *m) {
    const int size = b->set->size;
    const int count = txt_segment_count(b, s->axis, only_sheet);
    uint32_t total = 0;
    s->count = count;
    for (int g = 0; g < count; g++) {
        const int from = g * size / count, to = (g + 1) * size / count;
        const int ends = count == 1 && !b->is_triangle ? txt_end(b) : 0;
        txt_strip_query extra = {b, others, other_count, s->axis, from + ends, to - from - 2 * ends};
        txt_place best;
        int found = 0;
        txt_fill_line_costs(b, s->axis, size / count - 2 * ends, txt_wanted_step(b, s));
        q->extra = txt_strip_extra;
        /* cppcheck-suppress autoVariables ; used in this round only */
        q->context = &extra;
        q->apart = 1;
        txt_end_samples(b, q, s, g + 1, from, 1, g + 1 == count);
        for (int k = 0; k < 4; k++) { /* it must cover its part and overlap the next ones */
            const int first = g ? from - 7 : b->is_triangle ? 0 : txt_near(b);
            const int last = g + 1 < count ? to + 7 : b->is_triangle ? size : size - txt_near(b);
            txt_along(b, s->axis, k & 1 ? last : first, k & 2 ? TXT_LOCK : -TXT_LOCK,
                      &q->need[k][0], &q->need[k][1]);
        }
        q->need_count = 4;
        for (int e = 0; e < b->sheet_count; e++) {
            if (only_sheet < 0 || e == only_sheet)
                found = txt_search(b, q, e, 0, m, &best, found, 1);
        }
        if (!found) return UINT32_MAX;
        s->segment[g].sheet = best.sheet;
        s->segment[g].i = best.i;
        s->segment[g].j = best.j;
        total += best.cost;
    }
    return total / (uint32_t)count;
}

/* Where piece w of a strip ends and the next begins, line by line across the strip: the minimum
   error cut [2] through a = from..to-1. */
static void txt_cut_strip(const txt_build *b, txt_seam_strip *s, int w, int from, int to) {
    enum { LINES = 2 * TXT_ACROSS + 1 };
    float error[LINES * 64];
    double scratch[LINES * 64];
    int path[LINES];
    const int size = b->set->size, length = size + b->is_triangle;
    if (to - from > 64) to = from + 64;
    const int width = to - from;
    for (int l = 0; l < LINES; l++) {
        const int u = l - TXT_ACROSS;
        int before = txt_difference(b, txt_strip_shows(b, s, w, from, u),
                                    txt_strip_shows(b, s, w + 1, from, u));
        for (int k = 0; k < width; k++) {
            const int a = from + k + 1;
            const int after = txt_difference(b, txt_strip_shows(b, s, w, a, u),
                                             txt_strip_shows(b, s, w + 1, a, u));
            error[l * width + k] = (float)((before + after) * (before + after));
            before = after;
        }
    }
    txm_cut(error, LINES, width, width, 1, path, scratch);
    for (int l = 0; l < b->lock_count; l++) {
        const int turn = from + path[b->lock_from + l + TXT_ACROSS];
        for (int a = turn + 1; a < length; a++) s->which[a * b->lock_count + l] = (uint8_t)(w + 1);
    }
}

/* Cut all pieces of a strip, and note which of them each texel shows. */
static void txt_finish_strip(const txt_build *b, txt_seam_strip *s) {
    const int size = b->set->size, n = b->lock_count, zone = txt_zone_end(b), nearest = txt_near(b);
    if (b->is_triangle) {
        memset(s->which, 1, (size_t)(size + 1) * (size_t)n);
        for (int g = 1; g < s->count; g++)
            txt_cut_strip(b, s, g, g * size / s->count - 6, g * size / s->count + 6);
        s->which[-b->lock_from] = 0; /* the vertices themselves belong to all strips */
        s->which[size * n - b->lock_from] = (uint8_t)(s->count + 1);
        return;
    }
    memset(s->which, 0, (size_t)size * (size_t)n);
    txt_cut_strip(b, s, 0, nearest, zone);
    for (int g = 1; g < s->count; g++)
        txt_cut_strip(b, s, g, g * size / s->count - 6, g * size / s->count + 6);
    txt_cut_strip(b, s, s->count, size - zone - 1, size - nearest - 1);
}

/* The cost of a place as a corner: how far it is from typical roughness and salience. */
static uint32_t txt_corner_cost(const txt_build *b, int sheet, int i, int j) {
    const int x = i + (b->is_triangle ? txt_half(j) : 0), r = 10;
    double off = 0, excess = 0;
    const int axes = b->is_triangle ? 1 : 2;
    for (int axis = 0; axis < axes; axis++) {
        double step = 0;
        for (int k = -r; k < r; k++) {
            const int px = axis ? x + k : x - r, py = axis ? j - r : j + k;
            step += txt_line_mean(b, &b->cross[axis], axis, sheet, px, py, 2 * r);
            excess += txt_line_mean(b, &b->salience[axis], axis, sheet, px, py, 2 * r) / axes;
        }
        step /= 2 * r;
        off += fabs(step - 1);
        /* and of the joint's own end */
        step = txt_line_mean(b, &b->cross[axis], axis, sheet, axis ? x : x - r, axis ? j - r : j,
                             2 * r);
        off += 0.5 * fabs(step - 1);
    }
    excess = excess / (2 * r) - 1;
    uint32_t cost = (uint32_t)((30 * off + (excess > 0 ? 8 * excess : 0)) * TXT_SCALE);
    if (b->is_triangle) {
        /* the surroundings of the vertex should look the same turned by multiples of 60 degrees */
        int sum = 0, n = 0;
        for (int dj = -4; dj <= 4; dj++) {
            for (int di = -4; di <= 4; di++) {
                if (abs(di + dj) > 4) continue;
                const int32_t here = txt_number(b, sheet, i + di, j + dj);
                for (int turn = 1; turn < 6; turn++) {
                    int ti, tj;
                    txt_turn(turn, di, dj, &ti, &tj);
                    sum += txt_difference(b, here, txt_number(b, sheet, i + ti, j + tj));
                    n++;
                }
            }
        }
        cost += (uint32_t)(sum * (TXT_SCALE / 4) / n);
    }
    return cost;
}

/* the exemplar that edges of a colour are taken from; -1: any */
static int txt_edge_sheet(const txt_build *b, int color) {
    return b->desc->edge_exemplars ? b->desc->edge_exemplars[color] : -1;
}

/* The number of an edge's strip. wang, frame: axis 0 then axis 1, by colour; corner: by axis,
   colour at the start and at the end; triangle: by colour. */
static int txt_strip_index(const txt_build *b, int axis, int color, int end_color) {
    const int c = b->set->colors;
    if (b->set->kind == TEXTILES_CORNER) return (axis * c + color) * c + end_color;
    return axis * c + color;
}

/* Choose all strips for the corners as they are; the sum of the costs. */
static uint64_t txt_choose_strips(txt_build *b, txt_seam_strip *strips, txt_query *q,
                                  txt_scratch *m) {
    const int is_corner = b->set->kind == TEXTILES_CORNER, axes = b->is_triangle ? 1 : 2;
    const int ends = is_corner ? b->corner_count : 1;
    const int colors = is_corner ? b->corner_count : b->set->colors;
    uint64_t total = 0;
    int count = 0;
    txt_seam_strip list[2 * TEXTILES_MAX_COLORS * TEXTILES_MAX_COLORS];
    for (int axis = 0; axis < axes; axis++) {
        for (int c = 0; c < colors; c++) {
            for (int e = 0; e < ends; e++) {
                txt_seam_strip *s = &list[count];
                memset(s, 0, sizeof *s);
                s->axis = axis;
                s->corner[0] = is_corner ? c : 0;
                s->corner[1] = is_corner ? e : 0;
                const uint32_t cost = txt_choose_strip(b, s, list, count,
                                                       is_corner ? -1 : txt_edge_sheet(b, c), q, m);
                if (cost == UINT32_MAX) return UINT64_MAX;
                total += cost;
                if (strips) {
                    txt_seam_strip *to = &strips[txt_strip_index(b, axis, c, e)];
                    s->which = to->which;
                    *to = *s;
                    s->which = NULL;
                }
                count++;
            }
        }
    }
    return count ? total / (uint64_t)count : UINT64_MAX;
}

/* A random place for a corner, far enough from the borders where the sheet is large enough. */
static void txt_random_corner(const txt_build *b, txm_rng *rng, int *sheet, int *i, int *j) {
    *sheet = (int)txm_rng_below(rng, (uint32_t)b->sheet_count);
    const txt_sheet *s = &b->sheets[*sheet];
    const int mx = s->width > 48 ? 16 : s->width / 3, my = s->height > 48 ? 16 : s->height / 3;
    const int x = txm_rng_range(rng, mx, s->width - 1 - mx);
    *j = txm_rng_range(rng, my, s->height - 1 - my);
    *i = x - (b->is_triangle ? txt_half(*j) : 0);
}

/* Choose one more corner: of TXT_CORNERS random places the most typical ones are compared by the
   strips that they lead to. */
static txm_status txt_choose_corner(txt_build *b, txm_rng *rng, txt_query *q, txt_scratch *m) {
    enum { SHORT_LIST = 10 };
    struct {
        int sheet, i, j;
        uint32_t cost;
    } list[SHORT_LIST];
    int count = 0, best = -1;
    uint64_t least = UINT64_MAX;
    const int me = b->corner_count++;
    memset(list, 0, sizeof list);
    for (int k = 0; k < TXT_CORNERS; k++) {
        int sheet, i, j;
        txt_random_corner(b, rng, &sheet, &i, &j);
        int away = 1;
        for (int c = 0; c < me; c++) {
            if (b->corner[c].sheet == sheet && abs(b->corner[c].i - i) < 24 &&
                abs(b->corner[c].j - j) < 24 && k < TXT_CORNERS * 3 / 4)
                away = 0;
        }
        if (!away) continue;
        const uint32_t cost = txt_corner_cost(b, sheet, i, j);
        if (count == SHORT_LIST && list[count - 1].cost <= cost) continue;
        if (count < SHORT_LIST) count++;
        int at = count - 1;
        for (; at > 0 && list[at - 1].cost > cost; at--) list[at] = list[at - 1];
        list[at].sheet = sheet;
        list[at].i = i;
        list[at].j = j;
        list[at].cost = cost;
    }
    for (int k = 0; k < count; k++) {
        b->corner[me].sheet = list[k].sheet;
        b->corner[me].i = list[k].i;
        b->corner[me].j = list[k].j;
        q->coarse = 3;
        uint64_t cost = txt_choose_strips(b, NULL, q, m);
        q->coarse = 0;
        if (cost == UINT64_MAX) continue;
        cost += list[k].cost;
        if (cost < least) {
            least = cost;
            best = k;
        }
        if (txm_progress(b->env, 0.02f + 0.08f * (float)(me * count + k + 1) /
                                             (float)(count * b->set->colors), "edges"))
            return txm_fail(b->env, TXM_CANCELLED, "cancelled while choosing edges");
    }
    if (best < 0)
        return txm_fail(b->env, TXM_TOO_SMALL,
                        "exemplars: too small to cut an edge from; give a larger picture");
    b->corner[me].sheet = list[best].sheet;
    b->corner[me].i = list[best].i;
    b->corner[me].j = list[best].j;
    return TXM_OK;
}

/* Choose the corners, then for each colour the strip at its edges: unmodified exemplar on both
   sides of the joint, which agrees with the corners at its ends and lies apart from the other
   strips. */
static txm_status txt_make_frames(txt_build *b) {
    const int c = b->set->colors, is_corner = b->set->kind == TEXTILES_CORNER;
    const int corners = is_corner ? c : 1, length = b->set->size + b->is_triangle;
    b->lock_from = -TXT_LOCK;
    b->lock_count = 2 * TXT_LOCK + b->is_triangle;
    b->strip_count = b->is_triangle ? c : is_corner ? 2 * c * c : 2 * c;
    b->strips = (txt_seam_strip *)txm_arena_zero(&b->arena, (size_t)b->strip_count, sizeof(txt_seam_strip));
    const size_t cells = (size_t)length * (size_t)b->lock_count;
    uint8_t *which = (uint8_t *)txm_arena_alloc(&b->arena, (size_t)b->strip_count, cells);
    txm_arena arena;
    txt_scratch m;
    txt_query q;
    txm_arena_init(&arena, b->env);
    memset(&q, 0, sizeof q);
    q.capacity = 256;
    q.samples = (txt_sample *)txm_arena_alloc(&arena, 256, sizeof(txt_sample));
    txm_status status = TXM_OK;
    txt_scratch_make(b, &arena, &m);
    if (b->arena.failed || arena.failed) {
        status = txm_fail(b->env, TXM_OUT_OF_MEMORY, "no memory for the edges");
        goto done;
    }
    for (int s = 0; s < b->strip_count; s++) b->strips[s].which = which + (size_t)s * cells;
    {
        txm_rng rng = txm_rng_make(b->desc->seed, 1);
        for (int k = 0; k < corners && status == TXM_OK; k++)
            status = txt_choose_corner(b, &rng, &q, &m);
    }
    if (status != TXM_OK) goto done;
    b->corners_are_final = 1;
    if (txt_choose_strips(b, b->strips, &q, &m) == UINT64_MAX) {
        status = txm_fail(b->env, TXM_TOO_SMALL,
                          "exemplars: too small to cut an edge from; give a larger picture");
        goto done;
    }
    for (int s = 0; s < b->strip_count; s++) txt_finish_strip(b, &b->strips[s]);
done:
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXTILES_FRAME_H */
