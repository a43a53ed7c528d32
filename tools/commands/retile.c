/* retile.c - texkit retile: a triangle mesh in, one of near-equilateral triangles out
   SPDX-License-Identifier: MIT OR Unlicense

   Read, retile, dress (texture coordinates, colors, instances), measure, write: run_retile at the
   end tells the story.                                                                         */
#include "command.h"
#include "files/image_io.h"
#include "files/mesh_io.h"
#include "textiles.h"

#define TRIMESH_COVER_IMPLEMENTATION
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_cover.h"
#include "trimesh_relax.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>

enum {
    MAX_PROTOTYPES = 64, /* distinct colors of instanced points */
    SPHERE_STEPS = 3,    /* 72 triangles                        */
    CREASE = 50          /* degrees, where --crease is not given */
};

static const double TRIANGLE_HEIGHT = 0.86602540378443864676; /* sqrt(3) / 2 */

static const cli_manual retile_manual = {
    "retile", "MESH -o OUT --vertices N [options]",
    "cover a surface with near-equilateral triangles",
    "MESH is an OBJ or PLY file; small faults are mended (equal vertices welded, triangles\n"
    "turned to agree, fins cut off). OUT ends in .obj, .ply or .glb; it has exactly N\n"
    "vertices, before those along texture seams are doubled. Texture coordinates and\n"
    "colors of MESH are carried over. Instead of them,\n"
    "--tiles DIR takes a set of 'texkit tiles --kind triangle' and gives every triangle\n"
    "  the tile whose edges match its neighbours';\n"
    "--patches PICTURE takes a row of equilateral triangles, side by side with a gutter\n"
    "  around each, and gives every triangle one of them at random.\n"
    "The picture is written beside OUT, as OUT-atlas.png, and is inside of a .glb.\n"
    "--instances PATCH.ply puts things on every triangle. PATCH lies on the triangle\n"
    "  (0,0), (1,0), (1/2,sqrt(3)/2), z upwards. Points, with nx ny nz or qx qy qz qw if\n"
    "  they are to be tilted, become small spheres of their color; a mesh is put on every\n"
    "  triangle as it is. A .glb holds the surface and refers to the things\n"
    "  (EXT_mesh_gpu_instancing); .ply and .obj hold the things or points alone.\n"
    "Of --stats, 'mended' counts: vertices welded, vertices unused, triangles degenerate,\n"
    "duplicate, fins, turned, vertices split. 'quality' is twice the inscribed circle's\n"
    "radius over the circumscribed one's: 1 for an equilateral triangle.\n",
    "  texkit retile bunny.obj -o bunny.glb --vertices 5000 --tiles gravel-triangles\n"
    "  texkit retile cell.ply -o cell.glb --vertices 800 --instances lipids.ply\n",
    1, "mesh", 0, "take fewer vertices"};

typedef struct retile_job {
    cli run;
    char extension[8];

    /* options */
    trimesh_desc desc;
    const char *tiles, *patches, *instances, *texture, *density;
    int patch_count, gutter, dot, curved;

    mesh_data input, patch;
    trimesh_mesh *result;
    trimesh_report report;

    /* the output: positions, normals and indices are the result's, the rest our own */
    mesh_data output;

    /* its picture; name: behind the last '/' */
    unsigned char *png;
    size_t png_size;
    char png_path[MAX_PATH], mtl_path[MAX_PATH];

    /* what stands on it */
    mesh_data prototypes[MAX_PROTOTYPES];
    mesh_instances instanced[MAX_PROTOTYPES];
    int prototype_count;
    float *placements; /* of all instances: translations, then rotations, then scales */
    size_t placed;
} retile_job;

/* ---- the command line ---------------------------------------------------------------------- */

