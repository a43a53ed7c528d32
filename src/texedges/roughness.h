#ifndef TEXEDGES_ROUGHNESS_H
#define TEXEDGES_ROUGHNESS_H

#include "check.h"

/* ---- lines as arrays of points --------------------------------------------------------- */

typedef struct txe_point {
    double x, y;
} txe_point;

static txe_point txe_between(txe_point a, txe_point b, double t) {
    txe_point p;
    p.x = a.x + (b.x - a.x) * t;
    p.y = a.y + (b.y - a.y) * t;
    return p;
}

static double txe_distance(txe_point a, txe_point b) {
    const double dx = b.x - a.x, dy = b.y - a.y;
    return sqrt(dx * dx + dy * dy);
}

/* Length of the line through n points; closed: back to the first. Negative: cancelled. */
static double txe_length(const txe_point *p, size_t n, int is_closed, txe_progress *bar) {
    double sum = 0;
    for (size_t i = 1; i < n + (is_closed != 0); i++) {
        sum += txe_distance(p[i - 1], p[i < n ? i : 0]);
        if (txe_advance(bar, 1)) return -1;
    }
    return sum;
}

/* m points at equal distances along a line of n points and this length: closed from the first point
   on, open from the first to the last. 0 = cancelled. */
static int txe_resample(const txe_point *p, size_t n, int is_closed, double length,
                        txe_point *out, size_t m, txe_progress *bar) {
    const size_t segments = is_closed ? n : n - 1;
    const double step = length / (double)(is_closed ? m : m - 1);
    size_t i = 0;
    double from = 0, span = txe_distance(p[0], p[1]); /* of segment i */
    for (size_t k = 0; k < m; k++) {
        const double at = step * (double)k;
        while (at > from + span && i + 1 < segments) {
            from += span;
            i++;
            span = txe_distance(p[i], p[i + 1 < n ? i + 1 : 0]);
            if (txe_advance(bar, 1)) return 0;
        }
        const double t = span > 0 ? (at - from) / span : 0;
        out[k] = txe_between(p[i], p[i + 1 < n ? i + 1 : 0], t < 1 ? t : 1);
        if (txe_advance(bar, 1)) return 0;
    }
    return 1;
}

/* Blur a line with the weights radius + 1 - |d|, whole numbers. Closed: cyclically (n > radius);
   open: the radius shrinks towards the ends, which stay where they are. 0 = cancelled. */
static int txe_soften(const txe_point *p, size_t n, int is_closed, size_t radius,
                      txe_point *out, txe_progress *bar) {
    for (size_t i = 0; i < n; i++) {
        size_t reach = radius;
        if (!is_closed && reach > i) reach = i;
        if (!is_closed && reach > n - 1 - i) reach = n - 1 - i;
        double x = 0, y = 0;
        for (size_t d = 1; d <= reach; d++) {
            const txe_point a = p[i >= d ? i - d : i + n - d];
            const txe_point b = p[i + d < n ? i + d : i + d - n];
            const double weight = (double)(reach + 1 - d);
            x += weight * (a.x + b.x);
            y += weight * (a.y + b.y);
        }
        const double weight = (double)(reach + 1), sum = weight * weight;
        out[i].x = (x + weight * p[i].x) / sum;
        out[i].y = (y + weight * p[i].y) / sum;
        if (txe_advance(bar, reach + 1)) return 0;
    }
    return 1;
}

/* The unit vector from a to b; unchanged if they are the same point. */
static void txe_direction(txe_point a, txe_point b, txe_point *direction) {
    const double length = txe_distance(a, b);
    if (!(length > 1e-9)) return;
    direction->x = (b.x - a.x) / length;
    direction->y = (b.y - a.y) / length;
}

/* ---- the roughness of the exemplar's edges --------------------------------------------- */

/* One sample of a line of the exemplar, one pixel of length before the next: how far its smooth
   course advances to the next sample, and the offset of the line from the course, ahead and to the
   right. */
typedef struct txe_sample {
    double step, ahead, right;
    double length; /* of the line to the next sample, its offsets limited                      */
    int bin;       /* direction of the line relative to its course                             */
} txe_sample;

