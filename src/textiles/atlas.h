#ifndef TEXTILES_ATLAS_H
#define TEXTILES_ATLAS_H

#include "plane.h"

/* ---- atlas: where tiles lie ----------------------------------------------------------- */

/* The position of the pair (a, b) in a ring of all C^2 pairs, each of which begins with the second
   colour of the one before, (a, b), (b, c), (c, d) ... [6, section 3.1.1]. The first colours of the
   pairs are 0 0 1 1 0 2 1 2 2 0 3 1 3 2 3 3; the first C^2 of these are a de Bruijn sequence of C
   colours. */
static int txt_ring_place(int a, int b) {
    if (a == b) return a ? (a + 1) * (a + 1) - 2 : 0;
    if (b == 0) return (a + 1) * (a + 1) - 1;
    return a > b ? a * a + 2 * b - 1 : 2 * a + b * b;
}

/* Corner colours on a torus on which each of the 16 squares of four corners occurs once: the first
   such in lexicographic order. */
static const uint8_t txt_torus_corners[4][4] = {
    {0, 0, 0, 1}, {0, 0, 1, 0}, {1, 0, 1, 1}, {0, 1, 1, 1}};

/* Column and row of a complete set's tile, variant 0, in the torus.

   Wang tiles: the vertical edges of a row run through the ring of pairs (west, east), the
   horizontal edges of a column through that of pairs (north, south), so that every combination
   occurs.

   Corner tiles, 3 colours: column k of the corners is the ring, moved up by 0 + 1 + ... + (k - 1).
   From column to column the shift grows by k, and 0 + 1 + ... + 8 is a multiple of 9, so that the
   torus closes. The pair (nw, sw) gives the position of the left side in the ring, (ne, se) that of
   the right side, their difference k [Cock 1988]. This needs an odd number of colours. */
static void txt_torus_place(const textiles_layout *l, int code, int *column, int *row) {
    const int c = l->colors, ring = c * c;
    const int e[4] = {code / (c * c * c), code / (c * c) % c, code / c % c, code % c};
    if (l->kind == TEXTILES_WANG) {
        *column = txt_ring_place(e[3], e[1]);
        *row = txt_ring_place(e[0], e[2]);
    } else if (c == 3) {
        const int left = txt_ring_place(e[0], e[3]), right = txt_ring_place(e[1], e[2]);
        const int k = (right - left + ring) % ring;
        *column = k;
        *row = (left + ring * ring - k * (k - 1) / 2) % ring;
    } else {
        for (int i = 0; i < 16; i++) {
            const int x = i % 4, y = i / 4, right = (x + 1) % 4, below = (y + 1) % 4;
            if (txt_torus_corners[y][x] != e[0] || txt_torus_corners[y][right] != e[1]) continue;
            if (txt_torus_corners[below][right] != e[2]) continue;
            if (txt_torus_corners[below][x] != e[3]) continue;
            *column = x;
            *row = y;
        }
    }
}

/* the smallest multiple of a power of two that is not below x */
static int txt_round_up(int x, int power) {
    return (x + power - 1) / power * power;
}

/* Fill in columns, pitch and size of a layout whose other fields are set.

   The gutter is rounded up to a power of two, g. Tiles begin at multiples of g, and so do cells, so
   that a pixel of mip-map level log2(g) belongs to one cell. Bilinear filtering there looks at the
   two by two such pixels around a place, which from a border at a multiple of g reach g pixels far.

   Triangles: two to a cell, the second upside down, mirrored at the cell's centre. Rows and columns
   of texels behave as above, but across the hypotenuse the four pixels' far corner is further away:
   with the edge at i + j = N, the block of four begins at i + j <= floor(N + 1) - g, so that its
   last pixel has i + j <= floor(N + 1) + 3 g - 2, floor() to multiples of g.

         +--------------x      A owns the pixels with x + y < pitch of its cell, B the others:
         |A . . . . . / |      up to i + j = pitch - 1 - 2 g, and pitch - 2 - 2 g. The latter is
         | . A . . /  B |      the number above for pitch = floor(N + 1) + 5 g
         |  . . /  . .  |
         | . /  . . . B |
         x--------------+                                                                   */
