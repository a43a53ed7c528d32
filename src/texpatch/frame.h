#ifndef TEXPATCH_FRAME_H
#define TEXPATCH_FRAME_H

#include "sighting.h"

/* ---- the upright frame of a pattern -------------------------------------------------------- */

/* Which way is up, how wide a brick is and where the picture ends. The plane (X, Y) of a view still
   lacks an affine map: its stretch follows from the tilt and the focal length, its turn and shear
   from the edges in the picture, which in masonry, tiles, planks and cloth have two directions. */

/* ours, see docs/choices.md */
enum {
    TXP_DIRECTIONS = 360, /* of edges: half a degree each                                        */
    TXP_BLURRED = 4,      /* of them to each side are one direction                              */
    TXP_BLURS = 2,        /* of 3 x 3 pixels before edges are looked for                         */
    TXP_SNAP = 2,         /* an edge is along a wave within so many                              */
    TXP_SQUARE_LEAST = 2, /* the second axis is within so many of the normal of the first ...    */
    TXP_SQUARE_MOST = 40, /* ... or, in a tilted view, so many                                   */
    TXP_FIELD_ROUNDS = 6, /* of the search for the place that a field moves                       */
    TXP_CELLS = 72,       /* cells along the sides of the plane when the frame is chosen         */
    TXP_EDGES_FROM = 300  /* pixels: longer side of the picture whose edges are looked at        */
};
#define TXP_FOCAL 0.85      /* longer sides: of a camera of which nothing is known               */
#define TXP_SQUARE_TILTED 80 /* directions for each unit by which the stretch is uncertain        */
#define TXP_FOCAL_RANGE 1.7 /* it is between this part and so many times as long                  */
#define TXP_WAVE_EDGES 0.6  /* of the most edges: with so many along it a wave is an axis         */
#define TXP_UPRIGHT 0.8     /* edges of this part do not count if they lie at 45 degrees          */
#define TXP_SIMPLE 0.25     /* what each wave in a sum costs, of its edges                        */
#define TXP_CLEAR_EDGES 1.4 /* of the mean: a direction with so many edges is one               */
#define TXP_FAR_SIDE 0.3    /* of the scale in the middle: what is smaller is cut off           */

/* From the plane (X, Y) to the frame, x = xx X + xy Y + x0, and back to the photograph. */
typedef struct txp_frame {
    txp_view view;
    double xx, xy, yx, yy;  /* to the frame, in half sides of the photograph                     */
    double left, top, scale; /* of the output: pixels = (x - left) scale                         */
    int width, height;
    double half, middle_x, middle_y; /* of the photograph, in its pixels                          */
} txp_frame;

/* A blurred copy of a gray picture, in which noise and the blocks of JPEG have fewer edges. 0: no
   memory. */
static int txp_blur(const txp_gray *from, txm_arena *arena, txp_gray *to) {
    const size_t count = (size_t)from->width * (size_t)from->height;
    float *copy = (float *)txm_arena_alloc(arena, count, sizeof *copy);
    double *sums = (double *)txm_arena_alloc(arena, (size_t)from->width, sizeof *sums);
    if (!txp_gray_new(to, from->width, from->height, arena)) return 0;
    memcpy(to->at, from->at, count * sizeof *to->at);
    memcpy(to->known, from->known, count * sizeof *to->known);
    for (int i = 0; i < TXP_BLURS; i++)
        txp_box_sums(to->at, from->width, from->height, 1, sums, copy);
    return 1;
}

