#ifndef TREEPIECES_LEAVES_H
#define TREEPIECES_LEAVES_H

#include "bake.h"
#include "bark.h"

/* ---- foliage: leaf clouds ------------------------------------------------------------------ */

/* -1..1 */
static float tpc_signed(txm_rng *rng) {
    return 2 * txm_rng_float(rng) - 1;
}

/* v to unit length; spare if it has none */
static void tpc_to_unit(float v[3], float spare_x, float spare_y, float spare_z) {
    const float length = sqrtf(tpc_dot(v, v));
    const float spare[3] = {spare_x, spare_y, spare_z};
    for (int k = 0; k < 3; k++) v[k] = length > 1e-6f ? v[k] / length : spare[k];
}

/* Turn a card so that its picture grows along `along` and shows its face to `facing` as well as it
   then can; outward: where the cloud's surface looks to. */
static void tpc_aim_card(treepieces_card *card, float along[3], float facing[3],
                         const float outward[3], float half) {
    tpc_to_unit(along, 1, 0, 0);
    const float share = tpc_dot(facing, along);
    for (int k = 0; k < 3; k++) facing[k] -= share * along[k];
    if (tpc_dot(facing, facing) < 1e-6f) { /* anything across will do */
        facing[0] = along[1];
        facing[1] = -along[0];
        facing[2] = 0;
    }
    tpc_to_unit(facing, 1, 0, 0);
    float right[3];
    tpc_cross(along, facing, right);
    for (int k = 0; k < 3; k++) {
        card->right[k] = half * right[k];
        card->up[k] = half * along[k];
        card->normal[k] = outward[k] + 0.6f * facing[k];
    }
    tpc_to_unit(card->normal, outward[0], outward[1], outward[2]);
}

/* Impostors show no more than the sphere: draw a card's center in until its corners lie inside. */
static void tpc_keep_inside(treepieces_card *card) {
    for (int step = 0; step < 64; step++) {
        float most = 0;
        for (int corner = 0; corner < 4; corner++) {
            float p[3];
            for (int k = 0; k < 3; k++)
                p[k] = card->center[k] + (corner & 1 ? card->right[k] : -card->right[k]) +
                       (corner & 2 ? card->up[k] : -card->up[k]);
            most = txm_maxf(most, tpc_dot(p, p));
        }
        if (!(most > 1)) return;
        for (int k = 0; k < 3; k++) card->center[k] *= 0.93f;
    }
}

/* Direction `index` of `count` spread evenly over the sphere, each a little off its place. */
static void tpc_spread(int index, int count, float phase, txm_rng *rng, float direction[3]) {
    double sine, cosine;
    const float jitter = 0.6f * tpc_signed(rng), off = 0.3f * tpc_signed(rng);
    const float y = txm_clampf(1 - (2 * (float)index + 1 + jitter) / (float)count, -1, 1);
    const float ring = sqrtf(1 - y * y);
    txm_sincos((double)phase + 2.399963229728653 * index + (double)off, &sine, &cosine);
    direction[0] = ring * (float)cosine;
    direction[1] = y;
    direction[2] = ring * (float)sine;
}

/* A place in the unit ball far from those that are taken: of some tries the best. So there are
   neither heaps nor holes, and most places lie towards the surface. */
static void tpc_far_place(const treepieces_card *cards, int taken, const float size[3],
                          txm_rng *rng, float place[3]) {
    enum { TRIES = 6 };
    float best = -1;
    for (int t = 0; t < TRIES;) {
        float p[3], room = 8;
        for (int k = 0; k < 3; k++) p[k] = tpc_signed(rng);
        if (tpc_dot(p, p) > 1) continue;
        t++;
        for (int i = 0; i < taken; i++) {
            float off[3];
            for (int k = 0; k < 3; k++) off[k] = cards[i].center[k] / size[k] - p[k];
            room = txm_minf(room, tpc_dot(off, off));
        }
        if (room <= best) continue;
        best = room;
        memcpy(place, p, sizeof p);
    }
}

