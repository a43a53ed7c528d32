#ifndef TEXSYN_REGIONS_H
#define TEXSYN_REGIONS_H

#include "textons.h"

/* ---- regions ------------------------------------------------------------------------------

   The scene is divided into blocks; each is described by the histograms of the textons around it.
   Neighbouring blocks are joined, the most similar first, until a few dozen regions are left; these
   are then partitioned into cliques of mutually similar ones, wherever they lie [7]. A
   clique is a texture. */

enum {
    TXS_BINS_OF_BLOCK = TXS_COLOURS + TXS_GRAINS,
    TXS_BLOCK_TOTAL = 4096,    /* sum of either half of a normalised histogram                  */
    TXS_FAR = 1 << 16,         /* distance of histograms that have nothing in common            */
    TXS_BLOCK = 8,             /* pixels a side                                                 */
    TXS_SMALLEST_BLOCK = 2,    /* of small pictures, that have at least                         */
    TXS_BLOCKS_ACROSS = 16,    /* on their shorter side                                         */
    TXS_MOST_BLOCKS = 9216,    /* memory grows with their square                                */
    TXS_PIECES = 24,   /* regions that are partitioned                                  */
    TXS_LOG_UNIT = 256         /* of the table of n log2 n                                      */
};

typedef struct txs_blocks {
    int size, width, height, count; /* size: pixels a side                                       */
    uint16_t (*sums)[TXS_BINS_OF_BLOCK];   /* textons counted in each block                      */
    uint16_t (*wide)[TXS_BINS_OF_BLOCK];   /* of a block and what is around it, normalised       */
    uint16_t (*clear)[TXS_BINS_OF_BLOCK];  /* the same without mixtures at boundaries            */
    int *weight;                           /* counted pixels of each block                       */
    int32_t *log_table;                    /* n log2 n for n up to 2 TXS_BLOCK_TOTAL             */
} txs_blocks;

#define TXS_LN2 0.69314718055994530942

static void txs_log_table(int32_t *table) {
    table[0] = 0;
    for (int n = 1; n <= 2 * TXS_BLOCK_TOTAL; n++)
        table[n] = (int32_t)((double)(n * TXS_LOG_UNIT) * txm_log2((double)n) + 0.5);
}

/* The Jensen-Shannon divergence of bins from..to, 0..TXS_FAR. */
static int txs_divergence(const int32_t *table, const uint16_t *p, const uint16_t *q, int from,
                          int to) {
    int32_t sum = 0;
    for (int i = from; i < to; i++) sum += table[p[i]] + table[q[i]] - table[p[i] + q[i]];
    const int64_t whole = 2 * (int64_t)TXS_BLOCK_TOTAL * TXS_LOG_UNIT;
    const int64_t d = (whole + sum) * TXS_FAR / whole;
    return (int)(d < 0 ? 0 : d);
}

/* the mean of those of colour and of texture */
static int txs_unlike(const int32_t *table, const uint16_t *p, const uint16_t *q) {
    return (txs_divergence(table, p, q, 0, TXS_COLOURS) +
            txs_divergence(table, p, q, TXS_COLOURS, TXS_BINS_OF_BLOCK)) /
           2;
}

/* counts, each half to the sum TXS_BLOCK_TOTAL (but for rounding) */
static void txs_normalise_bins(const uint64_t *counts, uint16_t *out) {
    for (int half = 0; half < 2; half++) {
        const int from = half ? (int)TXS_COLOURS : 0;
        const int to = half ? (int)TXS_BINS_OF_BLOCK : (int)TXS_COLOURS;
        uint64_t total = 0;
        for (int i = from; i < to; i++) total += counts[i];
        if (!total) total = 1;
        for (int i = from; i < to; i++)
            out[i] = (uint16_t)((counts[i] * TXS_BLOCK_TOTAL + total / 2) / total);
    }
}

/* ---- blocks ------------------------------------------------------------------------------- */

static void txs_count_blocks(const txs_scene *s, txs_blocks *b) {
    for (int y = 0; y < s->height; y++) {
        for (int x = 0; x < s->width; x++) {
            const size_t i = (size_t)y * (size_t)s->width + (size_t)x;
            const int k = y / b->size * b->width + x / b->size;
            if (!s->counted[i]) continue;
            TEXSYN_ASSERT(k < b->count);
            b->sums[k][s->colour[i]]++;
            b->sums[k][TXS_COLOURS + s->shape[i]]++;
            b->weight[k]++;
        }
    }
}

