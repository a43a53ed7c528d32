/* render.c - draws meshes to look at; render.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense

   All vertices are projected once; then each band of rows draws the triangles that touch it. Only
   the samples of the bands being drawn are held in memory.                                      */
#include "render.h"

enum {
    BAND = 32,        /* rows of pixels                                     */
    MAX_SIDE = 16384, /* pixels                                             */
    MAX_LEVELS = 16,  /* mip-map levels                                     */
    SHADES = 1 << 16  /* steps of the table from linear light to sRGB       */
};

static const float FRAME = 0.94f; /* of the picture that the scene takes */

/* ---- the texture, with its mip-map levels ---------------------------------------------------- */

typedef struct mips {
    txm_image levels[MAX_LEVELS]; /* floats, linear RGB */
    int count;
} mips;

static void mips_free(mips *m) {
    for (int k = 0; k < m->count; k++) free(m->levels[k].pixels);
}

static int add_level(mips *m, int width, int height) {
    txm_image *level = &m->levels[m->count];
    size_t bytes;
    memset(level, 0, sizeof *level);
    level->width = width;
    level->height = height;
    level->channels = 3;
    level->sample = TXM_F32;
    if (!txm_mul((size_t)width, (size_t)height, 3 * sizeof(float), &bytes)) return 0;
    level->pixels = malloc(bytes);
    m->count += level->pixels != NULL;
    return level->pixels != NULL;
}

static int mips_make(mips *m, const txm_image *texture) {
    float linear[256];
    txm_env env = {0};
    for (int i = 0; i < 256; i++) linear[i] = txm_srgb_to_linear((float)i / 255.0f);
    txm_image from;
    txm_arena shown; /* a copy whose hidden colours are those of visible neighbours, if there are any */
    txm_arena_init(&shown, &env);
    if (texture->sample == TXM_F32 || !add_level(m, texture->width, texture->height)) return 0;
    if (txm_image_bled(texture, 0, &shown, &env, &from) != TXM_OK) {
        txm_arena_free(&shown);
        return 0;
    }
    const int n = from.channels;
    for (int y = 0; y < from.height; y++) {
        const unsigned char *row = (const unsigned char *)txm_image_row_const(&from, y);
        float *to = (float *)m->levels[0].pixels + 3 * (size_t)y * (size_t)from.width;
        for (int x = 0; x < from.width; x++) {
            for (int k = 0; k < 3; k++) {
                const int c = n < 3 ? 0 : k;
                *to++ = from.sample == TXM_U8 ? linear[row[x * n + c]]
                                              : txm_srgb_to_linear(txm_image_get(&from, x, y, c));
            }
        }
    }
    txm_arena_free(&shown);
    while (m->count < MAX_LEVELS) {
        const txm_image *last = &m->levels[m->count - 1];
        if (last->width == 1 && last->height == 1) break;
        if (!add_level(m, txm_level_side(last->width, 1), txm_level_side(last->height, 1))) return 0;
        if (txm_image_halve(last, TXM_COLOR, 0, &m->levels[m->count - 1], &env) != TXM_OK) return 0;
    }
    return 1;
}

/* Add weight times the bilinear value at (u, v), 0..1, the border going on outside. */
static void add_bilinear(const txm_image *level, float u, float v, float weight, float rgb[3]) {
    const float x = txm_clampf(u * (float)level->width - 0.5f, 0, (float)(level->width - 1));
    const float y = txm_clampf(v * (float)level->height - 0.5f, 0, (float)(level->height - 1));
    const int i = (int)x, j = (int)y;
    const size_t right = i + 1 < level->width ? 3 : 0;
    const size_t down = j + 1 < level->height ? 3 * (size_t)level->width : 0;
    const float s = x - (float)i, t = y - (float)j;
    const float *p =
        (const float *)level->pixels + 3 * ((size_t)j * (size_t)level->width + (size_t)i);
    for (size_t k = 0; k < 3; k++) {
        const float upper = p[k] + s * (p[right + k] - p[k]);
        const float lower = p[down + k] + s * (p[down + right + k] - p[down + k]);
        rgb[k] += weight * (upper + t * (lower - upper));
    }
}