/* Sprays of leaves, spread out and hanging as their kind does. */
static void tpc_leafy_card(const treepieces_species *species, treepieces_card *cards, int index,
                           const float scale[3], float half, txm_rng *rng) {
    const int is_lance = species->leaf_shape == TREEPIECES_LEAF_LANCE;
    const int is_blossom = species->leaf_shape == TREEPIECES_LEAF_BLOSSOM;
    const float droop = is_lance ? 1.2f : is_blossom ? 0 : 0.35f, loose = is_lance ? 0.3f : 0.8f;
    const float reach = txm_maxf(1 - half, 0.05f);
    const float size[3] = {reach * scale[0], reach * scale[1], reach * scale[2]};
    float place[3] = {0, 0, 0}, outward[3], along[3], facing[3];
    tpc_far_place(cards, index, size, rng, place);
    for (int k = 0; k < 3; k++) {
        cards[index].center[k] = size[k] * place[k];
        outward[k] = place[k] / scale[k];
    }
    tpc_to_unit(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) {
        along[k] = 0.45f * outward[k] + loose * tpc_signed(rng) - (k == 1 ? droop : 0);
        facing[k] = 0.7f * outward[k] + 0.7f * tpc_signed(rng) + (k == 1 ? 0.4f : 0);
    }
    tpc_aim_card(&cards[index], along, facing, outward, half);
}

/* Needles: cards one behind the other along twigs that radiate, crossed about them. */
static void tpc_needle_card(int index, int count, float phase, const float scale[3], float half,
                            txm_rng *rng, treepieces_card *card) {
    const float reach = txm_maxf(1 - half, 0);
    const float fit = 0.7f * reach / txm_maxf(half, 0.01f) + 0.95f; /* half overlapping */
    const int most = txm_clampi((int)txm_minf(fit, 4), 1, 4);
    const int twigs = (count + most - 1) / most, steps = (count + twigs - 1) / twigs;
    const int step = index / twigs;
    const float place = ((float)step + 0.5f + 0.5f * txm_rng_float(rng)) / (float)steps;
    const float roll = (float)((index % twigs + step) % 3 - 1);
    float along[3], facing[3], outward[3];
    tpc_spread(index % twigs, twigs, phase, rng, along);
    const float at = reach * (0.3f + 0.7f * place);
    for (int k = 0; k < 3; k++) along[k] *= scale[k];
    tpc_to_unit(along, 1, 0, 0);
    for (int k = 0; k < 3; k++) {
        card->center[k] = at * along[k];
        outward[k] = along[k] + (k == 1 ? 0.35f : 0);
    }
    tpc_to_unit(outward, 0, 1, 0);
    for (int k = 0; k < 3; k++) along[k] += 0.25f * tpc_signed(rng);
    /* across the twig, level */
    facing[0] = -1.2f * roll * along[2] + 0.2f * tpc_signed(rng);
    facing[1] = 1;
    facing[2] = 1.2f * roll * along[0] + 0.2f * tpc_signed(rng);
    tpc_aim_card(card, along, facing, outward, half);
}

TREEPIECES_API int treepieces_cloud(const treepieces_species *species, uint32_t look,
                                    treepieces_card *cards) {
    const int count = species ? txm_clampi(species->leaf_count, 0, 256) : 0;
    if (!cards || !count) return count;
    txm_rng rng = txm_rng_make(look, 0x1eaf);
    const float phase = 6.2831853f * txm_rng_float(&rng);
    const float flat = txm_clampf(species->cloud_flat, 0.1f, 2);
    const float half = 0.5f * txm_clampf(species->leaf_size, 0.01f, 4);
    const float wide = txm_minf(1, 1 / flat), scale[3] = {wide, txm_minf(1, flat), wide};
    for (int i = 0; i < count; i++) {
        if (species->leaf_shape == TREEPIECES_LEAF_NEEDLE)
            tpc_needle_card(i, count, phase, scale, half, &rng, &cards[i]);
        else tpc_leafy_card(species, cards, i, scale, half, &rng);
        tpc_keep_inside(&cards[i]);
    }
    return count;
}

/* ---- foliage: drawn leaves ----------------------------------------------------------------- */

