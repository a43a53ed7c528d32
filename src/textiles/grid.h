#ifndef TEXTILES_GRID_H
#define TEXTILES_GRID_H

#include "plane.h"

/* ---- grids: scan-line order ------------------------------------------------------------- */

/* The tiles (first variants only) that match the cells above and to the left. A key has a digit for
   each colour that must agree, 0..colors-1 or colors for "any": north and west; of corner tiles nw,
   ne and sw. There are at most 256 such tiles, each listed under 4 or 8 keys. */
enum { TXT_KEYS = 5 * 5 * 5, TXT_MAX_BASES = 256 };

typedef struct txt_choice {
    int first[TXT_KEYS + 1]; /* bases[first[key]] .. bases[first[key + 1] - 1] */
    uint8_t bases[8 * TXT_MAX_BASES];
} txt_choice;

static int txt_choice_key(const textiles_set *s, int nw_or_north, int ne, int sw_or_west) {
    const int n = s->colors + 1;
    return s->kind == TEXTILES_CORNER ? (nw_or_north * n + ne) * n + sw_or_west
                                      : nw_or_north * n + sw_or_west;
}

static void txt_choice_make(const textiles_set *s, txt_choice *choice) {
    int next[TXT_KEYS + 1];
    const int corner = s->kind == TEXTILES_CORNER, any = s->colors;
    memset(choice->first, 0, sizeof choice->first);
    for (int pass = 0; pass < 2; pass++) { /* count, then list in the order of the tiles */
        memcpy(next, choice->first, sizeof next);
        for (int base = 0; base < s->count / s->variants; base++) {
            const int *e = s->tiles[base * s->variants].edges;
            for (int mask = 0; mask < 8; mask++) { /* which of the digits are "any" */
                if (!corner && mask & 2) continue;
                const int key = txt_choice_key(s, mask & 1 ? any : e[0], mask & 2 ? any : e[1],
                                               mask & 4 ? any : e[3]);
                if (pass == 0) choice->first[key + 1]++;
                else choice->bases[next[key]++] = (uint8_t)base;
            }
        }
        for (int key = 0; key < TXT_KEYS && pass == 0; key++)
            choice->first[key + 1] += choice->first[key];
    }
}

/* Is there a tile for each pair of colours that the cells above and to the left can have? */
static txm_status txt_choice_check(const textiles_set *s, const txt_choice *choice, int width,
                                   int height, txm_env *env) {
    int south = 0, east = 0; /* sets of colours */
    for (int t = 0; t < s->count; t++) {
        south |= 1 << s->tiles[t].edges[2];
        east |= 1 << s->tiles[t].edges[1];
    }
    for (int n = 0; n < s->colors && s->kind != TEXTILES_CORNER; n++) { /* corner sets are complete */
        for (int w = 0; w < s->colors; w++) {
            if (!(south >> n & 1) || !(east >> w & 1)) continue;
            const int key = txt_choice_key(s, height > 1 ? n : s->colors, 0, width > 1 ? w : s->colors);
            if (choice->first[key] < choice->first[key + 1]) continue;
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "a dead end: no tile has north color # and west color #; add "
                                    "such a class, or use textiles_solve",
                                    (uint64_t)n, (uint64_t)w);
        }
    }
    return TXM_OK;
}

/* One of the tiles under a key, if possible neither `row` nor `column`, which would be the third
   equal one in a row or column (-1: nothing to avoid). */
static int txt_choose(const textiles_set *s, const txt_choice *choice, int key, int row, int column,
                      txm_rng *rng) {
    const uint8_t *bases = choice->bases + choice->first[key];
    const int n = (choice->first[key + 1] - choice->first[key]) * s->variants;
    int allowed = n;
    if (row >= 0 || column >= 0) {
        for (int i = 0; i < n; i++) {
            const int t = bases[i / s->variants] * s->variants + i % s->variants;
            allowed -= t == row || t == column;
        }
    }
    if (allowed == 0 || allowed == n) {
        const int i = (int)txm_rng_below(rng, (uint32_t)n);
        return bases[i / s->variants] * s->variants + i % s->variants;
    }
    int left = (int)txm_rng_below(rng, (uint32_t)allowed);
    for (int i = 0;; i++) {
        const int t = bases[i / s->variants] * s->variants + i % s->variants;
        if (t != row && t != column && left-- == 0) return t;
    }
}

