/* retile_dress.c - colors and textures for the result of 'texkit retile'
   SPDX-License-Identifier: MIT OR Unlicense */
#include "retile.h"
#include "files/image_io.h"
#include "textiles.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>

enum { CREASE = 50 }; /* degrees, where --crease is not given */

/* A picture as PNG: the file itself if it is one. */
static int read_png(retile_job *j, const char *path, txm_image *image) {
    static const unsigned char magic[] = {0x89, 'P', 'N', 'G'};
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    if (!bytes) return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", path, strerror(errno));
    const int status = decode_picture(&j->run, path, bytes, size, 0, TXM_U8, image);
    if (status) {
        free(bytes);
        return status;
    }
    if (size > sizeof magic && !memcmp(bytes, magic, sizeof magic)) {
        j->png = bytes;
        j->png_size = size;
        return CLI_DONE;
    }
    free(bytes);
    return encode_picture(&j->run, j->png_path, image, &j->png, &j->png_size);
}

/* ---- carried over from the input ------------------------------------------------------------ */

static int carry_colors(retile_job *j) {
    const size_t from = 4 * j->input.vertex_count, count = j->result->vertex_count;
    const txm_mesh input = mesh_view(&j->input);
    float *values = (float *)new_array(from, sizeof(float));
    float *carried = (float *)new_array(4 * count, sizeof(float));
    trimesh_values v = {0};
    int status = CLI_DONE;
    j->output.colors = (unsigned char *)new_array(count, 4);
    if (!values || !carried || !j->output.colors) {
        status = fail_memory(&j->run);
    } else {
        for (size_t i = 0; i < from; i++) values[i] = (float)j->input.colors[i];
        v.values = values;
        v.count = j->input.vertex_count;
        v.channels = 4;
        status = check_result(&j->run, trimesh_transfer(&input, &v, j->result->sources, count,
                                                        &j->run.env, carried), j->run.inputs[0]);
    }
    for (size_t i = 0; i < 4 * count && !status; i++)
        j->output.colors[i] = (unsigned char)(txm_clampf(carried[i], 0, 255) + 0.5f);
    free(values);
    free(carried);
    return status;
}

/* Values of the input's corners, `channels` each, at those of the result, on the same side of seams.
   Releases them, and returns the result's, or NULL with *status. */
static float *carry_corners(retile_job *j, float *values, int channels, int *status) {
    const size_t corners = 3 * j->input.triangle_count, made = 3 * j->result->triangle_count;
    const txm_mesh input = mesh_view(&j->input), mesh = trimesh_as_view(j->result);
    uint32_t *own = (uint32_t *)new_array(corners, sizeof(uint32_t)); /* each corner has its own */
    float *carried = (float *)new_array(made, (size_t)channels * sizeof(float));
    trimesh_values v = {0};
    *status = values && own && carried ? CLI_DONE : fail_memory(&j->run);
    if (!*status) {
        for (size_t c = 0; c < corners; c++) own[c] = (uint32_t)c;
        v.values = values;
        v.count = corners;
        v.indices = own;
        v.channels = channels;
        *status = check_result(&j->run,
                               trimesh_transfer_corners(&input, &v, &mesh, j->result->sources,
                                                        &j->run.env, carried),
                               j->run.inputs[0]);
    }
    free(own);
    free(values);
    if (!*status) return carried;
    free(carried);
    return NULL;
}

/* Texture coordinates and materials together: where materials meet, there is a seam. */
static int carry_uvs(retile_job *j) {
    const mesh_data *in = &j->input;
    const size_t corners = 3 * in->triangle_count, made = 3 * j->result->triangle_count;
    float *values = (float *)new_array(corners, 3 * sizeof(float));
    int status;
    for (size_t c = 0; c < corners && values; c++) {
        const size_t face = c / 3;
        values[3 * c] = in->uvs ? in->uvs[2 * c] : 0;
        values[3 * c + 1] = in->uvs ? in->uvs[2 * c + 1] : 0;
        values[3 * c + 2] = in->materials ? (float)in->materials[face] : 0;
    }
    float *carried = carry_corners(j, values, 3, &status);
    if (status) return status;
    if (in->uvs) j->output.uvs = (float *)new_array(made, 2 * sizeof(float));
    if (in->materials) j->output.materials = (uint32_t *)new_array(made / 3, sizeof(uint32_t));
    if ((in->uvs && !j->output.uvs) || (in->materials && !j->output.materials)) {
        free(carried);
        return fail_memory(&j->run);
    }
    for (size_t c = 0; c < made; c++) {
        if (in->uvs) memcpy(j->output.uvs + 2 * c, carried + 3 * c, 2 * sizeof(float));
        if (in->materials) j->output.materials[c / 3] = (uint32_t)carried[3 * c + 2];
    }
    free(carried);
    if (!in->materials) return CLI_DONE;
    j->output.material_count = in->material_count;
    j->output.material_names = in->material_names;
    j->output.library = in->library;
    return CLI_DONE;
}

