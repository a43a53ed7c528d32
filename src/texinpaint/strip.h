#ifndef TEXINPAINT_STRIP_H
#define TEXINPAINT_STRIP_H

#include "belief.h"
#include "stroke.h"

/* ---- strips: lines made straight ---------------------------------------------------------------
   The texture along a line is treated in the line's own frame: column c is a place on the line, row
   j lies across it, along the normal [1, III.A: frame v, d, n]. Two lines with the same contrast
   close to each other, the sides of a stroke, are one strip; its rows between the lines are
   stretched to the width that the stroke has at each column:

       margin rows  |  inside + 1 rows from line to line (1 row: a single line)  |  margin rows

   In this frame the paper's rotated candidates (each source patch turned so that its line has the
   direction of the target's) need no search: every source is turned exactly, at each column, and
   laid with its line on the target's line. The paper's search over +-10 degrees makes up for lines
   that are known roughly; here they are registered to a fraction of a pixel against the mean
   profile of the line. And the costs of all pairs of candidates become sums along diagonals of one
   table. */

enum {
    TXI_STRIP_MARGIN = 10, /* rows on each side, pixels; ours                                  */
    TXI_STRIP_INSIDE = TXI_STROKE_WIDEST, /* most rows between the lines of a stroke              */
    TXI_STRIP_ROWS = 2 * TXI_STRIP_MARGIN + 1 + TXI_STRIP_INSIDE,
    TXI_STRIP_REACH = 8, /* columns of a patch on each side of its centre: radius r [1, III.A] */
    TXI_STRIP_HOP = 6,   /* columns between neighbouring patches, so that they overlap        */
    TXI_STRIP_REACH_LEAST = 3, /* of patches where little of a line is known                      */
    TXI_STRIP_COLUMNS = 448, /* most columns of sources for a strip                               */
    TXI_STRIP_COLUMNS_LEAST = 128, /* and so many at least, however many strips there are         */
    TXI_STRIP_CELLS = 4 << 20, /* of all tables of overlaps, 4 bytes each: 16 MB                  */
    TXI_STRIP_OTHERS = 3, /* most other lines a strip takes texture from                       */
    TXI_STRIP_KEEP = 24,  /* candidates of a patch after pruning                               */
    TXI_STRIP_CLEAN = 24, /* columns of a stroke that show all of it, from which on no others are
                             used                                                            */
    TXI_STRIP_ONWARD = 12,  /* pixels that lines without an end are continued behind the hole    */
    TXI_STRIP_PROFILE = 12, /* known columns on each side that profiles are means of             */
    TXI_STRIP_FEATURES = (3 * TXI_STRIP_ROWS + 15) / 16 * 16
};

/* Columns of a line. */
typedef struct txi_ribbon {
    int count;
    txm_vec2 *place; /* the middle between the two lines, or the line, window pixels              */
    txm_vec2 *along; /* unit tangent t; rows grow along (-t.y, t.x)                               */
    float *half;     /* half of the distance between the two lines, 0 for a single line          */
} txi_ribbon;

/* A column of texture to copy from. */
typedef struct txi_column {
    txm_vec2 place, along;
    float half;
    float side;        /* 1, or -1: mirrored, rows grow along (t.y, -t.x)                        */
    int run;           /* columns next to each other on the same line have the same number        */
    int before, after; /* columns of the run in front of and behind it; -1: not usable            */
} txi_column;

typedef struct txi_strip {
    int curve, partner; /* indices of the curves; partner -1: a single line                       */
    int inside, rows;
    int first, last;    /* columns with hole pixels                                              */
    int tail;           /* columns behind the hole are no known part of the line, or are missing  */
    int is_open;        /* the line ends in the hole                                             */
    int is_bare;        /* a stroke that crosses others: see cover.h                              */
    uint8_t *typical;   /* its usual colours, 3 per row; NULL: not known                          */
    float tolerance;   /* levels; colours farther from the usual ones are not those of the stroke */
    txi_ribbon line;
    uint8_t *color;     /* 3 per column and row                                                  */
    uint8_t *known;     /* 1 per column and row: the colour is known                             */
    txi_column *sources;
    int source_count, room; /* room: most of them                                                */
    uint8_t *source_color; /* 3 per source column and row                                         */
    int16_t *source_feature; /* features per source column: colours, weighted                     */
    int features;        /* 3 * rows, rounded up to a multiple of 16                              */
    int reach, hop;
    int *labels;         /* source columns that are centres of whole patches                      */
    int label_count;
    int32_t *overlap;    /* source_count^2: see txi_strip_overlaps                                */
    float *profile;  /* 2 * 3 * rows: mean colours in front of the hole and behind it; NULL: none */
    int node, node_count; /* its patches in the graph; patch k is centred at first + k * hop      */
    int *chosen;         /* per patch: the source column chosen                                   */
} txi_strip;

static txm_vec2 txi_normal_of(txm_vec2 along) {
    return txm_v2(-along.y, along.x);
}