/* the checks that textiles_scanline and textiles_solve have in common */
static txm_status txt_check_grid(const textiles_set *set, int width, int height, const int *tiles,
                                 txm_env *env) {
    size_t bytes;
    if (!set || !tiles) return txm_fail(env, TXM_BAD_ARGUMENT, "set or tiles is NULL");
    if (set->kind == TEXTILES_TRIANGLE)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "triangles have no grid of squares; use textiles_plane_make or "
                        "textiles_assign_triangles");
    if (width < 1 || height < 1)
        return txm_fail(env, TXM_BAD_ARGUMENT, "width and height must be 1 or more");
    if (!txm_mul((size_t)width, (size_t)height, sizeof(int), &bytes))
        return txm_fail(env, TXM_TOO_LARGE, "width * height exceeds what memory can hold");
    return TXM_OK;
}

TEXTILES_API txm_status textiles_scanline(const textiles_set *set, int width, int height,
                                          uint64_t seed, txm_env *env, int *tiles) {
    txt_choice choice;
    txm_status status = txt_check_grid(set, width, height, tiles, env);
    if (status != TXM_OK) return status;
    txt_choice_make(set, &choice);
    status = txt_choice_check(set, &choice, width, height, env);
    if (status != TXM_OK) return status;

    txm_rng rng = txm_rng_make(seed, 40); /* streams: 40 here, 41 in textiles_solve */
    const int any = set->colors, corner = set->kind == TEXTILES_CORNER;
    const ptrdiff_t up = width;
    int *t = tiles;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++, t++) {
            const int *left = x ? set->tiles[t[-1]].edges : NULL;
            const int *above = y ? set->tiles[t[-up]].edges : NULL;
            int first = above ? above[2] : any, west = left ? left[1] : any, ne = any;
            if (corner) {
                ne = first;
                first = left ? left[1] : above ? above[3] : any;
                west = left ? left[2] : any;
            }
            const int row = x > 1 && t[-1] == t[-2] ? t[-1] : -1;
            const int column = y > 1 && t[-up] == t[-2 * up] ? t[-up] : -1;
            *t = txt_choose(set, &choice, txt_choice_key(set, first, ne, west), row, column, &rng);
        }
    }
    return TXM_OK;
}

/* ---- grids: tiling under constraints ---------------------------------------------------- */

/* The unknowns are the slots between the cells: horizontal edges, then vertical edges; of corner
   sets the corners. Each has a set of colours it may still take. In a complete set every
   combination has a tile, so that the given tiles decide some slots and the rest is drawn at
   random, in one pass.

   With reduced wang sets and frame sets (at most 64 tiles, variants not counted) there is a search.
   The domain of a cell is the set of tiles that its four slots allow; a slot keeps the colours that
   occur in the domains on both sides; this is propagated until nothing changes [AC-3, Mackworth
   1977]. Cells are decided in scan-line order, with propagation after each; on failure the latest
   decision is undone. After too many failures without progress the search restarts with other
   random numbers. */
enum {
    TXT_ATTEMPTS = 64,         /* ours: restarts                                              */
    TXT_FAILURES = 1000,       /* ours: failures without getting any further, and 8 a column  */
    TXT_REDRAWS = 8,           /* ours: draws to avoid three equal tiles in a row              */
    TXT_SLOTS = 1 << 28,       /* a trail entry is slot * 16 + colours, in 32 bits             */
    TXT_REPORT_CELLS = 1 << 14 /* cells done from one report to the next                       */
};

