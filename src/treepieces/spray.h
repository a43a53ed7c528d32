#ifndef TREEPIECES_SPRAY_H
#define TREEPIECES_SPRAY_H

#include "bark.h"
#include "cloud.h"

/* ---- foliage: drawn leaves ----------------------------------------------------------------- */

/* A spray is a list of marks, painted in order. A sample takes the colour of the last mark that
   covers it, so that edges are antialiased without seams and rows are independent of each other.
   Lengths are in sides of the image, y points down. */
enum {
    TPC_TWIG = TREEPIECES_LEAF_COMPOUND + 1, /* shape of a mark: a tapering stroke */
    TPC_MARKS = 2048,
    TPC_SAMPLES = 4 /* per pixel, across and down */
};

typedef struct tpc_mark {
    int shape;               /* treepieces_leaf_shape, or TPC_TWIG */
    float from[2], along[2]; /* its base, and the vector from there to its tip */
    float width;             /* half of it over the length */
    float taper;             /* of a twig: width at its tip over that at its base */
    float bend;              /* of the midrib, over the length */
    float fold;              /* how much lighter one half is than the other */
    float low[2], high[2];   /* bounding box */
    float color[3], tip[3];  /* at the base and at the tip */
} tpc_mark;

typedef struct tpc_spray {
    const treepieces_species *species;
    tpc_mark *marks;
    int count, shape;
    txm_rng rng;
    txm_image out;
    int first_row;
} tpc_spray;

/* The growth habit of a spray, by leaf shape. */
typedef struct tpc_habit {
    int leaves, twigs, twig_leaves; /* on the stem; side twigs; leaves on each */
    float length, width;            /* of a leaf; half the width over the length */
    float petiole, angle, bend;     /* angle: degrees between leaf and stem */
} tpc_habit;

static const tpc_habit tpc_habits[] = {
    {13, 12, 9, 0.105f, 0.31f, 0.012f, 55, 0.08f}, {7, 7, 6, 0.20f, 0.34f, 0.01f, 55, 0.06f},
    {15, 6, 11, 0.20f, 0.085f, 0.02f, 38, 0.14f}, {8, 8, 8, 0.125f, 0.44f, 0.04f, 62, 0.06f},
    {0, 13, 0, 0.07f, 0.042f, 0, 50, 0.05f},      {15, 7, 9, 0.058f, 0.42f, 0.075f, 80, 0},
    {6, 7, 5, 0.19f, 0.19f, 0.05f, 62, 0.04f},    {5, 5, 3, 0.32f, 0.30f, 0.02f, 55, 0.08f},
};

/* Half the width of a leaf at u of its length, over its maximum; side: 0..1 how far from the
   midrib. */
static float tpc_outline(int shape, float u, float side) {
    const float arc = 4 * u * (1 - u);
    float v, phase;
    switch (shape) {
    case TREEPIECES_LEAF_LOBED: /* lobes point to the tip */
        phase = 4.3f * (u - 0.14f * side) + 0.1f;
        v = 2 * (phase - floorf(phase)) - 1;
        return arc * (0.52f + 0.75f * u) * (0.4f + 0.64f * sqrtf(txm_maxf(0, 1 - v * v)));
    case TREEPIECES_LEAF_LANCE: return arc * (1.15f - 0.3f * u);
    case TREEPIECES_LEAF_HEART: /* toothed */
        phase = 13 * u;
        return sqrtf(u) * (1 - u) * (2.9f - 1.1f * u) * (1 + 0.05f * (phase - floorf(phase)));
    case TREEPIECES_LEAF_NEEDLE: return txm_minf(1, 5 * (1 - u));
    case TREEPIECES_LEAF_BLOSSOM: /* a petal, notched */
        if (u > 0.93f + 0.14f * side) return 0;
        v = u * (0.45f + 0.55f * u);
        return 2 * sqrtf(v * (1 - v)) * txm_minf(1, 0.4f + 1.2f * u);
    default:
        v = u * (0.75f + 0.25f * u);
        phase = 16 * u;
        return 2.6f * sqrtf(v) * (1 - v) * (1 + 0.04f * (phase - floorf(phase)));
    }
}