/* A spray is a list of marks, later ones over earlier ones. A sample of the picture asks them from
   the last to the first who has it; so edges are smoothed without seams, and rows do not wait for
   each other. Lengths are in sides of the picture, y goes down. */
enum {
    TPC_TWIG = TREEPIECES_LEAF_BLOSSOM + 1, /* a tapering stroke; else treepieces_leaf_shape */
    TPC_MARKS = 1024,
    TPC_SAMPLES = 4 /* across and down a pixel */
};

typedef struct tpc_mark {
    int shape;
    float from[2], along[2]; /* its foot, and from there to its tip */
    float width;             /* half of it over the length */
    float taper;             /* of a twig: width at its tip over that at its foot */
    float bend;              /* of the midrib, over the length */
    float fold;              /* how much one half is lighter than the other */
    float low[2], high[2];   /* the box around it */
    float color[3], tip[3];
} tpc_mark;

typedef struct tpc_spray {
    const treepieces_species *species;
    tpc_mark *marks;
    int count, shape;
    txm_rng rng;
    txm_image out;
    int first_row;
} tpc_spray;

/* What a leaf shape's spray is like. */
typedef struct tpc_habit {
    int leaves, twigs, twig_leaves; /* on the stem; side twigs; leaves on each */
    float length, width;            /* of a leaf; half the width over the length */
    float petiole, angle, bend;     /* angle: degrees between leaf and stem */
} tpc_habit;

/* by treepieces_leaf_shape */
static const tpc_habit tpc_habits[] = {
    {9, 6, 6, 0.23f, 0.31f, 0.02f, 58, 0.10f},   {7, 5, 4, 0.31f, 0.34f, 0.01f, 55, 0.06f},
    {15, 6, 9, 0.32f, 0.085f, 0.02f, 38, 0.14f}, {8, 6, 6, 0.20f, 0.44f, 0.05f, 62, 0.06f},
    {0, 9, 0, 0.13f, 0.034f, 0, 48, 0.05f},      {7, 6, 4, 0.105f, 0.42f, 0.06f, 75, 0},
};