/* The histogram of the directions of edges on the plane, as bins of half turns; s: the stretch. */
static void txp_edge_directions(const txp_gray *g, const txp_view *v, const double s[4],
                                double *bins) {
    double sums[TXP_DIRECTIONS] = {0};
    const double half = 0.5 * (g->width > g->height ? g->width : g->height);
    const double det_s = s[0] * s[3] - s[1] * s[2];
    for (int y = 1; y + 1 < g->height; y++) {
        const float *row = g->at + (size_t)y * (size_t)g->width;
        const float *known = g->known + (size_t)y * (size_t)g->width;
        for (int x = 1; x + 1 < g->width; x++) {
            double place[2], m[4];
            if (known[x] < 1) continue;
            /* Scharr's derivatives, whose direction is right */
            const float *t = row + x - g->width, *b = row + x + g->width;
            const double gx = 3 * ((double)t[1] - (double)t[-1] + (double)b[1] - (double)b[-1]) +
                              10 * ((double)row[x + 1] - (double)row[x - 1]);
            const double gy = 3 * ((double)b[1] - (double)t[1] + (double)b[-1] - (double)t[-1]) +
                              10 * ((double)b[0] - (double)t[0]);
            if (!txp_view_place(v, (x + 0.5 - 0.5 * g->width) / half,
                                (y + 0.5 - 0.5 * g->height) / half, place, m))
                continue;
            const double det = m[0] * m[3] - m[1] * m[2];
            const double px = (m[3] * gx - m[2] * gy) / det, py = (m[0] * gy - m[1] * gx) / det;
            const double qx = (s[3] * px - s[2] * py) / det_s;
            const double qy = (s[0] * py - s[1] * px) / det_s;
            double turn = 2 * txp_turns(qx, qy); /* opposite directions are one */
            turn -= floor(turn);
            /* squared once more, so that noise counts less than lines */
            const double strength = gx * gx + gy * gy;
            sums[(int)(turn * (int)TXP_DIRECTIONS) % TXP_DIRECTIONS] += strength * strength;
        }
    }
    for (int i = 0; i < TXP_DIRECTIONS; i++) {
        bins[i] = 0;
        for (int d = -TXP_BLURRED; d <= TXP_BLURRED; d++)
            bins[i] += (TXP_BLURRED + 1 - abs(d)) *
                       sums[(i + d + TXP_DIRECTIONS) % TXP_DIRECTIONS];
    }
}

/* The bin of most edges within reach of a bin, with the fraction by a parabola. */
static double txp_edge_peak(const double *bins, int middle, int reach, double *height) {
    int best = middle;
    for (int d = -reach; d <= reach; d++) {
        const int i = (middle + d + 2 * TXP_DIRECTIONS) % TXP_DIRECTIONS;
        if (bins[i] > bins[best]) best = i;
    }
    const double l = bins[(best + TXP_DIRECTIONS - 1) % TXP_DIRECTIONS];
    const double r = bins[(best + 1) % TXP_DIRECTIONS], c = bins[best];
    *height = c;
    return best + 0.5 + (l + r < 2 * c ? 0.5 * (l - r) / (l + r - 2 * c) : 0);
}

/* The direction of a vector as a bin. */
static double txp_direction_of(double x, double y) {
    const double turn = 2 * txp_turns(x, y);
    return (turn - floor(turn)) * (int)TXP_DIRECTIONS;
}

static double txp_bins_apart(double a, double b) {
    const double d = fabs(a - b);
    return fmin(d, (int)TXP_DIRECTIONS - d);
}

/* The plane's stretch by which distances become those of the wall: it was seen from the side. */
static void txp_stretch(const txp_view *v, double focal, double s[4], double *stretch) {
    const double tt = v->tilt_x * v->tilt_x + v->tilt_y * v->tilt_y;
    *stretch = sqrt(1 + 4 * focal * focal * tt);
    const double part = tt > 0 ? (*stretch - 1) / tt : 0;
    s[0] = 1 + part * v->tilt_x * v->tilt_x;
    s[1] = s[2] = part * v->tilt_x * v->tilt_y;
    s[3] = 1 + part * v->tilt_y * v->tilt_y;
}

/* Among the waves and simple sums of both: the one within reach of a direction along which most
   edges lie, simple ones first. Returns how many edges; *direction is left alone if there is none. */