/* RGB at a place, bilinear, at a place rounded to 1/256 of a pixel. Returns 0 if a pixel needed is
   not known, 1 if all are, 2 if all may be copied from; rgb is black for 0. */
static int txi_strip_pixel(const txi_window *w, double x, double y, int rgb[3]) {
    rgb[0] = rgb[1] = rgb[2] = 0;
    if (!(x >= 0 && y >= 0 && x <= w->width - 1 && y <= w->height - 1)) return 0;
    const int fx = (int)(x * 256 + 0.5), fy = (int)(y * 256 + 0.5);
    const int u = fx & 255, v = fy & 255;
    const size_t i = (size_t)(fy >> 8) * (size_t)w->width + (size_t)(fx >> 8);
    const size_t right = u ? 1 : 0, below = v ? (size_t)w->width : 0;
    const size_t at[4] = {i, i + right, i + below, i + below + right};
    const int weight[4] = {(256 - u) * (256 - v), u * (256 - v), (256 - u) * v, u * v};
    int best = 2;
    for (int k = 0; k < 4; k++) {
        const uint8_t s = w->state[at[k]];
        if (s == TXI_FOREIGN) best = 1;
        else if (s != TXI_KNOWN) return 0;
    }
    for (int c = 0; c < 3; c++) {
        int sum = 1 << 15;
        for (int k = 0; k < 4; k++) sum += weight[k] * w->color[4 * at[k] + (size_t)c];
        rgb[c] = sum >> 16;
    }
    return best;
}

/* Where a row, perhaps between two, lies: distance from the middle of a stroke of this half width,
   along the normal. */
static double txi_row_offset(double row, int inside, double half) {
    const double k = row - (double)TXI_STRIP_MARGIN;
    if (k <= 0) return k - half;
    if (k >= inside) return k - inside + half;
    return half * (2 * k / inside - 1);
}

/* The row, with fraction, at an offset from the middle: the inverse. */
static double txi_offset_row(double offset, int inside, double half) {
    if (offset <= -half) return (double)TXI_STRIP_MARGIN + offset + half;
    if (offset >= half) return TXI_STRIP_MARGIN + inside + offset - half;
    return (double)TXI_STRIP_MARGIN + inside * (0.5 * offset / half + 0.5);
}

/* ---- the frame of a line ---- */

/* Mean of values[i - radius .. i + radius], the window made smaller at the ends so that it stays
   symmetric; count values, `step` floats apart. */
static double txi_running_mean(const float *values, int count, int step, int i, int radius) {
    double sum = 0;
    if (i < radius) radius = i;
    if (count - 1 - i < radius) radius = count - 1 - i;
    for (int k = i - radius; k <= i + radius; k++) sum += (double)values[k * step];
    return sum / (2 * radius + 1);
}

/* Columns at points of a line about one pixel apart. */
static txm_status txi_ribbon_make(const txm_vec2 *points, int count, txm_arena *arena,
                                  txi_ribbon *r, txm_env *env) {
    r->count = count;
    r->place = (txm_vec2 *)txm_arena_alloc(arena, (size_t)count, sizeof *r->place);
    r->along = (txm_vec2 *)txm_arena_alloc(arena, (size_t)count, sizeof *r->along);
    r->half = (float *)txm_arena_zero(arena, (size_t)count, sizeof *r->half);
    if (arena->failed) return txi_no_memory(env);
    for (int i = 0; i < count; i++) {
        r->place[i].x = txm_float(txi_running_mean(&points[0].x, count, 2, i, 3));
        r->place[i].y = txm_float(txi_running_mean(&points[0].y, count, 2, i, 3));
    }
    for (int i = 0; i < count; i++) {
        const txm_vec2 a = r->place[i > 2 ? i - 2 : 0];
        const txm_vec2 b = r->place[i + 2 < count ? i + 2 : count - 1];
        r->along[i] = txi_unit((double)b.x - a.x, (double)b.y - a.y);
    }
    return TXM_OK;
}

/* The points of a curve. One that goes through the hole, but meets no line on the other side of it,
   is continued straight on there, so that its strip fits what is known; is_open receives 0 for it,
   1 for one that ends in the hole. points: room for TXI_STRIP_ONWARD more than the curve has.
   Returns how many. */
static int txi_curve_onward(const txi_window *w, const txi_curve *c, txm_vec2 *points,
                            int *is_open) {
    const int n = c->count;
    memcpy(points, c->points, (size_t)n * sizeof *points);
    *is_open = c->ends[1] < 0;
    if (c->ends[1] >= 0 || n < 4) return n;
    const txm_vec2 p = points[n - 1], t = txi_curve_along(c, n - 2);
    const ptrdiff_t beyond = txi_pixel(w->width, w->height, (double)p.x + 3 * (double)t.x,
                                       (double)p.y + 3 * (double)t.y);
    if (beyond < 0 || (w->state[beyond] != TXI_KNOWN && w->state[beyond] != TXI_FOREIGN)) return n;
    *is_open = 0;
    for (int i = 0; i < TXI_STRIP_ONWARD; i++)
        points[n + i] = txm_v2(txm_float((double)p.x + (i + 1) * (double)t.x),
                               txm_float((double)p.y + (i + 1) * (double)t.y));
    return n + TXI_STRIP_ONWARD;
}

