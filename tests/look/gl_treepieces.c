/* gl_treepieces.c - shaders/treepieces.glsl computes what treepieces.h does
   SPDX-License-Identifier: MIT OR Unlicense

   cc -I. tests/look/gl_treepieces.c build/files/stb.o -o gl_treepieces -lEGL -lOpenGL -lcjson -lm

   Runs the shaders of examples/forest_gl without a window, on whatever driver EGL finds (Mesa's
   llvmpipe on machines without a graphics card), and prints "ok - what" or "not ok - what" for each
   test. The example is part of this program, so that its own buffers and draw calls are tested.

   Rims: 1,000 trees of random pieces in different poses. The output of the vertex shader, by transform
   feedback: rims of parents against those of children, and all against treepieces_skin.

   Cracks: a tree tessellated in mixed levels, by transform feedback: the vertices of two patches along
   the edge that they share, and all against treepieces_bake.

   Impostors: pixel by pixel against those of treepieces_impostor.

   Pictures: coverage and depth against a rasterisation of what treepieces_bake and
   treepieces_impostor give.

   Draw calls: those of the example, counted where it calls OpenGL.                             */
#define _XOPEN_SOURCE 600 /* as headless.c says, which comes too late */
#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>

static int draw_calls;
static GLsizei most_instances = 0x7fffffff; /* limit per draw call, for forests that would take long */

static GLsizei limit(GLsizei instances) {
    draw_calls++;
    return instances < most_instances ? instances : most_instances;
}
static void counted_elements(GLenum mode, GLsizei count, GLenum type, const void *indices,
                             GLsizei instances) {
    glDrawElementsInstanced(mode, count, type, indices, limit(instances));
}
static void counted_instances(GLenum mode, GLint first, GLsizei count, GLsizei instances) {
    glDrawArraysInstanced(mode, first, count, limit(instances));
}
static void counted_arrays(GLenum mode, GLint first, GLsizei count) {
    limit(1);
    glDrawArrays(mode, first, count);
}

#define glDrawElementsInstanced counted_elements
#define glDrawArraysInstanced counted_instances
#define glDrawArrays counted_arrays
#define main forest_main
#include "examples/forest_gl/trees.c"
#include "examples/forest_gl/files.c"
#include "examples/forest_gl/options.c"
#include "examples/forest_gl/pictures.c"
#include "examples/forest_gl/shaders.c"
#include "examples/forest_gl/light.c"
#include "examples/forest_gl/buffers.c"
#include "examples/forest_gl/camera.c"
#include "examples/forest_gl/frame.c"
#include "examples/forest_gl/headless.c"
#include "examples/forest_gl/main.c"
#undef main
#include "tests/kit/treekit.h"

static int failures;

static void report(int good, const char *what, const char *format, ...) {
    char figures[400] = "";
    va_list list;
    va_start(list, format);
    vsnprintf(figures, sizeof figures, format, list);
    va_end(list);
    printf("%s - %s%s%s\n", good ? "ok" : "not ok", what, figures[0] ? ": " : "", figures);
    failures += !good;
}

/* without this nothing can be tested */
static void must(int good, const forest_gl *f) {
    if (good) return;
    printf("not ok - %s\n", f->failed[0] ? f->failed : "no memory");
    exit(1);
}

static void *room(size_t count, size_t size) {
    static const forest_gl none;
    void *p = calloc(count ? count : 1, size);
    must(p != NULL, &none);
    return p;
}

/* ---- scenes ---------------------------------------------------------------------------- */

static forest_gl scene;
static EGLDisplay display;

static forest_gl *new_scene(int trees, int pieces) {
    memset(&scene, 0, sizeof scene);
    scene.o = default_options();
    scene.o.shaders = "shaders";
    scene.o.count = trees;
    scene.o.pieces = pieces;
    scene.o.smooth = 1;
    scene.o.cards = 0; /* impostors only */
    return &scene;
}

static void close_scene(forest_gl *f) {
    glDeleteBuffers(BUFFERS, f->buffers);
    glDeleteBuffers(1, &f->block);
    glDeleteBuffers(1, &f->vertices);
    glDeleteBuffers(1, &f->indices);
    glDeleteTextures(TEXTURES, f->textures);
    for (int i = 0; i < PROGRAMS; i++) glDeleteProgram(f->programs[i]);
    f->display = EGL_NO_DISPLAY; /* the next scene needs it too */
    close_forest(f);
}

/* The complete scene of the example. */
static forest_gl *open_scene(forest_gl *f) {
    must(read_species(f) && grow_trees(f) && make_pictures(f) && upload_scene(f, "forest_gl"), f);
    choose_view(f);
    upload_bones(f);
    return f;
}

