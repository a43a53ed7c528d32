#ifndef TEXPATCH_RELAX_H
#define TEXPATCH_RELAX_H

#include "canvas.h"

/* ---- fields that jump at seams ------------------------------------------------------------ */

enum {
    TXP_SWEEPS = 12,     /* of the relaxation                                                    */
    TXP_TILE = 16,       /* pixels: width of the tiles that are relaxed or skipped               */
    TXP_TILE_ROWS = 8,   /* their height                                                         */
    TXP_FADE = 2 * TXP_SWEEPS, /* pixels beyond which a jump is not felt: one for each colour of a
                            sweep                                                                */
    TXP_JUMP_UNIT = 64   /* jumps are stored in 1 / 64                                           */
};

/* A field over some rows of the canvas with given jumps between neighbouring pixels: the minimum of

       sum over neighbours of pull |u(q) - u(p) - jump|^2 + screen |u|^2,

   which jumps at seams and fades within 1 / sqrt(screen) pixels. Row 0 is row `top` of the canvas; of
   a canvas that wraps, rows before the first and behind the last are those at the other end.     */
typedef struct txp_field {
    const txp_canvas *canvas;
    int top, height, lanes; /* lanes: values per pixel, 2 or a multiple of 4                   */
    int closed;       /* these are all rows of the canvas, and the last is followed by the first */
    float *value;
    int16_t *jump;    /* lanes per pixel: pull times jump, in 1 / TXP_JUMP_UNIT; a row more      */
    uint8_t *pull[2]; /* to the right neighbour, to the lower one, in 1 / 255; 255 inside a piece */
    float scale[4 * 255 + 1]; /* by the sum of the four pulls: 1 / (sum + screen)               */
    uint8_t *active; /* of each tile: 2 = it has jumps, 1 = near one; a row of tiles more      */
    int tiles;       /* in a row                                                                */
    int from, to;    /* rows that are relaxed now                                               */
    int colour;      /* of their pixels, on a checkerboard                                      */
} txp_field;

/* The row of the canvas that row y of the field is; -1: none. */
static inline int txp_field_row(const txp_field *f, int y) {
    const int height = f->canvas->height;
    const int row = f->top + y;
    if (row >= 0 && row < height) return row;
    return f->canvas->wrap & TEXPATCH_TILE_Y ? (row % height + height) % height : -1;
}

static inline void txp_field_mark(const txp_field *f, int x, int y) {
    f->active[(size_t)(y / TXP_TILE_ROWS) * (size_t)f->tiles + (size_t)(x / TXP_TILE)] = 2;
}