enum {
    TXI_REGISTER_SIDE = 12,  /* samples on each side of a line, half a pixel apart                */
    TXI_REGISTER_TAPS = 2 * TXI_REGISTER_SIDE + 1,
    TXI_REGISTER_SHIFT = 3   /* most samples that a line is moved                                 */
};

/* The profile across column i, 3 per tap; 0 if part of it is not known. */
static int txi_register_profile(const txi_window *w, const txi_ribbon *r, int i, float *profile) {
    const txm_vec2 n = txi_normal_of(r->along[i]);
    for (int k = 0; k < TXI_REGISTER_TAPS; k++) {
        const double t = 0.5 * (k - TXI_REGISTER_SIDE);
        int rgb[3];
        if (!txi_strip_pixel(w, (double)r->place[i].x + t * (double)n.x,
                             (double)r->place[i].y + t * (double)n.y, rgb))
            return 0;
        for (int c = 0; c < 3; c++) profile[3 * k + c] = (float)rgb[c];
    }
    return 1;
}

/* By how many pixels a profile is displaced against the mean one: least squares over shifts of half
   pixels, then a parabola. */
static double txi_register_shift(const double *mean, const double *profile) {
    const int most = TXI_REGISTER_SHIFT;
    double cost[2 * TXI_REGISTER_SHIFT + 1];
    int best = most;
    for (int s = -most; s <= most; s++) {
        double sum = 0;
        for (int k = most; k < TXI_REGISTER_TAPS - most; k++) {
            for (int c = 0; c < 3; c++) {
                const double d = mean[3 * k + c] - profile[3 * (k + s) + c];
                sum += d * d;
            }
        }
        cost[s + most] = sum;
    }
    for (int s = 0; s <= 2 * most; s++)
        if (cost[s] < cost[best]) best = s;
    if (best == 0 || best == 2 * most) return 0; /* no minimum: not registered */
    const double bend = cost[best - 1] - 2 * cost[best] + cost[best + 1];
    const double off = bend > 0 ? 0.5 * (cost[best - 1] - cost[best + 1]) / bend : 0;
    return 0.5 * (best - most + off);
}

/* Shifts where they are not known, by linear interpolation between the nearest known ones. */
static void txi_register_fill(float *shift, const uint8_t *known, int count) {
    int before = -1;
    for (int i = 0; i <= count; i++) {
        if (i < count && !known[i]) continue;
        for (int k = before + 1; k < i; k++) {
            if (before < 0 && i == count) shift[k] = 0;
            else if (before < 0) shift[k] = shift[i];
            else if (i == count) shift[k] = shift[before];
            else
                shift[k] = txm_lerpf(shift[before], shift[i],
                                     (float)(k - before) / (float)(i - before));
        }
        before = i;
    }
}

/* Move the columns of a single line across it, so that its known part looks alike everywhere: each
   column is registered against the mean profile. Missing columns are moved as those at their
   ends. */
static txm_status txi_ribbon_register(const txi_window *w, txi_ribbon *r, txm_arena *scratch,
                                      txm_env *env) {
    enum { SIZE = 3 * TXI_REGISTER_TAPS };
    const int count = r->count;
    float *profiles = (float *)txm_arena_alloc(scratch, (size_t)count, SIZE * sizeof *profiles);
    float *shift = (float *)txm_arena_alloc(scratch, 2 * (size_t)count, sizeof *shift);
    uint8_t *known = (uint8_t *)txm_arena_alloc(scratch, (size_t)count, 1);
    if (scratch->failed) return txi_no_memory(env);
    for (int round = 0; round < 2; round++) {
        double mean[SIZE] = {0}, sum = 0;
        int n = 0;
        for (int i = 0; i < count; i++) {
            known[i] = (uint8_t)txi_register_profile(w, r, i, profiles + (size_t)i * SIZE);
            for (int k = 0; k < SIZE && known[i]; k++)
                mean[k] += (double)profiles[(size_t)i * SIZE + (size_t)k];
            n += known[i];
        }
        if (n < 8) return TXM_OK;
        for (int k = 0; k < SIZE; k++) mean[k] /= n;
        for (int i = 0; i < count; i++) {
            double profile[SIZE] = {0};
            int m = 0;
            shift[i] = 0;
            for (int j = i > 4 ? i - 4 : 0; j <= i + 4 && j < count && known[i]; j++) {
                for (int k = 0; k < SIZE && known[j]; k++)
                    profile[k] += (double)profiles[(size_t)j * SIZE + (size_t)k];
                m += known[j];
            }
            for (int k = 0; k < SIZE && m; k++) profile[k] /= m;
            if (m) shift[i] = txm_float(txi_register_shift(mean, profile));
            sum += (double)shift[i];
        }
        for (int i = 0; i < count; i++)
            if (known[i]) shift[i] = txm_float((double)shift[i] - sum / n);
        txi_register_fill(shift, known, count);
        for (int i = 0; i < count; i++) {
            const txm_vec2 across = txi_normal_of(r->along[i]);
            const double s = txi_running_mean(shift, count, 1, i, 4);
            r->place[i].x = txm_float((double)r->place[i].x + s * (double)across.x);
            r->place[i].y = txm_float((double)r->place[i].y + s * (double)across.y);
        }
    }
    return TXM_OK;
}

