#ifndef TEXPATCH_REFINE_H
#define TEXPATCH_REFINE_H

#include "quilt.h"

/* ---- second pass: optimisation ----------------------------------------------------------- */

/* Room for a band of rows, per pixel. */
typedef struct txp_band {
    int32_t *sums, *total; /* of the bytes of all candidates, weighted; of the weights          */
    int32_t *nearest;      /* squared distance of the best candidate from the mean             */
    uint8_t *mean;
} txp_band;

/* The windows of one pass: those of a row lie side by side, `columns` of them, at xs[], ys[]. */
typedef struct txp_pass {
    const txp_source *source;
    const txp_stack *stack;
    const txp_canvas *canvas;
    int size, step; /* of the neighbourhoods; distance from one to the next                */
    int columns, rows;
    int *xs, *ys;
    txp_place *match; /* of each window                                                     */
    uint32_t *sad;    /* of its match, in gray levels; UINT32_MAX: no match                  */
    uint32_t *grain;  /* sum of differences of neighbouring pixels: its high frequencies     */
    int32_t *weight;  /* of each window in the mean                                         */
    txp_use use;
    double shift_x, shift_y, use_weight, lattice_weight;
    int most_same; /* see txp_search */
    int skip;      /* pixels from one place to the next in an exhaustive search                   */
    uint64_t seed;
    int exhaustive, first_row;
    int32_t bell[TXP_WINDOW * TXP_WINDOW]; /* 1..256 over a neighbourhood                       */
    int first_band;
    txp_band bands[TXP_LANES]; /* as many as the canvas has, at most                          */
} txp_pass;

/* A search for the match of one window. */
typedef struct txp_search {
    const txp_pass *pass;
    const uint8_t *target;
    int x, y;
    txp_goal goal;
    txp_place best;
    double cost;
    uint32_t sad;
    txp_place seen[16];
    int seen_count;
    int most_same; /* how many of 8 surrounding pixels may come from the same piece at most     */
    txp_place around[8];
} txp_search;

/* The pieces of 8 pixels around the window: where the window would lie in each of them. */
static void txp_find_surroundings(txp_search *f) {
    const txp_canvas *c = f->pass->canvas;
    const int r = f->pass->size / 2 + 2, mid = f->pass->size / 2;
    for (int d = 0, n = 0; d < 9; d++) {
        const int dx = mid + (d % 3 - 1) * r, dy = mid + (d / 3 - 1) * r;
        int cx = f->x + dx, cy = f->y + dy;
        if (d == 4) continue;
        if (c->wrap & TEXPATCH_TILE_X) cx = (cx + c->width) % c->width;
        if (c->wrap & TEXPATCH_TILE_Y) cy = (cy + c->height) % c->height;
        f->around[n].x = f->around[n].y = -1;
        if (cx >= 0 && cy >= 0 && cx < c->width && cy < c->height) {
            const txp_place at = c->at[txp_index(c, cx, cy)];
            f->around[n].x = at.x - dx;
            f->around[n].y = at.y - dy;
        }
        n++;
    }
}

/* Would (x, y) continue a piece that surrounds the window too much already? */
static int txp_continues(const txp_search *f, int x, int y) {
    int same = 0;
    for (int n = 0; n < 8; n++) same += f->around[n].x == x && f->around[n].y == y;
    return same > f->most_same;
}

static void txp_try(txp_search *f, int x, int y) {
    const txp_pass *p = f->pass;
    const txp_source *s = p->source;
    const int size = p->size;
    if (!txp_fits(s, p->stack, x, y, size, size)) return;
    for (int i = 0; i < 16 && i < f->seen_count; i++) {
        if (f->seen[i].x == x && f->seen[i].y == y) return;
    }
    f->seen[f->seen_count % 16].x = x;
    f->seen[f->seen_count++ % 16].y = y;
    double extra = 0;
    if (s->has_lattice) {
        const double d = txp_off_bond(p->stack, &s->courses, &f->goal, x, y);
        extra += p->lattice_weight * fmin(d, TXP_OFF_LATTICE);
    }
    extra += p->use_weight * txp_use_at(&p->use, x, y, size);
    if (f->most_same < 8 && txp_continues(f, x, y)) return;
    extra *= size * size;
    if (extra >= f->cost) return;
    const double limit = f->cost - extra;
    const uint32_t sad =
        txp_sad(f->target, p->canvas->pitch, txp_stack_at(s, p->stack, x, y), p->stack->pitch,
                size * s->bytes, size, limit < 4e9 ? (uint32_t)limit : 4000000000u);
    if (sad + extra >= f->cost) return;
    f->cost = sad + extra;
    f->sad = sad;
    f->best.x = x;
    f->best.y = y;
}

