#ifndef TRIMESH_RELAX_BANDS_H
#define TRIMESH_RELAX_BANDS_H

#include "surface.h"

/* ---- bands: chamfers and fillets narrower than an edge -------------------------------------- */

/* Parts have chamfers and fillets: narrow strips of faces between two flats, over which the surface
   turns. Triangles larger than the strip cannot follow it. Vertices that come to lie to either side
   of it make saw-teeth, unless it becomes a line. So strips are found here by walking across:

             flat 0  ________                       a walk starts in the middle of an edge, at right
                             `-. strip              angles to it, goes on straight over the unfolded
                                `\                  faces, and ends where the surface has been flat
                                  |                 for about half an edge length
                                  | flat 1

   and ridges.h extends both flats to the line in which they meet. All numbers here are ours, see
   docs/choices.md#bands. */
enum { TMR_WALK_MOST = 96 };    /* faces that a walk crosses at most                             */
#define TMR_BAND_WIDTH 1.8      /* widest strip, in edge lengths: a fillet that turns by 90 degrees
                                   turns by 50 in one edge length                              */
#define TMR_BAND_FLAT 0.45      /* a flat is as wide as this, in edge lengths                    */
#define TMR_FLAT_RATIO 2        /* of the widths of a flat and of the chamfer beside it, at least  */
#define TMR_BAND_SHIFT 0.85     /* how far a strip may be moved, in edge lengths                 */
#define TMR_BAND_BENT 0.14      /* how much a flat may turn: 2 sin of half the angle, 8 degrees  */
#define TMR_BAND_EVEN 0.026     /* what belongs to the flat turns by less: 1.5 degrees           */
#define TMR_BAND_SAME 0.01      /* faces of one plane turn by less: half a degree                */
#define TMR_BAND_LEAST 0.035    /* walks begin at edges that turn by more: 2 degrees             */
#define TMR_BAND_MOST 1.64      /* strips turn by no more than this: 110 degrees                 */
#define TMR_BAND_ONE_WAY 1.4    /* sum of the turns over the turn of the whole, at most          */

/* Faces on the way across from an edge. face[i] lies between point[i] and point[i + 1]; those lie at
   way[i] and way[i + 1]. */
typedef struct tmr_walk {
    int32_t count;
    int border; /* did it end at the border? */
    int32_t face[TMR_WALK_MOST];
    double way[TMR_WALK_MOST + 1];
    txm_dvec3 point[TMR_WALK_MOST + 1];
    int32_t corner;  /* of the next face, opposite to the edge by which it is entered              */
    txm_dvec3 a, b;  /* the ends of that edge: at the next corner and at the previous one          */
    txm_dvec3 d;     /* the direction in the next face, unit                                       */
} tmr_walk;

/* A strip as a walk has seen it. */
typedef struct tmr_band {
    int32_t count;                    /* faces in between                                        */
    int32_t face[2 * TMR_WALK_MOST];
    int32_t flat[2];                  /* a face of each flat                                     */
    txm_dvec3 normal[2], point[2];    /* of the flats; where the strip begins and ends           */
    double width;
    double section; /* area of the cross-section between the strip and the line where the flats
                       meet; negative where the surface is concave                              */
} tmr_band;

/* how far two unit normals are apart: 2 sin of half the angle */
static double tmr_chord(const tmr_surface *s, int32_t f, int32_t g) {
    return txm_d3_dist(s->normal[f], s->normal[g]);
}

/* Begin in the middle of the edge opposite to corner c, at right angles to it. */
static void tmr_walk_begin(const tmr_surface *s, int32_t c, tmr_walk *walk) {
    walk->count = walk->border = 0;
    walk->corner = c;
    walk->a = s->point[s->vertex[tmr_next(c)]];
    walk->b = s->point[s->vertex[tmr_prev(c)]];
    walk->d = txm_d3_cross(s->normal[c / 3], txm_d3_unit(txm_d3_sub(walk->b, walk->a)));
    walk->way[0] = 0;
    walk->point[0] = txm_d3_scale(txm_d3_add(walk->a, walk->b), 0.5);
}