/* Keep the columns lo .. hi - 1 only. */
static void txi_ribbon_crop(txi_ribbon *r, int lo, int hi) {
    r->place += lo;
    r->along += lo;
    r->half += lo;
    r->count = hi - lo;
}

/* Make a stroke of columns lo..hi - 1 of a line, its other side `width` to the right, or all to the
   left; the other columns are cropped. 0: it would be narrower than a pixel or wider than
   TXI_STRIP_INSIDE. */
static int txi_ribbon_widen_by(txi_ribbon *r, int lo, int hi, const float *width) {
    const double sign = width[lo] > 0 ? 1 : -1;
    for (int i = lo; i < hi; i++) {
        const double d = sign * (double)width[i];
        if (!(d >= 1 && d <= (double)TXI_STRIP_INSIDE)) return 0;
    }
    for (int i = lo; i < hi; i++) {
        const txm_vec2 n = txi_normal_of(r->along[i]);
        const double half = 0.5 * txi_running_mean(width + lo, hi - lo, 1, i - lo, 4);
        r->place[i].x = txm_float((double)r->place[i].x + half * (double)n.x);
        r->place[i].y = txm_float((double)r->place[i].y + half * (double)n.y);
        r->half[i] = txm_float(half < 0 ? -half : half);
    }
    txi_ribbon_crop(r, lo, hi);
    return 1;
}

/* Widen a line to the stroke between it and its partner, where both run along each other. 0: they
   do not, within TXI_STRIP_INSIDE pixels, from column `first` to `last`; the line is then
   unchanged.
   width  room for a float per column                                                            */
static int txi_ribbon_widen(txi_ribbon *r, const txi_ribbon *partner, int first, int last,
                            float *width) {
    int lo = 0, hi = r->count;
    for (int i = 0; i < r->count; i++) {
        const txm_vec2 t = r->along[i], p = r->place[i];
        double best = 1e30, x = 0, y = 0;
        for (int k = 0; k < partner->count; k++) {
            const double d = txi_distance(partner->place[k], p);
            if (d >= best) continue;
            best = d;
            x = (double)partner->place[k].x - p.x;
            y = (double)partner->place[k].y - p.y;
        }
        const double ahead = x * t.x + y * t.y;
        width[i] = txm_float(y * t.x - x * t.y);
        if (ahead > 2 || ahead < -2) { /* the partner has no column beside this one */
            if (i <= first) lo = i + 1;
            else if (i < hi) hi = i;
        }
    }
    if (lo > first || hi <= last || hi - lo < 2) return 0;
    return txi_ribbon_widen_by(r, lo, hi, width);
}

/* The same for a partner that is the line itself, moved sideways: the points of both are paired. */
static int txi_ribbon_widen_even(txi_ribbon *r, const txm_vec2 *points, const txm_vec2 *moved,
                                 float *width) {
    for (int i = 0; i < r->count; i++) {
        const txm_vec2 t = r->along[i];
        const double x = (double)moved[i].x - points[i].x, y = (double)moved[i].y - points[i].y;
        width[i] = txm_float(y * (double)t.x - x * (double)t.y);
    }
    return txi_ribbon_widen_by(r, 0, r->count, width);
}

/* ---- the strip's own columns ---- */

/* Sample the columns of a strip: colours, what is known, and which columns touch the hole. */
static txm_status txi_strip_sample(const txi_window *w, txi_strip *s, txm_arena *arena,
                                   txm_env *env) {
    const size_t cells = (size_t)s->line.count * (size_t)s->rows;
    s->color = (uint8_t *)txm_arena_alloc(arena, cells, 3);
    s->known = (uint8_t *)txm_arena_alloc(arena, cells, 1);
    if (arena->failed) return txi_no_memory(env);
    s->first = s->line.count;
    s->last = -1;
    for (int i = 0; i < s->line.count; i++) {
        const txm_vec2 n = txi_normal_of(s->line.along[i]), p = s->line.place[i];
        int touches = 0;
        for (int j = 0; j < s->rows; j++) {
            const double t = txi_row_offset(j, s->inside, (double)s->line.half[i]);
            const double x = (double)p.x + t * (double)n.x, y = (double)p.y + t * (double)n.y;
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            const ptrdiff_t pixel = txi_pixel(w->width, w->height, x, y);
            int rgb[3];
            s->known[at] = txi_strip_pixel(w, x, y, rgb) != 0;
            for (int c = 0; c < 3; c++) s->color[3 * at + (size_t)c] = (uint8_t)rgb[c];
            touches |= pixel >= 0 && w->state[pixel] == TXI_HOLE;
        }
        if (touches && s->first > i) s->first = i;
        if (touches) s->last = i;
    }
    return TXM_OK;
}