/* Trees about the origin in random poses, with only what the shaders of pieces read. */
static forest_gl *open_trees(int trees, int pieces, treepieces_rule_function *rule, float amount) {
    forest_gl *f = new_scene(trees, pieces);
    treepieces_forest_desc desc = {0};
    const treepieces_pose pose = {99, amount, NULL};
    treepieces_place *places = (treepieces_place *)room((size_t)trees, sizeof *places);
    must(read_species(f) && check(f, treepieces_kit_make(NULL, 0, &f->env, &f->kit)), f);
    for (int i = 0; i < trees; i++) places[i].seed = (uint64_t)i + 16; /* with these any_piece grows tall */
    desc.kit = f->kit;
    desc.species = f->species;
    desc.species_count = f->species_count;
    desc.places = places;
    desc.tree_count = trees;
    desc.max_pieces = pieces;
    desc.own_rule = rule;
    must(check(f, treepieces_forest_make(&desc, &f->env, &f->forest)), f);
    f->bones = (float *)room(f->forest->node_count, TREEPIECES_BONE * sizeof(float));
    must(check(f, treepieces_bones(f->forest, &pose, &f->env, f->bones)), f);
    free(places);

    glGenBuffers(BUFFERS, f->buffers);
    glGenBuffers(1, &f->block);
    glGenBuffers(1, &f->vertices);
    glGenBuffers(1, &f->indices);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, f->block);
    must(upload_pieces(f) && upload_trees(f), f);
    upload_bones(f);
    return f;
}

/* ---- transform feedback ------------------------------------------------------------------ */

static GLuint feedback_program(forest_gl *f, int has_patches, const char *const *names, int count) {
    GLint good = 0;
    char *library = read_shader(f, "treepieces.glsl", "");
    char *body = read_shader(f, "forest.glsl", "");
    must(library && body, f);
    const char *defines = "#define FEEDBACK\n";
    const GLuint program = glCreateProgram();
    must(add_stage(f, program, GL_VERTEX_SHADER, "PIECE_VERTEX", defines, library, body), f);
    if (has_patches)
        must(add_stage(f, program, GL_TESS_CONTROL_SHADER, "PIECE_CONTROL", defines, library,
                       body) &&
                 add_stage(f, program, GL_TESS_EVALUATION_SHADER, "PIECE_EVALUATION", defines,
                           library, body),
             f);
    glTransformFeedbackVaryings(program, count, names, GL_INTERLEAVED_ATTRIBS);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &good);
    must(good || fail(f, "the program for transform feedback does not link"), f);
    free(library);
    free(body);
    return program;
}

/* Record up to `bytes` of what drawing type t puts out; returns the number of primitives. */
static size_t record(forest_gl *f, GLuint program, int t, int has_patches, void *out,
                     size_t bytes) {
    const treepieces_batch *b = &f->forest->batches[t];
    GLuint buffer, query, count = 0;
    int first = 0;
    for (int k = 0; k < t; k++) first += treepieces_kit_piece(f->kit, k)->vertex_count;
    glGenQueries(1, &query);
    glGenBuffers(1, &buffer);
    glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, buffer);
    glBufferData(GL_TRANSFORM_FEEDBACK_BUFFER, (GLsizeiptr)bytes, NULL, GL_STREAM_READ);
    glUseProgram(program);
    glUniform1i(glGetUniformLocation(program, "kind"), t);
    glPatchParameteri(GL_PATCH_VERTICES, 4);
    glEnable(GL_RASTERIZER_DISCARD);
    glBeginQuery(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, query);
    glBeginTransformFeedback(has_patches ? GL_TRIANGLES : GL_POINTS);
    if (has_patches)
        glDrawElementsInstanced(GL_PATCHES, 4 * b->quad_count, GL_UNSIGNED_SHORT,
                                (void *)((size_t)f->first_index[t] * sizeof(uint16_t)),
                                (GLsizei)b->count);
    else
        glDrawArraysInstanced(GL_POINTS, first, treepieces_kit_piece(f->kit, t)->vertex_count,
                              (GLsizei)b->count);
    glEndTransformFeedback();
    glEndQuery(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN);
    glDisable(GL_RASTERIZER_DISCARD);
    glGetQueryObjectuiv(query, GL_QUERY_RESULT, &count);
    glGetBufferSubData(GL_TRANSFORM_FEEDBACK_BUFFER, 0, (GLsizeiptr)bytes, out);
    glDeleteBuffers(1, &buffer);
    glDeleteQueries(1, &query);
    return count;
}

/* ---- rims -------------------------------------------------------------------------------- */

typedef struct skinned {
    float position[3], normal[3];
} skinned;

/* All vertices of all pieces as the vertex shader computes them; first: first vertex of each node. */
static skinned *skin_all(forest_gl *f, size_t *first) {
    static const char *const names[] = {"vertex_place", "vertex_normal"};
    const GLuint program = feedback_program(f, 0, names, 2);
    size_t count = 0;
    for (uint32_t i = 0; i < f->forest->node_count; i++)
        count += (size_t)treepieces_kit_piece(f->kit, f->forest->nodes[i].type)->vertex_count;
    skinned *all = (skinned *)room(count, sizeof *all);
    count = 0;
    for (int t = 0; t < f->forest->type_count; t++) {
        const treepieces_batch *b = &f->forest->batches[t];
        const size_t size = (size_t)treepieces_kit_piece(f->kit, t)->vertex_count;
        for (uint32_t i = 0; i < b->count; i++)
            first[b->words[(size_t)i * b->stride]] = count + i * size;
        const size_t made = record(f, program, t, 0, all + count, b->count * size * sizeof *all);
        must(made == b->count * size || fail(f, "too few vertices recorded"), f);
        count += made;
    }
    glDeleteProgram(program);
    return all;
}