/* Try the place of the lattice that is nearest to a place. */
static void txp_try_snapped(txp_search *f, int x, int y) {
    const txp_pass *p = f->pass;
    if (p->source->has_lattice) txp_snap(p->stack, &p->source->courses, &f->goal, &x, &y);
    txp_try(f, x, y);
}

/* Try a random place of the sheet within radius of the best one so far. */
static void txp_try_near(txp_search *f, txm_rng *rng, int radius) {
    const txp_pass *p = f->pass;
    const txp_stack *k = p->stack;
    const int n = p->source->sheets > 1 ? k->sheet[f->best.y] : 0;
    const int x0 = f->best.x - radius < 0 ? 0 : f->best.x - radius;
    const int y0 = f->best.y - radius < k->first[n] ? k->first[n] : f->best.y - radius;
    int x1 = f->best.x + radius, y1 = f->best.y + radius;
    if (x1 > k->wide[n] - p->size) x1 = k->wide[n] - p->size;
    if (y1 > k->first[n] + k->high[n] - p->size) y1 = k->first[n] + k->high[n] - p->size;
    int x = txm_rng_range(rng, x0, x1 > x0 ? x1 : x0);
    int y = txm_rng_range(rng, y0, y1 > y0 ? y1 : y0);
    txp_try_snapped(f, x, y);
}

/* Try the pieces that pixels of the window come from now. */
static void txp_try_current(txp_search *f) {
    const txp_canvas *c = f->pass->canvas;
    const int size = f->pass->size;
    for (int v = 0; v < 5; v++) {
        for (int u = 0; u < 5; u++) {
            const int dx = u * (size - 1) / 4, dy = v * (size - 1) / 4;
            const txp_place at =
                c->at[txp_index(c, txp_wrap(f->x + dx, c->width), txp_wrap(f->y + dy, c->height))];
            if (at.x >= 0) txp_try(f, at.x - dx, at.y - dy);
        }
    }
}

/* The match of window w. */
static void txp_match(txp_pass *p, int i, int j) {
    const txp_source *s = p->source;
    const txp_stack *k = p->stack;
    const txp_canvas *c = p->canvas;
    const int size = p->size, w = j * p->columns + i;
    txp_search f;
    f.pass = p;
    f.x = p->xs[i];
    f.y = p->ys[j];
    f.goal = txp_goal_make(k, &s->courses, f.x + p->shift_x, f.y + p->shift_y, size);
    f.target = txp_canvas_at(s, c, f.x, f.y);
    f.cost = 1e30;
    f.sad = UINT32_MAX;
    f.best.x = f.best.y = -1;
    f.seen_count = 0;
    f.most_same = p->most_same;
    if (f.most_same < 8) txp_find_surroundings(&f);
    if (!txp_has_free_pixel(c, f.x, f.y, size)) {
        p->sad[w] = UINT32_MAX;
        return;
    }
    p->grain[w] = txp_sad(f.target, c->pitch, f.target + s->bytes, c->pitch, size * s->bytes, size,
                          UINT32_MAX);
    txp_try_current(&f);
    if (f.sad == 0) {
        p->match[w] = f.best;
        p->sad[w] = 0;
        return;
    }
    if (f.best.x < 0 && f.most_same < 8 && !p->exhaustive) { /* start near its own piece */
        const txp_place at = c->at[txp_index(c, txp_wrap(f.x + size / 2, c->width),
                                             txp_wrap(f.y + size / 2, c->height))];
        if (at.x >= 0) f.best = at;
    }
    if (p->exhaustive || f.best.x < 0) {
        for (int n = 0; n < s->sheets; n++) {
            for (int y = k->first[n]; y + size <= k->first[n] + k->high[n]; y += p->skip) {
                for (int x = 0; x + size <= k->wide[n]; x += p->skip) txp_try(&f, x, y);
            }
        }
    } else {
        txm_rng rng = txm_rng_make(p->seed, (uint64_t)w);
        for (int radius = k->width / 2; radius >= 2; radius /= 2) {
            txp_try_near(&f, &rng, radius);
        }
        if (s->has_lattice) {
            for (int d = 0; d < 8; d++) {
                static const int jump[8][2] = {{1, 0}, {-1, 0},  {0, 1},  {0, -1},
                                               {1, 1}, {-1, -1}, {1, -1}, {-1, 1}};
                const double x = k->lattice[0] * jump[d][0] + k->lattice[2] * jump[d][1];
                const double y = k->lattice[1] * jump[d][0] + k->lattice[3] * jump[d][1];
                const int to_x = f.best.x + (int)floor(x + 0.5), to_y = f.best.y + (int)floor(y + 0.5);
                if (s->courses.count) txp_try_snapped(&f, to_x, to_y);
                else txp_try(&f, to_x, to_y);
            }
        }
    }
    for (int round = 0; round < 3 && !(p->exhaustive && p->skip == 1); round++) {
        const txp_place at = f.best;
        for (int d = 0; d < 9; d++) {
            if (d != 4) txp_try(&f, at.x + d % 3 - 1, at.y + d / 3 - 1);
        }
        if (at.x == f.best.x && at.y == f.best.y) break;
    }
    if (f.sad == UINT32_MAX) { /* nothing else is near: continue the piece */
        f.most_same = 8;
        f.seen_count = 0;
        txp_try_current(&f);
    }
    p->match[w] = f.best;
    p->sad[w] = f.sad;
}