/* The histogram of a block with its neighbours, which weigh the less the farther they are. */
static void txs_widen(txs_blocks *b, int x, int y) {
    static const int taps[5] = {2, 4, 5, 4, 2};
    uint64_t sum[TXS_BINS_OF_BLOCK] = {0};
    for (int v = -2; v <= 2; v++) {
        for (int u = -2; u <= 2; u++) {
            if (x + u < 0 || x + u >= b->width || y + v < 0 || y + v >= b->height) continue;
            const uint16_t *from = b->sums[(y + v) * b->width + x + u];
            const uint32_t weight = (uint32_t)(taps[u + 2] * taps[v + 2]);
            for (int i = 0; i < TXS_BINS_OF_BLOCK; i++) sum[i] += weight * from[i];
        }
    }
    txs_normalise_bins(sum, b->wide[y * b->width + x]);
}

/* How much a block differs from those two blocks away. */
static int txs_local_spread(const txs_blocks *b, int x, int y) {
    static const int way[4][2] = {{-2, 0}, {2, 0}, {0, -2}, {0, 2}};
    int64_t sum = 0, n = 0;
    for (int k = 0; k < 4; k++) {
        const int u = x + way[k][0], v = y + way[k][1];
        if (u < 0 || u >= b->width || v < 0 || v >= b->height || !b->weight[v * b->width + u])
            continue;
        sum += txs_unlike(b->log_table, b->wide[y * b->width + x], b->wide[v * b->width + u]);
        n++;
    }
    return n ? (int)(sum / n) : 0;
}

/* At a boundary a block mixes two textures. So each takes the histogram of the least mixed one near
   it (Kuwahara's filter). spread: room for a number a block. */
static void txs_clear_mixtures(txs_blocks *b, int *spread) {
    for (int y = 0; y < b->height; y++)
        for (int x = 0; x < b->width; x++)
            spread[y * b->width + x] = txs_local_spread(b, x, y);
    for (int y = 0; y < b->height; y++) {
        for (int x = 0; x < b->width; x++) {
            int best = y * b->width + x;
            if (!b->weight[best]) continue;
            for (int v = txm_clampi(y - 2, 0, y); v <= y + 2 && v < b->height; v++) {
                for (int u = txm_clampi(x - 2, 0, x); u <= x + 2 && u < b->width; u++) {
                    const int k = v * b->width + u;
                    if (b->weight[k] && spread[k] < spread[best]) best = k;
                }
            }
            memcpy(b->clear[y * b->width + x], b->wide[best], sizeof b->wide[best]);
        }
    }
}

/* ---- joining neighbours ---------------------------------------------------------------------- */

typedef struct txs_region_set {
    const txs_blocks *blocks;
    int *of;             /* the region of each block, named by one of its blocks; -1: not counted */
    uint64_t (*sum)[TXS_BINS_OF_BLOCK];    /* of the histograms of its blocks, by area */
    uint16_t (*mean)[TXS_BINS_OF_BLOCK];   /* the same, normalised */
    int64_t *area;       /* counted pixels; 0: no region of this name */
    uint64_t *touches;   /* a row of bits for each region: its neighbours */
    int words;           /* of such a row */
    int *partner;        /* the neighbour that is joined most cheaply; -1: none */
    int64_t *cost;       /* of that */
    int count;
} txs_region_set;

static void txs_set_touch(txs_region_set *r, int a, int b, int value) {
    uint64_t *word = &r->touches[(size_t)a * (size_t)r->words + (size_t)(b >> 6)];
    const uint64_t bit = (uint64_t)1 << (b & 63);
    *word = value ? *word | bit : *word & ~bit;
}

/* Ward's: what joining two regions adds to the unlikeness within regions. */
static int64_t txs_join_cost(const txs_region_set *r, int a, int b) {
    const int64_t d = txs_unlike(r->blocks->log_table, r->mean[a], r->mean[b]);
    const int64_t both = r->area[a] + r->area[b];
    return both ? d * (r->area[a] * r->area[b] / both) : 0;
}

/* the next neighbour of a region after `after`, or -1 */
static int txs_next_touch(const txs_region_set *r, int a, int after) {
    const uint64_t *row = r->touches + (size_t)a * (size_t)r->words;
    for (int b = after + 1; b < r->blocks->count; b++) {
        if (!row[b >> 6]) b |= 63;
        else if (row[b >> 6] >> (b & 63) & 1) return b;
    }
    return -1;
}

static void txs_find_partner(txs_region_set *r, int a) {
    r->partner[a] = -1;
    for (int b = txs_next_touch(r, a, -1); b >= 0; b = txs_next_touch(r, a, b)) {
        const int64_t cost = txs_join_cost(r, a, b);
        if (r->partner[a] >= 0 && cost >= r->cost[a]) continue;
        r->partner[a] = b;
        r->cost[a] = cost;
    }
}