static double txp_wave_direction(const txp_guess *g, const double s[4], const double *bins,
                                 double reach, double *direction) {
    const double det = s[0] * s[3] - s[1] * s[2], middle = *direction;
    const txp_wave *w = g->wave;
    double most = 0, edges = 0;
    const int last = w[1].clear > 0 ? 2 : 0;
    for (int i = 0; i <= 2; i++) {
        for (int j = -last; j <= last; j++) {
            const double a = i * w[0].a + j * w[1].a, b = i * w[0].b + j * w[1].b;
            const int terms = i + abs(j);
            if (!(a * a + b * b > 0) || terms > 3) continue;
            const double to =
                txp_direction_of((s[3] * a - s[2] * b) / det, (s[0] * b - s[1] * a) / det);
            if (txp_bins_apart(to, middle) > reach) continue;
            const double height = bins[(int)to % TXP_DIRECTIONS];
            if (!(height * (1 - TXP_SIMPLE * terms) > most)) continue;
            most = height * (1 - TXP_SIMPLE * terms);
            edges = height;
            *direction = to;
        }
    }
    return edges;
}

/* The two axes of a pattern, as directions across its edges; s: the stretch. */
static void txp_find_axes(const txp_gray *g, const txp_guess *guess, double focal, double s[4],
                          double axes[2]) {
    double bins[TXP_DIRECTIONS], mean = 0, height, unused[4], shorter, longer, stretch;
    txp_stretch(&guess->view, focal / TXP_FOCAL_RANGE, unused, &shorter);
    txp_stretch(&guess->view, focal * TXP_FOCAL_RANGE, unused, &longer);
    txp_stretch(&guess->view, focal, s, &stretch);
    txp_edge_directions(g, &guess->view, s, bins);
    for (int i = 0; i < TXP_DIRECTIONS; i++) {
        /* who photographs a wall holds the camera nearly upright */
        const double off = fmin(fmin(i, TXP_DIRECTIONS - i), abs(i - TXP_DIRECTIONS / 2));
        bins[i] *= 1 - TXP_UPRIGHT * off / (0.25 * (int)TXP_DIRECTIONS);
        mean += bins[i] / (int)TXP_DIRECTIONS;
    }
    axes[0] = txp_edge_peak(bins, 0, TXP_DIRECTIONS / 2, &height);
    double wave = axes[0];
    const double edges = txp_wave_direction(guess, s, bins, TXP_DIRECTIONS, &wave);
    if (edges > TXP_WAVE_EDGES * height || height < TXP_CLEAR_EDGES * mean) axes[0] = wave;
    /* the focal length is a guess: in a tilted view the other axis need not be the normal */
    double normal = axes[0] + 0.5 * (int)TXP_DIRECTIONS;
    if (normal >= (int)TXP_DIRECTIONS) normal -= (int)TXP_DIRECTIONS;
    const int reach =
        (int)fmin((int)TXP_SQUARE_LEAST + TXP_SQUARE_TILTED * (longer / shorter - 1),
                  TXP_SQUARE_MOST);
    axes[1] = txp_edge_peak(bins, (int)normal, reach, &height);
    if (height < TXP_CLEAR_EDGES * mean) axes[1] = normal;
    wave = normal;
    if (txp_wave_direction(guess, s, bins, reach + TXP_SNAP, &wave) > TXP_WAVE_EDGES * height)
        axes[1] = wave;
}

/* The frame whose axes these are: x is the one that is nearer to the rows of the photograph. */
static void txp_set_axes(const double s[4], const double axes[2], txp_frame *f) {
    double rows[2][2];
    for (int k = 0; k < 2; k++) {
        double sine, cosine;
        txm_sincos(TXM_PI * axes[k] / (int)TXP_DIRECTIONS, &sine, &cosine);
        rows[k][0] = cosine * s[0] + sine * s[2];
        rows[k][1] = cosine * s[1] + sine * s[3];
    }
    const double as_they_are = fabs(rows[0][0] * rows[1][1]);
    const int first = as_they_are >= fabs(rows[0][1] * rows[1][0]) ? 0 : 1;
    const double sx = rows[first][0] < 0 ? -1 : 1, sy = rows[1 - first][1] < 0 ? -1 : 1;
    f->xx = sx * rows[first][0];
    f->xy = sx * rows[first][1];
    f->yx = sy * rows[1 - first][0];
    f->yy = sy * rows[1 - first][1];
}

/* ---- from the frame to the photograph ------------------------------------------------------ */