/* The roughness of one layer: the samples of all its lines, and the indices at which a piece of
   TXE_PIECE + TXE_JOIN samples can begin. */
typedef struct txe_roughness {
    txe_sample *samples;
    size_t *starts;
    size_t count, start_count, most; /* filled, and room for                                    */
    double amount;          /* factor of the exemplar's roughness                               */
    double step;            /* mean of all steps                                                */
    double share[TXE_BINS]; /* histogram of the directions of the exemplar's edges, sum 1       */
} txe_roughness;

/* Scratch for one line of up to count points. */
typedef struct txe_scratch {
    txe_point *a, *b, *c;
} txe_scratch;

static void txe_scratch_make(txe_scratch *scratch, txm_arena *arena, size_t count) {
    scratch->a = (txe_point *)txm_arena_alloc(arena, count, sizeof *scratch->a);
    scratch->b = (txe_point *)txm_arena_alloc(arena, count, sizeof *scratch->b);
    scratch->c = (txe_point *)txm_arena_alloc(arena, count, sizeof *scratch->c);
}

/* The factor that limits an offset of this length to TXE_MAX_OFFSET: 1 up to TXE_KEPT_OFFSET, then
   soft compression. */
static double txe_limit(double length) {
    const double room = TXE_MAX_OFFSET - TXE_KEPT_OFFSET, more = length - TXE_KEPT_OFFSET;
    return more > 0 ? (TXE_KEPT_OFFSET + room * more / (more + room)) / length : 1;
}

/* The direction of (ahead, right) or its opposite: 0 = straight on, then in steps of 1/16 of half a
   turn to the right. The table: cosine and sine of 1/2, 3/2, ... of such a step. */
static int txe_bin(double ahead, double right) {
    static const double edge[TXE_BINS / 2][2] = {
        {0.99518473, 0.09801714}, {0.95694034, 0.29028468}, {0.88192126, 0.47139674},
        {0.77301045, 0.63439328}, {0.63439328, 0.77301045}, {0.47139674, 0.88192126},
        {0.29028468, 0.95694034}, {0.09801714, 0.99518473}};
    const double x = ahead < 0 ? -ahead : ahead, y = right < 0 ? -right : right;
    int k = 0;
    while (k < TXE_BINS / 2 && y * edge[k][0] > x * edge[k][1]) k++;
    return (ahead < 0) != (right < 0) ? (TXE_BINS - k) % TXE_BINS : k % TXE_BINS;
}

/* The directions of a line of n points in scratch->b relative to its course, its blur of radius
   TXE_DIRECTION_BLUR; a blur of `radius` removes the steps of pixels first. Added to share, as if
   the line had `amount` times its roughness, or stored in the samples of its points.
   0 = cancelled. */
static int txe_directions(const txe_scratch *scratch, size_t n, int is_closed, size_t radius,
                          double amount, double *share, txe_sample *samples, txe_progress *bar) {
    const txe_point *line = scratch->a, *course = scratch->c;
    const size_t trim = is_closed || !share ? 0 : TXE_DIRECTION_BLUR; /* ends have no course */
    if (!txe_soften(scratch->b, n, is_closed, radius, scratch->a, bar) ||
        !txe_soften(scratch->b, n, is_closed, TXE_DIRECTION_BLUR, scratch->c, bar))
        return 0;
    for (size_t i = trim; i < n - trim; i++) {
        size_t at[4]; /* the course from at[0] to at[3], the line from at[1] to at[2] */
        for (int k = 0; k < 4; k++) {
            const size_t off = k == 0 || k == 3 ? TXE_CHORD : 1;
            if (k < 2) at[k] = i >= off ? i - off : is_closed ? i + n - off : 0;
            else at[k] = i + off < n ? i + off : is_closed ? i + off - n : n - 1;
        }
        const double cx = course[at[3]].x - course[at[0]].x, cy = course[at[3]].y - course[at[0]].y;
        const double dx = line[at[2]].x - line[at[1]].x, dy = line[at[2]].y - line[at[1]].y;
        const int bin = txe_bin(cx * dx + cy * dy, amount * (cx * dy - cy * dx));
        if (share) share[bin] += 1;
        if (samples) {
            samples[i].bin = bin;
            samples[i].length = txe_distance(line[i], line[at[2]]);
        }
        if (txe_advance(bar, 4)) return 0;
    }
    return 1;
}

