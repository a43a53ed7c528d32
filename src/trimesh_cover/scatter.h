#ifndef TRIMESH_COVER_SCATTER_H
#define TRIMESH_COVER_SCATTER_H

#include "check.h"

/* ---- geometry on triangles: patches made ready ----------------------------------------------- */

enum {
    TMC_MOST_POINTS = 1 << 20 /* of a patch */
};
#define TMC_WHOLE 6 /* sixths of a thing that a point inside counts; on a side 3, a corner 1 */

/* A point of a patch with all that does not depend on the triangle. */
typedef struct tmc_item {
    double w[3]; /* weights of the patch's corners                                        */
    double height, scale;
    txm_quat turn;  /* of length 1                                                        */
    uint32_t prototype;
    uint32_t before;      /* sixths of the points before this one                         */
    uint8_t side, corner; /* on which it lies; TMC_NONE = inside; both for a corner    */
} tmc_item;

typedef struct tmc_prepared {
    const tmc_item *items;
    const uint32_t *rim; /* numbers of the items on sides and corners, rising             */
    uint32_t count, rim_count;
    uint32_t sixths; /* of all points                                                     */
} tmc_prepared;

typedef struct tmc_scatter {
    const trimesh_scatter_desc *desc;
    const float *normals;
    const tmc_prepared *kits;
    const uint8_t *owned; /* 1 per triangle: bit k = its side k, bit 3 + k = its corner k; NULL =
                             no patch has points there                                    */
    double *area;         /* 1 per triangle, at the height                                */
    uint32_t *take;       /* 1 per triangle: how many points are used; NULL = all             */
    size_t *offset;       /* 1 per triangle: number of its first instance                 */
    const double *mix;    /* sums of the shares                                           */
    uint64_t key;         /* of the seed                                                  */
    trimesh_instance *out;
} tmc_scatter;

static txm_status tmc_check_point(const trimesh_point *p, size_t patch, size_t i, txm_env *env) {
    const char *why = NULL;
    double turn = 0;
    for (int k = 0; k < 4; k++) turn += (double)p->rotation[k] * p->rotation[k];
    if (!(p->u >= 0 && p->v >= 0 && (double)p->u + p->v <= 1 + TMC_SNAP))
        why = "patch #, point #: u and v must be 0 or more, their sum at most 1";
    else if (!(p->height >= -1000 && p->height <= 1000))
        why = "patch #, point #: height must be -1000 to 1000";
    else if (!(p->scale >= 0 && p->scale <= 1000))
        why = "patch #, point #: scale must be 0 to 1000";
    else if (!txm_is_finite(turn)) why = "patch #, point #: rotation is not finite";
    return why ? txm_fail_numbers(env, TXM_BAD_ARGUMENT, why, patch, i) : TXM_OK;
}

static void tmc_prepare_point(const trimesh_point *p, tmc_item *item) {
    const txm_quat turn = {p->rotation[0], p->rotation[1], p->rotation[2], p->rotation[3]};
    double sum = 0;
    int zeros = 0;
    item->w[0] = 1.0 - p->u - p->v;
    item->w[1] = p->u;
    item->w[2] = p->v;
    item->side = item->corner = TMC_NONE;
    for (int k = 0; k < 3; k++) { /* side k lies opposite corner k + 2 */
        if (item->w[k] > TMC_SNAP) continue;
        item->w[k] = 0;
        item->side = (uint8_t)((k + 1) % 3);
        zeros++;
    }
    for (int k = 0; k < 3; k++) {
        sum += item->w[k];
        if (zeros == 2 && item->w[k] > 0) item->corner = (uint8_t)k;
    }
    for (int k = 0; k < 3; k++) item->w[k] /= sum;
    item->height = p->height;
    item->scale = p->scale > 0 ? p->scale : 1;
    item->turn = txm_quat_unit(turn);
    item->prototype = p->prototype;
}

static uint32_t tmc_sixths(const tmc_item *item) {
    return item->corner != TMC_NONE ? 1 : item->side != TMC_NONE ? 3 : TMC_WHOLE;
}