/* Colors of faces: each triangle takes that of the face that it lies on. */
static int carry_face_colors(retile_job *j) {
    const unsigned char *colors = j->input.face_colors;
    const size_t corners = 3 * j->input.triangle_count, made = j->result->triangle_count;
    float *values = (float *)new_array(corners, 4 * sizeof(float));
    int status;
    for (size_t i = 0; i < 4 * corners && values; i++) {
        const size_t face = i / 12, channel = i % 4;
        values[i] = colors[4 * face + channel];
    }
    float *carried = carry_corners(j, values, 4, &status);
    if (status) return status;
    j->output.face_colors = (unsigned char *)new_array(made, 4);
    for (size_t i = 0; i < 4 * made && j->output.face_colors; i++)
        j->output.face_colors[i] = (unsigned char)carried[12 * (i / 4) + i % 4];
    free(carried);
    return j->output.face_colors ? CLI_DONE : fail_memory(&j->run);
}

/* OBJ files have colors at vertices only: those get the mean of the faces around them. */
static int average_face_colors(retile_job *j) {
    mesh_data *m = &j->output;
    uint32_t *sums = (uint32_t *)new_array(m->vertex_count, 5 * sizeof(uint32_t));
    m->colors = (unsigned char *)new_array(m->vertex_count, 4);
    if (!sums || !m->colors) {
        free(sums);
        return fail_memory(&j->run);
    }
    memset(sums, 0, 5 * m->vertex_count * sizeof(uint32_t));
    for (size_t c = 0; c < 3 * m->triangle_count; c++) {
        uint32_t *sum = sums + 5 * (size_t)m->indices[c];
        for (size_t k = 0; k < 4; k++) sum[k] += m->face_colors[4 * (c / 3) + k];
        sum[4]++;
    }
    for (size_t v = 0; v < m->vertex_count; v++) {
        const uint32_t *sum = sums + 5 * v, count = sum[4] ? sum[4] : 1;
        for (size_t k = 0; k < 4; k++)
            m->colors[4 * v + k] = (unsigned char)((sum[k] + count / 2) / count);
    }
    free(sums);
    free(m->face_colors);
    m->face_colors = NULL;
    return CLI_DONE;
}

/* Put the triangles into the order of their materials, as files have them. */
static int sort_by_material(retile_job *j) {
    mesh_data *m = &j->output;
    const size_t n = m->triangle_count;
    txm_pair *order = (txm_pair *)new_array(n, 2 * sizeof *order);
    float *uvs = m->uvs ? (float *)new_array(n, 6 * sizeof(float)) : NULL;
    unsigned char *colors = m->face_colors ? (unsigned char *)new_array(n, 4) : NULL;
    j->sorted = (uint32_t *)new_array(n, 3 * sizeof(uint32_t));
    if (!order || !j->sorted || (m->uvs && !uvs) || (m->face_colors && !colors)) {
        free(order);
        free(uvs);
        free(colors);
        return fail_memory(&j->run);
    }
    for (size_t t = 0; t < n; t++) {
        order[t].key = m->materials[t];
        order[t].value = (uint32_t)t;
    }
    txm_sort_pairs(order, order + n, n);
    for (size_t t = 0; t < n; t++) {
        const size_t from = order[t].value;
        m->materials[t] = order[t].key;
        memcpy(j->sorted + 3 * t, m->indices + 3 * from, 3 * sizeof(uint32_t));
        if (uvs) memcpy(uvs + 6 * t, m->uvs + 6 * from, 6 * sizeof(float));
        if (colors) memcpy(colors + 4 * t, m->face_colors + 4 * from, 4);
    }
    free(order);
    free(m->uvs);
    free(m->face_colors);
    m->uvs = uvs;
    m->face_colors = colors;
    m->indices = j->sorted;
    return CLI_DONE;
}