static void test_rims_meet(const forest_gl *f, const skinned *all, const size_t *first) {
    static int met[TREEPIECES_BUILTIN][TREEPIECES_MAX_LEAVES][TREEPIECES_BUILTIN];
    size_t apart = 0, vertices = 0;
    float step = 0;
    for (int t = 0; t < f->forest->tree_count; t++) {
        const treepieces_tree *tree = &f->forest->trees[t];
        const treepieces_node *nodes = f->forest->nodes + tree->first_node;
        for (uint32_t i = 1; i < tree->node_count; i++) {
            const treepieces_node *up = nodes + nodes[i].parent;
            const treepieces_piece *below = treepieces_kit_piece(f->kit, up->type);
            const treepieces_piece *above = treepieces_kit_piece(f->kit, nodes[i].type);
            const int rim = nodes[i].joint >> 3, turn = nodes[i].joint & 7;
            met[up->type][rim][nodes[i].type]++;
            for (int j = 0; j < TREEPIECES_RIM; j++, vertices++) {
                const skinned *a = all + first[up - f->forest->nodes] + below->leaf_rims[rim][j];
                const skinned *b = all + first[tree->first_node + i] +
                                   above->root_rim[(j + TREEPIECES_RIM - turn) % TREEPIECES_RIM];
                apart += memcmp(a->position, b->position, sizeof a->position) != 0;
                for (int k = 0; k < 3; k++)
                    step = txm_maxf(step, fabsf(a->normal[k] - b->normal[k]));
            }
        }
    }
    int pairs = 0, missed = 0;
    for (int a = 0; a < TREEPIECES_BUILTIN; a++) {
        for (int r = 0; r < treepieces_kit_piece(f->kit, a)->leaf_count; r++) {
            for (int b = 0; b < TREEPIECES_BUILTIN; b++, pairs++) missed += !met[a][r][b];
        }
    }
    report(missed == 0 && apart == 0 && vertices > 100000,
           "vertex shader: rims of parent and child are equal to the bit",
           "%d poses, %d pairs of piece, rim and piece (%d missed), %zu vertices, %zu apart",
           f->forest->tree_count, pairs, missed, vertices, apart);
    report(step <= 1e-6f, "vertex shader: the normals of rims agree", "within %.1e", (double)step);
}

/* Equal within 1e-5 of the radius and the rounding of coordinates? */
static void test_skin(const forest_gl *f, const skinned *all, const size_t *first) {
    float positions[3 * TREEPIECES_MAX_VERTICES], normals[3 * TREEPIECES_MAX_VERTICES];
    float most = 0, most_normal = 0;
    size_t equal = 0, vertices = 0;
    for (int t = 0; t < f->forest->type_count; t++) {
        const treepieces_batch *b = &f->forest->batches[t];
        const int count = treepieces_kit_piece(f->kit, t)->vertex_count;
        for (uint32_t i = 0; i < b->count; i++) {
            const uint32_t node = b->words[(size_t)i * b->stride];
            const float *bone = f->bones + TREEPIECES_BONE * (size_t)node;
            const float level = txm_maxf(fabsf(bone[3]), fabsf(bone[11]));
            const float largest = txm_maxf(level, fabsf(bone[7]));
            const float allowed = 1e-5f * f->forest->nodes[node].radius + 4e-7f * largest;
            treepieces_skin(f->forest, f->bones, t, i, positions, normals);
            for (int v = 0; v < count; v++, vertices++) {
                const skinned *s = all + first[node] + v;
                equal += memcmp(s->position, positions + 3 * v, sizeof s->position) == 0;
                for (int k = 0; k < 3; k++) {
                    most = txm_maxf(most, fabsf(s->position[k] - positions[3 * v + k]) / allowed);
                    most_normal = txm_maxf(most_normal, fabsf(s->normal[k] - normals[3 * v + k]));
                }
            }
        }
    }
    report(most <= 1 && most_normal <= 1e-4f, "vertex shader: agrees with treepieces_skin",
           "%zu vertices, %.1f %% equal to the bit, the others within %.2f of what is allowed, "
           "normals within %.1e",
           vertices, 100.0 * (double)equal / (double)vertices, (double)most, (double)most_normal);
}

static void test_rims(void) {
    forest_gl *f = open_trees(1000, 40, any_piece, 0.6f);
    size_t *first = (size_t *)room(f->forest->node_count, sizeof *first);
    skinned *all = skin_all(f, first);
    test_rims_meet(f, all, first);
    test_skin(f, all, first);
    free(all);
    free(first);
    close_scene(f);
}

/* ---- cracks ------------------------------------------------------------------------------ */

/* a recorded vertex of a triangle */
typedef struct tessellated {
    float place[3], normal[3];
    int32_t instance, quad;
    float at[2], tile[2];
    int32_t layer;
} tessellated;

/* a vertex on a side of a patch, with the edge between two corners, the lower one first */
typedef struct side_vertex {
    uint32_t edge[2], place[3], patch;
    float normal[3];
} side_vertex;

typedef struct patches {
    size_t count, vertex_count;
    tessellated *vertices; /* 3 per triangle */
    uint32_t *patch;       /* of each        */
    uint32_t *corners;     /* 4 per patch: numbers that are the same for equal positions */
    size_t first[TREEPIECES_MAX_TYPES + 1]; /* patch of each type of piece */
} patches;