typedef struct txt_decision {
    uint64_t untried; /* tiles left to try at this cell          */
    uint32_t cell;
    uint32_t scan;    /* all cells before this one are decided   */
    uint32_t mark;    /* length of the trail before the decision */
} txt_decision;

typedef struct txt_solver {
    const textiles_set *set;
    txm_env *env;
    int width, height, periodic;
    uint32_t cells, slots;
    uint8_t *colors; /* by slot: set of colours                                       */
    int *tiles;      /* by cell: the given tile or the result, -1 = none yet          */
    /* for the search only */
    uint64_t having[4][TEXTILES_MAX_COLORS]; /* tiles that show this colour there        */
    uint64_t allowing[4][1 << TEXTILES_MAX_COLORS]; /* tiles that show one of these colours */
    uint64_t all;                            /* all tiles; with a period of 1 those that
                                                match themselves                         */
    uint32_t *trail, trail_length;           /* changed slots with their colours before  */
    uint32_t *queue, queue_length;           /* cells to look at again                   */
    uint8_t *queued;                         /* by cell                                  */
    txt_decision *decisions;
    uint32_t failed_at;                      /* the cell whose domain became empty       */
    uint32_t steps;                          /* since the last report                    */
    float fraction;                          /* reported last                            */
    int cancelled;
} txt_solver;

/* Slots of a cell in the order of a tile's edges. */
static void txt_cell_slots(const txt_solver *s, uint32_t cell, uint32_t slot[4]) {
    const uint32_t w = (uint32_t)s->width, h = (uint32_t)s->height, x = cell % w, y = cell / w;
    const uint32_t right = s->periodic && x + 1 == w ? 0 : x + 1;
    const uint32_t below = s->periodic && y + 1 == h ? 0 : y + 1;
    const uint32_t columns = s->periodic ? w : w + 1, rows = s->periodic ? h : h + 1;
    if (s->set->kind == TEXTILES_CORNER) {
        slot[0] = y * columns + x;
        slot[1] = y * columns + right;
        slot[2] = below * columns + right;
        slot[3] = below * columns + x;
    } else {
        slot[0] = y * w + x;
        slot[1] = rows * w + y * columns + right;
        slot[2] = below * w + x;
        slot[3] = rows * w + y * columns + x;
    }
}

/* Report progress now and then; the fraction never falls. */
static int txt_solver_report(txt_solver *s, uint32_t steps, float fraction) {
    s->steps += steps;
    if (s->cancelled || s->steps < TXT_REPORT_CELLS) return s->cancelled;
    s->steps = 0;
    if (fraction > s->fraction) s->fraction = fraction;
    s->cancelled = txm_progress(s->env, s->fraction, "tiling") != 0;
    return s->cancelled;
}

static int txt_bit_count(uint64_t bits) {
    int n = 0;
    for (; bits; bits &= bits - 1) n++;
    return n;
}

/* one of the bits that are set, at random */
static int txt_random_bit(uint64_t bits, txm_rng *rng) {
    uint32_t left = txm_rng_below(rng, (uint32_t)txt_bit_count(bits));
    for (; left; left--) bits &= bits - 1;
    return txm_lowest_bit(bits);
}

static uint64_t txt_domain(const txt_solver *s, const uint32_t slot[4]) {
    uint64_t domain = s->all;
    for (int k = 0; k < 4; k++) domain &= s->allowing[k][s->colors[slot[k]]];
    return domain;
}

/* the tile of a cell that is decided */
static int txt_decided_base(const txt_solver *s, uint32_t cell) {
    uint32_t slot[4];
    txt_cell_slots(s, cell, slot);
    return txm_lowest_bit(txt_domain(s, slot));
}

static void txt_enqueue(txt_solver *s, uint32_t cell) {
    if (s->queued[cell]) return;
    s->queued[cell] = 1;
    TXM_ASSERT(s->queue_length < s->cells);
    s->queue[s->queue_length++] = cell;
}

/* Reduce the slots of a cell to the colours of the tiles of a domain; enqueue the neighbours at
   slots that change. */
