#ifndef TEXTILES_PLANE_H
#define TEXTILES_PLANE_H

#include "set.h"

/* ---- the hash ----------------------------------------------------------------------------- */

/* Which tile lies where is computed from

       hash(seed, what, x, y) = txt_at(txt_column(seed, x), what, y),

   32 bits that depend on the position, on the property wanted there (what) and on the seed. The
   inner half depends on the column only and is shared by all cells of a column, and by two edges of
   one. In 32-bit integers, since shaders/textiles.glsl computes the same; coordinates are taken
   modulo 2^32. The two multipliers of the mixing step are those of C. Wellons ("prospecting for
   hash functions"). */
static uint32_t txt_mix(uint32_t h) {
    h ^= h >> 16;
    h *= 0x7feb352du;
    h ^= h >> 15;
    h *= 0x846ca68bu;
    return h ^ (h >> 16);
}

static uint32_t txt_column(uint32_t seed, uint32_t x) {
    return txt_mix(x + seed);
}

/* the part of the hash that is the same for all columns */
static uint32_t txt_key(uint32_t what, uint32_t y) {
    return y * 0x9e3779b9u + what * 0x85ebca6bu;
}

static uint32_t txt_at(uint32_t column, uint32_t what, uint32_t y) {
    return txt_mix(column ^ txt_key(what, y));
}

/* a hash as a number of 0..n-1 */
static int txt_below(uint32_t hash, int n) {
    return (int)((hash >> 8) * (uint32_t)n >> 24);
}

/* the upper and lower 16 bits of a hash as numbers of 0..n-1 */
static int txt_upper(uint32_t hash, int n) {
    return (int)((hash >> 16) * (uint32_t)n >> 16);
}
static int txt_lower(uint32_t hash, int n) {
    return (int)((hash & 0xffffu) * (uint32_t)n >> 16);
}

/* ---- the plane: which tile lies where --------------------------------------------------- */

/* The hashes of a square (x, y):

       what 0   the colour of its north edge; its south edge is the north edge of (x, y + 1)
       what 1   the colour of its west edge; its east edge is the west edge of (x + 1, y)
       what 2   of corner tiles, the colour of its north-west corner
       what 3   variants of the upper left and lower right square of a block of 2 x 2
       what 4   variants of the other two

   Colours are txt_below(hash, colors). */

/* the k-th of the variants that are neither a nor d */
static int txt_other_variant(int k, int a, int d) {
    const int low = a < d ? a : d, high = a < d ? d : a;
    k += k >= low;
    return k + ((k >= high) & (low != high));
}

/* The variants of a block of squares (2 bx, 2 by) .. (2 bx + 1, 2 by + 1),

       a b      a and d at random (two variants: d = a),
       c d      b and c at random among those that are neither a nor d.

   Of three squares in a row two belong to the same block, and these have different variants, so
   that three equal tiles never lie in a row, whatever their colours. h = hash(3, bx, by), g =
   hash(4, bx, by) for bx = x / 2, by = y / 2 of the coordinates as unsigned numbers. */
static void txt_block_variants(uint32_t h, uint32_t g, int variants, int v[4]) {
    const int a = txt_upper(h, variants), d = variants == 2 ? a : txt_lower(h, variants);
    const int others = variants - 1 - (a != d);
    v[0] = a;
    v[1] = txt_other_variant(txt_upper(g, others), a, d);
    v[2] = txt_other_variant(txt_lower(g, others), a, d);
    v[3] = d;
}

/* the variant of a square */
static int txt_square_variant(uint32_t seed, int variants, uint32_t x, uint32_t y) {
    int v[4];
    if (variants < 2) return 0;
    const uint32_t column = txt_column(seed, x >> 1);
    txt_block_variants(txt_at(column, 3, y >> 1), txt_at(column, 4, y >> 1), variants, v);
    return v[(y & 1) * 2 + (x & 1)];
}

enum { TXT_STRIP = 256 }; /* columns that textiles_plane_fill computes at a time; even */

/* A strip of the plane, filled row by row; element i belongs to column x + i. */
typedef struct txt_strip {
    uint32_t column[TXT_STRIP + 1];    /* txt_column of the columns            */
    uint32_t block[TXT_STRIP / 2 + 1]; /* and of the blocks of two             */
    int upper[TXT_STRIP + 1];          /* colours at the row's upper side      */
    int lower[TXT_STRIP + 1];          /* and at its lower side                */
    int west[TXT_STRIP + 1];           /* colours of vertical edges            */
    int variant[2][TXT_STRIP + 2];     /* of the rows of a block, from even x  */
} txt_strip;