/* Undo the lens: the radius of which lens(radius) is r. */
static double txp_undo_lens(const txp_view *v, double r) {
    double p = r;
    for (int i = 0; i < 12; i++) {
        const double pp = p * p, value = p * (1 + pp * (v->bend + pp * v->curl)) - r;
        const double slope = 1 + pp * (3 * v->bend + 5 * pp * v->curl);
        if (!(slope > 0.02)) return -1;
        p -= value / slope;
    }
    return p;
}

/* The place of the photograph at (ux, uy) of the plane, by tilt and lens alone. 0: there is none. */
static int txp_seen_at(const txp_view *v, double ux, double uy, double *px, double *py) {
    const double depth = 1 - v->tilt_x * ux - v->tilt_y * uy;
    if (!(depth > 0.05)) return 0;
    const double qx = ux / depth, qy = uy / depth, r = sqrt(qx * qx + qy * qy);
    if (r > 3) return 0;
    const double p = txp_undo_lens(v, r);
    if (!(p >= 0) || !(p < 3)) return 0;
    *px = r > 0 ? qx * p / r : 0;
    *py = r > 0 ? qy * p / r : 0;
    return 1;
}

/* The place of the photograph, in half sides from its middle, at (x, y) of the frame; m: its
   derivatives by x and y. 0: there is none. */
static int txp_frame_place(const txp_frame *f, double x, double y, double *px, double *py,
                           double m[4]) {
    const txp_view *v = &f->view;
    const double det = f->xx * f->yy - f->xy * f->yx;
    const double ux = (f->yy * x - f->xy * y) / det, uy = (f->xx * y - f->yx * x) / det;
    double place[2], k[4];
    if (!txp_seen_at(v, ux, uy, px, py)) return 0;
    /* a field changes slowly: from here its displacement is nearly the one that is meant */
    for (int i = 0; i < TXP_FIELD_ROUNDS && v->field; i++) {
        txp_swell_at(v->field, *px, *py, place, k);
        if (!txp_seen_at(v, ux - place[0], uy - place[1], px, py)) return 0;
    }
    if (!txp_view_place(v, *px, *py, place, k)) return 0;
    /* frame by photograph, inverted */
    const double a = f->xx * k[0] + f->xy * k[2], b = f->xx * k[1] + f->xy * k[3];
    const double c = f->yx * k[0] + f->yy * k[2], d = f->yx * k[1] + f->yy * k[3];
    const double whole = a * d - b * c;
    if (!(fabs(whole) > 1e-9)) return 0;
    m[0] = d / whole;
    m[1] = -b / whole;
    m[2] = -c / whole;
    m[3] = a / whole;
    return 1;
}

/* ---- the rectangle -------------------------------------------------------------------------- */

/* Sums over all cells above and to the left. */
typedef struct txp_survey {
    double inside[TXP_CELLS + 1][TXP_CELLS + 1];
    int outside[TXP_CELLS + 1][TXP_CELLS + 1];
    double scale[TXP_CELLS][TXP_CELLS];
} txp_survey;

/* The box of the frame that holds the photograph. */
static void txp_frame_box(const txp_frame *f, double reach_x, double reach_y, double box[4]) {
    enum { STEPS = 48 };
    box[0] = box[1] = 1e30;
    box[2] = box[3] = -1e30;
    for (int i = 0; i <= STEPS; i++) {
        for (int j = 0; j <= STEPS; j++) {
            double place[2], m[4];
            if (!txp_view_place(&f->view, (2.0 * i / (int)STEPS - 1) * reach_x,
                                (2.0 * j / (int)STEPS - 1) * reach_y, place, m))
                continue;
            /* what is too far away to be seen well is cut off */
            const double size = m[0] * m[3] - m[1] * m[2];
            if (!(size * TXP_FAR_SIDE * TXP_FAR_SIDE < 1)) continue;
            const double x = f->xx * place[0] + f->xy * place[1];
            const double y = f->yx * place[0] + f->yy * place[1];
            box[0] = fmin(box[0], x);
            box[1] = fmin(box[1], y);
            box[2] = fmax(box[2], x);
            box[3] = fmax(box[3], y);
        }
    }
}