/* Half the width of a leaf at u of its length over the most it has; side: 0..1 how far across. */
static float tpc_outline(int shape, float u, float side) {
    const float arc = 4 * u * (1 - u);
    float v, phase;
    switch (shape) {
    case TREEPIECES_LEAF_LOBED: /* lobes point forwards */
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

/* The color of a leaf at u of its length and x across it, half the width being `half`. */
static void tpc_leaf_color(const tpc_mark *m, float u, float x, float half, float color[3]) {
    static const float veins[] = {9, 6, 11, 7}; /* by shape */
    const float across = x < 0 ? -x : x, edge = half > 0 ? across / half : 0;
    float shade = (x < 0 ? 1 - m->fold : 1 + m->fold) * (0.86f + 0.1f * u + 0.1f * edge), light = 0;
    if (m->shape < TREEPIECES_LEAF_NEEDLE) { /* side veins, and the blade bulging between them */
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

/* Does the mark have that place? Its color there then. color may be NULL. */
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

/* Color of the picture at a place, in the shadow of marks that lie higher; 0: it is transparent
   there. Of the marks, those listed can be there. */
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

/* Those of the marks in `from` that reach low..high along an axis, with the shadows they throw. */
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
            const float at_x = ((float)x + ((float)(k % TPC_SAMPLES) + 0.5f) * step) / width;
            const float at_y = ((float)y + ((float)(k / TPC_SAMPLES) + 0.5f) * step) / height;
            if (!tpc_spray_at(s, listed, count, at_x, at_y, color)) continue;
            for (int c = 0; c < 3; c++) sum[c] += color[c];
            covered++;
        }
        for (int c = 0; c < 3; c++) /* what is transparent too: filtering leaves no dark fringe */
            txm_image_set(&s->out, x, y, c, covered ? sum[c] / (float)covered
                                                    : 0.85f * s->species->leaf_color[c]);
        txm_image_set(&s->out, x, y, 3, (float)covered / (TPC_SAMPLES * TPC_SAMPLES));
    }
}

/* A mark from a to b, `half` a width to either side; NULL: there are too many, or it has no
   length. */
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

/* A place `length` from a, turned by so many degrees from `heading` (a unit vector), kept off the
   border by `margin`. */
static void tpc_go(const float a[2], const float heading[2], float degrees, float length,
                   float margin, float b[2]) {
    double sine, cosine;
    txm_sincos((double)degrees * (TXM_PI / 180), &sine, &cosine);
    const float x = heading[0] * (float)cosine - heading[1] * (float)sine;
    const float y = heading[0] * (float)sine + heading[1] * (float)cosine;
    b[0] = txm_clampf(a[0] + length * x, margin, 1 - margin);
    b[1] = txm_clampf(a[1] + length * y, margin, 1 - margin);
}

/* The leaf color, a bit lighter or darker, yellower or bluer. */
static void tpc_vary_color(tpc_spray *s, const float base[3], float color[3]) {
    const float light = 1 + 0.13f * tpc_signed(&s->rng), warm = 0.09f * tpc_signed(&s->rng);
    color[0] = base[0] * light * (1 + warm);
    color[1] = base[1] * light;
    color[2] = base[2] * light * (1 - 1.5f * warm);
}

/* A bent stem or twig. */
typedef struct tpc_stem {
    float from[2], to[2], bend;
} tpc_stem;

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

/* A leaf on its stalk, seen more or less from above. */
static void tpc_put_leaf(tpc_spray *s, int shape, const float at[2], const float heading[2],
                         float degrees, float size, const float base[3]) {
    const tpc_habit *habit = &tpc_habits[shape];
    float foot[2], tip[2], color[3];
    const float length = habit->length * size * (0.88f + 0.24f * txm_rng_float(&s->rng));
    const float half = length * habit->width * (0.72f + 0.34f * txm_rng_float(&s->rng));
    const float bend = habit->bend * tpc_signed(&s->rng), margin = 0.015f + 0.75f * half;
    tpc_vary_color(s, base, color);
    tpc_go(at, heading, degrees, habit->petiole * size + 0.01f, 0.01f, foot);
    tpc_go(foot, heading, degrees + 8 * tpc_signed(&s->rng), length, margin, tip);
    tpc_mark *stalk = tpc_add_mark(s, TPC_TWIG, at, foot, 0.004f, 0, color);
    if (stalk) stalk->taper = 0.7f;
    tpc_mark *leaf = tpc_add_mark(s, shape, foot, tip, half, bend, color);
    if (!leaf) return;
    leaf->fold = 0.09f * tpc_signed(&s->rng);
    for (int k = 0; k < 3; k++) leaf->tip[k] = color[k] * (k == 2 ? 1.0f : 1.08f);
}

/* Five petals about a middle with stamens, seen askew. */
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
        tpc_go(at, up, angle, 0.08f * radius, 0.01f, foot);
        tpc_go(at, up, angle, length, 0.01f, tip);
        tpc_mark *petal = tpc_add_mark(s, TREEPIECES_LEAF_BLOSSOM, foot, tip, half, 0, deep);
        if (!petal) return;
        const float paler = 0.45f + 0.35f * txm_rng_float(&s->rng);
        petal->fold = 0.03f * tpc_signed(&s->rng);
        for (int k = 0; k < 3; k++) {
            petal->tip[k] = txm_lerpf(tint[k], white[k], paler);
            petal->color[k] = txm_lerpf(deep[k], petal->tip[k], 0.4f);
        }
    }
    for (int i = 0; i < 9; i++) {
        const float angle = 40 * (float)i + 15 * tpc_signed(&s->rng);
        float tip[2], top[2];
        tpc_go(at, up, angle, radius * (0.2f + 0.2f * txm_rng_float(&s->rng)), 0.01f, tip);
        tpc_go(tip, up, angle, 0.07f * radius, 0.01f, top);
        tpc_add_mark(s, TPC_TWIG, at, tip, 0.014f * radius, 0, deep);
        tpc_add_mark(s, TPC_TWIG, tip, top, 0.04f * radius, 0, anther);
    }
}

