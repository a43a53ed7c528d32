/* soupkit.h - meshes of all kinds for the fuzz programs, as people have them and as nobody should
   SPDX-License-Identifier: MIT OR Unlicense

   A soup is made of one to three pieces: sheets, boxes, balls, rings, moebius bands, crossed cards, fans
   of huge valence, pages of a book, needles, stairs of T-junctions, anything. Then it is spoilt: faces
   doubled, turned, dropped, vertices doubled, merged, moved, numbers that are none, scales.       */
#ifndef SOUPKIT_H
#define SOUPKIT_H

#include "fuzzkit.h"

enum { MOST_VERTICES = 2400, MOST_FACES = 1600 };

typedef struct soup {
    float positions[3 * MOST_VERTICES];
    uint32_t indices[3 * MOST_FACES];
    size_t vertices, faces;
} soup;

/* Without room for more it says again what was said last. */
static inline uint32_t add_point(soup *m, float x, float y, float z) {
    if (m->vertices == MOST_VERTICES) return MOST_VERTICES - 1;
    float *p = m->positions + 3 * m->vertices;
    p[0] = x;
    p[1] = y;
    p[2] = z;
    return (uint32_t)m->vertices++;
}

static inline void add_triangle(soup *m, uint32_t a, uint32_t b, uint32_t c) {
    if (m->faces == MOST_FACES) return;
    uint32_t *f = m->indices + 3 * m->faces++;
    f[0] = a;
    f[1] = b;
    f[2] = c;
}

static inline void add_quad(soup *m, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    add_triangle(m, a, b, c);
    add_triangle(m, a, c, d);
}

/* ---- pieces --------------------------------------------------------------------------------- */

/* What a point of a square is on a bent sheet: tube, ring, ball or moebius band for some bends. */
static inline void bend(int kind, float u, float v, float p[3]) {
    const float turn = 6.2831853f, a = turn * u, b = turn * v;
    if (kind == 0) p[0] = u, p[1] = v, p[2] = 0;
    else if (kind == 1) p[0] = u, p[1] = v, p[2] = 0.3f * sinf(9 * u) * cosf(7 * v);
    else if (kind == 2) p[0] = cosf(a), p[1] = sinf(a), p[2] = 2 * v;
    else if (kind == 3) p[0] = cosf(a) * (1 + 0.4f * cosf(b)), p[1] = sinf(a) * (1 + 0.4f * cosf(b)), p[2] = 0.4f * sinf(b);
    else if (kind == 4) p[0] = cosf(a) * sinf(b / 2), p[1] = sinf(a) * sinf(b / 2), p[2] = cosf(b / 2);
    else {
        const float r = 1 + (v - 0.5f) * cosf(a / 2);
        p[0] = r * cosf(a), p[1] = r * sinf(a), p[2] = (v - 0.5f) * sinf(a / 2);
    }
}

/* A sheet of n x m squares, some of them holes; closed by equal places, which the weld finds. */
static inline void add_sheet_of(soup *s, source *b, int kind, int n, int m) {
    const uint32_t first = (uint32_t)s->vertices, row = (uint32_t)n + 1;
    const int holes = pick(b, 3) ? 0 : 2 + pick(b, 9);
    for (int j = 0; j <= m; j++)
        for (int i = 0; i <= n; i++) {
            float p[3];
            const int around = kind > 1, twice = kind == 3, flip = kind == 5 && i == n;
            const int k = around && i == n ? 0 : i, l = flip ? m - j : twice && j == m ? 0 : j;
            bend(kind, (float)k / (float)n, (float)l / (float)m, p);
            add_point(s, p[0], p[1], p[2]);
        }
    for (int k = 0; k < n * m; k++) {
        const uint32_t a = first + (uint32_t)(k / n) * row + (uint32_t)(k % n);
        if (holes && pick(b, holes) == 0) continue;
        add_quad(s, a, a + 1, a + row + 1, a + row);
    }
}