/* The color of a leaf at u of its length and x across; half: half its width there. */
static void tpc_leaf_color(const tpc_mark *m, float u, float x, float half, float color[3]) {
    static const float veins[] = {9, 6, 11, 7}; /* by shape, of those before needles */
    const float across = x < 0 ? -x : x, edge = half > 0 ? across / half : 0;
    float shade = (x < 0 ? 1 - m->fold : 1 + m->fold) * (0.86f + 0.1f * u + 0.1f * edge), light = 0;
    if (m->shape < TREEPIECES_LEAF_NEEDLE) { /* side veins, and the bulges between them */
        const float phase = (u - 0.7f * across) * veins[m->shape] + 100;
        const float between = phase - floorf(phase), off = between < 0.5f ? between : 1 - between;
        shade *= 0.96f + 0.1f * between;
        light = txm_maxf(0.3f * tpc_fade(9 * off) * (1 - edge),
                         0.6f * tpc_fade(across / (0.03f * (1.15f - u))));
    } else if (m->shape == TREEPIECES_LEAF_NEEDLE) {
        light = 0.35f * tpc_fade(2 * edge);
    } else if (m->shape == TREEPIECES_LEAF_BLOSSOM) {
        const float phase = 5 * edge + 0.5f;
        shade = (x < 0 ? 1 - m->fold : 1 + m->fold) * (0.97f + 0.03f * (phase - floorf(phase)));
    }
    for (int k = 0; k < 3; k++) {
        const float own = txm_lerpf(m->color[k], m->tip[k], u) * shade;
        color[k] = txm_lerpf(own, 1.25f * own + 0.07f, light);
    }
}

/* Does the mark cover (x, y)? If so, color (may be NULL) receives its color there. */
static int tpc_mark_at(const tpc_mark *m, float x, float y, float color[3]) {
    if (x < m->low[0] || y < m->low[1] || x > m->high[0] || y > m->high[1]) return 0;
    const float dx = x - m->from[0], dy = y - m->from[1];
    const float square = m->along[0] * m->along[0] + m->along[1] * m->along[1];
    const float u = (dx * m->along[0] + dy * m->along[1]) / square;
    if (!(u > 0 && u < 1)) return 0;
    const float off = (m->along[0] * dy - m->along[1] * dx) / square - m->bend * 4 * u * (1 - u);
    const float across = off < 0 ? -off : off;
    if (m->shape == TPC_TWIG) {
        const float half = m->width * (1 + u * (m->taper - 1));
        if (across > half) return 0;
        for (int k = 0; color && k < 3; k++)
            color[k] = txm_lerpf(m->color[k], m->tip[k], u) * (1 - 0.35f * off / half);
        return 1;
    }
    if (across > 1.3f * m->width) return 0;
    const float half = m->width * tpc_outline(m->shape, u, across / m->width);
    if (across > half) return 0;
    if (color) tpc_leaf_color(m, u, off, half, color);
    return 1;
}

/* Color of the spray at (x, y), shadows of higher marks included; 0 if it is transparent there.
   Only the listed marks are tested. */
static int tpc_spray_at(const tpc_spray *s, const uint16_t *listed, int count, float x, float y,
                        float color[3]) {
    int is_shaded = 0;
    for (int i = count; i-- > 0;) {
        const tpc_mark *m = &s->marks[listed[i]];
        if (tpc_mark_at(m, x, y, color)) {
            for (int k = 0; k < 3; k++) color[k] *= is_shaded ? 0.66f : 1;
            return 1;
        }
        is_shaded = is_shaded || tpc_mark_at(m, x - 0.008f, y - 0.014f, NULL);
    }
    return 0;
}