/* Add the samples of one line: n points in scratch->a, a pixel apart at most. With S the blur of
   radius TXE_COURSE_BLUR, the smooth course of the line P is 2 S P - S S P, which keeps curves that
   S alone would shrink. The ends of open lines, which have no course, are left out.
   0 = cancelled. */
static int txe_measure_run(txe_roughness *u, const txe_scratch *scratch, size_t n, int is_closed,
                           txe_progress *bar) {
    txe_point *line = scratch->b, *blurred = scratch->a, *course = scratch->c;
    if (n < TXE_MIN_LINE) return 1;
    const double length = txe_length(scratch->a, n, is_closed, bar);
    if (length < 0) return 0;
    const size_t m = (size_t)(length + 0.5) + !is_closed; /* at most n */
    const size_t trim = is_closed ? 0 : TXE_COURSE_BLUR;
    if (m < TXE_MIN_LINE + 2 * trim) return 1;
    if (!txe_resample(scratch->a, n, is_closed, length, line, m, bar) ||
        !txe_soften(line, m, is_closed, TXE_COURSE_BLUR, blurred, bar) ||
        !txe_soften(blurred, m, is_closed, TXE_COURSE_BLUR, course, bar))
        return 0;
    for (size_t i = 0; i < m; i++) {
        course[i].x = 2 * blurred[i].x - course[i].x;
        course[i].y = 2 * blurred[i].y - course[i].y;
    }
    /* a closed line is repeated beyond its end, so that pieces can begin anywhere */
    const size_t room = TXE_PIECE + TXE_JOIN, end = is_closed ? m + room : m - trim;
    txe_sample *first = u->samples + u->count;
    txe_point direction;
    direction.x = 1;
    direction.y = 0;
    for (size_t i = trim; i < end; i++) {
        const size_t at = i % m, back = (i + m - TXE_CHORD) % m, front = (i + TXE_CHORD) % m;
        const double dx = line[at].x - course[at].x, dy = line[at].y - course[at].y;
        TXM_ASSERT(u->count < u->most);
        txe_sample *s = &u->samples[u->count];
        txe_direction(course[back], course[front], &direction);
        s->step = txe_distance(course[at], course[(i + 1) % m]);
        s->ahead = u->amount * (dx * direction.x + dy * direction.y);
        s->right = u->amount * (dy * direction.x - dx * direction.y);
        if (i + room <= end) {
            u->starts[u->start_count++] = u->count;
            u->step += s->step;
        }
        u->count++;
        if (txe_advance(bar, 4)) return 0;
    }
    if (!txe_directions(scratch, m, is_closed, TXE_STEP_BLUR, u->amount, u->share, NULL, bar))
        return 0;
    /* Limit the offsets and take the directions once more, along a straight course, smoothed a
       little more than the exemplar's: a line that is drawn in pixels loses some of its roughness,
       and in the end as much shall be visible as in the exemplar. */
    double x = 0;
    const size_t count = end - trim;
    for (size_t i = 0; i < count; i++) {
        txe_sample *s = first + i;
        const double factor = txe_limit(sqrt(s->ahead * s->ahead + s->right * s->right));
        s->ahead *= factor;
        s->right *= factor;
        line[i].x = x + s->ahead;
        line[i].y = s->right;
        x += s->step;
        if (txe_advance(bar, 2)) return 0;
    }
    return txe_directions(scratch, count, 0, TXE_STEP_BLUR + 1, 1, NULL, first, bar);
}

/* does the crack from p to q run along the picture's border? */
static int txe_on_border(const texedges_set *e, txm_vec2 p, txm_vec2 q) {
    return (p.x == q.x && (p.x == 0 || p.x == (float)e->width)) ||
           (p.y == q.y && (p.y == 0 || p.y == (float)e->height));
}