static void txp_match_row(void *context, int index) {
    txp_pass *p = (txp_pass *)context;
    for (int i = 0; i < p->columns; i++) txp_match(p, i, p->first_row + index);
}

static double txp_power(double x) {
    /* x^(r - 2) for r = 0.8 and x >= 1, to 1 %: powers of two from a table, the rest a parabola */
    static const double fifth[5] = {1.0, 0.870550563296124, 0.757858283255199, 0.659753955386447,
                                    0.574349177498518};
    int e = 0;
    while (x >= 2) {
        x *= 0.5;
        e++;
    }
    const double t = x - 1, m = 1 - t * (1.1233 - t * 0.5586);
    double f = fifth[e % 5] * m;
    for (int i = 0; i < e / 5; i++) f *= 0.5;
    for (int i = 0; i < e; i++) f *= 0.5;
    return f;
}

/* The adaptive weights (section 3.5 of [1]): w = P |x - z|^(r - 2), r = 0.8, where |x - z|^2 is the
   energy of the match; P is the share of well-matched windows among those of high frequency nearby
   (itself included), so that good structure wins over bad. */
static void txp_set_weights(txp_pass *p) {
    const double floor_sad = p->size * p->size * 1.5;
    double mean = 0, grain = 0;
    size_t count = 0;
    const int n = p->columns * p->rows;
    for (int w = 0; w < n; w++) {
        if (p->sad[w] == UINT32_MAX) continue;
        mean += p->sad[w];
        grain += p->grain[w];
        count++;
    }
    if (count) mean /= (double)count;
    if (count) grain /= (double)count;
    for (int j = 0; j < p->rows; j++) {
        for (int i = 0; i < p->columns; i++) {
            const int w = j * p->columns + i;
            int tries = 1, hits = 1;
            p->weight[w] = 0;
            if (p->sad[w] == UINT32_MAX) continue;
            for (int v = j > 0 ? j - 1 : 0; v <= j + 1 && v < p->rows; v++) {
                for (int u = i > 0 ? i - 1 : 0; u <= i + 1 && u < p->columns; u++) {
                    const int o = v * p->columns + u;
                    if (p->sad[o] == UINT32_MAX || p->grain[o] < grain) continue;
                    tries++;
                    hits += p->sad[o] <= mean;
                }
            }
            const double e = p->sad[w] / floor_sad;
            const double f = 2000 * (e > 1 ? txp_power(e) : 1) * hits / tries;
            p->weight[w] = f > 1 ? (int32_t)f : 1;
        }
    }
}

/* A bell-shaped weight over a neighbourhood, 1..256. */
static void txp_bell(int size, int32_t *bell) {
    for (int v = 0; v < size; v++) {
        for (int u = 0; u < size; u++) {
            const double a = (2 * v + 1 - size) / (double)size,
                         b = (2 * u + 1 - size) / (double)size;
            const double f = (1 - a * a) * (1 - a * a) * (1 - b * b) * (1 - b * b);
            bell[v * size + u] = 1 + (int32_t)(255 * f);
        }
    }
}