static void txt_strip_colors(const uint32_t *column, int count, uint32_t what, uint32_t y, int colors,
                             int *out) {
    const uint32_t key = txt_key(what, y);
    for (int i = 0; i < count; i++) out[i] = txt_below(txt_mix(column[i] ^ key), colors);
}

static void txt_strip_variants(txt_strip *s, int blocks, int variants, uint32_t by) {
    int v[4][TXT_STRIP / 2 + 1];
    for (int i = 0; i < blocks; i++) {
        int of[4];
        txt_block_variants(txt_at(s->block[i], 3, by), txt_at(s->block[i], 4, by), variants, of);
        for (int k = 0; k < 4; k++) v[k][i] = of[k];
    }
    for (int i = 0; i < blocks; i++) {
        s->variant[0][2 * i] = v[0][i];
        s->variant[0][2 * i + 1] = v[1][i];
        s->variant[1][2 * i] = v[2][i];
        s->variant[1][2 * i + 1] = v[3][i];
    }
}

/* Fill count <= TXT_STRIP columns of a window; a row of tiles is `width` numbers long. */
static void txt_fill_strip(const textiles_plane *p, uint32_t x, uint32_t y, int count, int width,
                           int height, int *tiles) {
    txt_strip s;
    const int c = p->colors, v = p->variants, corner = p->kind == TEXTILES_CORNER;
    const uint32_t what = corner ? 2u : 0u, odd = x & 1;
    const int blocks = (count + (int)odd + 1) / 2, sides = corner ? count + 1 : count;
    for (int i = 0; i <= count; i++) s.column[i] = txt_column(p->seed, x + (uint32_t)i);
    for (int i = 0; i < blocks; i++) s.block[i] = txt_column(p->seed, (x + 2 * (uint32_t)i) >> 1);
    memset(s.variant, 0, sizeof s.variant);
    txt_strip_colors(s.column, sides, what, y, c, s.lower);
    for (int row = 0; row < height; row++, y++, tiles += width) {
        memcpy(s.upper, s.lower, (size_t)sides * sizeof s.upper[0]);
        txt_strip_colors(s.column, sides, what, y + 1, c, s.lower);
        if (v > 1 && (row == 0 || (y & 1) == 0)) txt_strip_variants(&s, blocks, v, y >> 1);
        const int *variant = s.variant[y & 1] + odd;
        if (corner) {
            for (int i = 0; i < count; i++) {
                const int code =
                    ((s.upper[i] * c + s.upper[i + 1]) * c + s.lower[i + 1]) * c + s.lower[i];
                tiles[i] = code * v + variant[i];
            }
        } else {
            txt_strip_colors(s.column, count + 1, 1, y, c, s.west);
            for (int i = 0; i < count; i++) {
                const int code =
                    ((s.upper[i] * c + s.west[i + 1]) * c + s.lower[i]) * c + s.west[i];
                tiles[i] = code * v + variant[i];
            }
        }
    }
}

/* ---- public: the plane ------------------------------------------------------------------ */

TEXTILES_API txm_status textiles_plane_make(const textiles_set *set, uint32_t seed, txm_env *env,
                                            textiles_plane *plane) {
    if (!set || !plane) return txm_fail(env, TXM_BAD_ARGUMENT, "set or plane is NULL");
    if (set->kind == TEXTILES_FRAME)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a frame set lacks combinations of colors that the plane needs; use "
                        "textiles_solve");
    if (!set->complete)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a reduced wang set lacks combinations of colors that the plane needs; "
                        "make the set without reduced, or use textiles_scanline");
    plane->kind = set->kind;
    plane->colors = set->colors;
    plane->variants = set->variants;
    plane->seed = seed;
    plane->table = set->kind == TEXTILES_TRIANGLE ? set->lookup : NULL;
    return TXM_OK;
}