/* Add the parts of a line that do not run along the picture's border. 0 = cancelled. */
static int txe_measure_line(txe_roughness *u, const txe_scratch *scratch, const texedges_set *e,
                            const texedges_polyline *line, txe_progress *bar) {
    const txm_vec2 *p = e->points + line->first;
    size_t start = line->count, n = 0;
    for (size_t j = 0; j < line->count && start == line->count; j++) { /* first on the border */
        if (txe_on_border(e, p[j], p[j + 1 < line->count ? j + 1 : 0])) start = j;
        if (txe_advance(bar, 1)) return 0;
    }
    const int is_closed = start == line->count;
    for (size_t k = 0; k < line->count; k++) {
        const size_t j = (start + k) % line->count, next = (j + 1) % line->count;
        if (txe_on_border(e, p[j], p[next])) {
            if (!txe_measure_run(u, scratch, n, 0, bar)) return 0;
            n = 0;
        } else { /* middles of cracks: a slope of 1 is a straight line */
            scratch->a[n].x = 0.5 * ((double)p[j].x + p[next].x);
            scratch->a[n].y = 0.5 * ((double)p[j].y + p[next].y);
            n++;
        }
        if (txe_advance(bar, 1)) return 0;
    }
    return txe_measure_run(u, scratch, n, is_closed, bar);
}

/* The roughness of a layer, amount times that of the exemplar, in memory of the arena. */
static txm_status txe_measure_layer(txe_roughness *u, const texedges_set *e, int layer,
                                    double amount, txm_arena *arena, txe_progress *bar,
                                    txm_env *env) {
    const size_t room = TXE_PIECE + TXE_JOIN;
    txe_scratch scratch;
    size_t most = 0, longest = 0;
    double sum = 0;
    memset(u, 0, sizeof *u);
    u->amount = amount;
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        if (line->layer != layer || line->count < TXE_MIN_LINE) continue;
        most += line->count + room;
        if (line->count > longest) longest = line->count;
    }
    if (most == 0) return TXM_OK;
    u->most = most; /* m samples of n points of a line, m at most n + 1; closed ones go on for room */
    u->samples = (txe_sample *)txm_arena_alloc(arena, most, sizeof *u->samples);
    u->starts = (size_t *)txm_arena_alloc(arena, most, sizeof *u->starts);
    txe_scratch_make(&scratch, arena, longest + room);
    if (arena->failed) return txe_no_memory(env);
    for (size_t i = 0; i < e->line_count; i++) {
        const texedges_polyline *line = &e->lines[i];
        if (line->layer != layer || line->count < TXE_MIN_LINE) continue;
        if (!txe_measure_line(u, &scratch, e, line, bar)) return txe_stopped(env);
    }
    for (int b = 0; b < TXE_BINS; b++) sum += u->share[b];
    for (int b = 0; b < TXE_BINS && sum > 0; b++) u->share[b] /= sum;
    if (u->start_count) u->step /= (double)u->start_count;
    if (u->step < 0.125) u->step = 0.125; /* of lines that turn on the spot */
    return TXM_OK;
}

/* ---- new roughness from pieces --------------------------------------------------------- */

/* The squared distance of two runs of TXE_JOIN samples: it compares offsets and slopes. */
static double txe_mismatch(const txe_sample *a, const txe_sample *b) {
    double sum = 0;
    for (int j = 0; j < TXE_JOIN; j++) {
        const double ahead = a[j].ahead - b[j].ahead, right = a[j].right - b[j].right;
        sum += ahead * ahead + right * right;
    }
    return sum;
}

/* Make a piece begin where the tail of the last one is: the difference of their first samples is
   removed gradually over TXE_JOIN samples. A cross-fade would smooth both. */
static void txe_join(const txe_sample *tail, txe_sample *piece) {
    const double ahead = tail->ahead - piece->ahead, right = tail->right - piece->right;
    for (int j = 0; j < TXE_JOIN; j++) {
        const double part = 1 - j / (double)TXE_JOIN;
        piece[j].ahead += ahead * part;
        piece[j].right += right * part;
    }
}

