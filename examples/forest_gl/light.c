/* light.c - how much light comes through the crowns, as a texture of three dimensions
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

/* How much wood and leaves there are, in the cells of a grid: how much light is lost on a way of one
   metre. */
typedef struct cells {
    int n[3];
    size_t count;
    float size, low[3];
    float *loss, *above; /* above: the sum of all losses on the way to the light */
} cells;

static float *cell_at(const cells *c, int x, int y, int z) {
    return c->loss + (((size_t)z * (size_t)c->n[1] + (size_t)y) * (size_t)c->n[0] + (size_t)x);
}

/* A ball that lets exp(-loss) of the light through its middle. */
static void add_ball(cells *c, const float p[3], float radius, float loss) {
    const float reach = txm_maxf(radius, 0.75f * c->size);
    int from[3], to[3];
    loss *= radius * radius / (reach * reach);
    for (int k = 0; k < 3; k++) {
        from[k] = txm_clampi((int)((p[k] - reach - c->low[k]) / c->size), 0, c->n[k] - 1);
        to[k] = txm_clampi((int)((p[k] + reach - c->low[k]) / c->size), 0, c->n[k] - 1);
    }
    for (int z = from[2]; z <= to[2]; z++) {
        for (int y = from[1]; y <= to[1]; y++) {
            for (int x = from[0]; x <= to[0]; x++) {
                const float d[3] = {c->low[0] + ((float)x + 0.5f) * c->size - p[0],
                                    c->low[1] + ((float)y + 0.5f) * c->size - p[1],
                                    c->low[2] + ((float)z + 0.5f) * c->size - p[2]};
                const float square = dot(d, d) / (reach * reach);
                if (square < 1) *cell_at(c, x, y, z) += 0.75f * loss / reach * (1 - square);
            }
        }
    }
}

/* Sums from the top down along a direction, layer by layer, each read between its cells: shadows
   soften with distance. */
static void sum_along(cells *c, const float to_light[3]) {
    const float step = c->size / to_light[1];
    const float dx = to_light[0] / to_light[1], dz = to_light[2] / to_light[1];
    const size_t line = (size_t)c->n[0], slice = line * (size_t)c->n[1];
    for (int y = c->n[1] - 1; y >= 0; y--) {
        for (int z = 0; z < c->n[2]; z++) {
            for (int x = 0; x < c->n[0]; x++) {
                const float u = (float)x + dx, v = (float)z + dz;
                const int i = (int)floorf(u), j = (int)floorf(v);
                float sum = 0;
                for (int k = 0; k < 4 && y + 1 < c->n[1]; k++) {
                    const int a = i + (k & 1), b = j + (k >> 1);
                    const float wa = k & 1 ? u - (float)i : 1 - (u - (float)i);
                    const float wb = k >> 1 ? v - (float)j : 1 - (v - (float)j);
                    if (a < 0 || b < 0 || a >= c->n[0] || b >= c->n[2]) continue;
                    const size_t up = (size_t)b * slice + (size_t)(y + 1) * line + (size_t)a;
                    sum += wa * wb * (c->above[up] + 0.5f * step * c->loss[up]);
                }
                const size_t here = (size_t)z * slice + (size_t)y * line + (size_t)x;
                c->above[here] = sum + 0.5f * step * c->loss[here];
            }
        }
    }
}

/* A grid over the forest and its shadows. */
static int open_cells(forest_gl *f, cells *c) {
    float volume = 1, size[3];
    for (int k = 0; k < 3; k++) {
        /* shadows fall to the side that the sun is not on */
        const float shadow = f->high[1] * f->frame.sun[k] / f->frame.sun[1], rim = k == 1 ? 0 : 1;
        c->low[k] = f->low[k] - rim * txm_maxf(shadow, 1);
        size[k] = f->high[k] + rim * txm_maxf(-shadow, 1) - c->low[k];
        volume *= size[k];
    }
    c->size = txm_maxf(cbrtf(volume / MAX_CELLS), 0.05f);
    c->count = 1;
    for (int k = 0; k < 3; k++) {
        c->n[k] = txm_clampi((int)(size[k] / c->size) + 1, 1, 1024);
        c->count *= (size_t)c->n[k];
    }
    c->loss = (float *)need(f, c->count, sizeof *c->loss);
    c->above = (float *)need(f, c->count, sizeof *c->above);
    return c->loss && c->above;
}