/* What grows on a twig: leaves to both sides in turn and one at the end. */
static void tpc_dress(tpc_spray *s, const tpc_stem *stem, int count, float first, float size) {
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
            tpc_put_leaf(s, s->shape, at, heading, angle, size * (1.05f - 0.3f * along * along),
                         s->species->leaf_color);
            continue;
        }
        if (is_last || txm_rng_float(&s->rng) < 0.35f)
            tpc_put_leaf(s, TREEPIECES_LEAF_LANCE, at, heading, -0.6f * angle, 0.4f, young);
        tpc_go(at, heading, angle, habit->petiole, 0.13f, middle);
        tpc_add_flower(s, middle, habit->length * (0.85f + 0.25f * txm_rng_float(&s->rng)));
    }
}

/* Needles on both sides of a twig and towards the eye. */
static void tpc_add_needles(tpc_spray *s, const tpc_stem *stem, float first) {
    const tpc_habit *habit = &tpc_habits[TREEPIECES_LEAF_NEEDLE];
    const float dx = stem->to[0] - stem->from[0], dy = stem->to[1] - stem->from[1];
    const int count = (int)((1 - first) * sqrtf(dx * dx + dy * dy) / 0.0085f) + 4;
    for (int i = 0; i < count; i++) {
        const float along = first + (1 - first) * (float)i / (float)(count - 1);
        const float spread = i % 5 == 4 ? 0.35f * tpc_signed(&s->rng) : i % 2 ? 1.0f : -1.0f;
        const float angle = spread * habit->angle * (1.15f - 0.75f * along * along);
        const float length = habit->length * (0.7f + 0.45f * txm_rng_float(&s->rng));
        float at[2], heading[2], tip[2], color[3];
        tpc_stem_at(stem, along, at, heading);
        tpc_vary_color(s, s->species->leaf_color, color);
        tpc_go(at, heading, angle + 12 * tpc_signed(&s->rng), length, 0.01f, tip);
        tpc_mark *m = tpc_add_mark(s, TREEPIECES_LEAF_NEEDLE, at, tip, habit->width * habit->length,
                                   habit->bend * tpc_signed(&s->rng), color);
        for (int k = 0; m && k < 3; k++) {
            m->color[k] = color[k];
            m->tip[k] = 1.3f * color[k] + 0.04f;
        }
    }
}

/* The whole spray: a stem from the middle of the lower side upwards, twigs to both sides. */
static void tpc_compose(tpc_spray *s) {
    const tpc_habit *habit = &tpc_habits[s->shape];
    const int is_needle = s->shape == TREEPIECES_LEAF_NEEDLE;
    const float top = is_needle ? 0.12f : 0.97f * habit->length + 0.03f;
    tpc_stem stem = {{0.5f, 1}, {0.5f, 0}, 0};
    stem.to[0] += 0.06f * tpc_signed(&s->rng);
    stem.to[1] = top;
    stem.bend = 0.05f * tpc_signed(&s->rng);
    tpc_add_stem(s, &stem, 0.011f, 0.004f);
    for (int i = 0; i < habit->twigs; i++) {
        const float along = 0.05f + 0.7f * (float)i / (float)habit->twigs;
        const float side = i % 2 ? -1.0f : 1.0f, length = 0.5f * (1.05f - 0.6f * along);
        const float angle = side * (66 - 24 * along) + 5 * tpc_signed(&s->rng);
        tpc_stem twig;
        float heading[2];
        tpc_stem_at(&stem, along, twig.from, heading);
        tpc_go(twig.from, heading, angle, length, 0.12f, twig.to);
        twig.bend = -0.08f * side;
        tpc_add_stem(s, &twig, 0.007f, 0.003f);
        if (is_needle) tpc_add_needles(s, &twig, 0.08f);
        else tpc_dress(s, &twig, habit->twig_leaves, 0.3f, 0.85f);
    }
    if (is_needle) tpc_add_needles(s, &stem, 0.03f);
    else tpc_dress(s, &stem, habit->leaves, 0.14f, 1);
}