/* Check and prepare all patches; *rims: has one of them points on its sides? */
static txm_status tmc_prepare(const trimesh_scatter_desc *desc, txm_arena *arena, txm_env *env,
                              tmc_scatter *s, int *rims) {
    size_t total = 0;
    for (size_t p = 0; p < (size_t)desc->patch_count; p++) {
        const trimesh_patch *patch = &desc->patches[p];
        if (patch->count > TMC_MOST_POINTS || (patch->count && !patch->points))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "patch # has more than 2^20 points, or points is NULL", p, 0);
        for (size_t i = 0; i < patch->count; i++) {
            const txm_status status = tmc_check_point(&patch->points[i], p, i, env);
            if (status != TXM_OK) return status;
        }
        total += patch->count;
    }
    tmc_item *items = (tmc_item *)txm_arena_alloc(arena, total + 1, sizeof *items);
    uint32_t *rim = (uint32_t *)txm_arena_alloc(arena, total + 1, sizeof *rim);
    tmc_prepared *kits =
        (tmc_prepared *)txm_arena_alloc(arena, (size_t)desc->patch_count, sizeof *kits);
    const txm_status status = tmc_check_memory(arena, env);
    if (status != TXM_OK) return status;
    s->kits = kits;
    for (size_t p = 0; p < (size_t)desc->patch_count; p++) {
        tmc_prepared *kit = &kits[p];
        kit->items = items;
        kit->rim = rim;
        kit->count = (uint32_t)desc->patches[p].count;
        kit->rim_count = kit->sixths = 0;
        for (uint32_t i = 0; i < kit->count; i++) {
            tmc_prepare_point(&desc->patches[p].points[i], &items[i]);
            items[i].before = kit->sixths;
            kit->sixths += tmc_sixths(&items[i]);
            if (items[i].side != TMC_NONE) rim[kit->rim_count++] = i;
        }
        items += kit->count;
        rim += kit->rim_count;
        if (kit->rim_count) *rims = 1;
    }
    return TXM_OK;
}

/* Assign every edge and every vertex to the first triangle that has it. */
static txm_status tmc_assign_owners(const txm_mesh *mesh, txm_env *env, uint8_t *owned) {
    const size_t sides = 3 * mesh->face_count;
    const uint32_t *vertex = mesh->indices;
    txm_arena scratch;
    uint32_t *sorted;
    txm_arena_init(&scratch, env);
    uint8_t *given = (uint8_t *)txm_arena_zero(&scratch, mesh->vertex_count, 1);
    const txm_status status = tmc_sort_sides(mesh, &scratch, env, &sorted);
    const int good = status == TXM_OK;
    for (size_t i = 0; i < sides && good; i = txm_mesh_edge_end(mesh, sorted, i))
        owned[sorted[i] / 3] |= (uint8_t)(1 << sorted[i] % 3);
    for (size_t i = 0; i < sides && good; i++) {
        if (!given[vertex[i]]) owned[i / 3] |= (uint8_t)(8 << i % 3);
        given[vertex[i]] = 1;
    }
    txm_arena_free(&scratch);
    return status;
}

/* The patch of a triangle and how it is turned. */
static const tmc_prepared *tmc_choice(const tmc_scatter *s, size_t t, size_t *rotation) {
    const trimesh_scatter_desc *d = s->desc;
    const uint64_t h = txm_hash(s->key + t);
    const size_t random = (size_t)((h >> 32) * (uint64_t)d->patch_count >> 32);
    *rotation = d->rotations ? (size_t)d->rotations[t] : (size_t)((h & 0xffffffffu) * 3 >> 32);
    return &s->kits[d->choices ? (size_t)d->choices[t] : random];
}

/* May this triangle show the item, turned so? */
static int tmc_owns(const tmc_scatter *s, size_t t, size_t rotation, const tmc_item *item) {
    if (item->side == TMC_NONE) return 1;
    const int corner = item->corner != TMC_NONE;
    const size_t there = corner ? item->corner : item->side, here = (there + 3 - rotation) % 3;
    return s->owned[t] >> (here + (corner ? 3 : 0)) & 1;
}

/* ---- geometry on triangles: how many where --------------------------------------------------- */

/* The edge length of the triangle that heights and scales refer to. */
static double tmc_unit(const tmc_scatter *s, txm_dvec3 area2) {
    return s->desc->unit > 0 ? s->desc->unit : sqrt(txm_d3_len(area2) / TMC_H);
}

