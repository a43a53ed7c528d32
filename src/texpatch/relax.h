#ifndef TEXPATCH_RELAX_H
#define TEXPATCH_RELAX_H

#include "canvas.h"

/* ---- fields that jump at seams ------------------------------------------------------------ */

enum {
    TXP_SWEEPS = 12,     /* of the relaxation                                                    */
    TXP_TILE = 16,       /* pixels: width of the tiles that are relaxed or skipped               */
    TXP_FADE = 48,       /* pixels beyond which a seam has no influence                          */
    TXP_JUMP_UNIT = 64   /* jumps are stored in 1 / 64                                           */
};

/* A field over the canvas with given jumps between neighbouring pixels: the minimum of

       sum over neighbours of pull |u(q) - u(p) - jump|^2 + screen |u|^2,

   which jumps at seams and fades within 1 / sqrt(screen) pixels.                                */
typedef struct txp_field {
    int width, height, wrap, lanes; /* lanes: values per pixel, 2 or a multiple of 4           */
    float *value;
    int16_t *jump;    /* lanes per pixel: pull times jump, in 1 / TXP_JUMP_UNIT                 */
    uint8_t *pull[2]; /* to the right neighbour, to the lower one, in 1 / 255; 255 inside a piece */
    float scale[4 * 255 + 1]; /* by the sum of the four pulls: 1 / (sum + screen)               */
    const uint8_t *fixed; /* 1 = value does not change; NULL: it does everywhere               */
    uint8_t *active; /* of each tile of TXP_TILE x 8 pixels: 2 = it has jumps, 1 = near one    */
    int tiles;     /* in a row                                                                */
    int colour;    /* of the pixels that are relaxed now, on a checkerboard                   */
} txp_field;

static inline void txp_field_mark(const txp_field *f, int x, int y) {
    f->active[(size_t)(y / 8) * (size_t)f->tiles + (size_t)(x / TXP_TILE)] = 2;
}

/* Activate the tiles within TXP_FADE of marked ones. */
static void txp_field_spread(const txp_field *f) {
    const int rows = (f->height + 7) / 8, across = TXP_FADE / TXP_TILE, along = TXP_FADE / 8;
    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < f->tiles; i++) {
            if (f->active[j * f->tiles + i] != 2) continue;
            for (int v = -along; v <= along; v++) {
                int y = j + v;
                if (f->wrap & TEXPATCH_TILE_Y) y = (y + 2 * rows) % rows;
                if (y < 0 || y >= rows) continue;
                for (int u = -across; u <= across; u++) {
                    int x = i + u;
                    if (f->wrap & TEXPATCH_TILE_X) x = (x + 2 * f->tiles) % f->tiles;
                    if (x < 0 || x >= f->tiles) continue;
                    if (!f->active[y * f->tiles + x]) f->active[y * f->tiles + x] = 1;
                }
            }
        }
    }
}

static inline void txp_relax_pixel(const txp_field *f, size_t i, const size_t *next,
                                   const uint8_t *pull, int lanes) {
    float *own = f->value + i * (size_t)lanes;
    const int16_t *jump = f->jump + i * (size_t)lanes;
    const float scale = f->scale[pull[0] + pull[1] + pull[2] + pull[3]];
    const float l = pull[0], r = pull[1], u = pull[2], d = pull[3];
    const float unit = 255.0f / (float)TXP_JUMP_UNIT;
    const float beyond = 1.6f; /* a variable: where floats are computed in double, so are constants */
    const float *a = f->value + next[0] * (size_t)lanes, *b = f->value + next[1] * (size_t)lanes;
    const float *c = f->value + next[2] * (size_t)lanes, *e = f->value + next[3] * (size_t)lanes;
    for (int k = 0; k < lanes; k++) {
        const float across = txm_float(txm_float(l * a[k]) + txm_float(r * b[k]));
        const float along = txm_float(txm_float(u * c[k]) + txm_float(d * e[k]));
        const float all = txm_float(txm_float(across + along) + txm_float(unit * (float)jump[k]));
        own[k] = txm_float(own[k] + txm_float(beyond * txm_float(txm_float(all * scale) - own[k])));
    }
}