/* List the marks in `from` that, with their shadows, overlap low..high along an axis. */
static int tpc_list_marks(const tpc_spray *s, const uint16_t *from, int count, int axis, float low,
                          float high, uint16_t *listed) {
    int kept = 0;
    for (int i = 0; i < count; i++) {
        const tpc_mark *m = &s->marks[from[i]];
        if (m->low[axis] <= high && m->high[axis] + 0.02f >= low) listed[kept++] = from[i];
    }
    return kept;
}

static void tpc_draw_row(void *context, int index) {
    enum { BLOCK = 16 }; /* pixels */
    const tpc_spray *s = (const tpc_spray *)context;
    const int y = s->first_row + index;
    const float step = 1.0f / (float)TPC_SAMPLES;
    const float width = (float)s->out.width, height = (float)s->out.height;
    uint16_t in_row[TPC_MARKS], listed[TPC_MARKS];
    int count = 0;
    for (int i = 0; i < s->count; i++) in_row[i] = (uint16_t)i;
    const int row_count = tpc_list_marks(s, in_row, s->count, 1, (float)y / height,
                                         (float)(y + 1) / height, in_row);
    for (int x = 0; x < s->out.width; x++) {
        if (x % BLOCK == 0)
            count = tpc_list_marks(s, in_row, row_count, 0, (float)x / width,
                                   (float)(x + BLOCK) / width, listed);
        float sum[3] = {0, 0, 0}, color[3];
        int covered = 0;
        for (int k = 0; k < TPC_SAMPLES * TPC_SAMPLES; k++) {
            const int column = k % TPC_SAMPLES, row = k / TPC_SAMPLES;
            const float at_x = ((float)x + ((float)column + 0.5f) * step) / width;
            const float at_y = ((float)y + ((float)row + 0.5f) * step) / height;
            if (!tpc_spray_at(s, listed, count, at_x, at_y, color)) continue;
            for (int c = 0; c < 3; c++) sum[c] += color[c];
            covered++;
        }
        for (int c = 0; c < 3; c++)
            txm_image_set(&s->out, x, y, c, covered ? sum[c] / (float)covered : 0);
        txm_image_set(&s->out, x, y, 3, (float)covered / (TPC_SAMPLES * TPC_SAMPLES));
    }
}

/* Add a mark from a to b of half width `half`; NULL if there are too many, or if it has no length. */
static tpc_mark *tpc_add_mark(tpc_spray *s, int shape, const float a[2], const float b[2],
                              float half, float bend, const float color[3]) {
    const float dx = b[0] - a[0], dy = b[1] - a[1], length = sqrtf(dx * dx + dy * dy);
    if (s->count == TPC_MARKS || !(length > 1e-4f)) return NULL;
    tpc_mark *m = &s->marks[s->count++];
    const float room = 1.3f * half + (bend < 0 ? -bend : bend) * length;
    memset(m, 0, sizeof *m);
    m->shape = shape;
    m->width = half / length;
    m->taper = 1;
    m->bend = bend;
    for (int k = 0; k < 2; k++) {
        m->from[k] = a[k];
        m->along[k] = b[k] - a[k];
        m->low[k] = txm_minf(a[k], b[k]) - room;
        m->high[k] = txm_maxf(a[k], b[k]) + room;
    }
    for (int k = 0; k < 3; k++) m->color[k] = m->tip[k] = color[k];
    return m;
}

/* b = the point at distance `length` from a in the direction of `heading` (unit length) rotated by
   `degrees`, kept away from the border by `margin`. */
static void tpc_advance(const float a[2], const float heading[2], float degrees, float length,
                   float margin, float b[2]) {
    double sine, cosine;
    txm_sincos((double)degrees * (TXM_PI / 180), &sine, &cosine);
    const float x = heading[0] * (float)cosine - heading[1] * (float)sine;
    const float y = heading[0] * (float)sine + heading[1] * (float)cosine;
    b[0] = txm_clampf(a[0] + length * x, margin, 1 - margin);
    b[1] = txm_clampf(a[1] + length * y, margin, 1 - margin);
}