static int compare_places(const void *a, const void *b) {
    return memcmp(a, b, 3 * sizeof(float));
}
static int compare_sides(const void *a, const void *b) {
    return memcmp(a, b, offsetof(side_vertex, normal));
}

/* Is this position of the pattern corner k? */
static int is_corner(const float at[2], int k) {
    return at[0] == (float)(k >> 1) && at[1] == (float)(k == 1 || k == 2);
}

/* Sort positions and remove duplicates; returns how many are left. */
static size_t sort_places(float *places, size_t count) {
    size_t kept = 0;
    for (size_t i = 0; i < 3 * count; i++) places[i] += 0.0f; /* -0 is 0 */
    qsort(places, count, 3 * sizeof *places, compare_places);
    for (size_t i = 0; i < count; i++)
        if (i == 0 || compare_places(places + 3 * i, places + 3 * (i - 1)) != 0)
            memmove(places + 3 * kept++, places + 3 * i, 3 * sizeof *places);
    return kept;
}

static patches tessellate(forest_gl *f, size_t most) {
    static const char *const names[] = {"place",    "normal",  "instance", "quad",
                                        "patch_at", "tile_at", "layer"};
    const GLuint program = feedback_program(f, 1, names, 7);
    patches p;
    memset(&p, 0, sizeof p);
    p.vertices = (tessellated *)room(most, sizeof *p.vertices);
    p.patch = (uint32_t *)room(most, sizeof *p.patch);
    for (int t = 0; t < f->forest->type_count; t++) {
        const treepieces_batch *b = &f->forest->batches[t];
        const size_t made = record(f, program, t, 1, p.vertices + p.vertex_count,
                                   (most - p.vertex_count) * sizeof *p.vertices);
        for (size_t i = p.vertex_count; i < p.vertex_count + 3 * made; i++)
            p.patch[i] = (uint32_t)p.count +
                         (uint32_t)(p.vertices[i].instance * b->quad_count + p.vertices[i].quad);
        p.vertex_count += 3 * made;
        p.count += (size_t)b->count * (size_t)b->quad_count;
        p.first[t + 1] = p.count;
    }
    glDeleteProgram(program);
    return p;
}

/* Number the corners of all patches; returns how many patches lack one. */
static size_t number_corners(patches *p) {
    float *places = (float *)room(p->vertex_count, 3 * sizeof *places);
    size_t missing = 0;
    for (size_t i = 0; i < p->vertex_count; i++)
        memcpy(places + 3 * i, p->vertices[i].place, 3 * sizeof *places);
    const size_t count = sort_places(places, p->vertex_count);
    p->corners = (uint32_t *)room(4 * p->count, sizeof *p->corners);
    for (size_t i = 0; i < p->vertex_count; i++) {
        for (int k = 0; k < 4; k++) {
            if (!is_corner(p->vertices[i].at, k)) continue;
            float place[3];
            for (int c = 0; c < 3; c++) place[c] = p->vertices[i].place[c] + 0.0f;
            const float *found =
                (const float *)bsearch(place, places, count, 3 * sizeof *places, compare_places);
            p->corners[4 * p->patch[i] + (uint32_t)k] = (uint32_t)((found - places) / 3) + 1;
        }
    }
    for (size_t i = 0; i < 4 * p->count; i++) missing += !p->corners[i];
    free(places);
    return missing;
}

/* The vertices along all sides, sorted, each once for a patch. */
static side_vertex *list_sides(const patches *p, size_t *count) {
    side_vertex *list = (side_vertex *)room(2 * p->vertex_count, sizeof *list);
    size_t n = 0, kept = 0;
    for (size_t i = 0; i < p->vertex_count; i++) {
        const float *at = p->vertices[i].at;
        const int on[4] = {at[0] == 0, at[1] == 1, at[0] == 1, at[1] == 0};
        for (int k = 0; k < 4; k++) {
            if (!on[k]) continue;
            const uint32_t a = p->corners[4 * p->patch[i] + (uint32_t)k];
            const uint32_t b = p->corners[4 * p->patch[i] + (uint32_t)((k + 1) % 4)];
            side_vertex *s = &list[n++];
            s->edge[0] = a < b ? a : b;
            s->edge[1] = a < b ? b : a;
            for (int c = 0; c < 3; c++) {
                const float x = p->vertices[i].place[c] + 0.0f;
                memcpy(&s->place[c], &x, sizeof x);
            }
            s->patch = p->patch[i];
            memcpy(s->normal, p->vertices[i].normal, sizeof s->normal);
        }
    }
    qsort(list, n, sizeof *list, compare_sides);
    for (size_t i = 0; i < n; i++)
        if (i == 0 || compare_sides(&list[i], &list[i - 1]) != 0) list[kept++] = list[i];
    *count = kept;
    return list;
}