/* Cross the next face, not after the border.

            q           The walk comes in between a and b, and leaves between b and q if q lies to its
           / \          left, else between q and a.
          /   \
         b--^--a        Returns 0 if it has crossed too many faces, or if this one has no area.  */
static int tmr_walk_on(const tmr_surface *s, tmr_walk *walk) {
    const int32_t i = walk->count, c = walk->corner;
    if (i >= TMR_WALK_MOST) return 0;
    const txm_dvec3 n = s->normal[c / 3], p = walk->point[i], d = walk->d, q = s->point[s->vertex[c]];
    const int left = txm_d3_dot(n, txm_d3_cross(d, txm_d3_sub(q, p))) > 0;
    const int32_t exit = left ? tmr_next(c) : tmr_prev(c);
    if (left) walk->a = q; /* seen from the next face */
    else walk->b = q;
    const txm_dvec3 e = txm_d3_unit(txm_d3_sub(walk->a, walk->b)), out = txm_d3_cross(e, n);
    const double speed = txm_d3_dot(d, out), cosine = txm_d3_dot(d, e);
    if (!(speed > 1e-9)) return 0;
    const double t = fmax(0, txm_d3_dot(txm_d3_sub(q, p), out) / speed);
    walk->face[i] = c / 3;
    walk->way[i + 1] = walk->way[i] + t;
    walk->point[i + 1] = txm_d3_mad(p, d, t);
    walk->count++;
    walk->corner = s->opposite[exit];
    walk->border = walk->corner < 0;
    if (walk->border) return 1;
    /* in the next face the edge runs the other way, so that its inside lies to the right */
    const txm_dvec3 in = txm_d3_cross(e, s->normal[walk->corner / 3]);
    walk->d = txm_d3_unit(txm_d3_mad(txm_d3_scale(e, cosine), in, sqrt(fmax(0, 1 - cosine * cosine))));
    return 1;
}

/* Walk from the edge opposite to corner c until a flat that is at least that wide is reached, but no
   farther than reach. *first receives the number of its first face, *flat that of its longest one.
   Returns 0 if there is none. */
static int tmr_walk_to_flat(const tmr_surface *s, int32_t c, double reach, double least, tmr_walk *walk,
                            int32_t *first, int32_t *flat) {
    int32_t from = 0;
    tmr_walk_begin(s, c, walk);
    while (!walk->border && walk->way[walk->count] < reach && tmr_walk_on(s, walk)) {
        const int32_t i = walk->count - 1;
        while (tmr_chord(s, walk->face[from], walk->face[i]) > TMR_BAND_BENT) from++;
        if (walk->way[i + 1] - walk->way[from] < least && !walk->border) continue;
        *flat = from;
        for (int32_t k = from; k <= i; k++)
            if (walk->way[k + 1] - walk->way[k] > walk->way[*flat + 1] - walk->way[*flat]) *flat = k;
        *first = from;
        while (tmr_chord(s, walk->face[*first], walk->face[*flat]) > TMR_BAND_EVEN) ++*first;
        return 1;
    }
    return 0;
}

/* the point nearest to q of the line where two planes meet, which are not parallel */
static txm_dvec3 tmr_meet(txm_dvec3 q, const txm_dvec3 normal[2], const txm_dvec3 point[2]) {
    const double g = txm_d3_dot(normal[0], normal[1]);
    const double a = txm_d3_dot(normal[0], txm_d3_sub(point[0], q));
    const double b = txm_d3_dot(normal[1], txm_d3_sub(point[1], q));
    const double inverse = 1 / fmax(1e-6, 1 - g * g);
    return txm_d3_mad(txm_d3_mad(q, normal[0], (a - g * b) * inverse), normal[1],
                      (b - g * a) * inverse);
}

/* The faces and cuts of two walks from one edge, from the flat on the left to that on the right:
   cut[i] lies between face[i] and face[i + 1]. */
typedef struct tmr_profile {
    int32_t count, edge; /* faces; the edge is cut[edge] */
    int32_t face[2 * TMR_WALK_MOST];
    txm_dvec3 cut[2 * TMR_WALK_MOST];
} tmr_profile;