/* The texture at (u, v), between two levels. level: log2 of texels per sample. */
static void look_up(const mips *m, float u, float v, float level, float rgb[3]) {
    const float l = txm_clampf(level, 0, (float)(m->count - 1));
    const int k = (int)l;
    const float t = l - (float)k;
    rgb[0] = rgb[1] = rgb[2] = 0;
    add_bilinear(&m->levels[k], u, v, 1 - t, rgb);
    if (t > 0) add_bilinear(&m->levels[k + 1], u, v, t, rgb);
}

/* ---- the scene, seen ------------------------------------------------------------------------- */

/* A vertex in the picture. near and share run linearly over the picture: the larger near hides the
   other, and share is what attributes are weighted by (1 / depth, or 1 for parallel rays). */
typedef struct seen {
    float x, y, near, share; /* x, y in samples, y down     */
    float normal[3];         /* in the camera's axes        */
} seen;

typedef struct layer {
    const mesh_data *mesh;
    seen *vertices;
    const mips *texture; /* or NULL */
    float wire;          /* width in samples */
} layer;

enum { MAX_LAYERS = 16 };

typedef struct picture {
    const render_desc *desc;
    layer layers[MAX_LAYERS];
    int layer_count, samples;
    txm_vec3 right, up, back; /* the camera's axes */
    txm_image *out;
    unsigned char *shades; /* SHADES from linear light */
    float linear[256];
    int failed; /* a band ran out of memory */
} picture;

static void set_axes(picture *p) {
    const render_desc *d = p->desc;
    const double degree = 3.14159265358979 / 180;
    const double a = (double)d->azimuth * degree, e = (double)d->elevation * degree;
    const double ca = cos(a), sa = sin(a), ce = cos(e), se = sin(e);
    p->right = txm_v3((float)ca, 0, (float)-sa);
    p->up = txm_v3((float)(-se * sa), (float)ce, (float)(-se * ca));
    p->back = txm_v3((float)(ce * sa), (float)se, (float)(ce * ca));
    if (!d->z_up) return;
    txm_vec3 *axes[3] = {&p->right, &p->up, &p->back};
    for (int k = 0; k < 3; k++) *axes[k] = txm_v3(axes[k]->x, -axes[k]->z, axes[k]->y);
}

static txm_vec3 vector_at(const float *p) {
    return txm_v3(p[0], p[1], p[2]);
}

/* A direction in the camera's axes. */
static void turn(const picture *p, txm_vec3 v, float to[3]) {
    to[0] = txm_vec3_dot(v, p->right);
    to[1] = txm_vec3_dot(v, p->up);
    to[2] = txm_vec3_dot(v, p->back);
}

/* Normals of the vertices, by the areas of their triangles. 3 per vertex, for free(). */
static float *make_normals(const mesh_data *m) {
    float *normals = (float *)calloc(m->vertex_count, 3 * sizeof(float));
    for (size_t t = 0; t < m->triangle_count && normals; t++) {
        const uint32_t *v = m->indices + 3 * t;
        double p[3][3];
        for (int k = 0; k < 3; k++) {
            for (int c = 0; c < 3; c++)
                p[k][c] = (double)m->positions[3 * (size_t)v[k] + (size_t)c];
        }
        for (int c = 0; c < 3; c++) {
            const int y = (c + 1) % 3, z = (c + 2) % 3;
            const double n = (p[1][y] - p[0][y]) * (p[2][z] - p[0][z]) -
                             (p[1][z] - p[0][z]) * (p[2][y] - p[0][y]);
            for (int k = 0; k < 3; k++) normals[3 * (size_t)v[k] + (size_t)c] += (float)n;
        }
    }
    return normals;
}

/* The vertices of a layer in the camera's axes, from the centre of the scene; share holds nothing
   yet, near is the height towards the camera. */
static int turn_layer(const picture *p, layer *l, txm_vec3 centre) {
    const mesh_data *m = l->mesh;
    const int none = p->desc->flat || m->corner_normals;
    float *own = m->normals || none ? NULL : make_normals(m);
    const float *normals = m->normals ? m->normals : own;
    l->vertices = (seen *)calloc(m->vertex_count, sizeof *l->vertices);
    if (!l->vertices || (!normals && !none)) {
        free(own);
        return 0;
    }
    for (size_t i = 0; i < m->vertex_count; i++) {
        const float *q = m->positions + 3 * i;
        seen *s = &l->vertices[i];
        const txm_vec3 v = txm_vec3_sub(txm_v3(q[0], q[1], q[2]), centre);
        s->x = txm_vec3_dot(v, p->right);
        s->y = txm_vec3_dot(v, p->up);
        s->near = txm_vec3_dot(v, p->back);
        if (!normals) continue;
        turn(p, txm_vec3_normalize(vector_at(normals + 3 * i)), s->normal);
    }
    free(own);
    return 1;
}