static txm_status txt_lay_out(textiles_layout *l, txm_env *env) {
    const int triangle = l->kind == TEXTILES_TRIANGLE, side = l->size + triangle;
    int cells = l->count, rows;
    if (l->gutter < 0 || l->gutter > l->size)
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be 0 to half the tiles' size, or -1");
    int g = 1;
    while (g < l->gutter) g *= 2;
    if (l->gutter > 0) l->gutter = g;

    if (l->packing == TEXTILES_TORUS) {
        l->columns = l->colors * l->colors * l->variants;
        rows = l->colors * l->colors;
        l->pitch_x = l->pitch_y = side;
    } else {
        l->pitch_x = txt_round_up(side, g) + 2 * l->gutter;
        if (triangle && l->packing == TEXTILES_PACKED) {
            l->pitch_x = l->gutter ? side / g * g + 5 * g : side + 1;
            cells = (cells + 1) / 2; /* all triangle sets have an even number of tiles */
        }
        l->pitch_y = l->pitch_x;
        l->columns = 1;
        while (l->packing == TEXTILES_PACKED && l->columns * l->columns < cells) l->columns++;
        rows = (cells + l->columns - 1) / l->columns;
    }
    l->width = l->columns * l->pitch_x;
    l->height = rows * l->pitch_y;
    if (l->height > TEXTILES_MAX_PIXELS / l->width)
        return txm_fail(env, TXM_TOO_LARGE,
                        "the atlas has more than TEXTILES_MAX_PIXELS pixels; use fewer tiles");
    return TXM_OK;
}

/* Refuse a layout that textiles_layout_make cannot have made: its numbers are used as indices. */
static txm_status txt_check_layout(const textiles_layout *layout, txm_env *env) {
    static const char *const bad = "layout was not made by textiles_layout_make";
    if (!layout) return txm_fail(env, TXM_BAD_ARGUMENT, "layout is NULL");
    textiles_layout l = *layout;
    if ((int)l.packing < TEXTILES_PACKED || (int)l.packing > TEXTILES_SLICES ||
        (int)l.kind < TEXTILES_WANG || (int)l.kind > TEXTILES_FRAME || l.size < TEXTILES_MIN_SIZE ||
        l.size > TEXTILES_MAX_SIZE || l.colors < 1 || l.colors > TEXTILES_MAX_COLORS ||
        l.variants < 1 || l.variants > TEXTILES_MAX_VARIANTS || l.count < 1 ||
        l.count > 256 * TEXTILES_MAX_VARIANTS)
        return txm_fail(env, TXM_BAD_ARGUMENT, bad);
    if (l.packing == TEXTILES_TORUS &&
        (l.kind == TEXTILES_TRIANGLE || l.kind == TEXTILES_FRAME || l.gutter != 0 ||
         (l.kind == TEXTILES_CORNER && l.colors == 4) ||
         l.count != l.colors * l.colors * l.colors * l.colors * l.variants))
        return txm_fail(env, TXM_BAD_ARGUMENT, bad);
    const txm_status status = txt_lay_out(&l, env);
    if (status != TXM_OK) return status;
    if (l.gutter != layout->gutter || l.columns != layout->columns ||
        l.pitch_x != layout->pitch_x || l.pitch_y != layout->pitch_y ||
        l.width != layout->width || l.height != layout->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, bad);
    return TXM_OK;
}