static void txs_join_two(txs_region_set *r, int a, int b) {
    r->area[a] += r->area[b];
    r->area[b] = 0;
    for (int i = 0; i < TXS_BINS_OF_BLOCK; i++) r->sum[a][i] += r->sum[b][i];
    txs_normalise_bins(r->sum[a], r->mean[a]);
    for (int c = txs_next_touch(r, b, -1); c >= 0; c = txs_next_touch(r, b, c)) {
        txs_set_touch(r, c, b, 0);
        if (c == a) continue;
        txs_set_touch(r, c, a, 1);
        txs_set_touch(r, a, c, 1);
    }
    r->partner[b] = -1;
    for (int k = 0; k < r->blocks->count; k++)
        if (r->of[k] == b) r->of[k] = a;
    r->count--;
    txs_find_partner(r, a);
    for (int c = txs_next_touch(r, a, -1); c >= 0; c = txs_next_touch(r, a, c)) {
        if (r->partner[c] == a || r->partner[c] == b) {
            txs_find_partner(r, c);
            continue;
        }
        const int64_t cost = txs_join_cost(r, c, a);
        if (cost < r->cost[c]) {
            r->partner[c] = a;
            r->cost[c] = cost;
        }
    }
}

/* Every counted block a region of its own. It touches the counted block before it in its row and
   in its column, also across what is not counted. */
static void txs_first_regions(txs_region_set *r) {
    const txs_blocks *b = r->blocks;
    r->count = 0;
    for (int k = 0; k < b->count; k++) {
        const int x = k % b->width;
        r->of[k] = b->weight[k] ? k : -1;
        r->area[k] = b->weight[k];
        if (!b->weight[k]) continue;
        r->count++;
        memcpy(r->mean[k], b->clear[k], sizeof r->mean[k]);
        for (int i = 0; i < TXS_BINS_OF_BLOCK; i++)
            r->sum[k][i] = (uint64_t)b->clear[k][i] * (uint64_t)b->weight[k];
        int left = k - 1, up = k - b->width;
        while (left >= k - x && !b->weight[left]) left--;
        while (up >= 0 && !b->weight[up]) up -= b->width;
        const int before[2] = {left >= k - x ? left : -1, up};
        for (int i = 0; i < 2; i++) {
            if (before[i] < 0) continue;
            txs_set_touch(r, k, before[i], 1);
            txs_set_touch(r, before[i], k, 1);
        }
    }
    for (int k = 0; k < b->count; k++) txs_find_partner(r, k);
}

/* Join the most similar neighbours until `most` regions are left, or none touch. */
static void txs_join_neighbours(txs_region_set *r, int most) {
    while (r->count > most) {
        int best = -1;
        for (int k = 0; k < r->blocks->count; k++)
            if (r->partner[k] >= 0 && (best < 0 || r->cost[k] < r->cost[best])) best = k;
        if (best < 0) return;
        const int other = r->partner[best];
        txs_join_two(r, best < other ? best : other, best < other ? other : best);
    }
}

/* ---- partition into cliques --------------------------------------------------------------- */

/* How unlike textures must be, for thick groups and for thin ones. */
typedef struct txs_standard {
    double thick, least_thick; /* the cut for groups of that thickness or more, in blocks */
    double thin, most_thin;    /* and for those of at most that                           */
} txs_standard;

/* Ours, see docs/choices.md: the strict one, and a finer one for what looks like one texture. */
static const txs_standard txs_strict = {0.39, 5, 0.5, 1.8};
static const txs_standard txs_fine = {0.31, 3, 0.5, 1.8};

typedef struct txs_partition {
    int count;         /* groups; 0..count-1, each of one region or more                      */
    int regions;       /* the matrices have as many rows and columns                          */
    int *unlike;       /* mean distance of two groups, by area                                */
    int *border;       /* length of their common boundary in sides of blocks                  */
    int64_t *area;     /* pixels                                                              */
    int *group;        /* of each region                                                      */
    int block;         /* pixels of a block                                                   */
} txs_partition;

static int *txs_unlike_at(const txs_partition *p, int a, int b) {
    return &p->unlike[(size_t)a * (size_t)p->regions + (size_t)b];
}

static int *txs_border_at(const txs_partition *p, int a, int b) {
    return &p->border[(size_t)a * (size_t)p->regions + (size_t)b];
}