static void txt_narrow(txt_solver *s, uint32_t cell, const uint32_t slot[4], uint64_t domain) {
    const uint32_t w = (uint32_t)s->width, x = cell % w, last = s->cells - w;
    for (int k = 0; k < 4; k++) {
        const uint8_t before = s->colors[slot[k]];
        uint8_t after = 0;
        for (int c = 0; c < s->set->colors; c++) {
            if (domain & s->having[k][c]) after = (uint8_t)(after | 1 << c);
        }
        if (after == before) continue;
        TXM_ASSERT(s->trail_length < 3 * s->slots);
        s->trail[s->trail_length++] = slot[k] * 16 + before;
        s->colors[slot[k]] = after;
        if (k == 0 && (cell >= w || s->periodic)) txt_enqueue(s, cell >= w ? cell - w : cell + last);
        if (k == 1 && (x + 1 < w || s->periodic)) txt_enqueue(s, x + 1 < w ? cell + 1 : cell - x);
        if (k == 2 && (cell < last || s->periodic))
            txt_enqueue(s, cell < last ? cell + w : cell - last);
        if (k == 3 && (x || s->periodic)) txt_enqueue(s, x ? cell - 1 : cell + w - 1);
    }
}

/* Process the queue; 0 if a cell has no tile left (failed_at), or when cancelled. */
static int txt_propagate(txt_solver *s) {
    while (s->queue_length) {
        uint32_t slot[4];
        const uint32_t cell = s->queue[--s->queue_length];
        s->queued[cell] = 0;
        txt_cell_slots(s, cell, slot);
        const uint64_t domain = txt_domain(s, slot);
        if (domain) txt_narrow(s, cell, slot, domain);
        else s->failed_at = cell;
        if (!domain || txt_solver_report(s, 1, 0)) {
            while (s->queue_length) s->queued[s->queue[--s->queue_length]] = 0;
            return 0;
        }
    }
    return 1;
}

static int txt_decide(txt_solver *s, uint32_t cell, int base) {
    uint32_t slot[4];
    txt_cell_slots(s, cell, slot);
    txt_narrow(s, cell, slot, (uint64_t)1 << base);
    return txt_propagate(s);
}

static void txt_undo(txt_solver *s, uint32_t mark) {
    while (s->trail_length > mark) {
        const uint32_t entry = s->trail[--s->trail_length];
        s->colors[entry / 16] = (uint8_t)(entry % 16);
    }
}

/* A random tile of the domain of a cell; without variants not the third equal one in a row or
   column, if the domain has another. */
static int txt_draw_base(const txt_solver *s, uint32_t cell, uint64_t domain, txm_rng *rng) {
    const uint32_t w = (uint32_t)s->width;
    uint64_t good = domain;
    if (s->set->variants == 1 && cell % w > 1) {
        const int base = txt_decided_base(s, cell - 1);
        if (base == txt_decided_base(s, cell - 2)) good &= ~((uint64_t)1 << base);
    }
    if (s->set->variants == 1 && cell / w > 1) {
        const int base = txt_decided_base(s, cell - w);
        if (base == txt_decided_base(s, cell - 2 * w)) good &= ~((uint64_t)1 << base);
    }
    return txt_random_bit(good ? good : domain, rng);
}

/* One attempt. 1 = every cell is decided, 0 = too many failures or cancelled, -1 = all
   possibilities were tried, there is no tiling.

   After a failure the cell without a tile is decided first at each level that the search returns
   to, until that succeeds: the cause is often a decision a row earlier, and all combinations of the
   cells between would be tried in vain ["last conflict", Lecoutre 2009]. */