static void tmr_join_walks(const tmr_walk *left, int32_t left_first, int32_t left_flat,
                           const tmr_walk *right, int32_t right_first, int32_t right_flat,
                           tmr_profile *p) {
    memset(p, 0, sizeof *p);
    for (int32_t i = left_first; i >= 0; i--) {
        p->cut[p->count] = left->point[i];
        p->face[p->count++] = left->face[i];
    }
    p->edge = p->count - 1;
    for (int32_t i = 0; i <= right_first; i++) {
        p->cut[p->count] = right->point[i + 1];
        p->face[p->count++] = right->face[i];
    }
    TRIMESH_ASSERT(p->count <= 2 * TMR_WALK_MOST);
    p->face[0] = left->face[left_flat];
    p->face[p->count - 1] = right->face[right_flat];
}

/* Narrow the range of faces low..high, whose ends are flats, until it turns by at most
   TMR_BAND_MOST and has at most one edge that is sharp by itself: its widest face becomes a flat. */
static void tmr_narrow_profile(const tmr_surface *s, const tmr_profile *p, double sharp,
                               int32_t *low, int32_t *high) {
    while (*high - *low >= 2) {
        int count = 0;
        int32_t widest = *low + 1;
        double most = -1;
        for (int32_t i = *low; i < *high; i++)
            count += tmr_chord(s, p->face[i], p->face[i + 1]) >= sharp;
        if (count <= 1 && tmr_chord(s, p->face[*low], p->face[*high]) <= TMR_BAND_MOST) return;
        for (int32_t i = *low + 1; i < *high; i++) {
            const double width = txm_d3_dist2(p->cut[i - 1], p->cut[i]);
            if (width > most) {
                most = width;
                widest = i;
            }
        }
        if (widest <= p->edge) *low = widest;
        else *high = widest;
    }
}

/* Does the range of the profile make a strip? Fill it in. */
static int tmr_measure_band(const tmr_surface *s, const tmr_profile *p, int32_t low, int32_t high,
                            double sharp, double spacing, tmr_band *band) {
    const double turn = tmr_chord(s, p->face[low], p->face[high]);
    double sum = 0;
    if (high - low < 2 || turn < sharp) return 0;
    band->count = 0;
    band->width = 0;
    for (int32_t i = low; i < high; i++) sum += tmr_chord(s, p->face[i], p->face[i + 1]);
    for (int32_t i = low + 1; i < high; i++) {
        band->face[band->count++] = p->face[i];
        band->width += txm_d3_dist(p->cut[i - 1], p->cut[i]);
    }
    if (sum > TMR_BAND_ONE_WAY * turn || band->width > TMR_BAND_WIDTH * spacing) return 0;
    for (int k = 0; k < 2; k++) {
        band->flat[k] = p->face[k ? high : low];
        band->normal[k] = s->normal[band->flat[k]];
        band->point[k] = p->cut[k ? high - 1 : low];
    }
    const txm_dvec3 middle = txm_d3_scale(txm_d3_add(band->point[0], band->point[1]), 0.5);
    const txm_dvec3 meet = tmr_meet(middle, band->normal, band->point), out = txm_d3_sub(meet, middle);
    txm_dvec3 area = txm_d3(0, 0, 0);
    for (int32_t i = low; i + 1 < high; i++)
        area = txm_d3_add(area, txm_d3_area2(meet, p->cut[i], p->cut[i + 1]));
    band->section = 0.5 * txm_d3_len(area);
    if (txm_d3_dot(out, txm_d3_add(band->normal[0], band->normal[1])) < 0)
        band->section = -band->section;
    return txm_d3_len(out) <= TMR_BAND_SHIFT * spacing;
}

/* The wanted edge length at the edge opposite to corner c. */
static double tmr_spacing_at(const tmr_surface *s, int32_t c, double spacing) {
    if (!s->scale) return spacing;
    return spacing * 0.5 *
           (s->scale[s->vertex[tmr_next(c)]] + (double)s->scale[s->vertex[tmr_prev(c)]]);
}