static void tmc_area_block(const void *job, size_t first, size_t end) {
    const tmc_scatter *s = (const tmc_scatter *)job;
    const txm_mesh *mesh = &s->desc->mesh;
    const double height = s->desc->inside ? -s->desc->height : s->desc->height;
    for (size_t t = first; t < end; t++) {
        txm_dvec3 p[3];
        txm_mesh_triangle(mesh, t, p);
        const txm_dvec3 flat = txm_d3_area2(p[0], p[1], p[2]);
        const double up = height * tmc_unit(s, flat);
        for (size_t k = 0; k < 3; k++) {
            const float *n = s->normals + 3 * (size_t)mesh->indices[3 * t + k];
            p[k] = txm_d3_mad(p[k], txm_d3_load(n), up);
        }
        const txm_dvec3 there = txm_d3_area2(p[0], p[1], p[2]);
        /* beyond the centre of curvature the triangle is inverted: no room there */
        s->area[t] = txm_d3_dot(there, flat) > 0 ? 0.5 * txm_d3_len(there) : 0;
    }
}

/* spread the lower ten bits of x to every third bit */
static uint32_t tmc_third_bits(uint32_t x) {
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

/* The triangles in the order of a Morton curve through their middles. pairs: room for 2 per
   triangle. */
static void tmc_morton(const txm_mesh *mesh, txm_pair *pairs) {
    double low[3] = {0, 0, 0}, size = 0;
    for (size_t i = 0; i < 3 * mesh->vertex_count; i++)
        if (i < 3 || mesh->positions[i] < low[i % 3]) low[i % 3] = mesh->positions[i];
    for (size_t i = 0; i < 3 * mesh->vertex_count; i++)
        if (mesh->positions[i] - low[i % 3] > size) size = mesh->positions[i] - low[i % 3];
    for (size_t t = 0; t < mesh->face_count; t++) {
        uint32_t key = 0;
        txm_dvec3 p[3];
        txm_mesh_triangle(mesh, t, p);
        const txm_dvec3 sum = txm_d3_add(txm_d3_add(p[0], p[1]), p[2]);
        const double at[3] = {sum.x / 3 - low[0], sum.y / 3 - low[1], sum.z / 3 - low[2]};
        for (int k = 0; k < 3; k++) {
            const int cell = size > 0 ? (int)(at[k] / size * 1023.5) : 0;
            key |= tmc_third_bits((uint32_t)txm_clampi(cell, 0, 1023)) << k;
        }
        pairs[t].key = key;
        pairs[t].value = (uint32_t)t;
    }
    txm_sort_pairs(pairs, pairs + mesh->face_count, mesh->face_count);
}

/* How many points from the front of a patch come nearest to so many sixths of a thing. */
static uint32_t tmc_prefix_length(const tmc_prepared *kit, double sixths) {
    uint32_t low = 0, high = kit->count; /* low points are not too many, high + 1 points are */
    while (low < high) {
        const uint32_t middle = (low + high + 1) / 2;
        const uint32_t sum = middle < kit->count ? kit->items[middle].before : kit->sixths;
        if (sum <= sixths) low = middle;
        else high = middle - 1;
    }
    if (low == kit->count) return low;
    const tmc_item *next = &kit->items[low];
    return sixths - next->before > 0.5 * tmc_sixths(next) ? low + 1 : low;
}

/* Fill s->take so that the number of things on any stretch of the curve fits its area. */
static txm_status tmc_thin_patches(const tmc_scatter *s, const txm_pair *order, txm_env *env) {
    const size_t triangles = s->desc->mesh.face_count;
    double carry = 0, most = 0;
    int short_of = 0;
    for (size_t i = 0; i < triangles; i++) {
        const size_t t = order[i].value;
        const double wanted = TMC_WHOLE * (double)s->desc->density * s->area[t];
        size_t rotation;
        const tmc_prepared *kit = tmc_choice(s, t, &rotation);
        const uint32_t n = tmc_prefix_length(kit, wanted + carry);
        carry += wanted - (n < kit->count ? kit->items[n].before : kit->sixths);
        /* what one triangle lacks goes to the next few, at most an eighth of their number */
        if (carry > fmax(TMC_WHOLE, wanted / 8)) {
            short_of = 1;
            carry = 0;
        }
        if (wanted > most) most = wanted;
        s->take[t] = n;
    }
    if (!short_of) return TXM_OK;
    most = ceil(most / TMC_WHOLE);
    return txm_fail_numbers(
        env, TXM_TOO_SMALL,
        "the patches have too few points for this density; the largest triangle "
        "needs #, points on sides counted half, on corners a sixth",
        most < 1e15 ? (uint64_t)most : (uint64_t)1000000000000000u, 0);
}

/* s->offset[t] = instances of triangle t */
static void tmc_count_block(const void *job, size_t first, size_t end) {
    const tmc_scatter *s = (const tmc_scatter *)job;
    for (size_t t = first; t < end; t++) {
        size_t rotation;
        const tmc_prepared *kit = tmc_choice(s, t, &rotation);
        const uint32_t take = s->take ? s->take[t] : kit->count;
        size_t count = take;
        for (uint32_t i = 0; i < kit->rim_count && kit->rim[i] < take; i++)
            count -= !tmc_owns(s, t, rotation, &kit->items[kit->rim[i]]);
        s->offset[t] = count;
    }
}

/* ---- geometry on triangles: frames ----------------------------------------------------------- */

/* A unit vector at a right angle to the unit vector n, near x if there is one. */
static txm_dvec3 tmc_tangent(txm_dvec3 x, txm_dvec3 n) {
    x = txm_d3_mad(x, n, -txm_d3_dot(x, n));
    if (txm_d3_len2(x) > 0) return txm_d3_unit(x);
    const txm_vec3 p = txm_vec3_perpendicular(
        txm_v3(txm_float(n.x), txm_float(n.y), txm_float(n.z)));
    x = txm_d3(p.x, p.y, p.z);
    return txm_d3_unit(txm_d3_mad(x, n, -txm_d3_dot(x, n)));
}

/* A triangle that a patch lies on. */
typedef struct tmc_base {
    txm_dvec3 p[3], n[3]; /* by the corner of the patch                     */
    txm_dvec3 ex, ey;     /* images of the patch's axes                     */
    txm_dvec3 up;         /* twice the area times the normal                */
    double unit, edge;  /* for heights and scales; the triangle's own     */
} tmc_base;

static void tmc_base_make(const tmc_scatter *s, size_t t, size_t rotation, tmc_base *b) {
    const txm_mesh *mesh = &s->desc->mesh;
    for (size_t k = 0; k < 3; k++) {
        const size_t v = mesh->indices[3 * t + k], to = (k + rotation) % 3;
        b->p[to] = txm_d3_load(mesh->positions + 3 * v);
        b->n[to] = txm_d3_load(s->normals + 3 * v);
    }
    b->up = txm_d3_area2(b->p[0], b->p[1], b->p[2]);
    b->ex = txm_d3_sub(b->p[1], b->p[0]);
    b->ey = txm_d3_scale(txm_d3_sub(b->p[2], txm_d3_scale(txm_d3_add(b->p[0], b->p[1]), 0.5)),
                         1 / TMC_H);
    b->unit = tmc_unit(s, b->up);
    b->edge = sqrt(txm_d3_len(b->up) / TMC_H);
}

/* Phong tessellation [4]: the point p of the triangle moves towards its feet on the tangent planes
   at the corners, here by half the distance, which on a sphere leads back to the sphere:

       sum_i w_i ((p_i - p) . n_i) n_i  =  sum_{i<j} w_i w_j |p_i - p_j|^2 / r  =  2 sagitta      */
static txm_dvec3 tmc_curve_point(const tmc_base *b, const double w[3], txm_dvec3 p, double curve) {
    txm_dvec3 sum = txm_d3(0, 0, 0);
    for (int k = 0; k < 3; k++)
        sum = txm_d3_mad(sum, b->n[k], w[k] * txm_d3_dot(txm_d3_sub(b->p[k], p), b->n[k]));
    sum = txm_d3_scale(sum, 0.5 * curve);
    const double length = txm_d3_len(sum);
    return length > b->edge ? txm_d3_scale(sum, b->edge / length) : sum;
}

/* A random rotation about z: half its angle is the angle of a random point of the disc. */
static txm_quat tmc_spin(uint64_t h) {
    double x, y, r;
    do {
        h = txm_hash(h + 1);
        x = (double)(int32_t)(uint32_t)h / 2147483648.0;
        y = (double)(int32_t)(uint32_t)(h >> 32) / 2147483648.0;
        r = x * x + y * y;
    } while (r > 1 || r < 0.01);
    const txm_quat q = {0, 0, x / sqrt(r), y / sqrt(r)};
    return q;
}

static uint32_t tmc_mix(const tmc_scatter *s, uint64_t h) {
    const int count = s->desc->mix_count;
    const double x = (double)(h >> 11) / 9007199254740992.0 * s->mix[count - 1];
    int k = 0;
    while (k + 1 < count && s->mix[k] <= x) k++;
    return (uint32_t)k;
}

/* As a float: of meshes near the end of the range of floats, things on them may lie beyond it. */
static float tmc_bounded(double x) {
    const double most = 3.4028234663852886e38;
    return txm_float(x < -most ? -most : x > most ? most : x);
}

static void tmc_place_item(const tmc_scatter *s, const tmc_base *b, const tmc_item *item,
                           uint64_t h, trimesh_instance *out) {
    const trimesh_scatter_desc *d = s->desc;
    const double *w = item->w, side = d->inside ? -1 : 1;
    txm_dvec3 p = txm_d3_scale(b->p[0], w[0]), n = txm_d3_scale(b->n[0], w[0]);
    for (int k = 1; k < 3; k++) {
        p = txm_d3_mad(p, b->p[k], w[k]);
        n = txm_d3_mad(n, b->n[k], w[k]);
    }
    n = txm_d3_unit(txm_d3_len2(n) > 0 ? n : b->up);
    if (!(txm_d3_len2(n) > 0)) n = txm_d3(0, 0, 1);
    if (d->curve > 0) p = txm_d3_add(p, tmc_curve_point(b, w, p, d->curve));
    p = txm_d3_mad(p, n, side * (item->height + d->height) * b->unit);
    /* In the plane of the triangle the nearest rotation takes x to the sum of ex and ey rotated by
       -90 degrees; seen from below, where the winding is opposite, by +90 degrees. */
    const double back = txm_d3_dot(n, b->up) < 0 ? -1 : 1;
    const txm_dvec3 x = tmc_tangent(txm_d3_mad(b->ex, txm_d3_cross(b->ey, n), back), n);
    const txm_dvec3 z = txm_d3_scale(n, side);
    txm_quat q = txm_quat_mul(txm_quat_from_axes(x, txm_d3_cross(z, x), z), item->turn);
    if (d->spin) q = txm_quat_mul(q, tmc_spin(h));
    const double length = sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    const double scale = q.w < 0 ? -1 / length : 1 / length;
    out->position[0] = tmc_bounded(p.x);
    out->position[1] = tmc_bounded(p.y);
    out->position[2] = tmc_bounded(p.z);
    out->rotation[0] = txm_float(q.x * scale);
    out->rotation[1] = txm_float(q.y * scale);
    out->rotation[2] = txm_float(q.z * scale);
    out->rotation[3] = txm_float(q.w * scale);
    out->scale = tmc_bounded(item->scale * b->unit);
    out->prototype = s->mix ? tmc_mix(s, txm_hash(h)) : item->prototype;
}

static void tmc_fill_block(const void *job, size_t first, size_t end) {
    const tmc_scatter *s = (const tmc_scatter *)job;
    for (size_t t = first; t < end; t++) {
        tmc_base base;
        size_t rotation;
        const tmc_prepared *kit = tmc_choice(s, t, &rotation);
        const uint32_t take = s->take ? s->take[t] : kit->count;
        trimesh_instance *out = s->out + s->offset[t];
        tmc_base_make(s, t, rotation, &base);
        for (uint32_t i = 0; i < take; i++) {
            const tmc_item *item = &kit->items[i];
            if (!tmc_owns(s, t, rotation, item)) continue;
            tmc_place_item(s, &base, item, txm_hash(s->key + ((uint64_t)t << 20 | i) + 1), out);
            out->triangle = (uint32_t)t;
            out++;
        }
    }
}

/* ---- geometry on triangles: public ----------------------------------------------------------- */

static txm_status tmc_check_choices(const trimesh_scatter_desc *d, txm_env *env) {
    for (size_t t = 0; t < d->mesh.face_count; t++) {
        if (d->choices && (d->choices[t] < 0 || d->choices[t] >= d->patch_count))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT,
                                    "the choice of triangle # is not 0..patch_count - 1", t, 0);
        if (d->rotations && (d->rotations[t] < 0 || d->rotations[t] > 2))
            return txm_fail_numbers(env, TXM_BAD_ARGUMENT, "the rotation of triangle # is not 0..2",
                                    t, 0);
    }
    return TXM_OK;
}