static int txt_attempt(txt_solver *s, txm_rng *rng) {
    const uint32_t most = TXT_FAILURES + 8 * (uint32_t)s->width;
    uint32_t depth = 0, failures = 0, scan = 0, furthest = 0, urgent = s->cells;
    while (scan < s->cells) {
        uint32_t slot[4];
        const uint32_t cell = urgent < s->cells ? urgent : scan;
        if (txt_solver_report(s, 1, 0.9f * (float)scan / (float)s->cells)) return 0;
        urgent = s->cells;
        txt_cell_slots(s, cell, slot);
        const uint64_t domain = txt_domain(s, slot);
        if (!(domain & (domain - 1))) { /* one tile left: the slots show it */
            scan += cell == scan;
            continue;
        }
        if (scan > furthest) {
            furthest = scan;
            failures = 0;
        }
        TXM_ASSERT(depth < s->cells);
        txt_decision *d = &s->decisions[depth++];
        int base = txt_draw_base(s, cell, domain, rng);
        d->cell = cell;
        d->scan = scan;
        d->mark = s->trail_length;
        d->untried = domain & ~((uint64_t)1 << base);
        while (!txt_decide(s, d->cell, base)) {
            if (s->cancelled || failures++ == most) return 0;
            for (; !d->untried; d--) {
                if (urgent == s->cells) urgent = d->cell;
                if (--depth == 0) return -1;
            }
            txt_undo(s, d->mark);
            scan = d->scan;
            base = txt_random_bit(d->untried, rng);
            d->untried &= ~((uint64_t)1 << base);
        }
    }
    return 1;
}

/* Enter the given tiles. 0: two of them disagree at the cell failed_at, or cancelled. */
static int txt_enter_given(txt_solver *s) {
    for (uint32_t cell = 0; cell < s->cells; cell++) {
        uint32_t slot[4];
        if (txt_solver_report(s, 1, 0)) return 0;
        if (s->tiles[cell] < 0) continue;
        const int *e = s->set->tiles[s->tiles[cell]].edges;
        txt_cell_slots(s, cell, slot);
        for (int k = 0; k < 4; k++) {
            s->colors[slot[k]] = (uint8_t)(s->colors[slot[k]] & 1 << e[k]);
            if (s->colors[slot[k]]) continue;
            s->failed_at = cell;
            return 0;
        }
    }
    return 1;
}

static txm_status txt_contradiction(txt_solver *s) {
    if (s->cancelled) return txt_cancelled(s->env);
    return txm_fail_numbers(s->env, TXM_BAD_ARGUMENT,
                            "tiles: those given near column #, row # contradict each other",
                            s->failed_at % (uint32_t)s->width, s->failed_at / (uint32_t)s->width);
}

/* Reduced wang and frame sets: fill in the numbers of tiles, variant 0, where none is given. */
static txm_status txt_search_tiles(txt_solver *s, txm_arena *arena, txm_rng *rng) {
    const textiles_set *set = s->set;
    s->trail = (uint32_t *)txm_arena_alloc(arena, s->slots, 3 * sizeof(uint32_t));
    s->queue = (uint32_t *)txm_arena_alloc(arena, s->cells, sizeof(uint32_t));
    s->queued = (uint8_t *)txm_arena_zero(arena, s->cells, 1);
    s->decisions = (txt_decision *)txm_arena_alloc(arena, s->cells, sizeof(txt_decision));
    if (arena->failed)
        return txm_fail(s->env, TXM_OUT_OF_MEMORY, "no memory to solve a grid of this size");
    for (int base = 0; base < set->count / set->variants; base++) {
        const int *e = set->tiles[base * set->variants].edges;
        const uint64_t bit = (uint64_t)1 << base;
        for (int k = 0; k < 4; k++) s->having[k][e[k]] |= bit;
        if (s->periodic && s->width == 1 && e[1] != e[3]) continue; /* lies beside itself */
        if (s->periodic && s->height == 1 && e[0] != e[2]) continue;
        s->all |= bit;
    }
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 1 << set->colors; i++) {
            for (int c = 0; c < set->colors; c++)
                if (i >> c & 1) s->allowing[k][i] |= s->having[k][c];
        }
    }

    /* first without the given tiles: is it the set that has no such tiling? */
    for (int with_given = 0; with_given < 2; with_given++) {
        if (with_given && !txt_enter_given(s)) return txt_contradiction(s);
        for (uint32_t cell = s->cells; cell-- > 0;) txt_enqueue(s, cell);
        if (txt_propagate(s)) {
            s->trail_length = 0; /* never to be undone */
        } else {
            if (with_given || s->cancelled) return txt_contradiction(s);
            return txm_fail(s->env, TXM_BAD_DATA, "the set has no tiling of this size");
        }
    }
    int found = 0;
    for (int attempt = 0; attempt < TXT_ATTEMPTS && !found; attempt++) {
        txt_undo(s, 0);
        found = txt_attempt(s, rng);
        if (s->cancelled) return txt_cancelled(s->env);
    }
    if (found < 0) return txm_fail(s->env, TXM_BAD_DATA, "no tiling has the given tiles");
    if (!found)
        return txm_fail(s->env, TXM_BAD_DATA,
                        "no tiling found in 64 attempts; another seed or fewer given tiles may "
                        "help");
    for (uint32_t cell = 0; cell < s->cells; cell++) {
        if (s->tiles[cell] < 0) s->tiles[cell] = txt_decided_base(s, cell) * set->variants;
    }
    return TXM_OK;
}