/* Say in one line what the output's format cannot hold; warn_of_stl has done it for STL. */
static void warn_lost(retile_job *j) {
    const mesh_data *m = &j->output;
    const int is_ply = !strcmp(j->extension, ".ply"), is_glb = !strcmp(j->extension, ".glb");
    char lost[160] = "";
    size_t n = 0;
    if (!strcmp(j->extension, ".stl")) return;
    if (is_ply && m->materials && (m->material_count > 1 || m->library))
        n += (size_t)snprintf(lost, sizeof lost, "materials (%lu)",
                              (unsigned long)m->material_count);
    if (!is_ply && j->input.face_colors && j->input.colors)
        n += (size_t)snprintf(lost + n, sizeof lost - n, "%scolors of faces", n ? ", " : "");
    if (is_glb && m->library && !j->png)
        snprintf(lost + n, sizeof lost - n, "%scolors and pictures of '%.60s'", n ? ", " : "",
                 m->library);
    if (lost[0]) cli_warn(&j->run, "'%s': not kept in %s: %s", j->run.inputs[0], j->extension, lost);
}

/* ---- tiles ---------------------------------------------------------------------------------- */

/* A triangle set as tiles.json describes it. */
typedef struct tile_file {
    textiles_desc desc;
    textiles_tile *tiles;
    float *uv; /* 6 per tile */
    int count;
} tile_file;

static int get_three(const cJSON *tile, const char *name, int low, int high, int values[3]) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(tile, name);
    for (int k = 0; k < 3; k++) {
        if (!json_int(cJSON_GetArrayItem(list, k), NULL, low, high, &values[k])) return 0;
    }
    return cJSON_GetArraySize(list) == 3;
}

static int get_tile(const cJSON *json, int colors, textiles_tile *tile, float uv[6]) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(json, "uv");
    memset(tile, 0, sizeof *tile);
    for (int k = 0; k < 6; k++) {
        const cJSON *x = cJSON_GetArrayItem(cJSON_GetArrayItem(list, k / 2), k % 2);
        if (!cJSON_IsNumber(x) || !(x->valuedouble >= 0 && x->valuedouble <= 1)) return 0;
        uv[k] = (float)x->valuedouble;
    }
    return get_three(json, "edges", 0, colors - 1, tile->edges) &&
           get_three(json, "directions", -1, 1, tile->directions) &&
           json_int(json, "variant", 0, TEXTILES_MAX_VARIANTS - 1, &tile->variant);
}

/* 0 with *why if this is no triangle set */
static int parse_tiles(const cJSON *json, tile_file *f, const char **why) {
    textiles_desc *d = &f->desc;
    const cJSON *kind = cJSON_GetObjectItemCaseSensitive(json, "kind");
    const cJSON *atlas = cJSON_GetObjectItemCaseSensitive(json, "atlas");
    const cJSON *packing = cJSON_GetObjectItemCaseSensitive(atlas, "packing");
    const cJSON *tiles = cJSON_GetObjectItemCaseSensitive(json, "tiles"), *tile;
    if (!cJSON_IsString(kind) || !cJSON_IsString(packing) || !cJSON_IsArray(tiles))
        return *why = "not a file of 'texkit tiles'", 0;
    if (strcmp(kind->valuestring, "triangle") != 0)
        return *why = "not a set of triangles; make one with --kind triangle", 0;
    if (strcmp(packing->valuestring, "packed") != 0)
        return *why = "not packed into one picture; make the set with --packing packed", 0;
    *why = "a field is missing or out of range; make the set again";
    if (!json_int(json, "colors", 2, TEXTILES_MAX_COLORS, &d->colors) ||
        !json_int(json, "variants", 1, TEXTILES_MAX_VARIANTS, &d->variants))
        return 0;
    const int c = d->colors, reduced = 2 * c * c * c * d->variants;
    const int whole = (8 * c * c * c + 4 * c) / 3 * d->variants;
    f->count = cJSON_GetArraySize(tiles);
    if (f->count != reduced && f->count != whole)
        return *why = "the number of tiles is wrong for such a set; make it again", 0;
    d->reduced = f->count == reduced;
    f->tiles = (textiles_tile *)new_array((size_t)f->count, sizeof *f->tiles);
    f->uv = (float *)new_array((size_t)f->count, 6 * sizeof(float));
    if (!f->tiles || !f->uv) return *why = "out of memory", 0;
    int i = 0;
    cJSON_ArrayForEach(tile, tiles) {
        if (!get_tile(tile, c, &f->tiles[i], f->uv + 6 * i)) return 0;
        i++;
    }
    return 1;
}