/* The vertices of an edge must come in pairs from the same two patches. A border edge has one patch. */
static void test_edges(const patches *p, int trees) {
    size_t count, alone = 0, borders = 0, edges = 0, levels[65] = {0};
    side_vertex *list = list_sides(p, &count);
    float step = 0;
    for (size_t i = 0, end; i < count; i = end) {
        int is_border = 1;
        size_t places = 0;
        for (end = i; end < count && memcmp(list[end].edge, list[i].edge, 8) == 0; end++)
            is_border &= list[end].patch == list[i].patch;
        for (size_t a = i, b; a < end; a = b, places++) {
            for (b = a; b < end && memcmp(list[b].place, list[a].place, 12) == 0; b++)
                for (int k = 0; k < 3; k++)
                    step = txm_maxf(step, fabsf(list[b].normal[k] - list[a].normal[k]));
            alone += is_border ? 0 : b - a != 2;
        }
        edges++;
        borders += (size_t)is_border;
        levels[places - 1 < 64 ? places - 1 : 64]++;
    }
    int found = 0;
    for (int k = 1; k <= 10; k++) found += levels[k] > 0;
    report(alone == 0 && found >= 9 && borders == 6 * (size_t)trees,
           "tessellation: every vertex on a shared edge has a partner that is equal to the bit",
           "%zu vertices on %zu edges (%zu at the foot) of levels 1 to 10 (%d of them), %zu alone",
           count, edges, borders, found, alone);
    report(step <= 1e-6f, "tessellation: normals along shared edges agree", "within %.1e",
           (double)step);
    free(list);
}

/* How many of a are farther than `most` from all of b; both sorted by x. */
static int compare_x(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}
static size_t count_lone(const float *a, size_t a_count, const float *b, size_t b_count,
                         float most) {
    size_t from = 0, lone = 0;
    for (size_t i = 0; i < a_count; i++) {
        int is_near = 0;
        while (from < b_count && b[3 * from] < a[3 * i] - most) from++;
        for (size_t j = from; j < b_count && b[3 * j] <= a[3 * i] + most && !is_near; j++)
            is_near = fabsf(b[3 * j + 1] - a[3 * i + 1]) <= most &&
                      fabsf(b[3 * j + 2] - a[3 * i + 2]) <= most;
        lone += !is_near;
    }
    return lone;
}

static void test_bake(const patches *p, const treepieces_mesh *mesh) {
    float *ours = (float *)room(p->vertex_count, 3 * sizeof *ours);
    float *theirs = (float *)room(mesh->vertex_count, 3 * sizeof *theirs);
    for (size_t i = 0; i < p->vertex_count; i++)
        memcpy(ours + 3 * i, p->vertices[i].place, 3 * sizeof *ours);
    memcpy(theirs, mesh->positions, 3 * mesh->vertex_count * sizeof *theirs);
    const size_t count = sort_places(ours, p->vertex_count), triangles = p->vertex_count / 3;
    qsort(ours, count, 3 * sizeof *ours, compare_x);
    qsort(theirs, mesh->vertex_count, 3 * sizeof *theirs, compare_x);
    const size_t lone = count_lone(ours, count, theirs, mesh->vertex_count, 2e-6f) +
                        count_lone(theirs, mesh->vertex_count, ours, count, 2e-6f);
    report(count == mesh->vertex_count && lone == 0 && triangles == mesh->triangle_count,
           "tessellation: the vertices are those of treepieces_bake",
           "%zu of %zu, %zu of either farther than 2 um from all of the others, %zu triangles of "
           "%zu",
           count, mesh->vertex_count, lone, triangles, mesh->triangle_count);
    free(ours);
    free(theirs);
}

/* Bark at the corners of all patches: layer and position in the sheet. */
static void test_tiles(const forest_gl *f, const patches *p) {
    size_t corners = 0, wrong = 0;
    for (size_t i = 0; i < p->vertex_count; i++) {
        const tessellated *v = &p->vertices[i];
        for (int k = 0, t = 0; k < 4; k++) {
            if (!is_corner(v->at, k)) continue;
            while (p->patch[i] >= p->first[t + 1]) t++;
            const treepieces_batch *b = &f->forest->batches[t];
            const uint32_t *record = b->words + (size_t)v->instance * b->stride;
            const int cell = (int)(record[4 + v->quad / 4] >> (8 * (v->quad & 3)) & 255u);
            float uv[2];
            const int layer = treepieces_quad_uv(&treepieces_kit_piece(f->kit, t)->quads[v->quad],
                                                 record[3], cell, 512, k, uv);
            wrong += layer != v->layer || fabsf(uv[0] - v->tile[0]) > 1e-6f ||
                     fabsf(uv[1] - v->tile[1]) > 1e-6f;
            corners++;
        }
    }
    report(wrong == 0 && corners >= 4 * p->count, "bark: where treepieces_quad_uv says",
           "%zu corners, %zu wrong", corners, wrong);
}