/* The base color made a little lighter or darker, yellower or bluer, at random. */
static void tpc_vary_color(tpc_spray *s, const float base[3], float color[3]) {
    const float light = 1 + 0.18f * tpc_signed(&s->rng), warm = 0.12f * tpc_signed(&s->rng);
    color[0] = base[0] * light * (1 + warm);
    color[1] = base[1] * light;
    color[2] = base[2] * light * (1 - 1.5f * warm);
}

/* A bent stem or twig. */
typedef struct tpc_stem {
    float from[2], to[2], bend;
} tpc_stem;

/* The point and the direction at s of the length of a stem. */
static void tpc_stem_at(const tpc_stem *t, float s, float at[2], float heading[2]) {
    const float dx = t->to[0] - t->from[0], dy = t->to[1] - t->from[1];
    const float arc = t->bend * 4 * s * (1 - s), slope = t->bend * 4 * (1 - 2 * s);
    at[0] = t->from[0] + s * dx - arc * dy;
    at[1] = t->from[1] + s * dy + arc * dx;
    heading[0] = dx - slope * dy;
    heading[1] = dy + slope * dx;
    const float length = txm_maxf(sqrtf(heading[0] * heading[0] + heading[1] * heading[1]), 1e-6f);
    heading[0] /= length;
    heading[1] /= length;
}

/* Add a stem as a chain of twig marks. */
static void tpc_add_stem(tpc_spray *s, const tpc_stem *stem, float half, float half_at_end) {
    const int parts = 8, is_blossom = s->shape == TREEPIECES_LEAF_BLOSSOM;
    float color[3], green[3];
    for (int k = 0; k < 3; k++) {
        const float leaf = is_blossom ? 0.35f : 0.75f * s->species->leaf_color[k];
        color[k] = 0.85f * s->species->bark_color[k];
        if (s->species->bark_color[0] > 0.6f) color[k] *= 0.55f; /* twigs of birches are brown */
        green[k] = 0.5f * color[k] + 0.5f * leaf;
    }
    for (int i = 0; i < parts; i++) {
        float a[2], b[2], heading[2];
        const float u = (float)i / (float)parts, v = u + 1.15f / (float)parts; /* overlap */
        tpc_stem_at(stem, u, a, heading);
        tpc_stem_at(stem, txm_minf(v, 1), b, heading);
        const float foot = txm_lerpf(half, half_at_end, u), top = txm_lerpf(half, half_at_end, v);
        tpc_mark *m = tpc_add_mark(s, TPC_TWIG, a, b, foot, 0, color);
        if (!m) return;
        m->taper = top / foot;
        for (int k = 0; k < 3; k++) {
            m->color[k] = txm_lerpf(color[k], green[k], u);
            m->tip[k] = txm_lerpf(color[k], green[k], txm_minf(v, 1));
        }
    }
}

/* Add one blade of a leaf; NULL as of tpc_add_mark. */
static tpc_mark *tpc_add_blade(tpc_spray *s, int outline, const float foot[2], const float heading[2],
                               float degrees, float length, float wide, const float color[3]) {
    const tpc_habit *habit = &tpc_habits[s->shape];
    const float half = length * wide, bend = habit->bend * tpc_signed(&s->rng);
    float tip[2];
    tpc_advance(foot, heading, degrees, length, 0.015f + 0.75f * half, tip);
    tpc_mark *blade = tpc_add_mark(s, outline, foot, tip, half, bend, color);
    if (!blade) return NULL;
    blade->fold = 0.09f * tpc_signed(&s->rng);
    for (int k = 0; k < 3; k++) blade->tip[k] = color[k] * (k == 2 ? 1.0f : 1.08f);
    return blade;
}