static txm_status tmc_check_scatter(const trimesh_scatter_desc *d, txm_env *env) {
    double sum = 0;
    if (!d) return txm_fail(env, TXM_BAD_ARGUMENT, "desc is NULL; pass a trimesh_scatter_desc");
    const txm_status status = txm_mesh_check(&d->mesh, "mesh", 3, 1, TRIMESH_MAX_VERTICES, env);
    if (status != TXM_OK) return status;
    if (d->normals && !tmc_are_finite(d->normals, 3 * d->mesh.vertex_count))
        return txm_fail(env, TXM_BAD_ARGUMENT, "normals must be finite");
    if (!d->patches || d->patch_count < 1 || d->patch_count > 65536)
        return txm_fail(env, TXM_BAD_ARGUMENT, "patch_count must be 1 to 65536, patches not NULL");
    if (!(d->unit >= 0 && txm_is_finite(d->unit)))
        return txm_fail(env, TXM_BAD_ARGUMENT, "unit must be finite and 0 or more");
    if (!(d->height >= -1000 && d->height <= 1000))
        return txm_fail(env, TXM_BAD_ARGUMENT, "height must be -1000 to 1000");
    if (!(d->curve >= 0 && d->curve <= 1))
        return txm_fail(env, TXM_BAD_ARGUMENT, "curve must be 0 to 1");
    if (!(d->density >= 0 && txm_is_finite(d->density)))
        return txm_fail(env, TXM_BAD_ARGUMENT, "density must be finite and 0 or more");
    if (d->mix_count < 0 || d->mix_count > 256 || (d->mix && d->mix_count == 0))
        return txm_fail(env, TXM_BAD_ARGUMENT, "mix_count must be 1 to 256 with mix, else 0");
    for (int i = 0; i < d->mix_count && d->mix; i++) {
        if (!(d->mix[i] >= 0 && txm_is_finite(d->mix[i])))
            return txm_fail(env, TXM_BAD_ARGUMENT, "mix must be finite and 0 or more");
        sum += d->mix[i];
    }
    if (d->mix && !(sum > 0)) return txm_fail(env, TXM_BAD_ARGUMENT, "mix must not be all 0");
    return tmc_check_choices(d, env);
}