/* Complete sets: draw the cells that are not given. Without variants a tile that would be the third
   equal one in a row is drawn again a few times. */
static txm_status txt_draw_tiles(txt_solver *s, txm_rng *rng) {
    const uint32_t w = (uint32_t)s->width;
    const int n = s->set->colors, v = s->set->variants, all = (1 << n) - 1;
    if (!txt_enter_given(s)) return txt_contradiction(s);
    for (uint32_t cell = 0; cell < s->cells; cell++) {
        uint32_t slot[4];
        int *t = s->tiles + cell, color[4], row = -1, column = -1;
        if (txt_solver_report(s, 1, 0.9f * (float)cell / (float)s->cells))
            return txt_cancelled(s->env);
        if (*t >= 0) continue;
        txt_cell_slots(s, cell, slot);
        if (v == 1 && cell % w > 1 && t[-1] == t[-2]) row = t[-1];
        if (v == 1 && cell / w > 1 && s->tiles[cell - w] == s->tiles[cell - 2 * w])
            column = s->tiles[cell - w];
        for (int draw = 0; draw < TXT_REDRAWS; draw++) {
            int code = 0;
            for (int k = 0; k < 4; k++) {
                const int set = s->colors[slot[k]]; /* one colour or all */
                color[k] = set == all ? (int)txm_rng_below(rng, (uint32_t)n)
                                      : txm_lowest_bit((uint64_t)set);
                for (int j = 0; j < k; j++) /* in a period of 1 a slot has two sides */
                    if (slot[j] == slot[k]) color[k] = color[j];
                code = code * n + color[k];
            }
            *t = s->set->lookup[code] / 4;
            if (*t != row && *t != column) break;
        }
        for (int k = 0; k < 4; k++) s->colors[slot[k]] = (uint8_t)(1 << color[k]);
    }
    return TXM_OK;
}

/* How many runs of three equal tiles, across and down, contain this cell. */
static int txt_runs(const txt_solver *s, int x, int y) {
    const int at[2] = {x, y}, length[2] = {s->width, s->height};
    const int tile = s->tiles[(size_t)y * (size_t)s->width + (size_t)x];
    int runs = 0;
    for (int axis = 0; axis < 2; axis++) {
        int equal = 0; /* length of the run so far */
        if (length[axis] == 1) continue;
        for (int d = -2; d <= 2; d++) {
            int p[2] = {x, y};
            p[axis] = at[axis] + d;
            if (s->periodic) p[axis] = (p[axis] + 2 * length[axis]) % length[axis];
            const int inside = p[axis] >= 0 && p[axis] < length[axis];
            equal = inside && s->tiles[(size_t)p[1] * (size_t)s->width + (size_t)p[0]] == tile
                        ? equal + 1
                        : 0;
            runs += equal >= 3;
        }
    }
    return runs;
}