/* Refuse, before any work, what does not go together. */
static int check_options(retile_job *j, const char *method) {
    static const char *const methods[] = {"lattice", "repel", NULL};
    const char *why;
    cli *run = &j->run;
    file_extension(run->output, j->extension);
    if (!mesh_can_write(j->extension, &why))
        return cli_fail(run, CLI_USAGE, "cannot write '%s': %s", run->output, why);
    if (j->desc.vertices == 0)
        return cli_fail(run, CLI_USAGE, "no number of vertices given; add --vertices N");
    const int repels = find_name(run, "--method", method, methods);
    if (repels < 0) return CLI_USAGE;
    j->desc.method = repels ? TRIMESH_REPEL : TRIMESH_LATTICE;
    if ((j->tiles != NULL) + (j->patches != NULL) + (j->texture != NULL) > 1)
        return cli_fail(run, CLI_USAGE, "choose one of --tiles, --patches and --texture");
    if (j->dot && !j->instances) return cli_fail(run, CLI_USAGE, "--dot goes with --instances");
    if (j->curved && !j->instances)
        return cli_fail(run, CLI_USAGE, "--curved goes with --instances");
    const int has_picture = j->tiles || j->patches || j->texture;
    if (has_picture && j->instances && strcmp(j->extension, ".glb") != 0)
        return cli_fail(run, CLI_USAGE, "--instances with a texture needs an OUT in .glb; it holds "
                        "both");
    int status = CLI_DONE;
    if (has_picture)
        status = path_beside(run, j->texture ? "-texture.png" : "-atlas.png", j->png_path);
    if (!status && has_picture && !strcmp(j->extension, ".obj"))
        status = path_beside(run, ".mtl", j->mtl_path);
    return status;
}

/* ---- reading ------------------------------------------------------------------------------- */

static int read_mesh(retile_job *j, const char *path, int points_too, mesh_data *mesh) {
    const char *why;
    if (mesh_read(path, points_too, mesh, &why)) return CLI_DONE;
    return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", path, why);
}

/* A picture as PNG: the file itself if it is one. */
static int read_png(retile_job *j, const char *path, txm_image *image) {
    static const unsigned char magic[] = {0x89, 'P', 'N', 'G'};
    const char *why;
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    if (!bytes) return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", path, strerror(errno));
    if (!image_decode(bytes, size, 0, image, &why)) {
        free(bytes);
        return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", path, why);
    }
    if (size > sizeof magic && !memcmp(bytes, magic, sizeof magic)) {
        j->png = bytes;
        j->png_size = size;
        return CLI_DONE;
    }
    free(bytes);
    return encode_picture(&j->run, j->png_path, image, &j->png, &j->png_size);
}

/* Wanted edge lengths from a picture on the input's texture coordinates: where it is white a
   quarter of what they are where it is black. *scale is for free(). */
static int read_density(retile_job *j, float **scale) {
    const mesh_data *m = &j->input;
    txm_image map;
    if (!m->uvs)
        return cli_fail(&j->run, CLI_FAILED, "--density: '%s' has no texture coordinates",
                        j->run.inputs[0]);
    const int status = read_picture(&j->run, j->density, 1, TXM_U8, &map);
    if (status) return status;
    *scale = (float *)new_array(m->vertex_count, sizeof(float));
    for (size_t i = 0; i < m->vertex_count && *scale; i++) (*scale)[i] = 1;
    for (size_t c = 0; c < 3 * m->triangle_count && *scale; c++) {
        const float u = txm_clampf(m->uvs[2 * c], 0, 1), v = txm_clampf(m->uvs[2 * c + 1], 0, 1);
        const int x = (int)(u * (float)(map.width - 1) + 0.5f);
        const int y = (int)(v * (float)(map.height - 1) + 0.5f);
        const unsigned char *row = (const unsigned char *)txm_image_row_const(&map, y);
        (*scale)[m->indices[c]] = txm_float(pow(0.25, row[x] / 255.0));
    }
    image_free(&map);
    return *scale ? CLI_DONE : fail_memory(&j->run);
}

/* ---- what the input has on it --------------------------------------------------------------- */

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