/* A set for assigning only: all its tiles share one small gray picture. */
static txm_status import_tiles(retile_job *j, tile_file *f, textiles_set **set) {
    static unsigned char gray[(TEXTILES_MIN_TRIANGLE + 1) * (TEXTILES_MIN_TRIANGLE + 1)];
    txm_image *images = (txm_image *)calloc((size_t)f->count, sizeof *images);
    if (!images) return TXM_OUT_OF_MEMORY;
    for (int i = 0; i < f->count; i++) {
        images[i].pixels = gray;
        images[i].width = images[i].height = TEXTILES_MIN_TRIANGLE + 1;
        images[i].channels = 1;
    }
    f->desc.kind = TEXTILES_TRIANGLE;
    f->desc.size = TEXTILES_MIN_TRIANGLE;
    const txm_status result = textiles_import(&f->desc, images, f->count, 1, &j->run.env, set);
    free(images);
    return result;
}

/* Does the file have the tiles of the set, in the same order? */
static int same_tiles(const textiles_set *set, const tile_file *f) {
    for (int i = 0; i < f->count; i++) {
        textiles_tile t;
        if (!textiles_tile_at(set, i, &t) || t.variant != f->tiles[i].variant) return 0;
        for (int k = 0; k < 3; k++) {
            if (t.edges[k] != f->tiles[i].edges[k] || t.directions[k] != f->tiles[i].directions[k])
                return 0;
        }
    }
    return 1;
}

/* tiles.json and atlas.png of the folder. */
static int read_tiles(retile_job *j, tile_file *f, textiles_set **set) {
    char path[MAX_PATH];
    const char *why = "";
    txm_image atlas;
    cJSON *json;
    int status = read_tiles_json(&j->run, j->tiles, &json);
    if (status) return status;
    const int ok = parse_tiles(json, f, &why);
    cJSON_Delete(json);
    snprintf(path, sizeof path, "%s/tiles.json", j->tiles);
    if (!ok) return cli_fail(&j->run, CLI_FAILED, "'%s': %s", path, why);
    const txm_status result = import_tiles(j, f, set);
    status = check_result(&j->run, result, path);
    if (status) return status;
    if (!same_tiles(*set, f))
        return cli_fail(&j->run, CLI_FAILED, "'%s': its tiles are not in the right order; make the set "
                        "again", path);
    snprintf(path, sizeof path, "%s/atlas.png", j->tiles);
    status = read_png(j, path, &atlas);
    if (!status) image_free(&atlas);
    return status;
}

/* Texture coordinates from the tile chosen for each triangle. */
static int place_tiles(retile_job *j, const int *tiles, const int *rotations, const float *uv,
                       int count) {
    const size_t triangles = j->result->triangle_count;
    j->output.uvs = (float *)new_array(triangles, 6 * sizeof(float));
    if (!j->output.uvs) return fail_memory(&j->run);
    return check_result(&j->run, trimesh_place_tiles(triangles, tiles, rotations, uv, (size_t)count,
                                                     &j->run.env, j->output.uvs), j->run.inputs[0]);
}

static int dress_with_tiles(retile_job *j) {
    const trimesh_mesh *m = j->result;
    textiles_set *set = NULL;
    tile_file f;
    memset(&f, 0, sizeof f);
    int *tiles = (int *)new_array(2 * m->triangle_count, sizeof(int));
    int status = tiles ? read_tiles(j, &f, &set) : fail_memory(&j->run);
    if (!status)
        status = check_result(&j->run,
                              textiles_assign_triangles(set, m->indices, m->triangle_count,
                                                        m->vertex_count, j->run.seed, &j->run.env,
                                                        tiles, tiles + m->triangle_count),
                              j->tiles);
    if (!status) status = place_tiles(j, tiles, tiles + m->triangle_count, f.uv, f.count);
    textiles_set_free(set);
    free(f.tiles);
    free(f.uv);
    free(tiles);
    return status;
}

