/* light.c - sun and sky light that reaches each place, as a 3D texture
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

/* Extinction of light by wood and leaves on a grid. */
typedef struct light_grid {
    int n[3];            /* cells along x, y, z                                               */
    size_t count;        /* of all cells                                                      */
    float size, low[3];  /* edge of a cell; corner of the grid, metres                        */
    float *loss;         /* optical depth per metre                                           */
    float *above;        /* optical depth from the cell to the light                          */
} light_grid;

static float *cell_at(const light_grid *g, int x, int y, int z) {
    return g->loss + (((size_t)z * (size_t)g->n[1] + (size_t)y) * (size_t)g->n[0] + (size_t)x);
}

/* Add a sphere of optical depth `loss` along a ray through its centre, denser in the middle. */
static void add_sphere(light_grid *g, const float p[3], float radius, float loss) {
    const float reach = txm_maxf(radius, 0.75f * g->size);
    int from[3], to[3];
    loss *= radius * radius / (reach * reach);
    for (int k = 0; k < 3; k++) {
        from[k] = txm_clampi((int)((p[k] - reach - g->low[k]) / g->size), 0, g->n[k] - 1);
        to[k] = txm_clampi((int)((p[k] + reach - g->low[k]) / g->size), 0, g->n[k] - 1);
    }
    for (int z = from[2]; z <= to[2]; z++) {
        for (int y = from[1]; y <= to[1]; y++) {
            for (int x = from[0]; x <= to[0]; x++) {
                const float d[3] = {g->low[0] + ((float)x + 0.5f) * g->size - p[0],
                                    g->low[1] + ((float)y + 0.5f) * g->size - p[1],
                                    g->low[2] + ((float)z + 0.5f) * g->size - p[2]};
                const float square = dot(d, d) / (reach * reach);
                if (square < 1) *cell_at(g, x, y, z) += 0.75f * loss / reach * (1 - square);
            }
        }
    }
}

/* Integrate the loss towards a light, layer by layer from the top. Each layer reads the one above it
   bilinearly, so that shadows get softer with distance. */
static void accumulate(light_grid *g, const float to_light[3]) {
    const float step = g->size / to_light[1];
    const float dx = to_light[0] / to_light[1], dz = to_light[2] / to_light[1];
    const size_t line = (size_t)g->n[0], slice = line * (size_t)g->n[1];
    for (int y = g->n[1] - 1; y >= 0; y--) {
        for (int z = 0; z < g->n[2]; z++) {
            for (int x = 0; x < g->n[0]; x++) {
                const float u = (float)x + dx, v = (float)z + dz;
                const int i = (int)floorf(u), j = (int)floorf(v);
                float sum = 0;
                for (int k = 0; k < 4 && y + 1 < g->n[1]; k++) {
                    const int a = i + (k & 1), b = j + (k >> 1);
                    const float wa = k & 1 ? u - (float)i : 1 - (u - (float)i);
                    const float wb = k >> 1 ? v - (float)j : 1 - (v - (float)j);
                    if (a < 0 || b < 0 || a >= g->n[0] || b >= g->n[2]) continue;
                    const size_t up = (size_t)b * slice + (size_t)(y + 1) * line + (size_t)a;
                    sum += wa * wb * (g->above[up] + 0.5f * step * g->loss[up]);
                }
                const size_t here = (size_t)z * slice + (size_t)y * line + (size_t)x;
                g->above[here] = sum + 0.5f * step * g->loss[here];
            }
        }
    }
}

/* A grid that contains the forest and its shadows. */
static int open_grid(forest_gl *f, light_grid *g) {
    float volume = 1, size[3];
    for (int k = 0; k < 3; k++) {
        /* shadows fall on the side away from the sun */
        const float shadow = f->high[1] * f->frame.sun[k] / f->frame.sun[1], margin = k == 1 ? 0 : 1;
        g->low[k] = f->low[k] - margin * txm_maxf(shadow, 1);
        size[k] = f->high[k] + margin * txm_maxf(-shadow, 1) - g->low[k];
        volume *= size[k];
    }
    g->size = txm_maxf(cbrtf(volume / MAX_CELLS), 0.05f);
    g->count = 1;
    for (int k = 0; k < 3; k++) {
        g->n[k] = txm_clampi((int)(size[k] / g->size) + 1, 1, 1024);
        g->count *= (size_t)g->n[k];
    }
    g->loss = (float *)allocate(f, g->count, sizeof *g->loss);
    g->above = (float *)allocate(f, g->count, sizeof *g->above);
    return g->loss && g->above;
}