/* Does the surface turn fast enough at the edge opposite to c for a strip? */
static int tmr_turns_fast(const tmr_surface *s, int32_t c, double sharp, double spacing) {
    const int32_t o = s->opposite[c];
    if (o < 0) return 0;
    const double turn = tmr_chord(s, c / 3, o / 3);
    if (turn < TMR_BAND_LEAST) return 0;
    double height = 0;
    for (int side = 0; side < 2; side++) {
        const int32_t *v = s->vertex + 3 * ((side ? o : c) / 3);
        const double area2 =
            txm_d3_len(txm_d3_area2(s->point[v[0]], s->point[v[1]], s->point[v[2]]));
        height = side && height < area2 ? height : area2;
    }
    const double length =
        txm_d3_dist(s->point[s->vertex[tmr_next(c)]], s->point[s->vertex[tmr_prev(c)]]);
    return turn * TMR_BAND_WIDTH * spacing * length > 0.4 * sharp * height;
}

/* Does a flat, at least that wide, begin at the edge opposite to corner c, on its side? */
static int tmr_is_beside_flat(const tmr_surface *s, int32_t c, double least) {
    tmr_walk walk;
    int32_t first, flat;
    return tmr_walk_to_flat(s, c, least, least, &walk, &first, &flat) && first == 0;
}

/* Is the edge opposite to corner c part of a strip? sharp: the turn that makes a crease, as
   tmr_chord has it. */
static int tmr_band_at(const tmr_surface *s, int32_t c, double sharp, double spacing,
                       tmr_band *band) {
    tmr_walk left, right;
    tmr_profile profile;
    int32_t first[2], flat[2];
    spacing = tmr_spacing_at(s, c, spacing);
    if (s->opposite[c] < c) return 0; /* the border, or seen from the other side */
    if (!tmr_turns_fast(s, c, sharp, spacing)) return 0;
    const double reach = (TMR_BAND_WIDTH + TMR_BAND_FLAT) * spacing, least = TMR_BAND_FLAT * spacing;
    if (tmr_is_beside_flat(s, c, least) && tmr_is_beside_flat(s, s->opposite[c], least))
        return 0; /* the usual case, seen from near */
    if (!tmr_walk_to_flat(s, c, reach, least, &left, first, flat) ||
        !tmr_walk_to_flat(s, s->opposite[c], reach, least, &right, first + 1, flat + 1))
        return 0;
    tmr_join_walks(&left, first[0], flat[0], &right, first[1], flat[1], &profile);
    int32_t low = 0, high = profile.count - 1;
    tmr_narrow_profile(s, &profile, sharp, &low, &high);
    return tmr_measure_band(s, &profile, low, high, sharp, spacing, band);
}

/* How wide is the flat that begins at the edge opposite to corner c, on its side? */
static double tmr_flat_width(const tmr_surface *s, int32_t c) {
    tmr_walk walk;
    tmr_walk_begin(s, c, &walk); /* to the border, or as far as a walk goes */
    while (!walk.border && tmr_walk_on(s, &walk))
        if (tmr_chord(s, c / 3, walk.face[walk.count - 1]) > TMR_BAND_BENT)
            return walk.way[walk.count - 1];
    return walk.way[walk.count];
}

/* Is the edge opposite to corner c one of a part, between two flats? They begin there on both sides. A
   single triangle is none: scans consist of such. Of a chamfer and the flat beside it one is much
   wider than the other; facets of a coarse mesh of something round are all alike. */
static int tmr_is_between_flats(const tmr_surface *s, int32_t c, double spacing) {
    double width[2];
    const double least = TMR_BAND_FLAT * tmr_spacing_at(s, c, spacing);
    for (int side = 0; side < 2; side++) {
        const int32_t k = side ? s->opposite[c] : c;
        const int32_t x = s->opposite[tmr_next(k)], y = s->opposite[tmr_prev(k)];
        if ((x < 0 || tmr_chord(s, k / 3, x / 3) > TMR_BAND_SAME) &&
            (y < 0 || tmr_chord(s, k / 3, y / 3) > TMR_BAND_SAME))
            return 0;
        width[side] = tmr_flat_width(s, k);
        if (width[side] < least) return 0;
    }
    return fmax(width[0], width[1]) >= TMR_FLAT_RATIO * fmin(width[0], width[1]);
}

#endif /* TRIMESH_RELAX_BANDS_H */