/* ---- sources ---- */

/* The column of a source at which a target's column is laid; c may have a fraction. */
static txi_column txi_column_at(const txi_strip *s, int column, double offset) {
    txi_column a = s->sources[column];
    int whole = (int)(offset + 1024) - 1024;
    if (whole > a.after) whole = a.after;
    if (whole < -a.before) whole = -a.before;
    a = s->sources[column + whole];
    const double rest = offset - whole;
    a.place.x = txm_float((double)a.place.x + rest * (double)a.along.x);
    a.place.y = txm_float((double)a.place.y + rest * (double)a.along.y);
    return a;
}

/* Where row offset t of a source's column lies. */
static txm_vec2 txi_column_place(const txi_column *a, double t) {
    const double u = t * (double)a->side;
    return txm_v2(txm_float((double)a->place.x - u * (double)a->along.y),
                  txm_float((double)a->place.y + u * (double)a->along.x));
}

/* Add columns from..to of a line to a strip's sources: forwards, or backwards (turned by half a
   turn), or mirrored (backwards, but with the rows as they are). */
static void txi_columns_add(txi_strip *s, const txi_ribbon *r, int from, int to, int backwards,
                           int mirrored) {
    const int room = s->room - s->source_count;
    const int count = to - from + 1 < room ? to - from + 1 : room;
    for (int k = 0; k < count; k++) {
        const int i = backwards || mirrored ? to - k : from + k;
        txi_column *a = &s->sources[s->source_count + k];
        a->place = r->place[i];
        a->along = r->along[i];
        if (backwards || mirrored) a->along = txm_v2(-a->along.x, -a->along.y);
        a->half = r->half[i];
        a->side = mirrored ? -1 : 1;
        a->run = s->source_count;
    }
    s->source_count += count > 0 ? count : 0;
}

/* Add the strip's own known columns: on each side of the hole at most room / 2, those next to it.
   Returns how many. */
static int txi_columns_own(txi_strip *s, int mirrored) {
    const int most = s->room / 2, before = s->source_count;
    const int from = s->first > most ? s->first - most : 0;
    const int to = s->line.count - 1 - s->last > most ? s->last + most : s->line.count - 1;
    if (s->first > 0) txi_columns_add(s, &s->line, from, s->first - 1, 0, mirrored);
    if (to > s->last && !s->tail) txi_columns_add(s, &s->line, s->last + 1, to, 0, mirrored);
    return s->source_count - before;
}

/* The weight of a row's colours in costs, in quarters: rows far from the lines count less, those
   beside a bare stroke hardly or not. */
static int txi_row_weight(const txi_strip *s, int j) {
    const int k = j - TXI_STRIP_MARGIN, out = k < 0 ? -k : k > s->inside ? k - s->inside : 0;
    if (s->is_bare) return out == 0 ? 4 : out == 1;
    return out <= 3 ? 4 : out <= 6 ? 3 : 2;
}

/* How far a colour is from the usual one of a row, levels. */
static double txi_typical_distance(const txi_strip *s, int j, const uint8_t *color) {
    int sum = 0;
    for (int c = 0; c < 3; c++) {
        const int d = color[c] - s->typical[3 * j + c];
        sum += d * d;
    }
    return sqrt(sum / 3.0);
}

/* How many rows of a column, from the edge or `beside` rows beside it, do not show the bare stroke,
   but something that covers it or lies beside it. */
static int txi_column_other(const txi_strip *s, const uint8_t *color, int beside) {
    int other = 0;
    for (int j = TXI_STRIP_MARGIN - beside; j <= TXI_STRIP_MARGIN + s->inside + beside; j++)
        other += txi_typical_distance(s, j, color + 3 * j) > (double)s->tolerance;
    return other;
}

/* Of the usable source columns of a bare stroke only those stay that show it: edges and all, if
   there are enough of them. */
static void txi_columns_bare(txi_strip *s) {
    int clean = 0;
    for (int i = 0; i < s->source_count; i++)
        clean += s->sources[i].before == 0 &&
                 !txi_column_other(s, s->source_color + 3 * i * s->rows, 1);
    for (int i = 0; i < s->source_count; i++) {
        const uint8_t *color = s->source_color + 3 * i * s->rows;
        const int other = txi_column_other(s, color, clean >= TXI_STRIP_CLEAN);
        if (clean >= TXI_STRIP_CLEAN ? other > 0 : 6 * other > s->inside) s->sources[i].before = -1;
    }
}