/* Put the camera where all is before it, and fit what it sees into the picture. */
static void frame(picture *p) {
    const render_desc *d = p->desc;
    const double tangent = tan((double)d->field / 2 * 3.14159265358979 / 180);
    double radius = 0, low[2] = {0, 0}, high[2] = {0, 0};
    int first = 1;
    for (int l = 0; l < p->layer_count; l++) {
        for (size_t i = 0; i < p->layers[l].mesh->vertex_count; i++) {
            const seen *s = &p->layers[l].vertices[i];
            const double r = sqrt((double)s->x * (double)s->x + (double)s->y * (double)s->y +
                                  (double)s->near * (double)s->near);
            if (r > radius) radius = r;
        }
    }
    if (!(radius > 0)) radius = 1;
    const double distance = d->field > 0 ? radius * sqrt(1 + 1 / (tangent * tangent)) : 0;
    for (int l = 0; l < p->layer_count; l++) {
        for (size_t i = 0; i < p->layers[l].mesh->vertex_count; i++) {
            seen *s = &p->layers[l].vertices[i];
            s->share = 1;
            if (d->field > 0) {
                s->share = (float)(radius / (distance * 1.001 - (double)s->near));
                s->x *= s->share;
                s->y *= s->share;
                s->near = s->share;
            }
            const double at[2] = {(double)s->x, (double)s->y};
            for (int k = 0; k < 2; k++) {
                if (first || at[k] < low[k]) low[k] = at[k];
                if (first || at[k] > high[k]) high[k] = at[k];
            }
            first = 0;
        }
    }
    const double width = d->width * p->samples, height = d->height * p->samples;
    const double span[2] = {high[0] - low[0], high[1] - low[1]};
    double scale = 1e30;
    if (span[0] > 0) scale = width / span[0];
    if (span[1] > 0 && height / span[1] < scale) scale = height / span[1];
    if (scale > 1e29) scale = 1;
    scale *= (double)FRAME * (d->zoom > 0 ? (double)d->zoom : 1);
    for (int l = 0; l < p->layer_count; l++) {
        for (size_t i = 0; i < p->layers[l].mesh->vertex_count; i++) {
            seen *s = &p->layers[l].vertices[i];
            s->x = (float)(width / 2 + scale * ((double)s->x - (low[0] + high[0]) / 2));
            s->y = (float)(height / 2 - scale * ((double)s->y - (low[1] + high[1]) / 2));
        }
    }
}

/* ---- shading -------------------------------------------------------------------------------- */

/* Light of a surface with this normal, in the camera's axes: a lamp from the upper left in front,
   and a sky that is brighter above. */
static float light(const float n[3]) {
    const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0)) return 0.5f;
    const float unit = (n[2] < 0 ? -1.0f : 1.0f) / length;
    const float lamp = unit * (-0.45f * n[0] + 0.55f * n[1] + 0.70f * n[2]);
    return 0.22f + 0.10f * unit * n[1] + 0.78f * txm_maxf(lamp, 0);
}

/* ---- a band of rows ---------------------------------------------------------------------------- */

typedef struct band {
    const picture *picture;
    int top, rows, columns; /* in samples */
    float *near;            /* 1 per sample     */
    float *rgb;             /* 3 per sample     */
} band;

/* One triangle on its way: E_k(x, y) = a_k x + b_k y + c_k is 1 at corner k and 0 on the side
   opposite to it. */
typedef struct raster {
    const layer *layer;
    const seen *v[3];
    size_t triangle;
    double a[3], b[3], c[3];
    float distance[3]; /* samples from corner k to the side opposite */
    float thin;        /* how much lines fade where triangles get too small for them */
    float level;       /* of the texture: log2 of texels per sample  */
    float normals[3][3]; /* of the corners, in the camera's axes */
} raster;