TEXTILES_API int textiles_plane_tile(const textiles_plane *plane, int x, int y) {
    const uint32_t u = (uint32_t)x, v = (uint32_t)y;
    const uint32_t here = txt_column(plane->seed, u), next = txt_column(plane->seed, u + 1);
    const int c = plane->colors;
    int code;
    if (plane->kind == TEXTILES_TRIANGLE) return -1;
    if (plane->kind == TEXTILES_CORNER) {
        code = txt_below(txt_at(here, 2, v), c);
        code = code * c + txt_below(txt_at(next, 2, v), c);
        code = code * c + txt_below(txt_at(next, 2, v + 1), c);
        code = code * c + txt_below(txt_at(here, 2, v + 1), c);
    } else {
        code = txt_below(txt_at(here, 0, v), c);
        code = code * c + txt_below(txt_at(next, 1, v), c);
        code = code * c + txt_below(txt_at(here, 0, v + 1), c);
        code = code * c + txt_below(txt_at(here, 1, v), c);
    }
    return code * plane->variants + txt_square_variant(plane->seed, plane->variants, u, v);
}

TEXTILES_API void textiles_plane_fill(const textiles_plane *plane, int x, int y, int width,
                                      int height, int *tiles) {
    if (width < 1 || height < 1) return;
    if (plane->kind == TEXTILES_TRIANGLE) {
        for (size_t i = 0; i < (size_t)width * (size_t)height; i++) tiles[i] = -1;
        return;
    }
    for (int left = 0; left < width; left += TXT_STRIP) {
        const int count = width - left < TXT_STRIP ? width - left : TXT_STRIP;
        txt_fill_strip(plane, (uint32_t)x + (uint32_t)left, (uint32_t)y, count, width, height,
                       tiles + left);
        if (count < TXT_STRIP) break; /* left + TXT_STRIP might overflow */
    }
}

/* The hashes of lattice points (a, b) of triangles, coordinates again modulo 2^32:

       what 7    the rank of the point. Edges run from the lower to the higher rank, of equal ranks
                 (2^-32 of all) from the lower to the higher a, of equal a from the lower b. As ranks
                 are an order, the three edges of a triangle never have the same direction: a reduced
                 set will do
       what 8    the colour of the edge (a, b) - (a+1, b)
       what 9    the colour of the edge (a, b) - (a, b+1)
       what 10   the colour of the edge (a+1, b) - (a, b+1)
       what 11   the variants: an even one for half 0 from the upper 16 bits, an odd one for half 1
                 from the lower. All neighbours of a half 0 are halves 1, so neighbours differ */
TEXTILES_API int textiles_plane_triangle(const textiles_plane *plane, int a, int b, int half,
                                         int *rotation) {
    const uint32_t u = (uint32_t)a, v = (uint32_t)b, one = half != 0;
    const uint32_t here = txt_column(plane->seed, u), next = txt_column(plane->seed, u + 1);
    if (rotation) *rotation = 0;
    if (!plane->table) return -1;
    /* corners in their order: (a, b), (a, b+1), (a+1, b) or (a+1, b+1), (a+1, b), (a, b+1) */
    const uint32_t at[3] = {u + one, u + one, u + 1 - one}; /* a of the corners */
    const uint32_t bt[3] = {v + one, v + 1 - one, v + one};
    const uint32_t rank[3] = {txt_at(one ? next : here, 7, bt[0]),
                              txt_at(one ? next : here, 7, bt[1]),
                              txt_at(one ? here : next, 7, bt[2])};
    const uint32_t hash[3] = {txt_at(one ? next : here, 9, v), txt_at(here, 10, v),
                              txt_at(here, 8, v + one)};
    const int symbols = 2 * plane->colors;
    int code = 0;
    for (int k = 0; k < 3; k++) {
        const int n = k == 2 ? 0 : k + 1;
        int against = rank[k] > rank[n];
        if (rank[k] == rank[n]) against = at[k] > at[n] || (at[k] == at[n] && bt[k] > bt[n]);
        code = code * symbols + 2 * txt_below(hash[k], plane->colors) + against;
    }
    const int32_t entry = plane->table[code];
    int variant = 0;
    if (plane->variants > 1) {
        const uint32_t h = txt_at(here, 11, v);
        variant = one ? 2 * txt_lower(h, plane->variants / 2) + 1
                      : 2 * txt_upper(h, (plane->variants + 1) / 2);
    }
    if (rotation) *rotation = (int)(entry & 3);
    return (int)(entry / 4) + variant;
}

TEXTILES_API const int32_t *textiles_plane_table(const textiles_plane *plane, int *count) {
    if (count) *count = plane->table ? 8 * plane->colors * plane->colors * plane->colors : 0;
    return plane->table;
}

#endif /* TEXTILES_PLANE_H */