/* A palmate leaf: five lobes from one point, the middle one last, on top. */
static void tpc_add_lobes(tpc_spray *s, const float foot[2], const float heading[2], float degrees,
                          float length, const float color[3]) {
    static const float angles[] = {-88, 88, -42, 42, 0}, lengths[] = {0.55f, 0.55f, 0.85f, 0.85f, 1};
    for (int i = 0; i < 5; i++)
        tpc_add_blade(s, TREEPIECES_LEAF_OVAL, foot, heading, degrees + angles[i],
                      lengths[i] * length, tpc_habits[s->shape].width, color);
}

/* A compound leaf: pairs of leaflets on a stalk, and one at its end. */
static void tpc_add_leaflets(tpc_spray *s, const float foot[2], const float heading[2], float degrees,
                             float length, const float color[3]) {
    enum { PAIRS = 4 };
    const float leaflet = 0.36f * length, wide = tpc_habits[s->shape].width;
    float end[2], at[2];
    tpc_advance(foot, heading, degrees, length - leaflet, 0.05f, end);
    tpc_mark *stalk = tpc_add_mark(s, TPC_TWIG, foot, end, 0.003f, 0, color);
    if (stalk) stalk->taper = 0.6f;
    for (int i = 0; i < 2 * PAIRS; i++) {
        const int pair = i / 2;
        const float along = 0.25f + 0.7f * (float)pair / (float)(PAIRS - 1);
        for (int k = 0; k < 2; k++) at[k] = txm_lerpf(foot[k], end[k], along);
        tpc_add_blade(s, TREEPIECES_LEAF_OVAL, at, heading, degrees + (i % 2 ? -55.0f : 55.0f), leaflet,
                      wide, color);
    }
    tpc_add_blade(s, TREEPIECES_LEAF_OVAL, end, heading, degrees, leaflet, wide, color);
}

/* Add a leaf with its petiole, seen roughly from above. */
static void tpc_add_leaf(tpc_spray *s, int shape, const float at[2], const float heading[2],
                         float degrees, float size, const float base[3]) {
    const tpc_habit *habit = &tpc_habits[shape];
    float foot[2], color[3];
    const float length = habit->length * size * (0.85f + 0.3f * txm_rng_float(&s->rng));
    const float wide = habit->width * (0.72f + 0.34f * txm_rng_float(&s->rng));
    tpc_vary_color(s, base, color);
    tpc_advance(at, heading, degrees, habit->petiole * size + 0.01f, 0.01f, foot);
    tpc_mark *stalk = tpc_add_mark(s, TPC_TWIG, at, foot, 0.003f, 0, color);
    if (stalk) stalk->taper = 0.7f;
    const float lean = 8 * tpc_signed(&s->rng);
    if (shape == TREEPIECES_LEAF_PALMATE)
        tpc_add_lobes(s, foot, heading, degrees + lean, length, color);
    else if (shape == TREEPIECES_LEAF_COMPOUND)
        tpc_add_leaflets(s, foot, heading, degrees + lean, length, color);
    else tpc_add_blade(s, shape, foot, heading, degrees + lean, length, wide, color);
}