/* Add a window's match to the sums of a band: its weighted bytes, and the weights. */
static void txp_sum_window(const txp_pass *p, int w, int x0, int y0, int top, int bottom,
                           const txp_band *band) {
    const txp_source *s = p->source;
    const txp_canvas *c = p->canvas;
    const int n = s->bytes, size = p->size;
    const txp_place m = p->match[w];
    for (int v = 0; v < size; v++) {
        const int y = txp_wrap(y0 + v, c->height);
        if (y < top || y >= bottom) continue;
        const uint8_t *in = txp_stack_at(s, p->stack, m.x, m.y + v);
        const size_t line = (size_t)(y - top) * (size_t)c->width;
        int32_t weight[TXP_WINDOW];
        for (int u = 0; u < size; u++)
            weight[u] = ((p->weight[w] * p->bell[v * size + u]) >> 8) + 1;
        int u = 0;
#ifdef TXP_SSE2
        if (n == 4 && x0 + size <= c->width) {
            const __m128i zero = _mm_setzero_si128();
            int32_t *total = band->total + line + (size_t)x0;
            int32_t *sums = band->sums + (line + (size_t)x0) * 4;
            for (; u < size; u += 4, total += 4, sums += 16, in += 16) {
                const __m128i pixels = _mm_loadu_si128((const __m128i *)(const void *)in);
                const __m128i low = _mm_unpacklo_epi8(pixels, zero);
                const __m128i high = _mm_unpackhi_epi8(pixels, zero);
                const __m128i f = _mm_loadu_si128((const __m128i *)(const void *)(weight + u));
                __m128i *t = (__m128i *)(void *)total, *o = (__m128i *)(void *)sums;
                _mm_storeu_si128(t, _mm_add_epi32(_mm_loadu_si128(t), f));
                _mm_storeu_si128(o, _mm_add_epi32(_mm_loadu_si128(o),
                                                  _mm_madd_epi16(_mm_unpacklo_epi16(low, zero),
                                                                 _mm_shuffle_epi32(f, 0x00))));
                _mm_storeu_si128(o + 1, _mm_add_epi32(_mm_loadu_si128(o + 1),
                                                      _mm_madd_epi16(_mm_unpackhi_epi16(low, zero),
                                                                     _mm_shuffle_epi32(f, 0x55))));
                _mm_storeu_si128(o + 2, _mm_add_epi32(_mm_loadu_si128(o + 2),
                                                      _mm_madd_epi16(_mm_unpacklo_epi16(high, zero),
                                                                     _mm_shuffle_epi32(f, 0xaa))));
                _mm_storeu_si128(o + 3, _mm_add_epi32(_mm_loadu_si128(o + 3),
                                                      _mm_madd_epi16(_mm_unpackhi_epi16(high, zero),
                                                                     _mm_shuffle_epi32(f, 0xff))));
            }
        }
#endif
        for (; u < size; u++, in += n) {
            const size_t x = line + (size_t)txp_wrap(x0 + u, c->width);
            int32_t *to = band->sums + x * (size_t)n;
            for (int b = 0; b < n; b++) to[b] += weight[u] * in[b];
            band->total[x] += weight[u];
        }
    }
}