/* The upright rectangle that shows most of the photograph and nothing beyond it: part of the box. */
static int txp_frame_rectangle(const txp_frame *f, double reach_x, double reach_y,
                               const double box[4], txp_survey *c, int best[4]) {
    double most = 0;
    memset(c, 0, sizeof *c);
    for (int y = 0; y < TXP_CELLS; y++) {
        for (int x = 0; x < TXP_CELLS; x++) {
            double px = 0, py = 0, m[4] = {0, 0, 0, 0};
            const double fx = box[0] + (box[2] - box[0]) * (x + 0.5) / (int)TXP_CELLS;
            const double fy = box[1] + (box[3] - box[1]) * (y + 0.5) / (int)TXP_CELLS;
            const int is_in = txp_frame_place(f, fx, fy, &px, &py, m) && fabs(px) <= reach_x &&
                              fabs(py) <= reach_y;
            const double size = is_in ? fabs(m[0] * m[3] - m[1] * m[2]) : 0;
            c->scale[y][x] = sqrt(size);
            c->inside[y + 1][x + 1] =
                size + c->inside[y][x + 1] + c->inside[y + 1][x] - c->inside[y][x];
            c->outside[y + 1][x + 1] =
                !is_in + c->outside[y][x + 1] + c->outside[y + 1][x] - c->outside[y][x];
        }
    }
    for (int y0 = 0; y0 < TXP_CELLS; y0++) {
        for (int y1 = y0 + 1; y1 <= TXP_CELLS; y1++) {
            for (int x0 = 0; x0 < TXP_CELLS; x0++) {
                for (int x1 = x0 + 1; x1 <= TXP_CELLS; x1++) {
                    if (c->outside[y1][x1] - c->outside[y0][x1] - c->outside[y1][x0] +
                        c->outside[y0][x0])
                        break;
                    const double sum = c->inside[y1][x1] - c->inside[y0][x1] - c->inside[y1][x0] +
                                       c->inside[y0][x0];
                    if (sum <= most) continue;
                    most = sum;
                    best[0] = x0;
                    best[1] = y0;
                    best[2] = x1;
                    best[3] = y1;
                }
            }
        }
    }
    return most > 0;
}

/* Choose rectangle and resolution: as fine as the photograph is anywhere in the rectangle, but not
   more than twice its pixels. 0: nothing is left. */
static int txp_frame_choose(txp_frame *f, int width, int height, txp_survey *c) {
    double box[4], finest = 0;
    int best[4] = {0, 0, 0, 0};
    f->half = 0.5 * (width > height ? width : height);
    f->middle_x = 0.5 * width;
    f->middle_y = 0.5 * height;
    const double reach_x = (f->middle_x - 0.5) / f->half, reach_y = (f->middle_y - 0.5) / f->half;
    txp_frame_box(f, reach_x, reach_y, box);
    if (!(box[2] > box[0] && box[3] > box[1]) ||
        !txp_frame_rectangle(f, reach_x, reach_y, box, c, best))
        return 0;
    for (int y = best[1]; y < best[3]; y++)
        for (int x = best[0]; x < best[2]; x++) finest = fmax(finest, c->scale[y][x]);
    const double step_x = (box[2] - box[0]) / (int)TXP_CELLS, step_y = (box[3] - box[1]) / (int)TXP_CELLS;
    /* middles of the outermost cells are inside for certain */
    const double w = (best[2] - best[0] - 1) * step_x, h = (best[3] - best[1] - 1) * step_y;
    f->left = box[0] + (best[0] + 0.5) * step_x;
    f->top = box[1] + (best[1] + 0.5) * step_y;
    f->scale = finest * f->half;
    const double most = 2.0 * width * height;
    if (w * h * f->scale * f->scale > most) f->scale = sqrt(most / (w * h));
    f->width = (int)floor(w * f->scale);
    f->height = (int)floor(h * f->scale);
    return f->width >= 1 && f->height >= 1;
}

#endif /* TEXPATCH_FRAME_H */