/* A tree in a pose, with an eye between its branches. */
static void test_cracks(treepieces_rule_function *rule, int pieces, float eye_height, float half) {
    forest_gl *f = open_trees(1, pieces, rule, 0.4f);
    treepieces_mesh *mesh;
    const treepieces_lod lod = {{0.7f, eye_height, 0.4f}, 10, half, 0.6f};
    treepieces_bake_desc desc = {0};
    desc.forest = f->forest;
    desc.bones = f->bones;
    desc.lod = &lod;
    must(check(f, treepieces_bake(&desc, &f->env, &mesh)), f);
    memcpy(f->frame.eye, lod.eye, sizeof lod.eye);
    f->frame.view_projection[15] = 1; /* everything is at the centre of the image */
    f->frame.lod[0] = lod.max_level;
    f->frame.lod[1] = lod.half_distance;
    f->frame.lod[2] = lod.shape;
    f->frame.lod[3] = 512;
    glBindBuffer(GL_UNIFORM_BUFFER, f->block);
    glBufferData(GL_UNIFORM_BUFFER, sizeof f->frame, &f->frame, GL_STREAM_DRAW);
    patches p = tessellate(f, 6 * mesh->triangle_count);
    const size_t missing = number_corners(&p);
    report(missing == 0, "tessellation: all patches are there", "%zu patches, %zu corners missing",
           p.count, missing);
    if (!missing) {
        test_edges(&p, f->forest->tree_count);
        test_bake(&p, mesh);
        test_tiles(f, &p);
    }
    treepieces_mesh_free(mesh);
    free(p.vertices);
    free(p.patch);
    free(p.corners);
    close_scene(f);
}

/* ---- pictures ------------------------------------------------------------------------------ */

/* nearest depth, 1 = background; row 0 at the bottom, as in OpenGL */
typedef struct picture {
    int width, height;
    float *depth;
} picture;

static picture new_picture(const forest_gl *f) {
    picture p = {f->o.width, f->o.height, NULL};
    p.depth = (float *)room((size_t)p.width * (size_t)p.height, sizeof *p.depth);
    for (int i = 0; i < p.width * p.height; i++) p.depth[i] = 1;
    return p;
}

/* x, y in pixels, depth, and 1 / w */
static void project(const forest_gl *f, const float p[3], double out[4]) {
    double clip[4];
    for (int k = 0; k < 4; k++) {
        const float *m = f->frame.view_projection + k;
        clip[k] = (double)m[0] * (double)p[0] + (double)m[4] * (double)p[1] +
                  (double)m[8] * (double)p[2] + (double)m[12];
    }
    out[0] = (0.5 + 0.5 * clip[0] / clip[3]) * f->o.width;
    out[1] = (0.5 + 0.5 * clip[1] / clip[3]) * f->o.height;
    out[2] = 0.5 + 0.5 * clip[2] / clip[3];
    out[3] = 1 / clip[3];
}

static void put(picture *p, int x, int y, double depth) {
    float *d = &p->depth[y * p->width + x];
    if (depth >= 0 && depth < (double)*d) *d = (float)depth;
}

/* Rasterise a triangle that faces the eye. */
static void raster_triangle(picture *p, double v[3][4]) {
    const double area = (v[1][0] - v[0][0]) * (v[2][1] - v[0][1]) -
                        (v[2][0] - v[0][0]) * (v[1][1] - v[0][1]);
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    if (area <= 0) return;
    for (int k = 0; k < 6; k++) {
        const double x = v[k / 2][k % 2];
        low[k % 2] = x < low[k % 2] ? x : low[k % 2];
        high[k % 2] = x > high[k % 2] ? x : high[k % 2];
    }
    const int x1 = txm_clampi((int)high[0], 0, p->width - 1);
    const int y1 = txm_clampi((int)high[1], 0, p->height - 1);
    for (int y = txm_clampi((int)low[1], 0, p->height); y <= y1; y++) {
        for (int x = txm_clampi((int)low[0], 0, p->width); x <= x1; x++) {
            double w[3], least = 1;
            for (int k = 0; k < 3; k++) {
                const double *a = v[(k + 1) % 3], *b = v[(k + 2) % 3];
                w[k] = ((b[0] - a[0]) * (y + 0.5 - a[1]) - (b[1] - a[1]) * (x + 0.5 - a[0])) / area;
                least = w[k] < least ? w[k] : least;
            }
            if (least >= 0) put(p, x, y, w[0] * v[0][2] + w[1] * v[1][2] + w[2] * v[2][2]);
        }
    }
}

static void raster_trees(forest_gl *f, picture *p) {
    treepieces_lod lod = {{0, 0, 0}, f->frame.lod[0], f->frame.lod[1], f->frame.lod[2]};
    memcpy(lod.eye, f->frame.eye, sizeof lod.eye);
    for (int t = 0; t < f->forest->tree_count; t++) {
        treepieces_bake_desc desc = {0};
        treepieces_mesh *mesh;
        desc.forest = f->forest;
        desc.tree = t;
        desc.bones = f->bones;
        desc.lod = &lod;
        must(check(f, treepieces_bake(&desc, &f->env, &mesh)), f);
        for (size_t i = 0; i < mesh->triangle_count; i++) {
            double v[3][4];
            for (int k = 0; k < 3; k++)
                project(f, mesh->positions + 3 * mesh->indices[3 * i + (size_t)k], v[k]);
            raster_triangle(p, v);
        }
        treepieces_mesh_free(mesh);
    }
}