/* Add a flower: five petals and the stamens, seen obliquely. */
static void tpc_add_flower(tpc_spray *s, const float at[2], float radius) {
    static const float white[3] = {1, 0.97f, 0.975f}, anther[3] = {0.85f, 0.62f, 0.25f};
    static const float up[2] = {0, -1};
    const float turn = 72 * txm_rng_float(&s->rng), lean = 180 * txm_rng_float(&s->rng);
    const float *tint = s->species->leaf_color;
    const float deep[3] = {0.9f * tint[0], 0.66f * tint[1], 0.76f * tint[2]};
    const float squash = 0.35f * txm_rng_float(&s->rng);
    for (int i = 0; i < 5; i++) {
        double sine, cosine;
        float tip[2], foot[2];
        const float angle = turn + 72 * (float)i + 5 * tpc_signed(&s->rng);
        txm_sincos((double)(angle - lean) * (TXM_PI / 180), &sine, &cosine);
        const float length = radius * (1 - squash * (float)(cosine * cosine));
        const float half = 0.46f * radius * (1 - squash * (float)(sine * sine));
        tpc_advance(at, up, angle, 0.08f * radius, 0.01f, foot);
        tpc_advance(at, up, angle, length, 0.01f, tip);
        tpc_mark *petal = tpc_add_mark(s, TREEPIECES_LEAF_BLOSSOM, foot, tip, half, 0, deep);
        if (!petal) return;
        const float paler = 0.45f + 0.35f * txm_rng_float(&s->rng);
        petal->fold = 0.03f * tpc_signed(&s->rng);
        for (int k = 0; k < 3; k++) {
            petal->tip[k] = txm_lerpf(tint[k], white[k], paler);
            petal->color[k] = txm_lerpf(deep[k], petal->tip[k], 0.4f);
        }
    }
    for (int i = 0; i < 5; i++) {
        const float angle = 72 * (float)i + 15 * tpc_signed(&s->rng);
        float tip[2], top[2];
        tpc_advance(at, up, angle, radius * (0.2f + 0.2f * txm_rng_float(&s->rng)), 0.01f, tip);
        tpc_advance(tip, up, angle, 0.07f * radius, 0.01f, top);
        tpc_add_mark(s, TPC_TWIG, at, tip, 0.014f * radius, 0, deep);
        tpc_add_mark(s, TPC_TWIG, tip, top, 0.04f * radius, 0, anther);
    }
}

/* Add the leaves or flowers of a twig: on alternate sides, and one at the end. */
static void tpc_add_foliage(tpc_spray *s, const tpc_stem *stem, int count, float first,
                            float size) {
    static const float young[3] = {0.42f, 0.55f, 0.2f};
    const tpc_habit *habit = &tpc_habits[s->shape];
    float side = txm_rng_float(&s->rng) < 0.5f ? -1.0f : 1.0f;
    for (int i = 0; i < count; i++, side = -side) {
        const int is_last = i == count - 1;
        const float along = count > 1 ? first + (1 - first) * (float)i / (float)(count - 1) : 1;
        const float turn = is_last ? 0 : side * habit->angle * (1.1f - 0.4f * along);
        const float angle = turn + 8 * tpc_signed(&s->rng);
        float at[2], heading[2], middle[2];
        tpc_stem_at(stem, along, at, heading);
        if (s->shape != TREEPIECES_LEAF_BLOSSOM) {
            tpc_add_leaf(s, s->shape, at, heading, angle, size * (1.05f - 0.3f * along * along),
                         s->species->leaf_color);
            continue;
        }
        if (is_last || txm_rng_float(&s->rng) < 0.35f)
            tpc_add_leaf(s, TREEPIECES_LEAF_LANCE, at, heading, -0.6f * angle, 0.4f, young);
        const float around = 180 * tpc_signed(&s->rng), off = sqrtf(txm_rng_float(&s->rng));
        tpc_advance(at, heading, around, off * habit->petiole, 0.09f, middle);
        tpc_add_flower(s, middle, habit->length * (0.85f + 0.25f * txm_rng_float(&s->rng)));
    }
}

/* Add needles all round a shoot, those at its tip forwards. long_by: their length over the usual. They
   are so dense that smaller pictures of them do not vanish. */