static int raster_begin(raster *r, const picture *p, const layer *l, size_t t) {
    const uint32_t *index = l->mesh->indices + 3 * t;
    memset(r, 0, sizeof *r);
    r->layer = l;
    r->triangle = t;
    for (int k = 0; k < 3; k++) r->v[k] = &l->vertices[index[k]];
    double x[3], y[3];
    for (int k = 0; k < 3; k++) {
        x[k] = (double)r->v[k]->x;
        y[k] = (double)r->v[k]->y;
    }
    const double area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (!(fabs(area) > 1e-9)) return 0;
    const txm_vec3 o = vector_at(l->mesh->positions + 3 * (size_t)index[0]);
    const txm_vec3 flat = txm_vec3_normalize(
        txm_vec3_cross(txm_vec3_sub(vector_at(l->mesh->positions + 3 * (size_t)index[1]), o),
                       txm_vec3_sub(vector_at(l->mesh->positions + 3 * (size_t)index[2]), o)));
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        r->a[k] = (y[i] - y[j]) / area;
        r->b[k] = (x[j] - x[i]) / area;
        r->c[k] = (x[i] * y[j] - x[j] * y[i]) / area;
        r->distance[k] = (float)(1 / sqrt(r->a[k] * r->a[k] + r->b[k] * r->b[k]));
    }
    const float least = txm_minf(r->distance[0], txm_minf(r->distance[1], r->distance[2]));
    r->thin = l->wire > 0 ? txm_minf(least / (5 * l->wire), 1) : 0;
    if (l->texture) {
        const float *uv = l->mesh->uvs + 6 * t;
        const txm_image *base = &l->texture->levels[0];
        const double texels =
            fabs(((double)uv[2] - (double)uv[0]) * ((double)uv[5] - (double)uv[1]) -
                 ((double)uv[4] - (double)uv[0]) * ((double)uv[3] - (double)uv[1])) *
            base->width * base->height;
        if (texels > 0) r->level = (float)(0.5 * log2(texels / fabs(area)));
    }
    for (size_t k = 0; k < 3; k++) {
        txm_vec3 n = flat;
        memcpy(r->normals[k], r->v[k]->normal, sizeof r->normals[k]);
        if (!p->desc->flat && !l->mesh->corner_normals) continue;
        if (!p->desc->flat) n = vector_at(l->mesh->corner_normals + 9 * t + 3 * k);
        turn(p, n, r->normals[k]);
    }
    return 1;
}

/* The surface's own color at shares w of the corners. */
static void surface_color(const raster *r, const picture *p, const float w[3], float rgb[3]) {
    const mesh_data *m = r->layer->mesh;
    rgb[0] = rgb[1] = rgb[2] = 0.62f;
    if (r->layer->texture) {
        const float *uv = m->uvs + 6 * r->triangle;
        look_up(r->layer->texture, w[0] * uv[0] + w[1] * uv[2] + w[2] * uv[4],
                w[0] * uv[1] + w[1] * uv[3] + w[2] * uv[5], r->level, rgb);
    } else if (p->desc->colors && m->colors) {
        const int largest = w[0] >= w[1] ? (w[0] >= w[2] ? 0 : 2) : w[1] >= w[2] ? 1 : 2;
        rgb[0] = rgb[1] = rgb[2] = 0;
        for (int k = 0; k < 3; k++) {
            const unsigned char *c =
                m->colors + 4 * (size_t)m->indices[3 * r->triangle + (size_t)k];
            const float share = !p->desc->cells ? w[k] : k == largest ? 1.0f : 0.0f;
            for (int i = 0; i < 3; i++) rgb[i] += share * p->linear[c[i]];
        }
    }
}

/* One sample; e: the edge functions there. */
static void shade(const raster *r, const picture *p, const float e[3], float *rgb) {
    float w[3], normal[3], sum = 0;
    for (int k = 0; k < 3; k++) sum += w[k] = e[k] * r->v[k]->share;
    for (int k = 0; k < 3; k++) w[k] /= sum;
    surface_color(r, p, w, rgb);
    for (int i = 0; i < 3; i++)
        normal[i] = w[0] * r->normals[0][i] + w[1] * r->normals[1][i] + w[2] * r->normals[2][i];
    const float brightness = light(normal);
    float line = 0;
    if (r->layer->wire > 0) { /* half of the line is on the triangle beyond the edge */
        for (int k = 0; k < 3; k++)
            line = txm_maxf(line, 0.5f * r->layer->wire + 0.5f - e[k] * r->distance[k]);
        line = 0.85f * r->thin * txm_clampf(line, 0, 1);
    }
    for (int i = 0; i < 3; i++) {
        const float lit = rgb[i] * brightness;
        rgb[i] = lit + line * (0.015f - lit);
    }
}