/* Areas, and from them how much of each patch is used. */
static txm_status tmc_plan_density(tmc_scatter *s, txm_arena *arena, txm_env *env) {
    const size_t triangles = s->desc->mesh.face_count;
    txm_arena scratch;
    txm_arena_init(&scratch, env);
    s->take = (uint32_t *)txm_arena_alloc(arena, triangles, sizeof(uint32_t));
    s->area = (double *)txm_arena_alloc(&scratch, triangles, sizeof(double));
    txm_pair *pairs = (txm_pair *)txm_arena_alloc(&scratch, triangles, 2 * sizeof(txm_pair));
    txm_status status = tmc_check_memory(arena, env);
    if (status == TXM_OK) status = tmc_check_memory(&scratch, env);
    if (status == TXM_OK)
        status = tmc_run_blocks(tmc_area_block, s, triangles, 0.1, 0.2, "areas", env);
    if (status == TXM_OK) {
        tmc_morton(&s->desc->mesh, pairs);
        status = tmc_thin_patches(s, pairs, env);
    }
    txm_arena_free(&scratch);
    return status;
}

/* Everything before placing: normals, patches, owners of edges and vertices, counts, offsets. */
static txm_status tmc_plan(tmc_scatter *s, txm_arena *arena, txm_env *env, size_t *count) {
    const trimesh_scatter_desc *d = s->desc;
    const size_t triangles = d->mesh.face_count;
    int rims = 0;
    txm_status status = tmc_prepare(d, arena, env, s, &rims);
    if (status == TXM_OK) status = tmc_report(env, 0, "patches");
    if (status != TXM_OK) return status;
    s->normals = d->normals;
    if (!s->normals) {
        float *n = (float *)txm_arena_alloc(arena, d->mesh.vertex_count, 3 * sizeof(float));
        txm_env quiet;
        memset(&quiet, 0, sizeof quiet);
        if (env) quiet = *env;
        quiet.progress = NULL; /* the call has progress of its own */
        if ((status = tmc_check_memory(arena, env)) != TXM_OK) return status;
        if ((status = trimesh_normals(&d->mesh, &quiet, n)) != TXM_OK)
            return txm_fail(env, status, quiet.message);
        s->normals = n;
    }
    if (d->mix) {
        double *mix = (double *)txm_arena_alloc(arena, (size_t)d->mix_count, sizeof(double));
        if ((status = tmc_check_memory(arena, env)) != TXM_OK) return status;
        for (int i = 0; i < d->mix_count; i++) mix[i] = d->mix[i] + (i ? mix[i - 1] : 0);
        s->mix = mix;
    }
    if (rims) {
        uint8_t *owned = (uint8_t *)txm_arena_zero(arena, triangles, 1);
        if ((status = tmc_check_memory(arena, env)) == TXM_OK)
            status = tmc_assign_owners(&d->mesh, env, owned);
        if (status != TXM_OK) return status;
        s->owned = owned;
    }
    if (d->density > 0) status = tmc_plan_density(s, arena, env);
    if (status != TXM_OK) return status;
    s->offset = (size_t *)txm_arena_alloc(arena, triangles, sizeof(size_t));
    if ((status = tmc_check_memory(arena, env)) != TXM_OK) return status;
    status = tmc_run_blocks(tmc_count_block, s, triangles, 0.2, 0.3, "counting", env);
    uint64_t sum = 0;
    for (size_t t = 0; t < triangles && status == TXM_OK; t++) {
        const size_t here = s->offset[t];
        s->offset[t] = (size_t)sum;
        sum += here;
        if (sum > (uint64_t)INT32_MAX || sum > SIZE_MAX / sizeof(trimesh_instance))
            return txm_fail(env, TXM_TOO_LARGE, "more than 2^31 instances");
    }
    if (status == TXM_OK) *count = (size_t)sum;
    return status;
}