static int carry_uvs(retile_job *j) {
    const size_t corners = 3 * j->input.triangle_count;
    const txm_mesh input = mesh_view(&j->input), mesh = trimesh_as_view(j->result);
    uint32_t *own = (uint32_t *)new_array(corners, sizeof(uint32_t)); /* each corner has its own */
    trimesh_values v = {0};
    int status = CLI_DONE;
    j->output.uvs = (float *)new_array(j->result->triangle_count, 6 * sizeof(float));
    if (!own || !j->output.uvs) {
        status = fail_memory(&j->run);
    } else {
        for (size_t c = 0; c < corners; c++) own[c] = (uint32_t)c;
        v.values = j->input.uvs;
        v.count = corners;
        v.indices = own;
        v.channels = 2;
        status = check_result(&j->run,
                              trimesh_transfer_corners(&input, &v, &mesh, j->result->sources,
                                                       &j->run.env, j->output.uvs),
                              j->run.inputs[0]);
    }
    free(own);
    return status;
}

/* ---- tiles ---------------------------------------------------------------------------------- */

/* A triangle set as its tiles.json tells it. */
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
        return *why = "not the number of tiles that such a set has; make it again", 0;
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

/* A set in which only the colors matter: all its tiles share one small gray picture. */
static txm_status import_tiles(retile_job *j, tile_file *f, textiles_set **set) {
    static unsigned char gray[(TEXTILES_MIN_SIZE + 1) * (TEXTILES_MIN_SIZE + 1)];
    txm_image *images = (txm_image *)calloc((size_t)f->count, sizeof *images);
    if (!images) return TXM_OUT_OF_MEMORY;
    for (int i = 0; i < f->count; i++) {
        images[i].pixels = gray;
        images[i].width = images[i].height = TEXTILES_MIN_SIZE + 1;
        images[i].channels = 1;
    }
    f->desc.kind = TEXTILES_TRIANGLE;
    f->desc.size = TEXTILES_MIN_SIZE;
    const txm_status result = textiles_import(&f->desc, images, f->count, 1, &j->run.env, set);
    free(images);
    return result;
}

/* Are the file's tiles those of the set, in its order? */
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
        return cli_fail(&j->run, CLI_FAILED, "'%s': its tiles are not in their order; make the set "
                        "again", path);
    snprintf(path, sizeof path, "%s/atlas.png", j->tiles);
    status = read_png(j, path, &atlas);
    if (!status) image_free(&atlas);
    return status;
}

/* Texture coordinates from the tiles chosen for all triangles. */
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

/* The layout of a picture of patches: with the gutter, or if there is none, without; a row of pixels
   more or less, which rounding makes, does not matter. */
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

/* ---- instances ------------------------------------------------------------------------------ */

/* The prototype of this color, made if there is none yet; -1: too many, -2: no memory. */
static int sphere_of(retile_job *j, const unsigned char color[4]) {
    for (int i = 0; i < j->prototype_count; i++) {
        if (!memcmp(j->prototypes[i].colors, color, 4)) return i;
    }
    if (j->prototype_count == MAX_PROTOTYPES) return -1;
    mesh_data *m = &j->prototypes[j->prototype_count++];
    if (!mesh_sphere(SPHERE_STEPS, m)) return -2;
    for (size_t i = 0; i < m->vertex_count; i++) memcpy(m->colors + 4 * i, color, 4);
    return j->prototype_count - 1;
}

/* The quaternion that turns z to a direction the shortest way. */
static void turn_z_to(const float *n, float q[4]) {
    const txm_vec3 d = txm_vec3_normalize(txm_v3(n[0], n[1], n[2]));
    q[0] = -d.y;
    q[1] = d.x;
    q[2] = 0;
    q[3] = 1 + d.z;
    if (q[3] > 1e-6f) return;
    q[0] = 1; /* straight down: half round about x */
    q[1] = q[3] = 0;
}