TREEPIECES_API txm_status treepieces_draw_leaves(const treepieces_species *species, uint64_t seed,
                                                 txm_env *env, txm_image out) {
    enum { ROWS = 64 }; /* between two reports */
    tpc_spray spray;
    if (!species) return txm_fail(env, TXM_BAD_ARGUMENT, "species is NULL");
    txm_status status = txm_image_check(&out, "out", 0, env);
    if (status != TXM_OK) return status;
    if (out.channels != 4 || out.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "out must have 4 channels of 8 bits");
    memset(&spray, 0, sizeof spray);
    spray.marks = (tpc_mark *)txm_alloc(env, TPC_MARKS * sizeof *spray.marks);
    if (!spray.marks) return txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the leaves");
    spray.species = species;
    spray.shape = txm_clampi(species->leaf_shape, 0, TREEPIECES_LEAF_BLOSSOM);
    spray.rng = txm_rng_make(seed, 0x59a7);
    spray.out = txm_image_resolve(out);
    tpc_compose(&spray);
    for (int y = 0; y < out.height && status == TXM_OK; y += ROWS) {
        spray.first_row = y;
        if (txm_progress(env, (float)y / (float)out.height, "leaves"))
            status = txm_fail(env, TXM_CANCELLED, "cancelled");
        else txm_parallel_for(env, txm_clampi(out.height - y, 0, ROWS), tpc_draw_row, &spray);
    }
    txm_free(env, spray.marks);
    return status;
}

/* ---- foliage: impostors -------------------------------------------------------------------- */

/* The color of a point p of a card is that of its texel, times

       (0.7 + 0.6 clamp(0.35 + 0.65 n.l) + 0.2 max(0, f.l)) * (0.65 + 0.35 min(1, p.p))

   with the card's normal n, l towards the light and f the view's forward: light that wraps around,
   light that shines through when the sun stands behind, and shade in the cloud's middle. Texels are
   the nearest, numbers sRGB as they are: a shader does the same in three lines. Cards whose plane
   is seen at a sine below 0.1 are left out: they would be rows of dots. */
static float tpc_card_light(const treepieces_impostor_desc *d, const treepieces_card *card) {
    const float direct = txm_clampf(0.35f + 0.65f * tpc_dot(card->normal, d->light), 0, 1);
    return 0.7f + 0.6f * direct + 0.2f * txm_maxf(0, tpc_dot(d->forward, d->light));
}

/* First and last pixel, of count, whose middles lie in low..high of -1..1. */
static void tpc_pixels(float low, float high, int count, int *first, int *last) {
    const float n = (float)count;
    *first = (int)txm_clampf((low + 1) * 0.5f * n - 0.5f, 0, n);
    *last = (int)txm_clampf((high + 1) * 0.5f * n + 0.5f, -1, n - 1);
}

/* The texel at s, t of a card, -1..1 to the right and up. */
static const uint8_t *tpc_texel(const txm_image *leaves, float s, float t) {
    const int x = (int)((s + 1) * 0.5f * (float)leaves->width);
    const int y = (int)((1 - t) * 0.5f * (float)leaves->height);
    const void *row = txm_image_row_const(leaves, txm_clampi(y, 0, leaves->height - 1));
    return (const uint8_t *)row + 4 * txm_clampi(x, 0, leaves->width - 1);
}