/* The result of treepieces_impostor for the view. */
static void make_impostor(forest_gl *f, uint32_t look, txm_image color, txm_image depth) {
    treepieces_card cards[256];
    treepieces_impostor_desc desc = {0};
    desc.cards = cards;
    desc.card_count = treepieces_cloud(&f->species[0], look, cards);
    desc.leaves = f->leaves[0];
    memcpy(desc.right, f->frame.right, sizeof desc.right);
    memcpy(desc.up, f->frame.up, sizeof desc.up);
    memcpy(desc.forward, f->frame.forward, sizeof desc.forward);
    memcpy(desc.light, f->frame.sun, sizeof desc.light);
    must(check(f, treepieces_impostor(&desc, &f->env, color, depth)), f);
}

/* Draw the depths of an impostor at the position of a cluster. */
static void raster_cloud(const forest_gl *f, const treepieces_cluster *c, const float *depth,
                         picture *p) {
    float center[3], corner[3], near[3];
    double at[4], to[4], out[4];
    axis_point(f, c->node, c->along, center);
    for (int k = 0; k < 3; k++)
        corner[k] = center[k] + c->radius * (f->frame.right[k] + f->frame.up[k]);
    project(f, center, at);
    project(f, corner, to);
    const int x1 = txm_clampi((int)to[0], 0, p->width - 1);
    const int y1 = txm_clampi((int)to[1], 0, p->height - 1);
    for (int y = txm_clampi((int)(2 * at[1] - to[1]), 0, p->height); y <= y1; y++) {
        for (int x = txm_clampi((int)(2 * at[0] - to[0]), 0, p->width); x <= x1; x++) {
            const double u = (x + 0.5 - at[0]) / (to[0] - at[0]);
            const double v = (y + 0.5 - at[1]) / (to[1] - at[1]);
            if (fabs(u) >= 1 || fabs(v) >= 1) continue;
            const int pixel = (int)((0.5 - 0.5 * v) * CLOUD_SIDE) * CLOUD_SIDE +
                              (int)((0.5 + 0.5 * u) * CLOUD_SIDE);
            if (depth[pixel] <= -1.5f) continue;
            for (int k = 0; k < 3; k++)
                near[k] = center[k] + c->radius * ((float)u * f->frame.right[k] +
                                                   (float)v * f->frame.up[k] -
                                                   depth[pixel] * f->frame.forward[k]);
            project(f, near, out);
            put(p, x, y, out[2]);
        }
    }
}

static void raster_clouds(forest_gl *f, picture *p) {
    txm_image color = image_of(room(CLOUD_SIDE * CLOUD_SIDE, 4), CLOUD_SIDE, CLOUD_SIDE, 4);
    txm_image depth = color;
    depth.pixels = room(CLOUD_SIDE * CLOUD_SIDE, sizeof(float));
    depth.channels = 1;
    depth.sample = TXM_F32;
    for (uint32_t look = 0; look < CLOUDS; look++) {
        make_impostor(f, look, color, depth);
        for (uint32_t i = 0; i < f->forest->cluster_count; i++)
            if (f->forest->clusters[i].look % CLOUDS == look)
                raster_cloud(f, &f->forest->clusters[i], (const float *)depth.pixels, p);
    }
    free(color.pixels);
    free(depth.pixels);
}

/* The depths of the graphics card, without ground and sky. */
static picture draw_depth(forest_gl *f) {
    picture p = new_picture(f);
    const GLuint target = make_target(p.width, p.height);
    aim_camera(f, p.width, p.height);
    if (!f->o.is_bare) draw_impostors(f);
    glBindFramebuffer(GL_FRAMEBUFFER, target);
    glViewport(0, 0, p.width, p.height);
    glEnable(GL_DEPTH_TEST);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glEnable(GL_CULL_FACE);
    draw_pieces(f, f->programs[PIECES]);
    glDisable(GL_CULL_FACE);
    if (!f->o.is_bare) draw_strips(f, CLOUD, (int)f->forest->cluster_count);
    glReadPixels(0, 0, p.width, p.height, GL_DEPTH_COMPONENT, GL_FLOAT, p.depth);
    glDeleteFramebuffers(1, &target);
    return p;
}

/* distance from the eye, metres */
static double distance_of(const forest_gl *f, float depth) {
    const double n = (double)f->near_plane, far = (double)f->far_plane;
    return far * n / (far - (double)depth * (far - n));
}

/* Of the pixels that either covers, both must cover the fraction `coverage`, and of those a fraction
   `share` must differ by at most `near` metres in distance. */
static void compare_pictures(const forest_gl *f, const char *what, const picture *a,
                             const picture *b, double coverage, double share, double near) {
    int both = 0, either = 0, same = 0;
    for (int i = 0; i < a->width * a->height; i++) {
        const int in_a = a->depth[i] < 1, in_b = b->depth[i] < 1;
        either += in_a || in_b;
        both += in_a && in_b;
        same += in_a && in_b &&
                fabs(distance_of(f, a->depth[i]) - distance_of(f, b->depth[i])) <= near;
    }
    report(both >= coverage * either && same >= share * both && both > 2000, what,
           "%d pixels, %.2f %% covered by both, of which %.2f %% at the same distance", either,
           100.0 * both / either, 100.0 * same / both);
}