static int clamp_to(double x, int low, int high) {
    return x < low ? low : x > high ? high : (int)x;
}

static void draw_triangle(const band *b, const layer *l, size_t t) {
    const uint32_t *index = l->mesh->indices + 3 * t;
    const seen *v[3] = {&l->vertices[index[0]], &l->vertices[index[1]], &l->vertices[index[2]]};
    const double bottom = b->top + b->rows;
    const double y0 = (double)txm_minf(v[0]->y, txm_minf(v[1]->y, v[2]->y));
    const double y1 = (double)txm_maxf(v[0]->y, txm_maxf(v[1]->y, v[2]->y));
    if (y0 > bottom || y1 < b->top) return;
    const double x0 = (double)txm_minf(v[0]->x, txm_minf(v[1]->x, v[2]->x));
    const double x1 = (double)txm_maxf(v[0]->x, txm_maxf(v[1]->x, v[2]->x));
    if (x0 > b->columns || x1 < 0) return;

    raster r;
    if (!raster_begin(&r, b->picture, l, t)) return;
    const int left = clamp_to(floor(x0), 0, b->columns), right = clamp_to(ceil(x1), 0, b->columns);
    const int first = clamp_to(floor(y0) - b->top, 0, b->rows);
    const int last = clamp_to(ceil(y1) - b->top, 0, b->rows);
    for (int y = first; y < last; y++) {
        const double sy = b->top + y + 0.5;
        /* the span of the row where all three edge functions are 0 or more */
        double from = left, to = right;
        for (int k = 0; k < 3; k++) {
            const double rest = r.b[k] * sy + r.c[k];
            if (r.a[k] > 0) from = -rest / r.a[k] - 0.5 > from ? -rest / r.a[k] - 0.5 : from;
            else if (r.a[k] < 0) to = -rest / r.a[k] - 0.5 < to ? -rest / r.a[k] - 0.5 : to;
            else if (rest < 0) to = from;
        }
        const size_t row = (size_t)y * (size_t)b->columns;
        for (int x = clamp_to(ceil(from - 1e-6), left, right); x < to - 1e-6 && x < right; x++) {
            float e[3], near = 0;
            for (int k = 0; k < 3; k++) {
                e[k] = txm_maxf((float)(r.a[k] * (x + 0.5) + r.b[k] * sy + r.c[k]), 0);
                near += e[k] * r.v[k]->near;
            }
            if (near <= b->near[row + (size_t)x]) continue;
            b->near[row + (size_t)x] = near;
            shade(&r, b->picture, e, b->rgb + 3 * (row + (size_t)x));
        }
    }
}

/* The mean of the samples of each pixel, in sRGB. */
static void develop(const band *b, int first_row) {
    const picture *p = b->picture;
    const int n = p->samples, width = p->out->width;
    for (int y = 0; y < b->rows / n; y++) {
        unsigned char *to = (unsigned char *)p->out->pixels +
                            3 * (size_t)(first_row + y) * (size_t)width;
        for (int x = 0; x < width; x++) {
            for (int k = 0; k < 3; k++) {
                float sum = 0;
                for (int j = 0; j < n; j++) {
                    const float *s = b->rgb + 3 * ((size_t)(y * n + j) * (size_t)b->columns +
                                                   (size_t)(x * n)) + k;
                    for (int i = 0; i < n; i++) sum += s[3 * i];
                }
                const float mean = txm_clampf(sum / (float)(n * n), 0, 1);
                *to++ = p->shades[(int)(mean * (SHADES - 1) + 0.5f)];
            }
        }
    }
}

static void draw_band(picture *p, int index) {
    const int first_row = index * BAND, n = p->samples;
    const int rows = p->out->height - first_row < BAND ? p->out->height - first_row : BAND;
    band b = {NULL, 0, 0, 0, NULL, NULL};
    b.picture = p;
    b.top = first_row * n;
    b.rows = rows * n;
    b.columns = p->out->width * n;
    const size_t count = (size_t)b.rows * (size_t)b.columns;
    b.near = (float *)malloc(count * sizeof(float));
    b.rgb = (float *)calloc(count, 3 * sizeof(float));
    if (b.near && b.rgb) {
        for (size_t i = 0; i < count; i++) {
            b.near[i] = -1e30f;
            b.rgb[3 * i] = b.rgb[3 * i + 1] = b.rgb[3 * i + 2] = 0.93f;
        }
        for (int l = 0; l < p->layer_count; l++) {
            for (size_t t = 0; t < p->layers[l].mesh->triangle_count; t++)
                draw_triangle(&b, &p->layers[l], t);
        }
        develop(&b, first_row);
    } else {
        p->failed = 1; /* the same value from whichever thread */
    }
    free(b.near);
    free(b.rgb);
}