static void txi_strip_feature(const txi_strip *s, const uint8_t *color, int16_t *feature) {
    for (int j = 0; j < s->rows; j++)
        for (int c = 0; c < 3; c++)
            feature[3 * j + c] = (int16_t)(color[3 * j + c] * txi_row_weight(s, j) / 4);
}

/* Colours and features of the sources. Where a row is not known the nearest known one towards the
   line counts. A column whose middle is not known, or less than two thirds, breaks its run. */
static txm_status txi_columns_sample(const txi_window *w, txi_strip *s, txm_arena *arena,
                                    txm_env *env) {
    const size_t rows = (size_t)s->rows, count = (size_t)s->source_count;
    const int low = TXI_STRIP_MARGIN, high = TXI_STRIP_MARGIN + s->inside,
              beside = s->is_bare ? 1 : 2;
    s->features = (3 * s->rows + 15) / 16 * 16;
    s->source_color = (uint8_t *)txm_arena_alloc(arena, count * rows, 3);
    s->source_feature =
        (int16_t *)txm_arena_zero(arena, count * (size_t)s->features, sizeof(int16_t));
    if (arena->failed) return txi_no_memory(env);
    for (size_t i = 0; i < count; i++) {
        txi_column *a = &s->sources[i];
        uint8_t *color = s->source_color + 3 * i * rows;
        int known[TXI_STRIP_ROWS] = {0}, n = 0, whole = 1;
        for (int j = 0; j < s->rows; j++) {
            const txm_vec2 p =
                txi_column_place(a, txi_row_offset(j, s->inside, (double)a->half));
            int rgb[3];
            known[j] = txi_strip_pixel(w, (double)p.x, (double)p.y, rgb) == 2;
            n += known[j];
            if (j >= low - beside && j <= high + beside) whole &= known[j];
            for (int c = 0; c < 3; c++) color[3 * j + c] = (uint8_t)rgb[c];
        }
        for (int j = low - 1; j >= 0; j--)
            if (!known[j]) memcpy(color + 3 * j, color + 3 * (j + 1), 3);
        for (int j = high + 1; j < s->rows; j++)
            if (!known[j]) memcpy(color + 3 * j, color + 3 * (j - 1), 3);
        txi_strip_feature(s, color, s->source_feature + i * (size_t)s->features);
        a->before = whole && (s->is_bare || 3 * n >= 2 * s->rows) ? 0 : -1;
    }
    if (s->is_bare) txi_columns_bare(s);
    txi_column *a = s->sources;
    for (int i = 1; i < s->source_count; i++)
        if (a[i].before == 0 && a[i].run == a[i - 1].run) a[i].before = a[i - 1].before + 1;
    for (int i = s->source_count - 1; i >= 0; i--) {
        const int goes_on = i + 1 < s->source_count && a[i].run == a[i + 1].run;
        a[i].after = a[i].before < 0 ? -1 : goes_on ? a[i + 1].after + 1 : 0;
    }
    return TXM_OK;
}

/* Squared distance of two columns of features; mask: all bits set where they count. */
static int32_t txi_feature_ssd(const int16_t *a, const int16_t *b, const int16_t *mask, int count) {
    int32_t sum = 0;
    for (int i = 0; i < count; i += 16) {
        for (int k = 0; k < 16; k++) {
            const int d = (a[i + k] - b[i + k]) & mask[i + k];
            sum += d * d;
        }
    }
    return sum;
}

/* Eq. 4 for all pairs at once. With C(p, q) the squared distance of source columns p and q, a patch
   centred at source column a and the next one, at b, overlap in 2 reach - hop + 1 columns:

       E(a, b) = sum of C(a + k, b - hop + k), k = hop - reach .. reach
               = S(a + hop - reach, b - reach),
       S(p, q) = sum of C(p + m, q + m), m = 0 .. 2 reach - hop

   overlap receives S, by running sums along diagonals.
   values  room for source_count int32                                                           */
static void txi_strip_overlaps(txi_strip *s, const int16_t *mask, int32_t *values) {
    const int n = s->source_count, length = 2 * s->reach - s->hop + 1;
    const size_t width = (size_t)s->features;
    for (int d = 0; d < n; d++) { /* q = p + d */
        int64_t sum = 0;
        for (int p = 0; p + d < n; p++) {
            values[p] = d ? txi_feature_ssd(s->source_feature + (size_t)p * width,
                                            s->source_feature + (size_t)(p + d) * width, mask,
                                            s->features)
                          : 0;
            sum += values[p];
            if (p >= length) sum -= values[p - length];
            const int from = p - length + 1;
            if (from < 0) continue;
            const int32_t cost = (int32_t)(sum < TXI_COST_MOST ? sum : (int64_t)TXI_COST_MOST);
            s->overlap[(size_t)from * (size_t)n + (size_t)(from + d)] = cost;
            s->overlap[(size_t)(from + d) * (size_t)n + (size_t)from] = cost;
        }
    }
}