/* A point of a patch: where it is on the reference triangle. 0 if it is outside. */
static int take_point(const mesh_data *m, size_t i, float scale, trimesh_point *to) {
    const float *p = m->positions + 3 * i;
    const double v = (double)p[1] / TRIANGLE_HEIGHT, u = (double)p[0] - v / 2, slack = 1e-3;
    memset(to, 0, sizeof *to);
    if (!(u >= -slack && v >= -slack && u + v <= 1 + slack && fabs((double)p[2]) <= 1000)) return 0;
    to->u = (float)(u < 0 ? 0 : u > 1 ? 1 : u);
    to->v = (float)(v < 0 ? 0 : v > 1 ? 1 : v);
    if (to->u + to->v > 1) to->v = 1 - to->u;
    to->height = p[2];
    to->scale = scale;
    if (m->rotations) memcpy(to->rotation, m->rotations + 4 * i, sizeof to->rotation);
    else if (m->normals) turn_z_to(m->normals + 3 * i, to->rotation);
    return 1;
}

/* Points become spheres. Without --dot these touch if the points are spread evenly. */
static int take_points(retile_job *j, trimesh_point *points) {
    static const unsigned char plain[4] = {200, 200, 200, 255};
    const mesh_data *m = &j->patch;
    const double radius = j->dot ? j->dot / 100.0 : 0.5 * sqrt(0.5 / (double)m->vertex_count);
    for (size_t i = 0; i < m->vertex_count; i++) {
        const int sphere = sphere_of(j, m->colors ? m->colors + 4 * i : plain);
        if (sphere == -2) return fail_memory(&j->run);
        if (sphere < 0)
            return cli_fail(&j->run, CLI_FAILED, "'%s': more than %d different colors",
                            j->instances, MAX_PROTOTYPES);
        if (!take_point(m, i, (float)radius, &points[i]))
            return cli_fail(&j->run, CLI_FAILED,
                            "'%s': point %lu lies outside of the triangle (0,0), "
                            "(1,0), (1/2,sqrt(3)/2)",
                            j->instances, (unsigned long)i);
        points[i].prototype = (uint32_t)sphere;
    }
    return CLI_DONE;
}

/* A mesh is one thing, held in the middle of the triangle. */
static void take_mesh(retile_job *j, trimesh_point *point) {
    mesh_data *m = &j->prototypes[j->prototype_count++];
    *m = j->patch;
    memset(&j->patch, 0, sizeof j->patch);
    for (size_t i = 0; i < m->vertex_count; i++) {
        m->positions[3 * i] -= 0.5f;
        m->positions[3 * i + 1] -= (float)(TRIANGLE_HEIGHT / 3);
    }
    memset(point, 0, sizeof *point);
    point->u = point->v = (float)(1.0 / 3);
}

/* Instances sorted by prototype into the arrays that a writer takes. */
static int sort_instances(retile_job *j, const trimesh_instance *list, size_t count) {
    size_t at[MAX_PROTOTYPES + 1] = {0};
    j->placements = (float *)new_array(count, 10 * sizeof(float));
    if (!j->placements) return fail_memory(&j->run);
    float *translations = j->placements, *rotations = translations + 3 * count;
    float *scales = rotations + 4 * count;
    for (size_t i = 0; i < count; i++) at[list[i].prototype + 1]++;
    for (int p = 0; p < j->prototype_count; p++) {
        mesh_instances *t = &j->instanced[p];
        t->mesh = &j->prototypes[p];
        t->count = at[p + 1];
        at[p + 1] += at[p];
        t->translations = translations + 3 * at[p];
        t->rotations = rotations + 4 * at[p];
        t->scales = scales + 3 * at[p];
    }
    for (size_t i = 0; i < count; i++) {
        const size_t to = at[list[i].prototype]++;
        memcpy(translations + 3 * to, list[i].position, 3 * sizeof(float));
        memcpy(rotations + 4 * to, list[i].rotation, 4 * sizeof(float));
        for (size_t k = 0; k < 3; k++) scales[3 * to + k] = list[i].scale;
    }
    j->placed = count;
    return CLI_DONE;
}