TRIMESH_COVER_API txm_status trimesh_scatter(const trimesh_scatter_desc *desc, txm_env *env,
                                       trimesh_instance *out, size_t capacity, size_t *count) {
    tmc_scatter s;
    txm_arena arena;
    txm_status status = tmc_check_scatter(desc, env);
    if (status != TXM_OK) return status;
    if (!count) return txm_fail(env, TXM_BAD_ARGUMENT, "count is NULL");
    if (desc->mesh.face_count == 0) {
        *count = 0;
        return TXM_OK;
    }
    memset(&s, 0, sizeof s);
    s.desc = desc;
    s.key = txm_hash(desc->seed + 0x9e3779b97f4a7c15u) << 1;
    s.out = out;
    txm_arena_init(&arena, env);
    status = tmc_plan(&s, &arena, env, count);
    if (status == TXM_OK && out && *count > capacity)
        status = txm_fail_numbers(env, TXM_TOO_LARGE, "# instances, but out has room for # only",
                                  *count, capacity);
    if (status == TXM_OK && out)
        status = tmc_run_blocks(tmc_fill_block, &s, desc->mesh.face_count, 0.3, 1, "placing", env);
    txm_arena_free(&arena);
    return status;
}

TRIMESH_COVER_API void trimesh_instance_apply(const trimesh_instance *instance, const float point[3],
                                        float out[3]) {
    const double x = instance->rotation[0], y = instance->rotation[1], z = instance->rotation[2];
    const txm_dvec3 axis = txm_d3(x, y, z), p = txm_d3_scale(txm_d3_load(point), instance->scale);
    const txm_dvec3 t = txm_d3_scale(txm_d3_cross(axis, p), 2);
    const txm_dvec3 turned =
        txm_d3_add(txm_d3_mad(p, t, instance->rotation[3]), txm_d3_cross(axis, t));
    out[0] = txm_float(turned.x + instance->position[0]);
    out[1] = txm_float(turned.y + instance->position[1]);
    out[2] = txm_float(turned.z + instance->position[2]);
}

#endif /* TRIMESH_COVER_SCATTER_H */