/* Which source columns can be centres of patches; reach and hop as the longest run allows. */
static void txi_strip_labels(txi_strip *s) {
    int longest = 0;
    for (int i = 0; i < s->source_count; i++) {
        const int run = s->sources[i].before + s->sources[i].after + 1;
        longest = run > longest ? run : longest;
    }
    s->reach = txm_clampi((longest - 1) / 4, TXI_STRIP_REACH_LEAST, TXI_STRIP_REACH);
    s->hop = s->reach * TXI_STRIP_HOP / TXI_STRIP_REACH;
    s->label_count = 0;
    for (int i = 0; i < s->source_count; i++)
        if (s->sources[i].before >= s->reach && s->sources[i].after >= s->reach)
            s->labels[s->label_count++] = i;
    s->node_count = s->label_count ? (s->last - s->first) / s->hop + 2 : 0;
}

/* Eq. 3: the squared distance of each label of a patch from the colours known in it. */
static void txi_strip_unary(const txi_strip *s, int patch, int16_t *feature, int16_t *mask,
                            int32_t *unary) {
    const int centre = s->first + patch * s->hop, width = s->features;
    for (int i = 0; i < s->label_count; i++) unary[i] = 0;
    for (int k = -s->reach; k <= s->reach; k++) {
        const int column = centre + k;
        int any = 0;
        if (column < 0 || column >= s->line.count) continue;
        const size_t at = (size_t)column * (size_t)s->rows;
        memset(mask, 0, (size_t)width * sizeof *mask);
        for (int j = 0; j < s->rows; j++) {
            if (!s->known[at + (size_t)j]) continue;
            any = 1;
            for (int c = 0; c < 3; c++) mask[3 * j + c] = -1;
        }
        if (!any) continue;
        memset(feature, 0, (size_t)width * sizeof *feature);
        txi_strip_feature(s, s->color + 3 * at, feature);
        for (int i = 0; i < s->label_count; i++) {
            const int64_t sum =
                (int64_t)unary[i] +
                txi_feature_ssd(feature,
                                s->source_feature + (size_t)(s->labels[i] + k) * (size_t)width,
                                mask, width);
            unary[i] = (int32_t)(sum < TXI_COST_MOST ? sum : (int64_t)TXI_COST_MOST);
        }
    }
}

/* ---- other lines as sources ---- */

/* Mean squared difference between the mean of a strip's known columns and the profile of an end of
   a line, read from left to right (turned 0) or from right to left. */
static double txi_strip_unlike(const double *mean, const txi_end *e, int turned) {
    double sum = 0;
    for (int t = -5; t <= 5; t++) {
        for (int c = 0; c < 3; c++) {
            const double d = mean[3 * (TXI_STRIP_MARGIN + t) + c] -
                             (double)e->profile[TXI_PROFILE / 2 + (turned ? -2 * t : 2 * t)][c];
            sum += d * d / 33;
        }
    }
    return sum;
}

/* The mean of the strip's own sources, 3 per row. */
static void txi_strip_mean(const txi_strip *s, double *mean) {
    int n = 0;
    for (int j = 0; j < 3 * s->rows; j++) mean[j] = 0;
    for (int i = 0; i < s->source_count; i++) {
        if (s->sources[i].before < 0) continue;
        n++;
        for (int j = 0; j < 3 * s->rows; j++)
            mean[j] += s->source_color[3 * i * s->rows + j];
    }
    for (int j = 0; j < 3 * s->rows && n; j++) mean[j] /= n;
}

/* The ends of other lines whose colours are most like those of a single line, best first, as
   2 * end + turned. Returns how many. */
static int txi_strip_others(const txi_strip *s, const txi_lines *lines, const int own[2],
                            int best[TXI_STRIP_OTHERS]) {
    double mean[3 * TXI_STRIP_ROWS], cost[TXI_STRIP_OTHERS];
    int n = 0;
    txi_strip_mean(s, mean);
    for (int i = 0; i < 2 * lines->end_count; i++) {
        const txi_end *e = &lines->ends[i / 2];
        if (i / 2 == own[0] || i / 2 == own[1] || e->count < 2 * TXI_STRIP_REACH + 1) continue;
        const double unlike = txi_strip_unlike(mean, e, i & 1);
        if (unlike > 15 * 15) continue; /* levels of 8 bits */
        int k = n < TXI_STRIP_OTHERS ? n++ : TXI_STRIP_OTHERS;
        for (; k > 0 && unlike < cost[k - 1]; k--) {
            if (k == TXI_STRIP_OTHERS) continue;
            cost[k] = cost[k - 1];
            best[k] = best[k - 1];
        }
        if (k == TXI_STRIP_OTHERS) continue;
        cost[k] = unlike;
        best[k] = i;
    }
    return n;
}