static void tpc_draw_card(const treepieces_impostor_desc *d, const treepieces_card *card,
                          const txm_image *leaves, const txm_image *color, const txm_image *depth) {
    const float c[3] = {tpc_dot(card->center, d->right), tpc_dot(card->center, d->up),
                        -tpc_dot(card->center, d->forward)};
    const float r[3] = {tpc_dot(card->right, d->right), tpc_dot(card->right, d->up),
                        -tpc_dot(card->right, d->forward)};
    const float u[3] = {tpc_dot(card->up, d->right), tpc_dot(card->up, d->up),
                        -tpc_dot(card->up, d->forward)};
    const float det = r[0] * u[1] - r[1] * u[0], light = tpc_card_light(d, card);
    const float wide = fabsf(r[0]) + fabsf(u[0]), high = fabsf(r[1]) + fabsf(u[1]);
    const float area = tpc_dot(card->right, card->right) * tpc_dot(card->up, card->up);
    int left, right, top, bottom;
    if (!(det * det > 0.01f * area)) return; /* seen edge on */
    if (!(fabsf(c[0]) + fabsf(c[1]) + wide + high < 1e6f)) return; /* not of this world */
    tpc_pixels(c[0] - wide, c[0] + wide, color->width, &left, &right);
    tpc_pixels(-c[1] - high, high - c[1], color->height, &top, &bottom);
    for (int row = top; row <= bottom; row++) {
        const float y = 1 - (2 * (float)row + 1) / (float)color->height;
        uint8_t *colors = (uint8_t *)txm_image_row(color, row);
        float *depths = (float *)txm_image_row(depth, row);
        for (int column = left; column <= right; column++) {
            const float x = (2 * (float)column + 1) / (float)color->width - 1;
            const float s = ((x - c[0]) * u[1] - (y - c[1]) * u[0]) / det;
            const float t = ((y - c[1]) * r[0] - (x - c[0]) * r[1]) / det;
            if (!(s >= -1 && s < 1 && t > -1 && t <= 1)) continue;
            const float z = c[2] + s * r[2] + t * u[2];
            if (!(z > depths[column])) continue;
            const uint8_t *texel = tpc_texel(leaves, s, t);
            if (texel[3] < 128) continue;
            const float shade = light * (0.65f + 0.35f * txm_minf(1, x * x + y * y + z * z));
            for (int k = 0; k < 3; k++) {
                const float lit = txm_clampf((float)texel[k] * shade, 0, 255);
                colors[4 * column + k] = (uint8_t)(lit + 0.5f);
            }
            colors[4 * column + 3] = 255;
            depths[column] = z;
        }
    }
}

/* Unit vectors at right angles? */
static int tpc_is_view(const treepieces_impostor_desc *d) {
    const float *v[4] = {d->right, d->up, d->forward, d->light};
    for (int i = 0; i < 4; i++) {
        if (!(fabsf(tpc_dot(v[i], v[i]) - 1) < 1e-3f)) return 0;
        if (i < 3 && !(fabsf(tpc_dot(v[i], v[(i + 1) % 3])) < 1e-3f)) return 0;
    }
    return 1;
}

TREEPIECES_API txm_status treepieces_impostor(const treepieces_impostor_desc *desc, txm_env *env,
                                              txm_image color, txm_image depth) {
    if (!desc || (desc->card_count && !desc->cards) || desc->card_count < 0)
        return txm_fail(env, TXM_BAD_ARGUMENT, "desc or cards is NULL, or card_count below 0");
    txm_status status = txm_image_check(&desc->leaves, "leaves", 0, env);
    if (status == TXM_OK) status = txm_image_check(&color, "color", 0, env);
    if (status == TXM_OK) status = txm_image_check(&depth, "depth", 0, env);
    if (status != TXM_OK) return status;
    const txm_image leaves = txm_image_resolve(desc->leaves);
    const txm_image c = txm_image_resolve(color), d = txm_image_resolve(depth);
    if (leaves.channels != 4 || leaves.sample != TXM_U8 || c.channels != 4 || c.sample != TXM_U8)
        return txm_fail(env, TXM_BAD_ARGUMENT, "leaves and color must have 4 channels of 8 bits");
    if (d.channels != 1 || d.sample != TXM_F32 || d.width != c.width || d.height != c.height)
        return txm_fail(env, TXM_BAD_ARGUMENT, "depth must be float, 1 channel, of color's size");
    if (!tpc_is_view(desc))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "right, up, forward and light must be unit vectors, the first three at "
                        "right angles");
    for (int y = 0; y < c.height; y++) {
        float *depths = (float *)txm_image_row(&d, y);
        memset(txm_image_row(&c, y), 0, 4 * (size_t)c.width);
        for (int x = 0; x < d.width; x++) depths[x] = -2;
    }
    for (int i = 0; i < desc->card_count; i++)
        tpc_draw_card(desc, &desc->cards[i], &leaves, &c, &d);
    return TXM_OK;
}