static void tpc_add_needles(tpc_spray *s, const tpc_stem *stem, float first, float long_by) {
    const tpc_habit *habit = &tpc_habits[TREEPIECES_LEAF_NEEDLE];
    const float dx = stem->to[0] - stem->from[0], dy = stem->to[1] - stem->from[1];
    const float covered = (1 - first) * sqrtf(dx * dx + dy * dy);
    const int count = (int)(covered / (0.0024f + 0.0016f * long_by)) + 4;
    for (int i = 0; i < count; i++) {
        const float along = first + (1 - first) * (float)i / (float)(count - 1);
        const float spread = i % 5 == 4 ? 0.5f * tpc_signed(&s->rng) : i % 2 ? 1.0f : -1.0f;
        const float angle = spread * habit->angle * (1.1f - 0.75f * along * along);
        const float length = long_by * habit->length * (0.7f + 0.45f * txm_rng_float(&s->rng));
        float at[2], heading[2], tip[2], color[3];
        tpc_stem_at(stem, along, at, heading);
        tpc_vary_color(s, s->species->leaf_color, color);
        tpc_advance(at, heading, angle + 9 * tpc_signed(&s->rng), length, 0.01f, tip);
        tpc_mark *m = tpc_add_mark(s, TREEPIECES_LEAF_NEEDLE, at, tip, habit->width * habit->length,
                                   habit->bend * tpc_signed(&s->rng), color);
        for (int k = 0; m && k < 3; k++) {
            m->color[k] = 0.75f * color[k];
            m->tip[k] = 1.2f * color[k] + 0.01f;
        }
    }
}

/* A spray of needles: thin shoots with gaps between them. Of pines there are few, from the foot of the
   spray, with long needles; of others they stand along a stem, and are the shorter the higher. */
static void tpc_make_shoots(tpc_spray *s) {
    const int is_tuft = s->species->cloud_kind == TREEPIECES_CLOUD_SHOOTS;
    const int twigs = is_tuft ? 6 : tpc_habits[TREEPIECES_LEAF_NEEDLE].twigs;
    const float long_by = is_tuft ? 2.6f : 1;
    tpc_stem stem = {{0.5f, 1}, {0.5f, is_tuft ? 0.17f : 0.07f}, 0};
    stem.to[0] += 0.06f * tpc_signed(&s->rng);
    stem.bend = 0.05f * tpc_signed(&s->rng);
    tpc_add_stem(s, &stem, 0.008f, 0.003f);
    for (int i = 0; i < twigs; i++) {
        const float along = (is_tuft ? 0.25f : 0.04f) + (is_tuft ? 0.4f : 0.8f) * (float)i / (float)twigs;
        const float side = i % 2 ? -1.0f : 1.0f;
        const float length = (is_tuft ? 0.36f : 0.34f * (1.02f - 0.7f * along)) *
                             (0.8f + 0.35f * txm_rng_float(&s->rng));
        const float angle = side * (is_tuft ? 50 - 45 * along : 44 - 10 * along) + 7 * tpc_signed(&s->rng);
        tpc_stem twig;
        float heading[2];
        tpc_stem_at(&stem, along, twig.from, heading);
        tpc_advance(twig.from, heading, angle, length, 0.07f * long_by, twig.to);
        twig.bend = -0.07f * side;
        tpc_add_stem(s, &twig, 0.005f, 0.002f);
        tpc_add_needles(s, &twig, is_tuft ? 0.35f : 0.06f, long_by);
    }
    tpc_add_needles(s, &stem, is_tuft ? 0.5f : 0.03f, long_by);
}

/* A spray for hanging strips: long shoots side by side, of different lengths. */
static void tpc_make_strips(tpc_spray *s) {
    enum { SHOOTS = 6, LEAVES = 20 };
    for (int i = 0; i < SHOOTS; i++) {
        const float x = ((float)i + 0.5f + 0.3f * tpc_signed(&s->rng)) / (float)SHOOTS;
        tpc_stem stem = {{0, 1}, {0, 0}, 0};
        stem.from[0] = 0.5f + 0.86f * (x - 0.5f);
        stem.to[0] = txm_clampf(stem.from[0] + 0.06f * tpc_signed(&s->rng), 0.08f, 0.92f);
        stem.to[1] = 0.08f + 0.4f * txm_rng_float(&s->rng) * txm_rng_float(&s->rng);
        stem.bend = 0.025f * tpc_signed(&s->rng);
        tpc_add_stem(s, &stem, 0.006f, 0.002f);
        tpc_add_foliage(s, &stem, LEAVES, 0.02f, 0.85f);
    }
}