/* All sources of a strip: its own known columns; where these are few, columns of similar other
   lines, and its own mirrored. */
static txm_status txi_strip_sources(const txi_window *w, const txi_lines *lines,
                                    const txi_curve *curve, txi_strip *s, txm_arena *arena,
                                    txm_env *env) {
    int best[TXI_STRIP_OTHERS], others = 0;
    s->sources = (txi_column *)txm_arena_alloc(arena, (size_t)s->room, sizeof *s->sources);
    s->labels = (int *)txm_arena_alloc(arena, (size_t)s->room, sizeof *s->labels);
    if (arena->failed) return txi_no_memory(env);
    s->source_count = 0;
    const int own = txi_columns_own(s, 0);
    txm_status status = txi_columns_sample(w, s, arena, env);
    if (status != TXM_OK) return status;
    if (s->partner < 0 && lines && own > 0 && own < s->room / 4)
        others = txi_strip_others(s, lines, curve->ends, best);
    for (int k = 0; k < others; k++) {
        const txi_end *e = &lines->ends[best[k] / 2];
        txi_ribbon r;
        status = txi_ribbon_make(lines->points + e->first, e->count, arena, &r, env);
        if (status != TXM_OK) return status;
        /* points run outwards, the profile is that seen on the way inwards */
        txi_columns_add(s, &r, 0, r.count - 1, !(best[k] & 1), 0);
    }
    if (own < s->room / 8) txi_columns_own(s, 1);
    return s->source_count > own ? txi_columns_sample(w, s, arena, env) : TXM_OK;
}

/* ---- profiles ---- */

/* The mean colours of the known columns next to the hole, row by row, on one side of it. Rows of
   which nothing is known are like the next one towards the lines. 0: the rows of the lines are not
   known. */
static int txi_strip_profile_side(const txi_strip *s, int end, float *profile) {
    const int from = end                            ? s->last + 1
                     : s->first > TXI_STRIP_PROFILE ? s->first - TXI_STRIP_PROFILE
                                                    : 0;
    const int behind = end ? from + TXI_STRIP_PROFILE : s->first;
    const int to = behind < s->line.count ? behind : s->line.count;
    const int low = TXI_STRIP_MARGIN, high = TXI_STRIP_MARGIN + s->inside;
    int known[TXI_STRIP_ROWS] = {0};
    for (int j = 0; j < s->rows; j++) {
        int sum[3] = {0, 0, 0};
        known[j] = 0;
        for (int i = from; i < to; i++) {
            const size_t at = (size_t)i * (size_t)s->rows + (size_t)j;
            for (int c = 0; c < 3 && s->known[at]; c++) sum[c] += s->color[3 * at + (size_t)c];
            known[j] += s->known[at];
        }
        for (int c = 0; c < 3 && known[j]; c++)
            profile[3 * j + c] = (float)sum[c] / (float)known[j];
        if (!known[j] && j >= low && j <= high) return 0;
    }
    for (int j = low - 1; j >= 0; j--)
        if (!known[j]) memcpy(profile + 3 * j, profile + 3 * (j + 1), 3 * sizeof *profile);
    for (int j = high + 1; j < s->rows; j++)
        if (!known[j]) memcpy(profile + 3 * j, profile + 3 * (j - 1), 3 * sizeof *profile);
    return 1;
}

/* The profiles on both sides of the hole; where one is missing the other one counts for both. */
static txm_status txi_strip_profile(txi_strip *s, txm_arena *arena, txm_env *env) {
    const size_t half = 3 * (size_t)s->rows;
    float *both = (float *)txm_arena_alloc(arena, half, 2 * sizeof *both);
    if (!both) return txi_no_memory(env);
    const int before = txi_strip_profile_side(s, 0, both);
    const int behind = txi_strip_profile_side(s, 1, both + half);
    if (!before && !behind) return TXM_OK;
    if (!before) memcpy(both, both + half, half * sizeof *both);
    if (!behind) memcpy(both + half, both, half * sizeof *both);
    s->profile = both;
    return TXM_OK;
}

/* The colour at a place of the strip by its profiles, blended along the hole. */
static void txi_strip_profile_at(const txi_strip *s, double column, double row, double rgb[3]) {
    const double along = (column - s->first + 1) / (s->last - s->first + 2);
    const double t = along < 0 ? 0 : along > 1 ? 1 : along;
    const double r = row < 0 ? 0 : row > s->rows - 1 ? s->rows - 1 : row;
    const int j = (int)r < s->rows - 1 ? (int)r : s->rows - 2;
    for (int c = 0; c < 3; c++) {
        const float *p = s->profile + 3 * j + c, *q = p + 3 * s->rows;
        const double before = (double)p[0] + (r - j) * ((double)p[3] - (double)p[0]);
        const double behind = (double)q[0] + (r - j) * ((double)q[3] - (double)q[0]);
        rgb[c] = before + t * (behind - before);
    }
}

#endif /* TEXINPAINT_STRIP_H */