/* Take a window's match for those pixels of a band where it is the nearest to the mean so far. */
static void txp_pick_window(const txp_pass *p, int w, int x0, int y0, int top, int bottom,
                            const txp_band *band) {
    const txp_source *s = p->source;
    const txp_canvas *c = p->canvas;
    const int n = s->bytes, size = p->size;
    const txp_place m = p->match[w];
    for (int v = 0; v < size; v++) {
        const int y = txp_wrap(y0 + v, c->height);
        if (y < top || y >= bottom) continue;
        const uint8_t *in = txp_stack_at(s, p->stack, m.x, m.y + v);
        const size_t line = (size_t)(y - top) * (size_t)c->width;
        int u = 0;
#ifdef TXP_SSE2
        if (n == 4 && x0 + size <= c->width) {
            const __m128i zero = _mm_setzero_si128(), four = _mm_set_epi32(0, 4, 0, 4);
            const uint8_t *mean = band->mean + (line + (size_t)x0) * 4;
            int32_t *nearest = band->nearest + line + (size_t)x0;
            txp_place *next = c->next + txp_index(c, x0, y), first[4];
            for (int i = 0; i < 4; i++) {
                first[i].x = m.x + i;
                first[i].y = m.y + v;
            }
            /* two places in each */
            __m128i place = _mm_loadu_si128((const __m128i *)(const void *)first);
            __m128i other = _mm_loadu_si128((const __m128i *)(const void *)(first + 2));
            for (; u < size; u += 4, mean += 16, in += 16, nearest += 4, next += 4) {
                const __m128i a = _mm_loadu_si128((const __m128i *)(const void *)mean);
                const __m128i b = _mm_loadu_si128((const __m128i *)(const void *)in);
                const __m128i d = _mm_or_si128(_mm_subs_epu8(a, b), _mm_subs_epu8(b, a));
                __m128i low = _mm_unpacklo_epi8(d, zero), high = _mm_unpackhi_epi8(d, zero);
                low = _mm_madd_epi16(low, low);
                high = _mm_madd_epi16(high, high);
                /* two sums for each pixel */
                const __m128i even = _mm_castps_si128(_mm_shuffle_ps(
                    _mm_castsi128_ps(low), _mm_castsi128_ps(high), _MM_SHUFFLE(2, 0, 2, 0)));
                const __m128i odd = _mm_castps_si128(_mm_shuffle_ps(
                    _mm_castsi128_ps(low), _mm_castsi128_ps(high), _MM_SHUFFLE(3, 1, 3, 1)));
                const __m128i square = _mm_add_epi32(even, odd);
                __m128i *o = (__m128i *)(void *)nearest, *at = (__m128i *)(void *)next;
                __m128i *after = (__m128i *)(void *)(next + 2);
                const __m128i best = _mm_loadu_si128(o), less = _mm_cmplt_epi32(square, best);
                _mm_storeu_si128(
                    o, _mm_or_si128(_mm_and_si128(less, square), _mm_andnot_si128(less, best)));
                const __m128i here = _mm_unpacklo_epi32(less, less);
                const __m128i there = _mm_unpackhi_epi32(less, less);
                _mm_storeu_si128(at, _mm_or_si128(_mm_and_si128(here, place),
                                                  _mm_andnot_si128(here, _mm_loadu_si128(at))));
                _mm_storeu_si128(after, _mm_or_si128(_mm_and_si128(there, other),
                                                     _mm_andnot_si128(there, _mm_loadu_si128(after))));
                place = _mm_add_epi32(place, four);
                other = _mm_add_epi32(other, four);
            }
        }
#endif
        for (; u < size; u++, in += n) {
            const int x = txp_wrap(x0 + u, c->width);
            const uint8_t *to = band->mean + (line + (size_t)x) * (size_t)n;
            int32_t d = 0;
            for (int b = 0; b < n; b++) d += (to[b] - in[b]) * (to[b] - in[b]);
            if (d >= band->nearest[line + (size_t)x]) continue;
            band->nearest[line + (size_t)x] = d;
            txp_place *at = c->next + txp_index(c, x, y);
            at->x = m.x + u;
            at->y = m.y + v;
        }
    }
}

/* One band of rows: the mean of all windows at each pixel, then the candidate nearest to it. */
static void txp_choose_band(void *context, int lane) {
    txp_pass *p = (txp_pass *)context;
    const txp_canvas *c = p->canvas;
    const int top = (p->first_band + lane) * TXP_BAND, n = p->source->bytes;
    const int bottom = top + TXP_BAND < c->height ? top + TXP_BAND : c->height;
    const size_t pixels = (size_t)(bottom - top) * (size_t)c->width;
    const txp_band *band = &p->bands[lane];
    memset(band->sums, 0, pixels * (size_t)n * sizeof *band->sums);
    memset(band->total, 0, pixels * sizeof *band->total);
    for (int turn = 0; turn < 2; turn++) {
        for (int j = 0; j < p->rows; j++) {
            const int y = p->ys[j], end = y + p->size;
            if (!((y < bottom && end > top) || (end > c->height && end - c->height > top)))
                continue;
            for (int i = 0; i < p->columns; i++) {
                const int w = j * p->columns + i;
                if (p->sad[w] == UINT32_MAX) continue;
                if (turn) txp_pick_window(p, w, p->xs[i], y, top, bottom, band);
                else txp_sum_window(p, w, p->xs[i], y, top, bottom, band);
            }
        }
        for (size_t i = 0; i < pixels && !turn; i++) {
            const int32_t *sum = band->sums + i * (size_t)n;
            const float part = band->total[i] ? txm_float(1.0f / (float)band->total[i]) : 0;
            for (int b = 0; b < n; b++)
                band->mean[i * (size_t)n + (size_t)b] =
                    (uint8_t)txm_float(txm_float((float)sum[b] * part) + 0.5f);
            band->nearest[i] = INT32_MAX;
        }
    }
    for (int y = top; y < bottom && c->fixed; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            if (c->fixed[i]) c->next[i] = c->at[i];
        }
    }
}