static void add_trees(const forest_gl *f, light_grid *g) {
    float p[3];
    for (uint32_t i = 0; i < f->forest->cluster_count; i++) {
        const treepieces_cluster *cluster = &f->forest->clusters[i];
        axis_point(f, cluster->node, cluster->along, p);
        add_sphere(g, p, 0.9f * cluster->radius, 0.9f);
    }
    for (uint32_t i = 0; i < f->forest->node_count; i++) {
        const treepieces_node *n = &f->forest->nodes[i];
        const int spheres = txm_clampi((int)(n->length / txm_maxf(g->size, n->radius)), 1, 16);
        /* spheres that together cast the shadow of the branch, inside it so that it does not shade
           its own surface */
        const float loss = 2 * txm_minf(1, n->length / ((float)spheres * 2 * n->radius));
        for (int k = 0; k < spheres; k++) {
            axis_point(f, i, ((float)k + 0.5f) / (float)spheres, p);
            add_sphere(g, p, txm_minf(0.8f * n->radius, 2 * g->size), loss);
        }
    }
}

static void upload_light(forest_gl *f, const light_grid *g, const uint8_t *bytes) {
    static const float unshaded[4] = {1, 1, 1, 1}; /* outside of the grid */
    glActiveTexture(GL_TEXTURE0 + LIGHT);
    glBindTexture(GL_TEXTURE_3D, f->textures[LIGHT]);
    glTexImage3D(GL_TEXTURE_3D, 0, GL_RG8, g->n[0], g->n[1], g->n[2], 0, GL_RG, GL_UNSIGNED_BYTE,
                 bytes);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_BORDER);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_BORDER);
    glTexParameteri(GL_TEXTURE_3D, GL_TEXTURE_WRAP_R, GL_CLAMP_TO_BORDER);
    glTexParameterfv(GL_TEXTURE_3D, GL_TEXTURE_BORDER_COLOR, unshaded);
    for (int k = 0; k < 3; k++) {
        f->frame.box_low[k] = g->low[k];
        f->frame.box_scale[k] = 1 / ((float)g->n[k] * g->size);
    }
    f->frame.box_low[3] = g->size;
}

/* Light from the sun (red) and from five directions of the sky (green), for the forest as it stands
   now. The wind moves shadows too little to compute them again. */
int make_light(forest_gl *f) {
    static const float sky[5][3] = {{0, 1, 0}, {0.7f, 0.7f, 0}, {-0.7f, 0.7f, 0}, {0, 0.7f, 0.7f},
                                    {0, 0.7f, -0.7f}};
    const float to_sun[3] = {0.53f, 0.62f, 0.58f}, length = sqrtf(dot(to_sun, to_sun));
    for (int k = 0; k < 3; k++) f->frame.sun[k] = to_sun[k] / length;
    light_grid g = {{0, 0, 0}, 0, 0, {0, 0, 0}, NULL, NULL};
    const int is_open = open_grid(f, &g);
    float *from_sky = is_open ? (float *)allocate(f, g.count, sizeof *from_sky) : NULL;
    uint8_t *bytes = from_sky ? (uint8_t *)allocate(f, g.count, 2) : NULL;
    if (bytes) {
        add_trees(f, &g);
        for (int d = 0; d < 5; d++) {
            accumulate(&g, sky[d]);
            for (size_t i = 0; i < g.count; i++) from_sky[i] += 51 * expf(-g.above[i]);
        }
        accumulate(&g, f->frame.sun);
        for (size_t i = 0; i < g.count; i++) {
            bytes[2 * i] = (uint8_t)(255 * expf(-g.above[i]) + 0.5f);
            bytes[2 * i + 1] = (uint8_t)(from_sky[i] + 0.5f);
        }
        upload_light(f, &g, bytes);
    }
    free(g.loss);
    free(g.above);
    free(from_sky);
    free(bytes);
    return !f->failed[0];
}