/* Activate the tiles within TXP_FADE of marked ones. */
static void txp_field_spread(const txp_field *f) {
    const int rows = (f->height + TXP_TILE_ROWS - 1) / TXP_TILE_ROWS;
    const int across = (TXP_FADE + TXP_TILE - 1) / TXP_TILE;
    const int along = (TXP_FADE + TXP_TILE_ROWS - 1) / TXP_TILE_ROWS;
    for (int j = 0; j < rows; j++) {
        for (int i = 0; i < f->tiles; i++) {
            if (f->active[j * f->tiles + i] != 2) continue;
            for (int v = -along; v <= along; v++) {
                int y = j + v;
                if (f->closed) y = (y + 2 * rows) % rows;
                if (y < 0 || y >= rows) continue;
                for (int u = -across; u <= across; u++) {
                    int x = i + u;
                    if (f->canvas->wrap & TEXPATCH_TILE_X) x = (x + 2 * f->tiles) % f->tiles;
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

/* The pixels of one colour in a row of tiles: successive over-relaxation. */
static void txp_relax_rows(void *context, int index) {
    const txp_field *f = (const txp_field *)context;
    const int w = f->canvas->width, h = f->height, lanes = f->lanes;
    const int wraps = f->canvas->wrap & TEXPATCH_TILE_X, part = f->from / TXP_TILE_ROWS + index;
    const int first = part * TXP_TILE_ROWS, end = first + TXP_TILE_ROWS;
    const uint8_t *active = f->active + (size_t)part * (size_t)f->tiles;
    for (int y = first < f->from ? f->from : first; y < end && y < f->to; y++) {
        const int row = txp_field_row(f, y);
        if (row < 0) continue;
        const int is_open = !f->closed, last = h - 1;
        int up = y > 0 ? y - 1 : is_open ? -1 : last, down = y < last ? y + 1 : is_open ? -1 : 0;
        if (up >= 0 && txp_field_row(f, up) < 0) up = -1;
        if (down >= 0 && txp_field_row(f, down) < 0) down = -1;
        const uint8_t *fixed = f->canvas->fixed ? f->canvas->fixed + txp_index(f->canvas, 0, row) : NULL;
        for (int x = (y + f->colour) % 2; x < w; x += 2) {
            const size_t i = (size_t)y * (size_t)w + (size_t)x;
            if (!active[x / TXP_TILE]) {
                x += TXP_TILE - 2; /* the next tile */
                continue;
            }
            if (fixed && fixed[x]) continue;
            const int left = x > 0 ? x - 1 : wraps ? w - 1 : -1;
            const int right = x + 1 < w ? x + 1 : wraps ? 0 : -1;
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

/* One sweep over the pixels of one colour in rows from..to-1. Where a torus has an odd number of rows,
   the first and the last have one colour: not at a time. */
static void txp_relax_field(txp_field *f, int from, int to, int colour, txm_env *env) {
    const int tile = TXP_TILE_ROWS, parts = (to + tile - 1) / tile - from / tile;
    const int alone = f->closed && f->height % 2;
    f->from = from;
    f->to = to;
    f->colour = colour;
    txm_parallel_for(env, parts - alone, txp_relax_rows, f);
    if (alone) txp_relax_rows(f, parts - 1);
}

/* Allocate a field over so many rows of a canvas. arena->failed: no memory. */
static void txp_field_make(txp_field *f, const txp_canvas *c, int height, int lanes, double screen,
                           txm_arena *arena) {
    const size_t width = (size_t)c->width, pixels = width * (size_t)height;
    const size_t rows = (size_t)(height + TXP_TILE_ROWS - 1) / TXP_TILE_ROWS;
    f->canvas = c;
    f->height = height;
    f->closed = height == c->height && c->wrap & TEXPATCH_TILE_Y;
    f->lanes = lanes;
    for (int i = 0; i <= 4 * 255; i++) f->scale[i] = txm_float(1 / (i + 255 * screen));
    f->value = (float *)txm_arena_zero(arena, pixels, (size_t)lanes * sizeof(float));
    f->jump = (int16_t *)txm_arena_zero(arena, pixels + width, (size_t)lanes * sizeof(int16_t));
    f->pull[0] = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    f->pull[1] = (uint8_t *)txm_arena_zero(arena, pixels, 1);
    f->tiles = (c->width + TXP_TILE - 1) / TXP_TILE;
    f->active = (uint8_t *)txm_arena_zero(arena, (size_t)f->tiles, rows + 1);
}

/* Go on to later rows: what is known of the last rows becomes that of the first, the rest is none. */
static void txp_field_move(txp_field *f, int rows) {
    const size_t width = (size_t)f->canvas->width, tiles = (size_t)f->tiles;
    const size_t stay = (size_t)(f->height - rows), gone = (size_t)rows;
    const size_t jumps = width * (size_t)f->lanes, tile_rows = (size_t)(f->height / TXP_TILE_ROWS);
    const size_t tiles_gone = gone / TXP_TILE_ROWS, tiles_stay = tile_rows - tiles_gone;
    TXM_ASSERT(rows % TXP_TILE_ROWS == 0 && f->height % TXP_TILE_ROWS == 0 && rows <= f->height);
    f->top += rows;
    for (int d = 0; d < 2; d++) {
        memmove(f->pull[d], f->pull[d] + width * gone, width * stay);
        memset(f->pull[d] + width * stay, 0, width * gone);
    }
    memmove(f->jump, f->jump + jumps * gone, jumps * (stay + 1) * sizeof *f->jump);
    memset(f->jump + jumps * (stay + 1), 0, jumps * gone * sizeof *f->jump);
    memmove(f->active, f->active + tiles * tiles_gone, tiles * (tiles_stay + 1));
    memset(f->active + tiles * (tiles_stay + 1), 0, tiles * tiles_gone);
    for (size_t i = 0; i < tiles * (tile_rows + 1); i++) f->active[i] &= 2;
    memset(f->value, 0, width * (size_t)f->height * (size_t)f->lanes * sizeof *f->value);
}

#endif /* TEXPATCH_RELAX_H */