/* The impostors themselves: of the pixels where either shows a leaf, the share where both show the same. */
static void test_impostors(void) {
    enum { PIXELS = CLOUD_SIDE * CLOUD_SIDE };
    forest_gl *f = open_scene(new_scene(1, 8));
    float *depths = (float *)room(CLOUDS * PIXELS, sizeof *depths);
    uint8_t *colors = (uint8_t *)room(CLOUDS * PIXELS, 4);
    txm_image color = image_of(room(PIXELS, 4), CLOUD_SIDE, CLOUD_SIDE, 4), depth = color;
    depth.pixels = room(PIXELS, sizeof(float));
    depth.channels = 1;
    depth.sample = TXM_F32;
    int either = 0, both = 0, same = 0, alike = 0;
    aim_camera(f, 64, 64);
    draw_impostors(f);
    glActiveTexture(GL_TEXTURE0 + IMPOSTORS);
    glGetTexImage(GL_TEXTURE_2D_ARRAY, 0, GL_RGBA, GL_UNSIGNED_BYTE, colors);
    glActiveTexture(GL_TEXTURE0 + DEPTHS);
    glGetTexImage(GL_TEXTURE_2D_ARRAY, 0, GL_RED, GL_FLOAT, depths);
    for (int look = 0; look < CLOUDS; look++) {
        make_impostor(f, (uint32_t)look, color, depth);
        for (int i = 0; i < PIXELS; i++) {
            const int row = CLOUD_SIDE - 1 - i / CLOUD_SIDE; /* of OpenGL, from below */
            const size_t at = (size_t)((look * CLOUD_SIDE + row) * CLOUD_SIDE + i % CLOUD_SIDE);
            const float ours = depths[at], theirs = ((const float *)depth.pixels)[i];
            int step = 0;
            for (size_t k = 0; k < 3; k++)
                step += abs(colors[4 * at + k] - ((const uint8_t *)color.pixels)[4 * i + (int)k]);
            either += ours > -1.5f || theirs > -1.5f;
            if (!(ours > -1.5f && theirs > -1.5f)) continue;
            both++;
            same += fabsf(ours - theirs) < 0.02f;
            alike += step < 24;
        }
    }
    report(both >= 0.98 * either && same >= 0.98 * both && alike >= 0.98 * both && both > 10000,
           "impostors: as those of treepieces_impostor",
           "%d pixels, %.2f %% covered by both, of which %.2f %% at the same depth, %.2f %% alike",
           either, 100.0 * both / either, 100.0 * same / both, 100.0 * alike / both);
    free(depths);
    free(colors);
    free(color.pixels);
    free(depth.pixels);
    close_scene(f);
}

static void test_picture(const char *what, int is_bare, double coverage, double share,
                         double near) {
    forest_gl *f = new_scene(1, 120);
    f->o.is_bare = is_bare;
    f->o.seed = 2;
    if (!is_bare) f->o.orbit[2] = 6; /* impostors are enlarged: no mip-maps */
    f->o.width = 480;
    f->o.height = 480;
    f->o.level = 4;
    open_scene(f);
    f->o.wind = 0; /* bent as the wind left it, but no leaf shimmers: that is the shaders' alone */
    picture ours = draw_depth(f), theirs = new_picture(f);
    raster_trees(f, &theirs);
    if (!is_bare) raster_clouds(f, &theirs);
    compare_pictures(f, what, &ours, &theirs, coverage, share, near);
    free(ours.depth);
    free(theirs.depth);
    close_scene(f);
}

/* ---- draw calls ------------------------------------------------------------------------------ */

static int count_calls(int trees, int pieces, uint32_t *all) {
    forest_gl *f = new_scene(trees, pieces);
    f->o.width = f->o.height = 64;
    open_scene(f);
    const GLuint target = make_target(64, 64);
    most_instances = 64;
    draw_calls = 0;
    draw_frame(f, target, 64, 64);
    const int calls = draw_calls == f->draws ? draw_calls : -1;
    most_instances = 0x7fffffff;
    *all = f->forest->node_count;
    glDeleteFramebuffers(1, &target);
    close_scene(f);
    return calls;
}

static void test_calls(void) {
    uint32_t pieces[2];
    const int one = count_calls(1, 600, &pieces[0]), many = count_calls(10000, 8, &pieces[1]);
    report(many <= one && many > 0 && one <= 10, "at most as many draw calls for 10,000 trees as for one",
           "%d for %u pieces, %d for %u", many, pieces[1], one, pieces[0]);
}

int main(void) {
    GLuint array;
    forest_gl *f = new_scene(1, 8);
    must(open_headless(f), f);
    display = f->display;
    glGenVertexArrays(1, &array);
    glBindVertexArray(array);
    make_target(64, 64); /* without a frame buffer nothing is drawn or recorded */
    test_rims();
    test_cracks(NULL, 150, 0.5f, 3);
    test_cracks(any_piece, 100, 1, 1.5f);
    test_impostors();
    /* outlines of leaves differ, as only OpenGL filters them, and behind them is a leaf far away */
    test_picture("a bare tree: as treepieces_bake's, drawn without OpenGL", 1, 0.99, 0.97, 0.02);
    test_picture("in leaf: as treepieces_impostor's, drawn without OpenGL", 0, 0.91, 0.87, 0.1);
    test_calls();
    report(glGetError() == GL_NO_ERROR, "no OpenGL error", "%s", glGetString(GL_RENDERER));
    eglTerminate(display);
    return failures != 0;
}