/* ---- patches -------------------------------------------------------------------------------- */

/* The layout of a picture of patches, with the default gutter or, failing that, without one. Its
   height may be off by one pixel, through rounding. */
static int find_layout(retile_job *j, const txm_image *picture, trimesh_atlas *atlas) {
    const int pitch = picture->width / j->patch_count;
    const int gutters[2] = {j->gutter < 0 ? 8 : j->gutter, j->gutter < 0 ? 0 : j->gutter};
    for (int k = 0; k < 2 && picture->width % j->patch_count == 0; k++) {
        const int size = pitch - 2 * gutters[k];
        if (size < 2 ||
            trimesh_atlas_make(j->patch_count, size, gutters[k], &j->run.env, atlas) != TXM_OK)
            continue;
        if (abs(atlas->height - picture->height) > 1) continue;
        atlas->height = picture->height;
        return CLI_DONE;
    }
    return cli_fail(
        &j->run, CLI_FAILED,
        "'%s' is %d x %d; %d patches in a row with gutters of G pixels are %d W wide and "
        "(W - 2 G) sqrt(3)/2 + 2 G high; see --patch-count and --gutter",
        j->patches, picture->width, picture->height, j->patch_count, j->patch_count);
}

static int dress_with_patches(retile_job *j) {
    const txm_mesh mesh = trimesh_as_view(j->result);
    trimesh_choose_desc choose = {0};
    trimesh_atlas atlas;
    txm_image picture = {0};
    int *patches = (int *)new_array(2 * mesh.face_count, sizeof(int));
    float *uv = (float *)new_array((size_t)j->patch_count, 6 * sizeof(float));
    choose.patches = j->patch_count;
    choose.seed = j->run.seed;
    int status = patches && uv ? read_png(j, j->patches, &picture) : fail_memory(&j->run);
    if (!status) status = find_layout(j, &picture, &atlas);
    if (!status)
        status = check_result(&j->run,
                              trimesh_choose(&mesh, &choose, &j->run.env, patches,
                                             patches + mesh.face_count),
                              j->run.inputs[0]);
    if (!status) {
        trimesh_atlas_uv(&atlas, -1, uv);
        status = place_tiles(j, patches, patches + mesh.face_count, uv, j->patch_count);
    }
    image_free(&picture);
    free(patches);
    free(uv);
    return status;
}

/* ---- all of it ------------------------------------------------------------------------------ */

/* Colors, texture coordinates and materials that the input has. */
static int carry_over(retile_job *j) {
    const mesh_data *in = &j->input;
    const int is_ply = !strcmp(j->extension, ".ply"), is_obj = !strcmp(j->extension, ".obj");
    const int is_textured = j->tiles || j->patches; /* instead */
    int status = CLI_DONE;
    if (in->colors) status = carry_colors(j);
    if (!status && in->face_colors && (is_ply || !in->colors)) status = carry_face_colors(j);
    if (!status && is_obj && j->output.face_colors) status = average_face_colors(j);
    if (!status && !is_textured && (in->uvs || in->materials)) status = carry_uvs(j);
    if (!status && j->output.materials) status = sort_by_material(j);
    if (!status) warn_lost(j);
    return status;
}

int retile_dress(retile_job *j) {
    cli_stage(&j->run, "dress");
    int status = carry_over(j);
    if (!status && j->tiles) status = dress_with_tiles(j);
    if (!status && j->patches) status = dress_with_patches(j);
    if (!status && j->texture) {
        txm_image picture = {0};
        if (!j->output.uvs)
            return cli_fail(&j->run, CLI_FAILED, "--texture: '%s' has no texture coordinates",
                            j->run.inputs[0]);
        status = read_png(j, j->texture, &picture);
        image_free(&picture);
    }
    const float crease = j->desc.crease_angle > 0 ? j->desc.crease_angle : CREASE;
    if (!status && j->report.crease_edges && !mesh_crease(&j->output, crease))
        status = fail_memory(&j->run);
    if (!status && j->instances) status = retile_place_instances(j);
    return status;
}