static int retile_place_instances(retile_job *j) {
    trimesh_patch patch = {0};
    trimesh_scatter_desc d = {0};
    trimesh_instance *list = NULL;
    size_t count = 0;
    const int has_points = j->patch.triangle_count == 0;
    trimesh_point *points =
        (trimesh_point *)new_array(has_points ? j->patch.vertex_count : 1, sizeof *points);
    int status = points ? CLI_DONE : fail_memory(&j->run);
    if (points) {
        patch.points = points;
        patch.count = has_points ? j->patch.vertex_count : 1;
        if (has_points) status = take_points(j, points);
        else take_mesh(j, points);
    }
    d.mesh = trimesh_as_view(j->result);
    d.normals = j->result->normals;
    d.patches = &patch;
    d.patch_count = 1;
    d.curve = (float)j->curved;
    d.seed = j->run.seed;
    if (!status)
        status = check_result(&j->run, trimesh_scatter(&d, &j->run.env, NULL, 0, &count),
                              j->instances);
    if (!status && count) {
        list = (trimesh_instance *)new_array(count, sizeof *list);
        if (!list) status = fail_memory(&j->run);
        if (!status)
            status = check_result(&j->run, trimesh_scatter(&d, &j->run.env, list, count, &count),
                                  j->instances);
        if (!status) status = sort_instances(j, list, count);
    }
    free(list);
    free(points);
    return status;
}

/* ---- figures -------------------------------------------------------------------------------- */