TEXTILES_API int textiles_place(const textiles_layout *layout, int tile, int *px, int *py,
                                int *step, float uv[4][2]) {
    if (!layout || tile < 0 || tile >= layout->count || layout->columns < 1) return 0;
    const textiles_layout *l = layout;
    const int triangle = l->kind == TEXTILES_TRIANGLE, slices = l->packing == TEXTILES_SLICES;
    const int pair = triangle && !slices, cell = pair ? tile / 2 : tile;
    int column = cell % l->columns, row = cell / l->columns;
    if (l->packing == TEXTILES_TORUS) {
        txt_torus_place(l, tile / l->variants, &column, &row);
        column += tile % l->variants * l->colors * l->colors;
    }
    const int down = !(pair && tile & 1); /* else upside down, its corner at the lower right */
    const int x = column * l->pitch_x + (down ? l->gutter : l->pitch_x - 1 - l->gutter);
    const int y = row * l->pitch_y + (down ? l->gutter : l->pitch_y - 1 - l->gutter);
    if (px) *px = x;
    if (py) *py = y;
    if (step) *step = down ? 1 : -1;
    if (uv) {
        /* of triangles from texel centre to texel centre; of slices inside the slice */
        static const int squares[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
        static const int triangles[3][2] = {{0, 0}, {0, 1}, {1, 0}};
        const double centre = triangle ? 0.5 : 0, side = down ? l->size : -l->size;
        for (int k = 0; k < (triangle ? 3 : 4); k++) {
            const int *corner = triangle ? triangles[k] : squares[k];
            uv[k][0] = txm_float((x + centre + side * corner[0]) / l->width);
            uv[k][1] = txm_float((y - (slices ? row * l->pitch_y : 0) + centre + side * corner[1]) /
                                 (slices ? l->pitch_y : l->height));
        }
    }
    return 1;
}

/* ---- atlas: what lies around a tile --------------------------------------------------- */

/* A square and eight tiles around it that match; -1: none does. The diagonal ones match the tiles
   above or below and beside them, where the set has such a tile. */
static void txt_around(const textiles_set *s, int tile, int around[3][3]) {
    static const int order[8][2] = {{2, 1}, {0, 1}, {1, 0}, {1, 2}, {2, 0}, {0, 0}, {2, 2}, {0, 2}};
    for (int i = 0; i < 9; i++) around[i / 3][i % 3] = -1;
    around[1][1] = tile;
    for (int k = 0; k < 8; k++) {
        const int x = order[k][0], y = order[k][1];
        const int beside = x == 1 ? -1 : around[y][1], above = y == 1 ? -1 : around[1][x];
        if (k >= 4 && (beside < 0 || above < 0)) continue;
        for (int u = 0; u < s->count && around[y][x] < 0; u += s->variants) {
            if (beside >= 0 && !(x == 2 ? txt_joins(s, beside, u, 0) : txt_joins(s, u, beside, 0)))
                continue;
            if (above >= 0 && !(y == 2 ? txt_joins(s, above, u, 1) : txt_joins(s, u, above, 1)))
                continue;
            around[y][x] = u;
        }
    }
}

/* Pixel (x, y) of the plane around a square, less than a tile away. Where no tile matches, the
   nearest pixel of those around. */
static const uint8_t *txt_square_texel(const textiles_set *s, int map, int around[3][3], int x,
                                       int y) {
    const int n = s->size;
    int column = x < 0 ? 0 : x < n ? 1 : 2, row = y < 0 ? 0 : y < n ? 1 : 2;
    if (around[row][column] < 0) {
        if (around[1][column] >= 0) row = 1;
        else if (around[row][1] >= 0) column = 1;
        else row = column = 1;
    }
    return txt_texel(s, map, around[row][column], txm_clampi(x - (column - 1) * n, 0, n - 1),
                     txm_clampi(y - (row - 1) * n, 0, n - 1));
}

/* A triangle that may lie beyond side k of another, as tile * 3 + its own side there: of the same
   colour and opposite direction. Every triangle set has one, near the start of the list. */
static int txt_across(const textiles_set *s, int tile, int k) {
    const textiles_tile *t = &s->tiles[tile];
    for (int u = 0; u < s->count; u += s->variants) {
        for (int m = 0; m < 3; m++) {
            if (s->tiles[u].edges[m] == t->edges[k] &&
                s->tiles[u].directions[m] == -t->directions[k])
                return u * 3 + m;
        }
    }
    return tile * 3 + k;
}

/* Texel (i, j) of the plane around a triangle: go from triangle to triangle, each time across the
   side that the texel lies furthest beyond. With w[k] the barycentric coordinate of corner k, times
   size, the neighbour across side k has the third corner Q = V(k) + V(k+1) - V(k+2), so that

       w(k) V(k) + w(k+1) V(k+1) + w(k+2) V(k+2)
           = (w(k) + w(k+2)) V(k) + (w(k+1) + w(k+2)) V(k+1) - w(k+2) Q,

   and its own side m runs from V(k+1) to V(k). */
static const uint8_t *txt_triangle_texel(const textiles_set *s, int map, int tile, int i, int j) {
    int w[3] = {s->size - i - j, j, i};
    for (;;) {
        int least = w[1] < w[0] ? 1 : 0;
        if (w[2] < w[least]) least = 2;
        if (w[least] >= 0) return txt_texel(s, map, tile, w[2], w[1]);
        const int k = (least + 1) % 3, next = txt_across(s, tile, k), m = next % 3;
        const int beyond = -w[least], start = w[(k + 1) % 3] - beyond, end = w[k] - beyond;
        w[m] = start;
        w[(m + 1) % 3] = end;
        w[(m + 2) % 3] = beyond;
        tile = next / 3;
    }
}

/* Draw texels (i, j) of the plane around a tile, i and j in low..high, i + j <= most, at
   (px + step i, py + step j) of a picture. */
static void txt_draw_around(const textiles_set *s, int map, int tile, const txm_image *out, int px,
                            int py, int step, int low, int high, int most) {
    const size_t texel = s->maps[map].texel;
    int around[3][3];
    if (s->kind != TEXTILES_TRIANGLE) txt_around(s, tile, around);
    for (int j = low; j <= high; j++) {
        uint8_t *row = (uint8_t *)txm_image_row(out, py + step * j);
        for (int i = low; i <= high && i + j <= most; i++) {
            uint8_t *to = row + (size_t)(px + step * i) * texel;
            if (s->kind == TEXTILES_TRIANGLE) {
                memcpy(to, txt_triangle_texel(s, map, tile, i, j), texel);
            } else if (i == 0 && j >= 0 && j < s->size) {
                memcpy(to, txt_texel(s, map, tile, 0, j), (size_t)s->size * texel);
                i = s->size - 1; /* the tile's own row at once */
            } else {
                memcpy(to, txt_square_texel(s, map, around, i, j), texel);
            }
        }
    }
}

/* Draw one tile of an atlas and the rest of its cell around it. */
typedef struct txt_atlas_job {
    const textiles_set *set;
    const textiles_layout *layout;
    const txm_image *out;
    int map;
} txt_atlas_job;

static void txt_draw_cell(void *context, int tile) {
    const txt_atlas_job *job = (const txt_atlas_job *)context;
    const textiles_layout *l = job->layout;
    const int high = l->pitch_x - 1 - l->gutter;
    int px, py, step, most = 2 * high;
    textiles_place(l, tile, &px, &py, &step, NULL);
    if (l->packing == TEXTILES_PACKED && l->kind == TEXTILES_TRIANGLE)
        most = l->pitch_x - (step > 0 ? 1 : 2) - 2 * l->gutter;
    txt_draw_around(job->set, job->map, tile, job->out, px, py, step, -l->gutter, high, most);
}

/* ---- atlas: the plane, pixel by pixel ------------------------------------------------- */

/* a window of the plane */
typedef struct txt_view {
    const textiles_plane *plane;
    const textiles_layout *layout;
    txm_image atlas, out;
    double x, y, step;
} txt_view;

/* Bilinear interpolation at (x, y) of the atlas, pixel centres at whole numbers. Torus layouts
   repeat; others are clamped to the picture, slices to the slice. */
static void txt_bilinear(const txt_view *v, int tile, double x, double y, void *to) {
    const textiles_layout *l = v->layout;
    const int slices = l->packing == TEXTILES_SLICES;
    const int top = slices ? tile * l->pitch_y : 0;
    const int bottom = slices ? top + l->pitch_y - 1 : l->height - 1;
    const double fx = x - floor(x), fy = y - floor(y);
    const void *rows[2];
    size_t at[2];
    for (int k = 0; k < 2; k++) {
        int ix = (int)floor(x) + k, iy = (int)floor(y) + k;
        if (l->packing == TEXTILES_TORUS) {
            ix = (ix + l->width) % l->width;
            iy = (iy + l->height) % l->height;
        }
        at[k] = (size_t)txm_clampi(ix, 0, l->width - 1) * (size_t)v->atlas.channels;
        rows[k] = txm_image_row_const(&v->atlas, txm_clampi(iy, top, bottom));
    }
    const int last = v->atlas.channels - 1, has_alpha = txm_image_has_alpha(&v->atlas);
    double alpha[4] = {1, 1, 1, 1}, shown = 0;
    for (int k = 0; k < 4 && has_alpha; k++) {
        alpha[k] = fmax(txt_stored(v->atlas.sample, rows[k / 2], at[k & 1] + (size_t)last), 0);
        shown += alpha[k] * (k & 1 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
    }
    const int is_even = alpha[0] == alpha[1] && alpha[0] == alpha[2] && alpha[0] == alpha[3];
    for (int c = 0; c <= last; c++) {
        double s[4];
        const int by_alpha = c < last && !is_even && shown > 0;
        for (int k = 0; k < 4; k++) {
            s[k] = txt_stored(v->atlas.sample, rows[k / 2], at[k & 1] + (size_t)c);
            if (by_alpha) s[k] *= alpha[k] / shown;
        }
        const double above = s[0] * (1 - fx) + s[1] * fx, below = s[2] * (1 - fx) + s[3] * fx;
        const double value = above * (1 - fy) + below * fy;
        if (v->atlas.sample == TXM_F32) ((float *)to)[c] = txm_float(value);
        else if (v->atlas.sample == TXM_U16) ((uint16_t *)to)[c] = (uint16_t)(value + 0.5);
        else ((uint8_t *)to)[c] = (uint8_t)(value + 0.5);
    }
}

/* One row of the window. The tile is looked up again only when the position leaves it. */
static void txt_view_row(void *context, int row) {
    const txt_view *v = (const txt_view *)context;
    const textiles_layout *l = v->layout;
    const int triangle = l->kind == TEXTILES_TRIANGLE;
    const double n = l->size, root3 = 1.7320508075688772935;
    const size_t texel = (size_t)v->out.channels * txm_sample_bytes(v->out.sample);
    uint8_t *to = (uint8_t *)txm_image_row(&v->out, row);
    int last[3] = {0, 0, -1}, tile = 0, rotation = 0, px = 0, py = 0, step = 1;
    for (int column = 0; column < v->out.width; column++, to += texel) {
        const double x = v->x + (column + 0.5) * v->step, y = v->y + (row + 0.5) * v->step;
        const double a = triangle ? (x - y / root3) / n : x / n;
        const double b = triangle ? y * 2 / (root3 * n) : y / n;
        const double fa = a - floor(a), fb = b - floor(b);
        const int now[3] = {(int)floor(a), (int)floor(b), triangle && fa + fb >= 1};
        if (now[0] != last[0] || now[1] != last[1] || now[2] != last[2]) {
            for (int k = 0; k < 3; k++) last[k] = now[k];
            tile = triangle ? textiles_plane_triangle(v->plane, now[0], now[1], now[2], &rotation)
                            : textiles_plane_tile(v->plane, now[0], now[1]);
            textiles_place(l, tile, &px, &py, &step, NULL);
        }
        if (triangle) {
            const double w[3] = {now[2] ? fa + fb - 1 : 1 - fa - fb, now[2] ? 1 - fb : fb,
                                 now[2] ? 1 - fa : fa};
            const double j = w[(4 - rotation) % 3] * n, i = w[(5 - rotation) % 3] * n;
            txt_bilinear(v, tile, px + step * i, py + step * j, to);
        } else {
            txt_bilinear(v, tile, px + (x - now[0] * n) - 0.5, py + (y - now[1] * n) - 0.5, to);
        }
    }
}

/* ---- public: pictures of a set -------------------------------------------------------- */

TEXTILES_API txm_status textiles_layout_make(const textiles_set *set, textiles_packing packing,
                                             int gutter, txm_env *env, textiles_layout *layout) {
    textiles_layout l;
    if (!set || !layout) return txm_fail(env, TXM_BAD_ARGUMENT, "set or layout is NULL");
    if ((int)packing < TEXTILES_PACKED || (int)packing > TEXTILES_SLICES)
        return txm_fail(env, TXM_BAD_ARGUMENT, "packing is none of textiles_packing");
    const int torus = packing == TEXTILES_TORUS;
    if (gutter < -1 || gutter > set->size / 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be 0 to half the tiles' size, or -1");
    if (torus && gutter > 0)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "TEXTILES_TORUS has no gutter; leave it 0, or use TEXTILES_PACKED");
    if (torus && (!set->complete || set->kind == TEXTILES_TRIANGLE))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "TEXTILES_TORUS is for complete wang and corner sets; use TEXTILES_PACKED");
    if (torus && set->kind == TEXTILES_CORNER && set->colors == 4)
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "TEXTILES_TORUS takes corner sets of 2 or 3 colors; use TEXTILES_PACKED");
    memset(&l, 0, sizeof l);
    l.packing = packing;
    l.kind = set->kind;
    l.size = set->size;
    l.colors = set->colors;
    l.variants = set->variants;
    l.count = set->count;
    l.gutter = torus ? 0 : gutter < 0 ? 8 < set->size / 2 ? 8 : set->size / 2 : gutter;
    const txm_status status = txt_lay_out(&l, env);
    if (status == TXM_OK) *layout = l;
    return status;
}