static void txp_count_use(const txp_canvas *c, txp_use *u) {
    uint32_t total = 0;
    memset(u->count, 0, (size_t)u->columns * (size_t)u->rows * sizeof *u->count);
    for (size_t i = 0; i < (size_t)c->width * (size_t)c->height; i++) {
        if (c->at[i].x < 0) continue;
        u->count[c->at[i].y / TXP_CELL * u->columns + c->at[i].x / TXP_CELL]++;
        total++;
    }
    txp_use_mean(u, (double)(total ? total : 1));
    txp_use_integrate(u);
}

/* ---- single pixels at seams ------------------------------------------------------------- */

typedef struct txp_polish {
    const txp_source *source;
    const txp_stack *stack;
    const txp_canvas *canvas;
    int first_band;
} txp_polish;

/* For each pixel whose neighbours belong to other pieces: of all pieces around it, the one whose
   5 x 5 pixels fit best (k-coherence with k = 1; pixels inside a piece do not change). */
static void txp_polish_band(void *context, int index) {
    const txp_polish *p = (const txp_polish *)context;
    const txp_canvas *c = p->canvas;
    const txp_source *s = p->source;
    const txp_stack *k = p->stack;
    const int top = (p->first_band + index) * TXP_BAND;
    const int bottom = top + TXP_BAND < c->height ? top + TXP_BAND : c->height;
    const int wx = c->wrap & TEXPATCH_TILE_X, wy = c->wrap & TEXPATCH_TILE_Y;
    for (int y = top; y < bottom; y++) {
        for (int x = 0; x < c->width; x++) {
            const size_t i = txp_index(c, x, y);
            const txp_place own = c->at[i];
            txp_place tried[9], best = own;
            int count = 0;
            c->next[i] = own;
            if (own.x < 0 || (c->fixed && c->fixed[i])) continue;
            tried[count++] = own;
            for (int d = 0; d < 9; d++) {
                int qx = x + d % 3 - 1, qy = y + d / 3 - 1;
                if (d == 4) continue;
                if (wx) qx = qx < 0 ? qx + c->width : txp_wrap(qx, c->width);
                if (wy) qy = qy < 0 ? qy + c->height : txp_wrap(qy, c->height);
                if (qx < 0 || qy < 0 || qx >= c->width || qy >= c->height) continue;
                txp_place at = c->at[txp_index(c, qx, qy)];
                if (at.x < 0) continue;
                at.x -= d % 3 - 1;
                at.y -= d / 3 - 1;
                int known = 0;
                for (int t = 0; t < count && !known; t++)
                    known = tried[t].x == at.x && tried[t].y == at.y;
                if (known) continue;
                TXM_ASSERT(count < 9); /* the own one and those of 8 neighbours */
                tried[count++] = at;
            }
            if (count == 1) continue;
            /* the 5 x 5 pixels around it, moved inwards at borders that do not wrap */
            int x0 = x - 2, y0 = y - 2;
            if (wx) x0 = x0 < 0 ? x0 + c->width : x0;
            else x0 = txm_clampi(x0, 0, c->width - 5);
            if (wy) y0 = y0 < 0 ? y0 + c->height : y0;
            else y0 = txm_clampi(y0, 0, c->height - 5);
            int dx = x - x0, dy = y - y0;
            if (dx < 0) dx += c->width;
            if (dy < 0) dy += c->height;
            const uint8_t *target = txp_canvas_at(s, c, x0, y0);
            uint32_t least = UINT32_MAX;
            for (int t = 0; t < count; t++) {
                const int sx = tried[t].x - dx, sy = tried[t].y - dy;
                if (!txp_fits(s, k, sx, sy, 5, 5)) continue;
                const uint32_t sad = txp_sad(target, c->pitch, txp_stack_at(s, k, sx, sy), k->pitch,
                                             5 * s->bytes, 5, least);
                if (sad >= least) continue;
                least = sad;
                best = tried[t];
            }
            c->next[i] = best;
        }
    }
}

#endif /* TEXPATCH_REFINE_H */