/* Choose the variants of cells that are not given: first those of the plane, which have no three
   equal tiles in a row; then, since given tiles and the period may break that, the best for each
   cell. */
static txm_status txt_choose_variants(txt_solver *s, const uint8_t *given, uint32_t seed) {
    const int variants = s->set->variants;
    for (int pass = 0; pass < 4 && variants > 1; pass++) {
        int changed = 0;
        uint32_t cell = 0;
        for (int y = 0; y < s->height; y++) {
            if (txt_solver_report(s, (uint32_t)s->width, 0.9f)) return txt_cancelled(s->env);
            for (int x = 0; x < s->width; x++, cell++) {
                int *t = s->tiles + cell;
                if (given[cell]) continue;
                if (pass == 0) {
                    *t += txt_square_variant(seed, variants, (uint32_t)x, (uint32_t)y);
                    continue;
                }
                int least = txt_runs(s, x, y), best = *t;
                const int old = *t, base = old - old % variants;
                for (int v = 1; v < variants && least; v++) {
                    *t = base + (old + v) % variants;
                    const int runs = txt_runs(s, x, y);
                    if (runs < least) {
                        least = runs;
                        best = *t;
                    }
                }
                *t = best;
                changed |= best != old;
            }
        }
        if (pass && !changed) break;
    }
    return TXM_OK;
}

TEXTILES_API txm_status textiles_solve(const textiles_set *set, int width, int height, int periodic,
                                       uint64_t seed, txm_env *env, int *tiles) {
    txt_solver s;
    txm_arena arena;
    txm_status status = txt_check_grid(set, width, height, tiles, env);
    if (status != TXM_OK) return status;
    if (((uint64_t)width + 1) * ((uint64_t)height + 1) > TXT_SLOTS / 2)
        return txm_fail(env, TXM_TOO_LARGE, "width * height must stay below 2^27; solve it in parts");
    const uint32_t w = (uint32_t)width, h = (uint32_t)height;
    for (uint32_t i = 0; i < w * h; i++) {
        if (tiles[i] < -1 || tiles[i] >= set->count)
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "tiles: the one at column #, row # is neither -1 nor a tile's "
                                    "number",
                                    i % w, i / w);
    }
    if (txm_progress(env, 0, "tiling")) return txt_cancelled(env);

    memset(&s, 0, sizeof s);
    s.set = set;
    s.env = env;
    s.width = width;
    s.height = height;
    s.periodic = periodic != 0;
    s.cells = w * h;
    s.slots = set->kind == TEXTILES_CORNER ? (w + 1) * (h + 1) : 2 * w * h + w + h;
    txm_arena_init(&arena, env);
    s.colors = (uint8_t *)txm_arena_alloc(&arena, s.slots, 1);
    s.tiles = (int *)txm_arena_alloc(&arena, s.cells, sizeof(int));
    uint8_t *given = (uint8_t *)txm_arena_alloc(&arena, s.cells, 1);
    if (arena.failed) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory to solve a grid of this size");
        goto done;
    }
    memset(s.colors, (1 << set->colors) - 1, s.slots);
    memcpy(s.tiles, tiles, s.cells * sizeof(int));
    for (uint32_t i = 0; i < s.cells; i++) given[i] = tiles[i] >= 0;

    {
        txm_rng rng = txm_rng_make(seed, 41);
        status = set->complete ? txt_draw_tiles(&s, &rng) : txt_search_tiles(&s, &arena, &rng);
        if (status == TXM_OK) status = txt_choose_variants(&s, given, txm_rng_next(&rng));
    }
    if (status == TXM_OK && txm_progress(env, 1, "tiling")) status = txt_cancelled(env);
    if (status == TXM_OK) memcpy(tiles, s.tiles, s.cells * sizeof(int));

done:
    txm_arena_free(&arena);
    return status;
}

#endif /* TEXTILES_GRID_H */