/* A spray for all other clouds: a stem upwards from the middle of the lower side, twigs on both
   sides. */
static void tpc_make_spray(tpc_spray *s) {
    const tpc_habit *habit = &tpc_habits[s->shape];
    tpc_stem stem = {{0.5f, 1}, {0.5f, 0}, 0};
    stem.to[0] += 0.06f * tpc_signed(&s->rng);
    stem.to[1] = 0.97f * habit->length + 0.03f;
    stem.bend = 0.05f * tpc_signed(&s->rng);
    tpc_add_stem(s, &stem, 0.010f, 0.003f);
    for (int i = 0; i < habit->twigs; i++) {
        const float along = 0.05f + 0.75f * (float)i / (float)habit->twigs;
        const float side = i % 2 ? -1.0f : 1.0f, length = 0.52f * (1.05f - 0.6f * along);
        const float angle = side * (66 - 24 * along) + 5 * tpc_signed(&s->rng);
        tpc_stem twig;
        float heading[2];
        tpc_stem_at(&stem, along, twig.from, heading);
        tpc_advance(twig.from, heading, angle, length, 0.12f, twig.to);
        twig.bend = -0.08f * side;
        tpc_add_stem(s, &twig, 0.006f, 0.0025f);
        tpc_add_foliage(s, &twig, habit->twig_leaves, 0.25f, 0.85f);
    }
    tpc_add_foliage(s, &stem, habit->leaves, 0.14f, 0.88f);
}

TREEPIECES_API txm_status treepieces_draw_leaves(const treepieces_species *species, uint64_t seed,
                                                 txm_env *env, txm_image out) {
    enum { ROWS = 64 }; /* between two progress reports */
    tpc_spray spray;
    if (!species) return txm_fail(env, TXM_BAD_ARGUMENT, "species is NULL");
    txm_status status = txm_image_check(&out, "out", 0, env);
    if (status != TXM_OK) return status;
    if (out.channels != 4 || out.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out must have 4 channels of 8 bits");
    txm_arena arena;
    txm_arena_init(&arena, env);
    memset(&spray, 0, sizeof spray);
    out = txm_image_resolve(out);
    spray.marks = (tpc_mark *)txm_arena_alloc(&arena, TPC_MARKS, sizeof *spray.marks);
    status = spray.marks ? tpc_new_picture(&out, &arena, env, &spray.out)
                         : txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the leaves");
    spray.species = species;
    spray.shape = txm_clampi(species->leaf_shape, 0, TREEPIECES_LEAF_COMPOUND);
    spray.rng = txm_rng_make(seed, 0x59a7);
    if (status == TXM_OK && spray.shape == TREEPIECES_LEAF_NEEDLE) tpc_make_shoots(&spray);
    else if (status == TXM_OK && species->cloud_kind == TREEPIECES_CLOUD_STRIPS)
        tpc_make_strips(&spray);
    else if (status == TXM_OK) tpc_make_spray(&spray);
    for (int y = 0; y < out.height && status == TXM_OK; y += ROWS) {
        spray.first_row = y;
        if (txm_progress(env, (float)y / (float)out.height, "leaves"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
        else txm_parallel_for(env, txm_clampi(out.height - y, 0, ROWS), tpc_draw_row, &spray);
    }
    if (status == TXM_OK) status = tpc_deliver(&spray.out, &out, env);
    txm_arena_free(&arena);
    return status;
}

#endif /* TREEPIECES_SPRAY_H */