/* ---- foliage: baked leaf cards ------------------------------------------------------------- */

/* Card number `index` of the mesh, of a cloud about `center`. */
static void tpc_bake_card(treepieces_mesh *m, size_t index, const treepieces_card *card,
                          const float center[3], float radius, uint32_t joint) {
    static const float sides[4][2] = {{-1, 1}, {-1, -1}, {1, -1}, {1, 1}}; /* nw, sw, se, ne */
    static const uint32_t corners[6] = {0, 1, 2, 0, 2, 3};
    for (size_t k = 0; k < 4; k++) {
        const size_t vertex = 4 * index + k;
        for (size_t a = 0; a < 3; a++) {
            const float across = sides[k][0] * card->right[a] + sides[k][1] * card->up[a];
            m->positions[3 * vertex + a] = center[a] + radius * (card->center[a] + across);
            m->normals[3 * vertex + a] = card->normal[a];
        }
        for (size_t j = 0; j < 4; j++) {
            m->joints[4 * vertex + j] = j ? 0 : joint;
            m->weights[4 * vertex + j] = j ? 0 : 1;
        }
    }
    for (size_t k = 0; k < 6; k++) {
        m->indices[6 * index + k] = (uint32_t)(4 * index) + corners[k];
        m->uvs[12 * index + 2 * k] = sides[corners[k]][0] > 0 ? 1.0f : 0.0f;
        m->uvs[12 * index + 2 * k + 1] = sides[corners[k]][1] > 0 ? 0.0f : 1.0f;
    }
}

TREEPIECES_API txm_status treepieces_bake_leaves(const treepieces_forest *forest, int tree,
                                                 const float *bones, int looks, txm_env *env,
                                                 treepieces_mesh **out) {
    if (!out) return txm_fail(env, TXM_BAD_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!bones || !tpc_has_tree(forest, tree))
        return txm_fail(env, TXM_BAD_ARGUMENT, "forest or bones is NULL, or there is no such tree");
    if (looks < 1 || looks > 64) return txm_fail(env, TXM_BAD_ARGUMENT, "looks must be 1 to 64");
    const treepieces_tree *t = &forest->trees[tree];
    const treepieces_species *species = &forest->species[t->species];
    const size_t count = (size_t)treepieces_cloud(species, 0, NULL);
    if (count * t->cluster_count > 0x7fffffffu / 6)
        return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 corners");
    const size_t all = count * t->cluster_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    tpc_mesh *made = tpc_make_mesh(env);
    treepieces_card *cards =
        (treepieces_card *)txm_arena_alloc(&scratch, (size_t)looks * (count + 1), sizeof *cards);
    txm_status status = TXM_OK;
    if (!made || !cards || !tpc_alloc_mesh(made, 4 * all, 2 * all)) {
        status = txm_fail(env, TXM_OUT_OF_MEMORY, "no memory for the mesh");
    } else {
        made->mesh.vertex_count = 4 * all;
        made->mesh.triangle_count = 2 * all;
    }
    for (int k = 0; k < looks && status == TXM_OK; k++)
        treepieces_cloud(species, (uint32_t)k, cards + (size_t)k * count);
    for (uint32_t i = 0; i < t->cluster_count && status == TXM_OK; i++) {
        const treepieces_cluster *c = &forest->clusters[t->first_cluster + i];
        const float *bone = bones + (size_t)c->node * TREEPIECES_BONE;
        const treepieces_card *look = cards + (size_t)(c->look % (uint32_t)looks) * count;
        const float center[3] = {bone[3] + c->along * bone[1], bone[7] + c->along * bone[5],
                                 bone[11] + c->along * bone[9]};
        for (size_t k = 0; k < count; k++)
            tpc_bake_card(&made->mesh, count * i + k, &look[k], center, c->radius,
                          c->node - t->first_node);
    }
    txm_arena_free(&scratch);
    *out = tpc_hand_over(made, status);
    return status;
}

#endif /* TREEPIECES_LEAVES_H */