/* The pieces chosen so far, as far as the choice of the next one depends on them. */
typedef struct txe_chain {
    const txe_sample *tail; /* how the last piece continues in the exemplar; NULL: there is none */
    double length;          /* of the line so far                                                */
    double bins[TXE_BINS];  /* the same by direction                                             */
} txe_chain;

/* How far the histogram of directions would be from the exemplar's with this piece. */
static double txe_direction_error(const txe_chain *chain, const double *share,
                                  const txe_sample *piece, size_t length) {
    double bins[TXE_BINS], total = chain->length, sum = 0;
    memcpy(bins, chain->bins, sizeof bins);
    for (size_t j = 0; j < length; j++) {
        bins[piece[j].bin] += piece[j].length;
        total += piece[j].length;
    }
    for (int b = 0; b < TXE_BINS; b++) {
        const double off = bins[b] - share[b] * total;
        sum += off * off / (share[b] + 0.01);
    }
    return sum;
}

/* Choose a piece of this length. Of random candidates those with the best joints stay: to the tail,
   and if the piece closes the line to head (NULL: to its own beginning). Of these the one is taken
   that brings the histogram of directions nearest to the exemplar's. */
static const txe_sample *txe_choose_piece(const txe_roughness *u, txm_rng *rng,
                                          const txe_chain *chain, size_t length, int closes,
                                          const txe_sample *head) {
    const txe_sample *good[TXE_BEST + 1] = {NULL}, *best;
    double gaps[TXE_BEST + 1] = {0}, least;
    int count = 0;
    for (int i = 0; i < TXE_TRIES * (closes ? 4 : 1); i++) {
        const size_t pick = (size_t)(txm_rng_double(rng) * (double)u->start_count);
        const txe_sample *piece = u->samples + u->starts[pick];
        double gap = chain->tail ? txe_mismatch(chain->tail, piece) : 0;
        if (closes) gap += txe_mismatch(piece + length, head ? head : piece);
        int at = count;
        for (; at > 0 && gap < gaps[at - 1]; at--) {
            gaps[at] = gaps[at - 1];
            good[at] = good[at - 1];
        }
        gaps[at] = gap;
        good[at] = piece;
        if (count < TXE_BEST) count++;
    }
    best = good[0];
    least = closes ? 0 : txe_direction_error(chain, u->share, best, length);
    for (int i = 1; i < count && !closes; i++) {
        const double off = txe_direction_error(chain, u->share, good[i], length);
        if (off >= least) continue;
        best = good[i];
        least = off;
    }
    return best;
}

/* Join pieces to a closed line of m samples, m >= TXE_PIECE / 3. 0 = cancelled. */
static int txe_chain_pieces(const txe_roughness *u, txm_rng *rng, txe_sample *samples, size_t m,
                            txe_progress *bar) {
    const size_t shortest = TXE_PIECE / 3;
    txe_chain chain;
    memset(&chain, 0, sizeof chain);
    for (size_t k = 0; k < m;) {
        const size_t rest = m - k;
        size_t length = rest;
        if (rest > TXE_PIECE)
            length = shortest + txm_rng_below(rng, TXE_PIECE - (uint32_t)shortest + 1);
        if (length < rest && rest - length < shortest) length = rest - shortest;
        const txe_sample *piece =
            txe_choose_piece(u, rng, &chain, length, length == rest, k ? samples : NULL);
        memcpy(samples + k, piece, length * sizeof *samples);
        if (chain.tail) txe_join(chain.tail, samples + k);
        for (size_t j = 0; j < length; j++) {
            chain.bins[piece[j].bin] += piece[j].length;
            chain.length += piece[j].length;
        }
        chain.tail = piece + length;
        k += length;
        if (txe_advance(bar, 64 * TXE_TRIES)) return 0;
    }
    txe_join(chain.tail, samples);
    return 1;
}

#endif /* TEXEDGES_ROUGHNESS_H */