static void add_trees(const forest_gl *f, cells *c) {
    float p[3];
    for (uint32_t i = 0; i < f->forest->cluster_count; i++) {
        const treepieces_cluster *cluster = &f->forest->clusters[i];
        axis_point(f, cluster->node, cluster->along, p);
        add_ball(c, p, 0.9f * cluster->radius, 0.9f);
    }
    for (uint32_t i = 0; i < f->forest->node_count; i++) {
        const treepieces_node *n = &f->forest->nodes[i];
        const int balls = txm_clampi((int)(n->length / txm_maxf(c->size, n->radius)), 1, 16);
        /* together as much shade as a rod gives, and within it, so that its surface has light */
        const float loss = 2 * txm_minf(1, n->length / ((float)balls * 2 * n->radius));
        for (int k = 0; k < balls; k++) {
            axis_point(f, i, ((float)k + 0.5f) / (float)balls, p);
            add_ball(c, p, txm_minf(0.8f * n->radius, 2 * c->size), loss);
        }
    }
}

static void upload_light(forest_gl *f, const cells *c, const uint8_t *bytes) {
    static const float open[4] = {1, 1, 1, 1}; /* outside of the grid */
    glActiveTexture(GL_TEXTURE0 + LIGHT);
    glBindTexture(GL_TEXTURE_3D, f->textures[LIGHT]);
    glTexImage3D(GL_TEXTURE_3D, 0, GL_RG8, c->n[0], c->n[1], c->n[2], 0, GL_RG, GL_UNSIGNED_BYTE,
                 bytes);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_BORDER);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_BORDER);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_R, GL_CLAMP_TO_BORDER);
    glTexParameterfv(GL_TEXTURE_3D, GL_TEXTURE_BORDER_COLOR, open);
    for (int k = 0; k < 3; k++) {
        f->frame.box_low[k] = c->low[k];
        f->frame.box_scale[k] = 1 / ((float)c->n[k] * c->size);
    }
    f->frame.box_low[3] = c->size;
}

/* Light from the sun and from five directions of the sky, for the forest as it stands now. The wind
   moves shadows too little to do it again. */
int make_light(forest_gl *f) {
    static const float sky[5][3] = {{0, 1, 0}, {0.7f, 0.7f, 0}, {-0.7f, 0.7f, 0}, {0, 0.7f, 0.7f},
                                    {0, 0.7f, -0.7f}};
    cells c = {{0, 0, 0}, 0, 0, {0, 0, 0}, NULL, NULL};
    const int is_open = open_cells(f, &c);
    float *from_sky = is_open ? (float *)need(f, c.count, sizeof *from_sky) : NULL;
    uint8_t *bytes = from_sky ? (uint8_t *)need(f, c.count, 2) : NULL;
    if (bytes) {
        add_trees(f, &c);
        for (int d = 0; d < 5; d++) {
            sum_along(&c, sky[d]);
            for (size_t i = 0; i < c.count; i++) from_sky[i] += 51 * expf(-c.above[i]);
        }
        sum_along(&c, f->frame.sun);
        for (size_t i = 0; i < c.count; i++) {
            bytes[2 * i] = (uint8_t)(255 * expf(-c.above[i]) + 0.5f);
            bytes[2 * i + 1] = (uint8_t)(from_sky[i] + 0.5f);
        }
        upload_light(f, &c, bytes);
    }
    free(c.loss);
    free(c.above);
    free(from_sky);
    free(bytes);
    return !f->failed[0];
}