/* Row and column `from` of both matrices to `to`. */
static void txs_move_group(txs_partition *p, int to, int from) {
    p->area[to] = p->area[from];
    for (int k = 0; k < p->regions; k++)
        if (p->group[k] == from) p->group[k] = to;
    for (int c = 0; c < p->regions; c++) {
        *txs_unlike_at(p, to, c) = *txs_unlike_at(p, from, c);
        *txs_border_at(p, to, c) = *txs_border_at(p, from, c);
    }
    for (int c = 0; c < p->regions; c++) {
        *txs_unlike_at(p, c, to) = *txs_unlike_at(p, c, from);
        *txs_border_at(p, c, to) = *txs_border_at(p, c, from);
    }
}

/* Group b becomes part of group a; the last group takes the number of b. */
static void txs_unite_groups(txs_partition *p, int a, int b) {
    const int64_t whole = p->area[a] + p->area[b];
    for (int c = 0; c < p->count; c++) {
        const int64_t sum =
            p->area[a] * *txs_unlike_at(p, a, c) + p->area[b] * *txs_unlike_at(p, b, c);
        const int border = *txs_border_at(p, a, c) + *txs_border_at(p, b, c);
        *txs_unlike_at(p, a, c) = *txs_unlike_at(p, c, a) = (int)(sum / whole);
        *txs_border_at(p, a, c) = *txs_border_at(p, c, a) = border;
    }
    *txs_border_at(p, a, a) = 0;
    p->area[a] = whole;
    for (int k = 0; k < p->regions; k++)
        if (p->group[k] == b) p->group[k] = a;
    if (b != --p->count) txs_move_group(p, b, p->count);
}

/* Area per boundary, in blocks: half the width of a strip, a quarter of a square's side. */
static double txs_thickness(const txs_partition *p, int a) {
    int64_t border = 0;
    for (int c = 0; c < p->count; c++) border += c == a ? 0 : *txs_border_at(p, a, c);
    return (double)p->area[a] / (double)(p->block * p->block) / (double)(border ? border : 1);
}

/* How unlike two groups must be to count as two textures. Thin ones are more often parts of one
   texture, such as bricks and mortar. */
static int txs_group_cut(const txs_partition *p, const txs_standard *z, int a, int b) {
    const double s = txs_thickness(p, a), t = txs_thickness(p, b), thinner = s < t ? s : t;
    double share = (z->least_thick - thinner) / (z->least_thick - z->most_thin);
    share = share < 0 ? 0 : share > 1 ? 1 : share;
    return (int)((z->thick + (z->thin - z->thick) * share) * (double)TXS_FAR);
}

/* The pair of groups a < b that is most likely one texture; returns by how much their distance
   exceeds what it may be, INT_MAX if there is but one group. */
static int txs_most_similar(const txs_partition *p, const txs_standard *z, int pair[2]) {
    int best = INT_MAX;
    for (int a = 0; a < p->count; a++) {
        for (int b = a + 1; b < p->count; b++) {
            const int excess = *txs_unlike_at(p, a, b) - txs_group_cut(p, z, a, b);
            if (excess >= best) continue;
            best = excess;
            pair[0] = a;
            pair[1] = b;
        }
    }
    return best;
}

/* Unite the most similar groups while they may be one texture or more than `most` are left, but
   never to fewer than `least`. */
static void txs_find_cliques(txs_partition *p, const txs_standard *z, int least, int most) {
    int pair[2] = {0, 0};
    while (p->count > least) {
        const int excess = txs_most_similar(p, z, pair);
        if (excess >= 0 && p->count <= most) return;
        txs_unite_groups(p, pair[0], pair[1]);
    }
}

/* A strip along a boundary is a mixture of what lies beside it, and the filters see both sides:
   it looks like a texture of its own, but is thinner than this, in blocks. */
#define TXS_THINNEST 1.25

/* The smallest group that is smaller than `least_area` or too thin for a texture, or -1. */
static int txs_least_group(const txs_partition *p, int64_t least_area) {
    int least = -1;
    for (int c = 0; c < p->count; c++) {
        if (p->area[c] >= least_area && txs_thickness(p, c) >= TXS_THINNEST) continue;
        if (least < 0 || p->area[c] < p->area[least]) least = c;
    }
    return least;
}

/* Groups that are too small or too thin join the most similar other one, the smallest first. */
static void txs_join_least(txs_partition *p, int64_t least_area) {
    while (p->count > 1) {
        const int a = txs_least_group(p, least_area);
        int best = -1;
        if (a < 0) return;
        for (int c = 0; c < p->count; c++) {
            if (c == a) continue;
            if (best < 0 || *txs_unlike_at(p, a, c) < *txs_unlike_at(p, a, best)) best = c;
        }
        txs_unite_groups(p, a < best ? a : best, a < best ? best : a);
    }
}

#endif /* TEXSYN_REGIONS_H */