/* The pixels of one colour in 8 rows: successive over-relaxation. */
static void txp_relax_rows(void *context, int index) {
    const txp_field *f = (const txp_field *)context;
    const int w = f->width, h = f->height, lanes = f->lanes;
    for (int y = 8 * index; y < 8 * index + 8 && y < h; y++) {
        const int up = y > 0 ? y - 1 : f->wrap & TEXPATCH_TILE_Y ? h - 1 : -1;
        const int down = y + 1 < h ? y + 1 : f->wrap & TEXPATCH_TILE_Y ? 0 : -1;
        const uint8_t *active = f->active + (size_t)(y / 8) * (size_t)f->tiles;
        for (int x = (y + f->colour) % 2; x < w; x += 2) {
            const size_t i = (size_t)y * (size_t)w + (size_t)x;
            if (!active[x / TXP_TILE]) {
                x += TXP_TILE - 2; /* the next tile */
                continue;
            }
            if (f->fixed && f->fixed[i]) continue;
            const int left = x > 0 ? x - 1 : f->wrap & TEXPATCH_TILE_X ? w - 1 : -1;
            const int right = x + 1 < w ? x + 1 : f->wrap & TEXPATCH_TILE_X ? 0 : -1;
            size_t next[4];
            uint8_t pull[4];
            next[0] = left < 0 ? i : (size_t)y * (size_t)w + (size_t)left;
            next[1] = right < 0 ? i : (size_t)y * (size_t)w + (size_t)right;
            next[2] = up < 0 ? i : (size_t)up * (size_t)w + (size_t)x;
            next[3] = down < 0 ? i : (size_t)down * (size_t)w + (size_t)x;
            pull[0] = left < 0 ? 0 : f->pull[0][next[0]];
            pull[1] = right < 0 ? 0 : f->pull[0][i];
            pull[2] = up < 0 ? 0 : f->pull[1][next[2]];
            pull[3] = down < 0 ? 0 : f->pull[1][i];
            if (lanes == 4) txp_relax_pixel(f, i, next, pull, 4);
            else if (lanes == 2) txp_relax_pixel(f, i, next, pull, 2);
            else txp_relax_pixel(f, i, next, pull, lanes);
        }
    }
}

/* Where a torus has an odd number of rows, the first and the last have one colour: not at a time. */
static void txp_relax_field(txp_field *f, txm_env *env) {
    const int parts = (f->height + 7) / 8, alone = f->wrap & TEXPATCH_TILE_Y && f->height % 2;
    for (f->colour = 0; f->colour < 2; f->colour++) {
        txm_parallel_for(env, parts - alone, txp_relax_rows, f);
        if (alone) txp_relax_rows(f, parts - 1);
    }
}

/* Allocate a field: its values, all 0, in memory, the rest in scratch. The failed of both arenas
   tells whether there was no memory. */
static void txp_field_make(txp_field *f, const txp_canvas *c, int lanes, double screen,
                           txm_arena *memory, txm_arena *scratch) {
    const size_t pixels = (size_t)c->width * (size_t)c->height;
    f->width = c->width;
    f->height = c->height;
    f->wrap = c->wrap;
    f->fixed = c->fixed;
    f->lanes = lanes;
    for (int i = 0; i <= 4 * 255; i++) f->scale[i] = txm_float(1 / (i + 255 * screen));
    f->value = (float *)txm_arena_zero(memory, pixels, (size_t)lanes * sizeof(float));
    f->jump = (int16_t *)txm_arena_zero(scratch, pixels, (size_t)lanes * sizeof(int16_t));
    f->pull[0] = (uint8_t *)txm_arena_alloc(scratch, pixels, 1);
    f->pull[1] = (uint8_t *)txm_arena_alloc(scratch, pixels, 1);
    f->tiles = (c->width + TXP_TILE - 1) / TXP_TILE;
    f->active = (uint8_t *)txm_arena_zero(scratch, (size_t)f->tiles, (size_t)(c->height + 7) / 8);
}

#endif /* TEXPATCH_RELAX_H */