/* ---- all of it ---------------------------------------------------------------------------- */

/* The centre of the bounding box. */
static txm_vec3 centre_of(const picture *p) {
    double low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    int first = 1;
    for (int l = 0; l < p->layer_count; l++) {
        const mesh_data *m = p->layers[l].mesh;
        for (size_t i = 0; i < m->vertex_count; i++, first = 0) {
            for (int k = 0; k < 3; k++) {
                const double x = (double)m->positions[3 * i + (size_t)k];
                if (first || x < low[k]) low[k] = x;
                if (first || x > high[k]) high[k] = x;
            }
        }
    }
    return txm_v3((float)((low[0] + high[0]) / 2), (float)((low[1] + high[1]) / 2),
                  (float)((low[2] + high[2]) / 2));
}

static int draw(picture *p, const char **why) {
    const render_desc *d = p->desc;
    txm_image *out = p->out;
    for (int i = 0; i < 256; i++) p->linear[i] = txm_srgb_to_linear((float)i / 255.0f);
    p->shades = (unsigned char *)malloc(SHADES);
    out->pixels = malloc(3 * (size_t)d->width * (size_t)d->height);
    int ok = p->shades && out->pixels;
    for (int i = 0; i < SHADES && ok; i++)
        p->shades[i] =
            (unsigned char)(255 * txm_linear_to_srgb((float)i / (float)(SHADES - 1)) + 0.5f);
    const txm_vec3 centre = centre_of(p);
    for (int l = 0; l < p->layer_count && ok; l++) ok = turn_layer(p, &p->layers[l], centre);
    if (ok) {
        frame(p);
        const int bands = (d->height + BAND - 1) / BAND;
#ifdef _OPENMP
#pragma omp parallel for schedule(dynamic)
#endif
        for (int i = 0; i < bands; i++) draw_band(p, i);
        ok = !p->failed;
    }
    free(p->shades);
    if (!ok) *why = "not enough memory to draw this";
    return ok;
}

int render(const mesh_scene *scene, const render_desc *desc, txm_image *out, const char **why) {
    picture p;
    mips texture;
    mesh_data baked[MAX_LAYERS];
    int ok = 1, bakes = 0;
    memset(&p, 0, sizeof p);
    memset(&texture, 0, sizeof texture);
    memset(out, 0, sizeof *out);
    p.desc = desc;
    p.out = out;
    p.samples = desc->samples ? desc->samples : 3;
    if (desc->width < 1 || desc->height < 1 || desc->width > MAX_SIDE || desc->height > MAX_SIDE ||
        p.samples < 1 || p.samples > 4 || !(desc->field >= 0 && desc->field <= 120))
        return *why = "a size or an angle is out of range", 0;
    if (scene->instance_count >= MAX_LAYERS) return *why = "too many kinds of copies", 0;
    out->width = desc->width;
    out->height = desc->height;
    out->channels = 3;

    set_axes(&p);
    if (scene->surface) {
        layer *l = &p.layers[p.layer_count++];
        l->mesh = scene->surface;
        l->wire = desc->wire * (float)p.samples;
        if (desc->texture && scene->surface->uvs) {
            ok = mips_make(&texture, desc->texture);
            if (!ok) *why = "the texture is too large for the memory";
            l->texture = &texture;
        }
    }
    for (int i = 0; i < scene->instance_count && ok; i++) {
        if (scene->instances[i].count == 0) continue;
        ok = mesh_bake(&scene->instances[i], 1, &baked[bakes], why);
        if (ok) p.layers[p.layer_count++].mesh = &baked[bakes++];
    }
    if (ok && p.layer_count == 0) ok = 0, *why = "there is nothing to draw";
    ok = ok && draw(&p, why);
    for (int l = 0; l < p.layer_count; l++) free(p.layers[l].vertices);
    for (int i = 0; i < bakes; i++) mesh_free(&baked[i]);
    mips_free(&texture);
    if (!ok) {
        free(out->pixels);
        memset(out, 0, sizeof *out);
    }
    return ok;
}