/* the checks of a map's number and of out that both calls that draw tiles have in common */
static txm_status txt_check_picture(const textiles_set *set, int map, const txm_image *out,
                                    int width, int height, txm_env *env) {
    if (map < 0 || map >= set->map_count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "map: the set has no map of this number");
    const txm_status status = txm_image_check(out, "out", TEXTILES_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (out->width != width || out->height != height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: width or height is not what the tiles need");
    if (txm_image_resolve(*out).channels != set->maps[map].channels ||
        out->sample != set->maps[map].sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: channels and sample type must be the map's");
    return TXM_OK;
}

TEXTILES_API txm_status textiles_draw_atlas(const textiles_set *set, const textiles_layout *layout,
                                            int map, txm_env *env, txm_image out) {
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    txm_status status = txt_check_layout(layout, env);
    if (status != TXM_OK) return status;
    if (layout->kind != set->kind || layout->size != set->size || layout->count != set->count ||
        layout->colors != set->colors || layout->variants != set->variants)
        return txm_fail(env, TXM_BAD_ARGUMENT, "layout belongs to another set");
    status = txt_check_picture(set, map, &out, layout->width, layout->height, env);
    if (status != TXM_OK) return status;

    const txm_image im = txm_image_resolve(out);
    txt_atlas_job job;
    job.set = set;
    job.layout = layout;
    job.out = &im;
    job.map = map;
    txm_parallel_for(env, set->count, txt_draw_cell, &job);

    /* cells without a tile, at the end of the last row: the nearest pixel to the left or above */
    const int pair = layout->kind == TEXTILES_TRIANGLE && layout->packing == TEXTILES_PACKED;
    const int cells = pair ? set->count / 2 : set->count;
    const int right = ((cells - 1) % layout->columns + 1) * layout->pitch_x;
    const int top = im.height - layout->pitch_y;
    const size_t texel = set->maps[map].texel;
    for (int y = top; y < im.height; y++) {
        uint8_t *row = (uint8_t *)txm_image_row(&im, y);
        for (int x = right; x < im.width; x++) {
            const uint8_t *from = row + (size_t)(right - 1) * texel;
            if (top > 0 && y - top < x - right)
                from = (const uint8_t *)txm_image_row(&im, top - 1) + (size_t)x * texel;
            memcpy(row + (size_t)x * texel, from, texel);
        }
    }
    return TXM_OK;
}

TEXTILES_API txm_status textiles_draw_tile(const textiles_set *set, int tile, int gutter, int map,
                                           txm_env *env, txm_image out) {
    if (!set) return txm_fail(env, TXM_BAD_ARGUMENT, "set is NULL");
    if (tile < 0 || tile >= set->count)
        return txm_fail(env, TXM_BAD_ARGUMENT, "tile: the set has no tile of this number");
    if (gutter < 0 || gutter > set->size / 2)
        return txm_fail(env, TXM_BAD_ARGUMENT, "gutter must be 0 to half the tiles' size");
    const int side = set->side + 2 * gutter;
    const txm_status status = txt_check_picture(set, map, &out, side, side, env);
    if (status != TXM_OK) return status;
    const txm_image im = txm_image_resolve(out);
    const int high = set->side - 1 + gutter;
    txt_draw_around(set, map, tile, &im, gutter, gutter, 1, -gutter, high, 2 * high);
    return TXM_OK;
}

TEXTILES_API txm_status textiles_draw_plane(const textiles_plane *plane,
                                            const textiles_layout *layout, const txm_image *atlas,
                                            double x, double y, double step, txm_env *env,
                                            txm_image out) {
    if (!plane) return txm_fail(env, TXM_BAD_ARGUMENT, "plane is NULL");
    txm_status status = txt_check_layout(layout, env);
    if (status != TXM_OK) return status;
    const int c = layout->colors;
    int fits = plane->kind == layout->kind && plane->colors == c &&
               plane->variants == layout->variants && layout->kind != TEXTILES_FRAME;
    if (fits && layout->kind == TEXTILES_TRIANGLE) {
        fits = plane->table != NULL;
        for (int i = 0; fits && i < 8 * c * c * c; i++)
            fits = plane->table[i] / 4 <= layout->count - layout->variants;
    } else if (fits) {
        fits = layout->count == c * c * c * c * layout->variants;
    }
    if (!fits) return txm_fail(env, TXM_BAD_ARGUMENT, "plane and layout belong to different sets");
    status = txm_image_check(atlas, "atlas", TEXTILES_MAX_PIXELS, env);
    if (status == TXM_OK) status = txm_image_check(&out, "out", TEXTILES_MAX_PIXELS, env);
    if (status != TXM_OK) return status;
    if (atlas->width != layout->width || atlas->height != layout->height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "atlas: width or height is not that of the layout");
    if (txm_image_resolve(*atlas).channels != txm_image_resolve(out).channels ||
        atlas->sample != out.sample)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out: channels and sample type must be the atlas's");
    if (!txm_is_finite(x) || !txm_is_finite(y) || !txm_is_finite(step) || !(step > 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "x, y and step must be finite, and step above 0");
    /* tile numbers must fit an int; of triangles they mix both coordinates */
    const double reach = fabs(x) + fabs(y) + step * out.width + step * out.height;
    if (!(reach / layout->size < 1e9))
        return txm_fail(env, TXM_BAD_ARGUMENT, "the window lies more than 10^9 tiles from the origin");

    txt_view view;
    view.plane = plane;
    view.layout = layout;
    view.atlas = txm_image_resolve(*atlas);
    view.out = txm_image_resolve(out);
    view.x = x;
    view.y = y;
    view.step = step;
    txm_parallel_for(env, out.height, txt_view_row, &view);
    return TXM_OK;
}

TEXTILES_API int textiles_face_uv(const textiles_layout *layout, int tile, int rotation,
                                  float uv[4][2]) {
    float corner[4][2];
    if (!uv || rotation < 0 || rotation > 2) return 0;
    if (!textiles_place(layout, tile, NULL, NULL, NULL, corner)) return 0;
    const int triangle = layout->kind == TEXTILES_TRIANGLE, corners = triangle ? 3 : 4;
    for (int k = 0; k < corners; k++) { /* squares are listed clockwise, faces not */
        const int from = triangle ? (k + rotation) % 3 : (4 - k) % 4;
        uv[k][0] = corner[from][0];
        uv[k][1] = corner[from][1];
    }
    return corners;
}

#endif /* TEXTILES_ATLAS_H */