static int compare_keys(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* Which set an item is in: the root of its tree. Paths are halved on the way. */
static uint32_t find_root(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static size_t join(uint32_t *parent, uint32_t a, uint32_t b) {
    const uint32_t x = find_root(parent, a), y = find_root(parent, b);
    parent[x > y ? x : y] = x > y ? y : x;
    return x != y;
}

typedef struct figures {
    size_t edges, components, loops;
    double inner, six; /* vertices inside, and those of valence 6 */
} figures;

/* Count what belongs to edges. Sorted, an edge inside is there twice, on the border once. */
static int count_edges(const trimesh_mesh *m, figures *f) {
    const size_t sides = 3 * m->triangle_count, n = m->vertex_count;
    uint64_t *keys = (uint64_t *)new_array(sides, sizeof *keys);
    uint32_t *pieces = (uint32_t *)new_array(n, 3 * sizeof *pieces);
    if (!keys || !pieces) {
        free(keys);
        free(pieces);
        return 0;
    }
    uint32_t *rims = pieces + n, *valence = rims + n;
    memset(f, 0, sizeof *f);
    for (size_t i = 0; i < n; i++) {
        pieces[i] = rims[i] = (uint32_t)i;
        valence[i] = 0;
    }
    f->components = n;
    for (size_t c = 0; c < sides; c++) {
        const uint32_t a = m->indices[c], b = m->indices[c % 3 == 2 ? c - 2 : c + 1];
        keys[c] = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
        f->components -= join(pieces, a, b);
    }
    qsort(keys, sides, sizeof *keys, compare_keys);
    for (size_t c = 0; c < sides; c++) {
        const uint32_t a = (uint32_t)(keys[c] >> 32), b = (uint32_t)(keys[c] & 0xffffffffu);
        if (c > 0 && keys[c] == keys[c - 1]) continue;
        f->edges++;
        valence[a] += valence[a] < 1u << 30;
        valence[b] += valence[b] < 1u << 30;
        if (c + 1 < sides && keys[c] == keys[c + 1]) continue;
        /* a border edge: a loop for every rim that closes */
        f->loops += 1 - join(rims, a, b);
        valence[a] |= 1u << 31;
        valence[b] |= 1u << 31;
    }
    for (size_t i = 0; i < n; i++) {
        if (valence[i] >> 31) continue;
        f->inner++;
        f->six += valence[i] == 6;
    }
    free(keys);
    free(pieces);
    return 1;
}

/* Sums for a mean and a coefficient of variation. */
typedef struct spread {
    double sum, squares, count;
} spread;

static void spread_add(spread *s, double x) {
    s->sum += x;
    s->squares += x * x;
    s->count++;
}

static double spread_mean(const spread *s) {
    return s->count > 0 ? s->sum / s->count : 0;
}

static double spread_variation(const spread *s) {
    const double mean = spread_mean(s), square = s->count > 0 ? s->squares / s->count : 0;
    return mean > 0 && square > mean * mean ? sqrt(square - mean * mean) / mean : 0;
}

/* The angle opposite to side a in degrees. */
static double angle_of(double a, double b, double c) {
    const double x = (b * b + c * c - a * a) / (2 * b * c);
    return acos(x < -1 ? -1 : x > 1 ? 1 : x) * 180 / 3.14159265358979;
}

/* Measure the mesh for --stats; returns the mean quality and the share of valence 6. */
static int mesh_figures(cli *run, const trimesh_mesh *m, const trimesh_report *r,
                        double *mean_quality, double *valence_6) {
    spread edges = {0, 0, 0}, areas = {0, 0, 0}, qualities = {0, 0, 0};
    double least_quality = 1, least_angle = 180;
    figures f;
    if (!count_edges(m, &f)) return fail_memory(run);
    for (size_t t = 0; t < m->triangle_count; t++) {
        double side[3];
        for (size_t k = 0; k < 3; k++) { /* side k is opposite to corner k */
            const float *p = m->positions + 3 * (size_t)m->indices[3 * t + (k + 1) % 3];
            const float *q = m->positions + 3 * (size_t)m->indices[3 * t + (k + 2) % 3];
            double sum = 0;
            for (int c = 0; c < 3; c++) {
                const double d = (double)p[c] - (double)q[c];
                sum += d * d;
            }
            side[k] = sqrt(sum);
            spread_add(&edges, side[k]);
        }
        const double a = side[0], b = side[1], c = side[2], product = a * b * c;
        const double excess = (b + c - a) * (c + a - b) * (a + b - c);
        const double quality = product > 0 && excess > 0 ? excess / product : 0;
        spread_add(&qualities, quality);
        spread_add(&areas, excess > 0 ? 0.25 * sqrt(excess * (a + b + c)) : 0);
        if (quality < least_quality) least_quality = quality;
        for (int k = 0; k < 3; k++) {
            const double angle =
                product > 0 ? angle_of(side[k], side[(k + 1) % 3], side[(k + 2) % 3]) : 0;
            if (angle < least_angle) least_angle = angle;
        }
    }
    const int mended[7] = {(int)r->welded, (int)r->unused, (int)r->degenerate, (int)r->duplicate,
                           (int)r->fins, (int)r->turned, (int)r->split};
    *mean_quality = spread_mean(&qualities);
    *valence_6 = f.inner > 0 ? f.six / f.inner : 0;
    cli_figure(run, "vertices", (double)m->vertex_count);
    cli_figure(run, "triangles", (double)m->triangle_count);
    cli_figure(run, "euler",
               (double)m->vertex_count - (double)f.edges + (double)m->triangle_count);
    cli_figure(run, "components", (double)f.components);
    cli_figure(run, "loops", (double)f.loops);
    cli_figures(run, "mended", mended, 7);
    cli_figure(run, "crease_edges", (double)r->crease_edges);
    cli_figure(run, "edge_length", m->edge_length);
    cli_figure(run, "quality", *mean_quality);
    cli_figure(run, "quality_least", least_quality);
    cli_figure(run, "valence_6", *valence_6);
    cli_figure(run, "edge_variation", spread_variation(&edges));
    cli_figure(run, "area_variation", spread_variation(&areas));
    cli_figure(run, "least_angle", least_angle);
    return CLI_DONE;
}

/* ---- writing -------------------------------------------------------------------------------- */

/* Things baked into one mesh; spheres shrink to points, with the point's normal and color. */
static int bake(retile_job *j, mesh_data *baked) {
    static float zero[3] = {0, 0, 0}, up[3] = {0, 0, 1};
    mesh_data points[MAX_PROTOTYPES];
    mesh_instances list[MAX_PROTOTYPES];
    const char *why;
    const int has_points = j->patch.positions != NULL; /* a mesh has been taken out of it */
    for (int p = 0; p < j->prototype_count; p++) {
        list[p] = j->instanced[p];
        if (!has_points) continue;
        memset(&points[p], 0, sizeof points[p]);
        points[p].vertex_count = 1;
        points[p].positions = zero;
        points[p].normals = up;
        points[p].colors = j->prototypes[p].colors;
        list[p].mesh = &points[p];
    }
    if (mesh_bake(list, j->prototype_count, baked, &why)) return CLI_DONE;
    return cli_fail(&j->run, CLI_FAILED, "cannot write '%s': %s", j->run.output, why);
}

static int write_output(retile_job *j) {
    cli *run = &j->run;
    cli_file files[3] = {{0}, {0}, {0}};
    unsigned char *bytes = NULL, *mtl = NULL;
    mesh_data baked;
    mesh_scene scene = {0};
    const char *why;
    int status = CLI_DONE, count = 1;
    const int is_glb = !strcmp(j->extension, ".glb");
    memset(&baked, 0, sizeof baked);

    scene.surface = &j->output;
    if (j->png) scene.texture = name_in(j->png_path);
    if (is_glb) {
        scene.png = j->png;
        scene.png_size = j->png_size;
        scene.instances = j->instanced;
        scene.instance_count = j->instances ? j->prototype_count : 0;
    } else if (j->instances) {
        status = bake(j, &baked);
        scene.surface = &baked;
    } else if (j->mtl_path[0]) {
        scene.library = name_in(j->mtl_path);
    }
    if (!status && !mesh_encode(j->extension, &scene, &bytes, &files[0].size, &why))
        status = cli_fail(run, CLI_FAILED, "cannot write '%s': %s", run->output, why);
    files[0].name = run->output;
    files[0].bytes = bytes;
    if (!status && scene.library) {
        if (!mesh_encode_mtl(&scene, &mtl, &files[count].size, &why))
            status = cli_fail(run, CLI_FAILED, "cannot write '%s': %s", j->mtl_path, why);
        files[count].name = j->mtl_path;
        files[count++].bytes = mtl;
    }
    if (!status && j->png) {
        files[count].name = j->png_path;
        files[count].bytes = j->png;
        files[count++].size = j->png_size;
    }
    cli_figure(run, "file_bytes", (double)files[0].size);
    if (!status) status = cli_finish_files(run, files, count);
    free(bytes);
    free(mtl);
    mesh_free(&baked);
    return status;
}

/* ---- the command ---------------------------------------------------------------------------- */

static int retile(retile_job *j) {
    float *scale = NULL;
    int status = CLI_DONE;
    if (j->density) status = read_density(j, &scale);
    if (!status) {
        cli_stage(&j->run, "retile");
        j->desc.surface = mesh_view(&j->input);
        j->desc.scale = scale;
        j->desc.seed = j->run.seed;
        status = check_result(&j->run,
                              trimesh_retile(&j->desc, &j->run.env, &j->report, &j->result),
                              j->run.inputs[0]);
    }
    free(scale);
    if (status) return status;
    j->output.vertex_count = j->result->vertex_count;
    j->output.triangle_count = j->result->triangle_count;
    j->output.positions = j->result->positions;
    j->output.normals = j->result->normals;
    j->output.indices = j->result->indices;
    return CLI_DONE;
}

static int retile_dress(retile_job *j) {
    int status = CLI_DONE;
    cli_stage(&j->run, "dress");
    if (j->input.colors) status = carry_colors(j);
    if (!status && j->tiles) status = dress_with_tiles(j);
    else if (!status && j->patches) status = dress_with_patches(j);
    else if (!status && j->input.uvs) status = carry_uvs(j);
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

static void free_job(retile_job *j) {
    for (int i = 0; i < j->prototype_count; i++) mesh_free(&j->prototypes[i]);
    mesh_free(&j->input);
    mesh_free(&j->patch);
    trimesh_free(j->result);
    free(j->output.colors);
    free(j->output.uvs);
    free(j->output.corner_normals);
    free(j->placements);
    free(j->png);
    free(j);
}

static int run_job(retile_job *j, int argc, char **argv) {
    int vertices = 0, crease = 0, adapt = 0, spacing = 0, status;
    const char *method = "lattice";
    double quality = 0, valence_6 = 0;
    const cli_option options[] = {
        {CLI_INT, "--vertices", "N", "how many vertices the result has, 4 or more", &vertices, 4,
         TRIMESH_MAX_VERTICES},
        {CLI_TEXT, "--method", "HOW", "lattice (default, most regular) or repel (as published)",
         &method, 0, 0},
        {CLI_INT, "--crease", "DEGREES", "keep sharp edges that bend by so much, 1 to 180; default 50",
         &crease, 1, 180},
        {CLI_INT, "--adapt", "PERCENT", "shorter edges where the surface bends, 0 to 100", &adapt,
         0, 100},
        {CLI_INT, "--spacing", "PERCENT",
         "edges along creases and borders, 25 to 400 of the others", &spacing, 25, 400},
        {CLI_INPUT, "--density", "MAP",
         "picture on MESH's texture: shorter edges where it is lighter", &j->density, 0, 0},
        {CLI_TILES, "--tiles", "DIR", "texture: a triangle set of 'texkit tiles'", &j->tiles, 0, 0},
        {CLI_INPUT, "--patches", "PICTURE", "texture: patches at random", &j->patches, 0, 0},
        {CLI_INT, "--patch-count", "N", "patches in PICTURE; default 4", &j->patch_count, 1, 256},
        {CLI_INT, "--gutter", "G", "pixels around each patch; default 8, or none", &j->gutter, 0,
         8192},
        {CLI_INPUT, "--texture", "PICTURE", "texture: that of MESH", &j->texture, 0, 0},
        {CLI_INPUT, "--instances", "PATCH.ply", "points or a small mesh for every triangle",
         &j->instances, 0, 0},
        {CLI_INT, "--dot", "PERCENT", "radius of points in edge lengths; default: they touch",
         &j->dot, 1, 1000},
        {CLI_FLAG, "--curved", NULL, "instances stand on the smooth surface, not on flat triangles",
         &j->curved, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (cli_begin(&j->run, &retile_manual, options, argc, argv, &status)) return status;
    j->desc.vertices = (size_t)vertices;
    j->desc.crease_angle = (float)crease;
    j->desc.adapt = (float)adapt / 100;
    j->desc.line_spacing = (float)spacing / 100;
    status = check_options(j, method);
    if (status) return status;

    cli_stage(&j->run, "read");
    status = read_mesh(j, j->run.inputs[0], 0, &j->input);
    if (!status && j->instances) status = read_mesh(j, j->instances, 1, &j->patch);
    if (!status) status = retile(j);
    if (!status) status = retile_dress(j);
    if (!status) {
        cli_stage(&j->run, "measure");
        status = mesh_figures(&j->run, j->result, &j->report, &quality, &valence_6);
        if (j->instances) cli_figure(&j->run, "instances", (double)j->placed);
    }
    if (!status) {
        cli_stage(&j->run, "encode");
        status = write_output(j);
    }
    if (!status && !j->run.quiet)
        printf("%s: %lu vertices, %lu triangles, quality %.3f, %.1f %% of valence 6, %.1f s\n",
               j->run.output, (unsigned long)j->result->vertex_count,
               (unsigned long)j->result->triangle_count, quality, 100 * valence_6,
               cli_seconds(&j->run));
    return status;
}

static int run_retile(int argc, char **argv) {
    retile_job *j = (retile_job *)calloc(1, sizeof *j); /* too large for a small stack */
    if (!j) {
        fprintf(stderr, "texkit retile: out of memory\n");
        return CLI_FAILED;
    }
    j->patch_count = 4;
    j->gutter = -1;
    const int status = run_job(j, argc, argv);
    free_job(j);
    return status;
}

const command retile_command = {&retile_manual, run_retile};