static inline void add_box(soup *m, source *b) {
    const float x = 0.25f * (float)pick(b, 5), y = 0.25f * (float)pick(b, 5), z = 0.25f * (float)pick(b, 3);
    const float w = 0.5f + (float)pick(b, 3), h = pick(b, 6) ? 1.0f : 0.001f;
    static const uint8_t side[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    const uint32_t first = (uint32_t)m->vertices;
    for (int k = 0; k < 8; k++)
        add_point(m, x + w * (float)(k & 1), y + w * (float)(k >> 1 & 1), z + h * (float)(k >> 2));
    for (int k = 0; k < 6; k++)
        add_quad(m, first + side[k][0], first + side[k][1], first + side[k][2], first + side[k][3]);
}

/* Cards that cross in one line, or grow out of it: exactly symmetric ones, too. */
static inline void add_cards(soup *m, source *b) {
    const int cards = 2 + pick(b, 5), from_axis = pick(b, 3) == 0, parts = 1 + pick(b, 3);
    const float start = pick(b, 2) ? 0 : unit(b), shift = pick(b, 4) ? 0 : 0.2f * unit(b);
    for (int k = 0; k < cards; k++) {
        const float turn = (from_axis ? 6.2831853f : 3.1415927f), a = start + turn * (float)k / (float)cards;
        const float c = pick(b, 8) && cards == 2 && start == 0 ? (float)(k == 0) : cosf(a);
        const float s = cards == 2 && start == 0 ? (float)(k == 1) : sinf(a), l = from_axis ? 0 : -1;
        uint32_t last[2] = {0, 0};
        for (int j = 0; j <= parts; j++) {
            const float z = (float)j / (float)parts;
            const uint32_t p = add_point(m, l * c + shift, l * s, z), q = add_point(m, c + shift, s, z);
            if (j) add_quad(m, last[0], last[1], q, p);
            last[0] = p;
            last[1] = q;
        }
    }
}

/* A vertex of huge valence; with two tips a closed bipyramid, with turns it goes round several times. */
static inline void add_fan(soup *m, source *b) {
    const int spokes = 3 + pick(b, pick(b, 3) ? 40 : 400), tips = 1 + pick(b, 3), turns = 1 + pick(b, 4) / 3;
    const uint32_t tip = add_point(m, 0, 0, 0.5f), low = add_point(m, 0, 0, -0.5f);
    const uint32_t first = (uint32_t)m->vertices;
    for (int k = 0; k < spokes; k++) {
        const float a = 6.2831853f * (float)(turns * k) / (float)spokes;
        add_point(m, cosf(a), sinf(a), 0);
    }
    for (int k = 0; k < spokes; k++) {
        const uint32_t p = first + (uint32_t)k, q = first + (uint32_t)((k + 1) % spokes);
        if (tips == 3 && pick(b, 5) == 0) continue;
        add_triangle(m, tip, p, q);
        if (tips == 2) add_triangle(m, low, q, p);
    }
}

/* Pages that share one edge, with one number or with one place. */
static inline void add_book(soup *m, source *b) {
    const int pages = 1 + pick(b, 9), shared = pick(b, 2), flat = pick(b, 4) == 0;
    uint32_t p = add_point(m, 0, 0, 0), q = add_point(m, 0, 0, 1);
    for (int k = 0; k < pages; k++) {
        const float a = flat ? 0.7f * (float)(k % 2) : 6.2831853f * (float)k / (float)pages;
        const uint32_t r = add_point(m, cosf(a), sinf(a), pick(b, 2) ? 0 : 1), t = add_point(m, cosf(a), sinf(a), 2);
        if (!shared) {
            p = add_point(m, 0, 0, 0);
            q = add_point(m, 0, 0, 1);
        }
        if (pick(b, 2)) add_triangle(m, p, q, r);
        else add_triangle(m, q, p, r);
        if (pick(b, 3) == 0) add_triangle(m, q, r, t);
    }
}

/* Long triangles beside each other, flat ones, and sides that are divided on one side only. */
static inline void add_needles(soup *m, source *b) {
    const int count = 1 + pick(b, 20), divided = pick(b, 2);
    const float width = pick(b, 2) ? 1e-3f : 1e-7f;
    const uint32_t a = add_point(m, 0, 0, 0), c = add_point(m, 1, 0, 0);
    uint32_t last = a;
    add_triangle(m, a, add_point(m, 0.5f, -1, 0), c);
    for (int k = 1; k <= count; k++) {
        const float t = (float)k / (float)count;
        const uint32_t at = k == count ? c : add_point(m, t, divided ? 0 : width * unit(b), 0);
        add_triangle(m, last, at, add_point(m, t, 1, 0));
        if (divided && pick(b, 2)) add_triangle(m, last, at, at);
        last = at;
    }
}

static inline void add_anything(soup *m, source *b) {
    const uint32_t first = (uint32_t)m->vertices;
    const int points = 3 + pick(b, 40), faces = 1 + pick(b, 120), grid = 2 + pick(b, 3), flat = pick(b, 5) == 0;
    for (int k = 0; k < points; k++)
        add_point(m, (float)pick(b, grid), (float)pick(b, grid), flat ? 0 : (float)pick(b, grid));
    for (int k = 0; k < faces; k++) {
        const uint32_t p = first + (uint32_t)pick(b, points), q = first + (uint32_t)pick(b, points);
        add_triangle(m, p, q, first + (uint32_t)pick(b, points));
    }
}

static inline void add_piece(soup *m, source *b) {
    const int most = pick(b, 3) ? 8 : 20;
    switch (pick(b, 12)) {
    case 0: add_box(m, b); break;
    case 1: add_cards(m, b); break;
    case 2: add_fan(m, b); break;
    case 3: add_book(m, b); break;
    case 4: add_needles(m, b); break;
    case 5: add_anything(m, b); break;
    default: {
        const int kind = pick(b, 6), n = 1 + pick(b, most), m_ = 1 + pick(b, most);
        add_sheet_of(m, b, kind, kind > 1 && n < 3 ? 3 : n, kind == 3 && m_ < 3 ? 3 : m_);
    }
    }
}

/* ---- spoiling --------------------------------------------------------------------------------- */

/* Every corner gets a vertex of its own, in one place with the others or nearly so. */
static inline void part_corners(soup *m, source *b) {
    static soup whole;
    const float gap = pick(b, 2) ? 0 : pick(b, 2) ? 1e-6f : 1e-4f;
    whole = *m;
    m->vertices = m->faces = 0;
    for (size_t f = 0; f < whole.faces && m->vertices + 3 <= MOST_VERTICES; f++) {
        uint32_t v[3];
        for (int k = 0; k < 3; k++) {
            const float *p = whole.positions + 3 * (whole.indices[3 * f + (size_t)k] % whole.vertices);
            v[k] = add_point(m, p[0] + gap * unit(b), p[1] + gap * unit(b), p[2] + gap * unit(b));
        }
        add_triangle(m, v[0], v[1], v[2]);
    }
}

/* Instances of the piece, turned by quarters: they cross themselves exactly, in edges and vertices. */
static inline void repeat_crossed(soup *m, source *b) {
    const size_t vertices = m->vertices, faces = m->faces;
    const int axis = pick(b, 3), moved = pick(b, 3);
    for (size_t v = 0; v < vertices; v++) {
        const float *p = m->positions + 3 * v, d = 0.5f * (float)moved;
        add_point(m, p[(axis + 1) % 3] + d, axis ? p[(axis + 2) % 3] : -p[2], p[axis]);
    }
    for (size_t f = 0; f < faces && m->vertices == 2 * vertices; f++) {
        const uint32_t *i = m->indices + 3 * f, n = (uint32_t)vertices;
        add_triangle(m, i[0] + n, i[1] + n, i[2] + n);
    }
}

static inline void spoil(soup *m, source *b) {
    static const float odd[8] = {NAN, INFINITY, -INFINITY, 1e20f, 3e38f, 1e-40f, -1e9f, 0};
    static const float scales[8] = {1e-30f, 1e-38f, 1e-6f, 1e6f, 1e18f, 1e38f, 0, -1};
    const int faces = (int)m->faces, vertices = (int)m->vertices, kind = pick(b, 28), times = 1 + pick(b, 12);
    if (faces == 0 || vertices == 0) return;
    if (kind == 0) part_corners(m, b);
    if (kind == 1) repeat_crossed(m, b);
    if (kind == 2) {
        const float scale = scales[pick(b, 8)];
        for (size_t i = 0; i < 3 * m->vertices; i++) m->positions[i] *= scale;
    }
    if (kind == 3)
        for (size_t i = 0; i < 3 * m->vertices; i++) m->positions[i] += (i % 3 + 1) * 1e5f;
    if (kind == 4)
        for (size_t i = 0; i < m->vertices; i++) m->positions[3 * i + (size_t)times % 3] *= 1e-3f;
    for (int k = 0; k < times; k++) {
        uint32_t *f = m->indices + 3 * (size_t)pick(b, faces), swap = f[0];
        float *p = m->positions + 3 * (size_t)pick(b, vertices) + pick(b, 3);
        switch (kind) {
        case 5: add_triangle(m, f[0], f[1], f[2]); break;
        case 6: add_triangle(m, f[1], f[0], f[2]); break;
        case 7: f[0] = f[1], f[1] = swap; break;
        case 8: memcpy(f, m->indices + 3 * --m->faces, 3 * sizeof *f); break;
        case 9: f[0] = f[1]; break;
        case 10: f[pick(b, 3)] = (uint32_t)pick(b, vertices); break;
        case 11: *p += 1e-5f; break;
        case 12: *p = 3 * unit(b); break;
        case 13: memcpy(m->positions + 3 * (size_t)pick(b, vertices), p - (p - m->positions) % 3, 3 * sizeof *p); break;
        case 14: add_triangle(m, f[0], f[1], add_point(m, unit(b), unit(b), unit(b))); break;
        case 15: add_point(m, pick(b, 2) ? 9 : NAN, 0, 0); break;
        case 16:
            if (k == 0) *p = odd[pick(b, 8)];
            break;
        case 17:
            if (k == 0) f[pick(b, 3)] = pick(b, 2) ? 0xffffffffu : (uint32_t)m->vertices;
            break;
        default: return;
        }
        if (m->faces == 0) return;
    }
}

/* A soup of some kind, spoilt or not. */
static inline void make_soup(soup *m, source *b) {
    memset(m, 0, sizeof *m);
    for (int k = 1 + pick(b, 6) / 3 + pick(b, 8) / 7; k > 0; k--) add_piece(m, b);
    for (int k = pick(b, 5); k > 0; k--) spoil(m, b);
}

/* A view of it, in blocks of its own, which end where the arrays end. */
static inline txm_mesh view_of(const soup *m, pool *p) {
    float *positions = (float *)(void *)take(p, 3 * m->vertices * sizeof *positions);
    uint32_t *indices = (uint32_t *)(void *)take(p, 3 * m->faces * sizeof *indices);
    txm_mesh view;
    memcpy(positions, m->positions, 3 * m->vertices * sizeof *positions);
    memcpy(indices, m->indices, 3 * m->faces * sizeof *indices);
    view.positions = positions;
    view.indices = indices;
    view.vertex_count = m->vertices;
    view.face_count = m->faces;
    view.corners = 0;
    return view;
}

#endif /* SOUPKIT_H */
