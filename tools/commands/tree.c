/* tree.c - texkit tree and texkit forest: a species in, trees out
   SPDX-License-Identifier: MIT OR Unlicense

   run_job and grow_trees at the end show the steps: read the species, dress (bark, leaves),
   grow, pose, build, write. What is built is a baked mesh, a mesh with a skeleton, or instances.    */
#include "tree.h"
#include "files/image_io.h"

#include <cjson/cJSON.h>
#include <stdio.h>

enum { MAX_LEVEL = 16, BAKED_LOOKS = 8 };

static const cli_manual tree_manual = {
    "tree", "-o OUT [options]", "grow a tree from interlocking pieces",
    "OUT ends in\n"
    "  .glb  one mesh on a skeleton of the thickest pieces, and with --wind an\n"
    "        animation of its swaying that loops seamlessly\n"
    "  .obj  a mesh with its pictures beside it; the bark is one closed surface\n"
    "  .ply  the same mesh with colors, without pictures; .stl, without colors as well\n"
    "  .txt  the species itself, to edit and pass to --species (see docs/trees.md)\n"
    "Species: oak, beech, maple, birch, poplar, willow, almond, pine, spruce, dead.\n"
    "Each --seed gives a different tree. A skeleton has 128 joints, or as many as --bones says,\n"
    "and at most one for each piece; thinner twigs move with the branches that bear them. A\n"
    "joint costs an engine a matrix a frame, and the file 16 bytes for each key of --wind.\n"
    "--lods writes coarser levels of the same tree as files of their own: each has a third of\n"
    "the pieces of the one before, the same height and main branches, and fewer twigs.\n"
    "--pose bends every joint a little at random: the skeleton of a .glb, the mesh of an .obj or\n"
    ".ply. In .obj and .ply, --wind bends the mesh as at one moment. Without --tiles and --leaf,\n"
    "bark and leaves are drawn procedurally.\n",
    "  texkit tree -o oak.glb --species oak --wind 8\n"
    "  texkit tree -o birch.glb --species birch --pieces 2000 --lods 3\n"
    "  texkit tree -o mine.txt --species birch\n"
    "  texkit tree -o mine.obj --species mine.txt --tiles bark-tiles --level 3\n",
    0, NULL, 0, "take fewer --pieces", ".glb"};

static const cli_manual forest_manual = {
    "forest", "--count N -o OUT [options]", "grow many different trees from the same pieces",
    "OUT ends in\n"
    "  .glb  instances of some pieces and leaf clouds (EXT_mesh_gpu_instancing): at most 10\n"
    "        nodes, plus one for each species with leaves after the third, for any number\n"
    "        of trees\n"
    "  .obj  every tree as a mesh, with the pictures beside it\n"
    "  .ply  the same with colors, without pictures; .stl, without colors as well\n"
    "In glTF instances cannot have skeletons: the pieces in a .glb are rigid and overlap a\n"
    "little where a branch bends. 'texkit tree' writes one tree that can move. All\n"
    "instances of a piece show the same bark tiles.\n"
    "--variants K is for programs without that extension: the .glb holds K different trees as\n"
    "meshes, and a plain node for each of the N trees. The first of the K is the tree that\n"
    "'texkit tree' makes of the same --seed, the next that of the next seed, and so on.\n",
    "  texkit forest --count 1000 -o forest.glb --species oak,birch,spruce\n"
    "  texkit forest --count 500 -o wood.glb --species beech,oak --variants 6 --pieces 300\n"
    "  texkit forest --count 20 -o grove.obj --species poplar --spacing 6 --pieces 200\n",
    0, NULL, 0, "take fewer --pieces or trees", ".glb"};

/* The species as text. */
static int write_species(tree_job *j) {
    const size_t size = treepieces_species_print(&j->species[0], NULL, 0);
    char *text = (char *)new_array(size + 1, 1);
    if (!text) return fail_memory(&j->run);
    treepieces_species_print(&j->species[0], text, size + 1);
    cli_figure(&j->run, "file_bytes", (double)size);
    const int status = cli_finish(&j->run, text, size);
    free(text);
    if (!status && !j->run.quiet)
        printf("%s: the species %s\n", j->run.output, j->species[0].name);
    return status;
}

/* ---- baked meshes -------------------------------------------------------------------------- */

static void *more(void *block, size_t count, size_t size) {
    size_t bytes;
    return txm_mul(count, size, 1, &bytes) ? realloc(block, bytes ? bytes : 1) : NULL;
}

/* Make room for so many more vertices and triangles; 0: no memory. */
static int extend(mesh_data *m, size_t vertices, size_t triangles, int with_uvs, int with_colors) {
    const size_t v = m->vertex_count + vertices, t = m->triangle_count + triangles;
    void *block;
    if (v > 0x7fffffff || t > 0x7fffffff) return 0;
    if (!(block = more(m->positions, v, 3 * sizeof(float)))) return 0;
    m->positions = (float *)block;
    if (!(block = more(m->normals, v, 3 * sizeof(float)))) return 0;
    m->normals = (float *)block;
    if (!(block = more(m->indices, t, 3 * sizeof(uint32_t)))) return 0;
    m->indices = (uint32_t *)block;
    if (with_uvs && !(block = more(m->uvs, t, 6 * sizeof(float)))) return 0;
    if (with_uvs) m->uvs = (float *)block;
    if (with_colors && !(block = more(m->colors, v, 4))) return 0;
    if (with_colors) m->colors = (unsigned char *)block;
    return 1;
}

/* Append a tree's bark or leaves to a mesh. color: sRGB, instead of uvs; in GLB, the colors that go with
   the picture. */
static int append(tree_job *j, const treepieces_mesh *from, const float *color, mesh_data *to) {
    const size_t base = to->vertex_count, first = 3 * to->triangle_count;
    if (!extend(to, from->vertex_count, from->triangle_count, !color, color || tree_is_glb(j)))
        return fail_memory(&j->run);
    memcpy(to->positions + 3 * base, from->positions, 3 * from->vertex_count * sizeof(float));
    memcpy(to->normals + 3 * base, from->normals, 3 * from->vertex_count * sizeof(float));
    for (size_t c = 0; c < 3 * from->triangle_count; c++)
        to->indices[first + c] = (uint32_t)(base + from->indices[c]);
    if (!color)
        memcpy(to->uvs + 2 * first, from->uvs, 6 * from->triangle_count * sizeof(float));
    if (!color && tree_is_glb(j)) memcpy(to->colors + 4 * base, from->colors, 4 * from->vertex_count);
    for (size_t i = 0; i < from->vertex_count && color; i++) {
        for (size_t k = 0; k < 3; k++)
            to->colors[4 * (base + i) + k] =
                (unsigned char)((float)from->colors[4 * i + k] * txm_clampf(color[k], 0, 1) + 0.5f);
        to->colors[4 * (base + i) + 3] = 255;
    }
    to->vertex_count += from->vertex_count;
    to->triangle_count += from->triangle_count;
    return CLI_DONE;
}

/* Bark and leaves of a tree; *leaves stays NULL if it has none. */
static int bake_tree(tree_job *j, int tree, const float *bones, treepieces_mesh **bark,
                     treepieces_mesh **leaves) {
    const treepieces_tree *t = &j->forest->trees[tree];
    treepieces_lod lod = {{0, 0, 0}, 0, 1e30f, 0}; /* so far that the level never drops */
    treepieces_bake_desc desc;
    memset(&desc, 0, sizeof desc);
    lod.max_level = (float)j->level;
    desc.forest = j->forest;
    desc.tree = tree;
    desc.bones = bones;
    desc.lod = j->level > 1 ? &lod : NULL;
    desc.capped = j->capped;
    desc.sheet_size = j->bark[0].width;
    txm_status result = treepieces_bake(&desc, &j->run.env, bark);
    if (result == TXM_OK && t->cluster_count && j->species[t->species].leaf_count)
        result = treepieces_bake_leaves(j->forest, tree, bones, BAKED_LOOKS, &j->run.env, leaves);
    return check_result(&j->run, result, j->species[t->species].name);
}

/* ---- what is built ------------------------------------------------------------------------- */

typedef struct built {
    mesh_scene scene;
    mesh_data wood[MAX_SPECIES], foliage[MAX_SPECIES];
    mesh_part parts[2 * MAX_SPECIES];
    treepieces_mesh *bark, *leaves; /* of a tree with a rig, whose meshes are views of these */
    tree_rig rig;
    tree_copies copies;
    tree_places places;
    mesh_object objects[MAX_VARIANTS];
    mesh_part variant_parts[MAX_VARIANTS][2];
    mesh_data *variants; /* wood and foliage of each */
    char names[MAX_VARIANTS][TREEPIECES_MAX_NAME + 8];
    char *extras;
} built;

static void free_built(built *b) {
    for (int s = 0; s < MAX_SPECIES; s++) {
        if (b->bark) { /* all but joints and weights is the library's */
            free(b->wood[s].joints);
            free(b->wood[s].weights);
            free(b->foliage[s].joints);
            free(b->foliage[s].weights);
            continue;
        }
        mesh_free(&b->wood[s]);
        mesh_free(&b->foliage[s]);
    }
    treepieces_mesh_free(b->bark);
    treepieces_mesh_free(b->leaves);
    for (int k = 0; k < 2 * MAX_VARIANTS && b->variants; k++) mesh_free(&b->variants[k]);
    free(b->variants);
    tree_free_places(&b->places);
    tree_free_rig(&b->rig);
    tree_free_copies(&b->copies);
    cJSON_free(b->extras);
}

static void add_part(built *b, const mesh_data *mesh, const mesh_material *material) {
    if (mesh->triangle_count == 0) return;
    b->parts[b->scene.part_count].mesh = mesh;
    b->parts[b->scene.part_count++].material = material;
}

/* All trees in their final pose; without textures all in one mesh. */
static int build_baked(tree_job *j, built *b) {
    const int is_bare = tree_is_bare(j);
    int status = CLI_DONE;
    for (int t = 0; t < j->forest->tree_count && !status; t++) {
        treepieces_mesh *bark = NULL, *leaves = NULL;
        const int species = j->forest->trees[t].species;
        const treepieces_species *s = &j->species[species];
        const int to_wood = is_bare || tree_has_one_bark(j) ? 0 : species;
        status = bake_tree(j, t, j->posed, &bark, &leaves);
        if (!status) status = append(j, bark, is_bare ? s->bark_color : NULL, &b->wood[to_wood]);
        if (!status && j->wind_attributes) status = tree_add_pivots(j, t, bark, &b->wood[to_wood]);
        if (!status && leaves)
            status = append(j, leaves, is_bare ? s->leaf_color : NULL,
                            is_bare ? &b->wood[0] : &b->foliage[species]);
        if (!status && leaves && j->wind_attributes)
            status = tree_add_pivots(j, t, leaves, &b->foliage[species]);
        treepieces_mesh_free(bark);
        treepieces_mesh_free(leaves);
    }
    for (int s = 0; s < j->species_count; s++) {
        add_part(b, &b->wood[s], &j->bark_materials[s]);
        add_part(b, &b->foliage[s], &j->leaf_materials[s]);
    }
    return status;
}

/* A view of a library mesh for the writer, which shares its arrays. */
static int rigged_view(tree_job *j, const tree_rig *rig, const treepieces_mesh *from,
                       mesh_data *to) {
    to->vertex_count = from->vertex_count;
    to->triangle_count = from->triangle_count;
    to->positions = from->positions;
    to->normals = from->normals;
    to->indices = from->indices;
    to->uvs = from->uvs;
    to->colors = from->colors;
    return tree_bind_mesh(j, rig, from, to);
}

static int build_rigged(tree_job *j, built *b) {
    int status = tree_make_rig(j, &b->rig);
    if (!status) status = bake_tree(j, 0, j->rest, &b->bark, &b->leaves);
    if (!status) status = rigged_view(j, &b->rig, b->bark, &b->wood[0]);
    if (!status && b->leaves) status = rigged_view(j, &b->rig, b->leaves, &b->foliage[0]);
    add_part(b, &b->wood[0], &j->bark_materials[0]);
    add_part(b, &b->foliage[0], &j->leaf_materials[0]);
    b->scene.skeleton = &b->rig.skeleton;
    if (j->lod) return status;
    cli_figure(&j->run, "joints", b->rig.skeleton.joint_count);
    cli_figure(&j->run, "keys", b->rig.skeleton.key_count);
    return status;
}

static int build_copies(tree_job *j, const float tint[3], built *b) {
    const int status = tree_make_copies(j, tint, &b->copies);
    cli_stage(&j->run, "build");
    b->scene.instances = b->copies.list;
    b->scene.instance_count = b->copies.count;
    cli_figure(&j->run, "nodes", b->copies.count);
    return status;
}

/* One of the different trees, as a mesh in the places where it stands. */
static int build_variant(tree_job *j, int k, built *b) {
    treepieces_mesh *bark = NULL, *leaves = NULL;
    const int species = k % j->species_count, one = tree_has_one_bark(j) ? 0 : species;
    const size_t first = b->places.first[k];
    mesh_object *o = &b->objects[b->scene.object_count];
    int status = bake_tree(j, k, j->posed, &bark, &leaves);
    if (!status) status = append(j, bark, NULL, &b->variants[2 * k]);
    if (!status && leaves) status = append(j, leaves, NULL, &b->variants[2 * k + 1]);
    if (!status && j->wind_attributes) status = tree_add_pivots(j, k, bark, &b->variants[2 * k]);
    if (!status && j->wind_attributes && leaves)
        status = tree_add_pivots(j, k, leaves, &b->variants[2 * k + 1]);
    snprintf(b->names[k], sizeof b->names[k], "%s-%d", j->species[species].name, k + 1);
    o->name = b->names[k];
    o->parts = b->variant_parts[k];
    o->part_count = leaves ? 2 : 1;
    b->variant_parts[k][0].mesh = &b->variants[2 * k];
    b->variant_parts[k][0].material = &j->bark_materials[one];
    b->variant_parts[k][1].mesh = &b->variants[2 * k + 1];
    b->variant_parts[k][1].material = &j->leaf_materials[species];
    o->count = b->places.first[k + 1] - first;
    o->translations = b->places.translations + 3 * first;
    o->rotations = b->places.rotations + 4 * first;
    o->scales = b->places.scales + first;
    b->scene.object_count++;
    treepieces_mesh_free(bark);
    treepieces_mesh_free(leaves);
    return status;
}

static int build_variants(tree_job *j, built *b) {
    int status = tree_make_places(j, &b->places);
    b->variants = (mesh_data *)new_array(2 * MAX_VARIANTS, sizeof(mesh_data));
    if (!status && !b->variants) status = fail_memory(&j->run);
    b->scene.objects = b->objects;
    for (int k = 0; k < j->variants && !status; k++)
        if (b->places.first[k + 1] > b->places.first[k]) status = build_variant(j, k, b);
    cli_figure(&j->run, "variants", b->scene.object_count);
    cli_figure(&j->run, "nodes", j->count);
    return status;
}

/* The extras of a .glb: species, seed, numbers of trees and pieces. */
static int make_extras(tree_job *j, built *b) {
    char seed[24];
    cJSON *json = cJSON_CreateObject();
    cJSON *names = cJSON_AddArrayToObject(json, "species");
    for (int s = 0; s < j->species_count; s++)
        cJSON_AddItemToArray(names, cJSON_CreateString(j->species[s].name));
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)j->run.seed);
    cJSON_AddRawToObject(json, "seed", seed); /* a double cannot hold all of them */
    cJSON_AddNumberToObject(json, "trees", j->count);
    if (j->variants) cJSON_AddNumberToObject(json, "variants", j->variants);
    cJSON_AddNumberToObject(json, "pieces", (double)j->grown.pieces);
    b->extras = cJSON_PrintUnformatted(json);
    cJSON_Delete(json);
    b->scene.extras = b->extras;
    return b->extras ? CLI_DONE : fail_memory(&j->run);
}

static size_t count_triangles(const built *b) {
    size_t sum = 0;
    for (int i = 0; i < b->scene.part_count; i++) sum += b->parts[i].mesh->triangle_count;
    for (int i = 0; i < b->scene.instance_count; i++)
        sum += b->copies.list[i].count * b->copies.list[i].mesh->triangle_count;
    for (int i = 0; i < b->scene.object_count; i++)
        for (int k = 0; k < b->objects[i].part_count; k++)
            sum += b->objects[i].count * b->objects[i].parts[k].mesh->triangle_count;
    return sum;
}

static size_t count_vertices(const built *b) {
    size_t sum = 0;
    for (int i = 0; i < b->scene.part_count; i++) sum += b->parts[i].mesh->vertex_count;
    for (int i = 0; i < b->scene.instance_count; i++)
        sum += b->copies.list[i].count * b->copies.list[i].mesh->vertex_count;
    for (int i = 0; i < b->scene.object_count; i++)
        for (int k = 0; k < b->objects[i].part_count; k++)
            sum += b->objects[i].count * b->objects[i].parts[k].mesh->vertex_count;
    return sum;
}

/* ---- writing ------------------------------------------------------------------------------- */

static int write_output(tree_job *j, built *b) {
    cli *run = &j->run;
    cli_file files[2 + 2 * MAX_SPECIES + MAX_LEVELS]; /* OUT, .mtl, pictures, levels */
    unsigned char *mtl = NULL;
    mesh_file out;
    const char *why;
    int status = CLI_DONE, count = 1;
    const int is_obj = !strcmp(j->extension, ".obj");
    memset(files, 0, sizeof files);

    b->scene.parts = b->parts;
    if (is_obj) b->scene.library = name_in(j->mtl_path);
    if (!mesh_encode_extents(j->extension, &b->scene, &out, &why))
        status = cli_fail(run, CLI_FAILED, "cannot write '%s': %s", run->output, why);
    files[0].name = run->output;
    files[0].extents = out.extents;
    files[0].extent_count = out.count;
    files[0].size = out.size;
    if (!status && is_obj) {
        if (!mesh_encode_mtl(&b->scene, &mtl, &files[1].size, &why))
            status = cli_fail(run, CLI_FAILED, "cannot write '%s': %s", j->mtl_path, why);
        files[1].name = j->mtl_path;
        files[1].bytes = mtl;
        count = 2;
        for (int s = 0; s < 2 * j->species_count; s++) {
            const picture *p = s % 2 ? &j->leaves[s / 2] : &j->bark[s / 2];
            if (!p->png) continue;
            files[count].name = p->path;
            files[count].bytes = p->png;
            files[count++].size = p->size;
        }
    }
    for (int i = 0; i < MAX_LEVELS; i++) {
        if (!j->levels[i].bytes) continue;
        files[count].name = j->levels[i].path;
        files[count].bytes = j->levels[i].bytes;
        files[count++].size = j->levels[i].size;
    }
    cli_figure(run, "file_bytes", (double)files[0].size);
    if (!status) status = cli_finish_files(run, files, count);
    mesh_file_free(&out);
    free(mtl);
    return status;
}

static void print_summary(const tree_job *j, const built *b, size_t triangles) {
    printf("%s: ", j->run.output);
    if (j->is_forest) printf("%d trees, ", j->count);
    else printf("%s, %.1f m high, ", j->species[0].name, (double)j->grown.height);
    if (j->variants) printf("%d different ones, ", b->scene.object_count);
    printf("%lu pieces, %lu triangles", (unsigned long)j->grown.pieces, (unsigned long)triangles);
    if (b->scene.skeleton) printf(", %d joints", b->rig.skeleton.joint_count);
    if (b->rig.skeleton.key_count) printf(", %d keys", b->rig.skeleton.key_count);
    if (b->scene.instance_count) printf(" in %d nodes", b->scene.instance_count);
    printf(", %.1f s\n", cli_seconds(&j->run));
}

/* ---- the commands -------------------------------------------------------------------------- */

/* The same tree with fewer pieces, which shares materials with the one to come. */
static int make_level(tree_job *j, int level) {
    const char *why;
    built *b = (built *)new_array(1, sizeof *b);
    if (!b) return fail_memory(&j->run);
    j->lod = level;
    int status = tree_grow(j);
    cli_stage(&j->run, "build");
    if (!status) status = j->wind_attributes ? build_baked(j, b) : build_rigged(j, b);
    if (!status) status = make_extras(j, b);
    b->scene.parts = b->parts;
    if (!status && !mesh_encode(".glb", &b->scene, &j->levels[level].bytes, &j->levels[level].size, &why))
        status = cli_fail(&j->run, CLI_FAILED, "cannot write '%s': %s", j->levels[level].path, why);
    if (!status && !j->run.quiet)
        printf("%s: %lu pieces, %lu triangles\n", j->levels[level].path, (unsigned long)j->forest->node_count,
               (unsigned long)count_triangles(b));
    free_built(b);
    free(b);
    tree_fell(j);
    j->lod = 0;
    return status;
}

/* Trunk and main branches as one closed mesh, without a picture. */
static int make_collision(tree_job *j) {
    const mesh_material plain = {"collision", NULL, NULL, 0, NULL, 0, 0, 0, 0};
    const int capped = j->capped;
    const char *why;
    treepieces_mesh *bark = NULL, *leaves = NULL;
    built *b = (built *)new_array(1, sizeof *b);
    if (!b) return fail_memory(&j->run);
    j->lod = -1;
    j->capped = 1;
    int status = tree_grow(j);
    if (!status) status = bake_tree(j, 0, j->posed, &bark, &leaves);
    if (!status && !extend(&b->wood[0], bark->vertex_count, bark->triangle_count, 0, 0))
        status = fail_memory(&j->run);
    if (!status) {
        mesh_data *m = &b->wood[0];
        m->vertex_count = bark->vertex_count;
        m->triangle_count = bark->triangle_count;
        memcpy(m->positions, bark->positions, 3 * m->vertex_count * sizeof(float));
        memcpy(m->normals, bark->normals, 3 * m->vertex_count * sizeof(float));
        memcpy(m->indices, bark->indices, 3 * m->triangle_count * sizeof(uint32_t));
        add_part(b, m, &plain);
        b->scene.parts = b->parts;
        if (!mesh_encode(".obj", &b->scene, &j->levels[0].bytes, &j->levels[0].size, &why))
            status = cli_fail(&j->run, CLI_FAILED, "cannot write '%s': %s", j->levels[0].path, why);
    }
    if (!status && !j->run.quiet)
        printf("%s: %lu triangles\n", j->levels[0].path, (unsigned long)count_triangles(b));
    treepieces_mesh_free(bark);
    treepieces_mesh_free(leaves);
    free_built(b);
    free(b);
    tree_fell(j);
    j->lod = 0;
    j->capped = capped;
    return status;
}

/* Dress, grow, pose and write. */
static int grow_trees(tree_job *j, built *b) {
    const int is_copied = tree_is_copied(j); /* grows as its copies are made */
    float tint[3];
    cli_stage(&j->run, "dress");
    int status = tree_dress(j, tint);
    for (int i = j->lods - 1; i > 0 && !status; i--) status = make_level(j, i);
    if (j->collision && !status) status = make_collision(j);
    if (!status && !is_copied) status = tree_grow(j);
    if (status) return status;
    cli_stage(&j->run, "build");
    if (j->variants) status = build_variants(j, b);
    else if (!tree_is_glb(j) || j->wind_attributes) status = build_baked(j, b);
    else status = is_copied ? build_copies(j, tint, b) : build_rigged(j, b);
    if (!status) status = make_extras(j, b);
    if (status) return status;
    const size_t triangles = count_triangles(b);
    cli_figure(&j->run, "vertices", (double)count_vertices(b));
    cli_figure(&j->run, "triangles", (double)triangles);
    cli_stage(&j->run, "encode");
    status = write_output(j, b);
    if (!status && !j->run.quiet) print_summary(j, b, triangles);
    return status;
}

/* Name and announce the files beside an .obj, and the levels beside a .glb. */
static int name_files(tree_job *j) {
    char ending[32];
    for (int i = 1; i < j->lods; i++) {
        snprintf(ending, sizeof ending, "-%d.glb", i);
        const int status = path_beside(&j->run, ending, j->levels[i].path);
        if (status) return status;
    }
    if (j->collision) {
        const int status = path_beside(&j->run, "-collision.obj", j->levels[0].path);
        if (status) return status;
    }
    if (strcmp(j->extension, ".obj") != 0) return CLI_DONE;
    int status = path_beside(&j->run, ".mtl", j->mtl_path);
    for (int s = 0; s < j->species_count && !status; s++) {
        char number[12] = "";
        if (s > 0) snprintf(number, sizeof number, "-%d", s + 1);
        snprintf(ending, sizeof ending, "-bark%s.png", number);
        if (tree_has_bark(j, s)) status = path_beside(&j->run, ending, j->bark[s].path);
        snprintf(ending, sizeof ending, "-leaves%s.png", number);
        if (!status && j->species[s].leaf_count)
            status = path_beside(&j->run, ending, j->leaves[s].path);
    }
    return status;
}

static int check_output_kind(tree_job *j) {
    const char *why;
    file_extension(j->run.output, j->extension);
    if (!j->is_forest && !strcmp(j->extension, ".txt")) return CLI_DONE;
    if (mesh_can_write(j->extension, &why)) return CLI_DONE;
    return cli_fail(&j->run, CLI_USAGE, "cannot write '%s': %s%s", j->run.output, why,
                    j->is_forest ? "" : ", or in .txt for the species");
}

/* Everything after the command line has been read. */
static int run_job(tree_job *j, int needs_glb) {
    built *b;
    int status = check_output_kind(j);
    if (status) return status;
    if (needs_glb && !tree_is_glb(j))
        return cli_fail(&j->run, CLI_USAGE, "--bones, --seconds, --rate and --lods go with an OUT in .glb");
    if (j->variants && !tree_is_glb(j))
        return cli_fail(&j->run, CLI_USAGE, "--variants goes with an OUT in .glb");
    if (j->wind_attributes && (!tree_is_glb(j) || (j->is_forest && !j->variants)))
        return cli_fail(&j->run, CLI_USAGE, "--wind-attributes goes with %san OUT in .glb",
                        j->is_forest ? "--variants and " : "");
    if (j->level > 1 && j->is_forest && tree_is_glb(j) && !j->variants)
        return cli_fail(&j->run, CLI_USAGE,
                        "--level does not go with a forest in .glb; add --variants K");
    cli_stage(&j->run, "read");
    status = tree_read_species(j);
    if (status) return status;
    if (j->variants && j->variants < j->species_count)
        return cli_fail(&j->run, CLI_USAGE, "--variants: at least %d, one for each species",
                        j->species_count);
    if (!strcmp(j->extension, ".txt")) return write_species(j);
    status = name_files(j);
    if (status) return status;
    b = (built *)new_array(1, sizeof *b); /* too large for a small stack, as the job */
    if (!b) return fail_memory(&j->run);
    status = grow_trees(j, b);
    free_built(b);
    free(b);
    return status;
}

static int run_tree(int argc, char **argv) {
    tree_job *j = new_tree_job(0);
    const char *wind = NULL, *seconds = NULL, *bend = NULL;
    int status;
    if (!j) return CLI_FAILED;
    const cli_option options[] = {
        {CLI_TEXT, "--species", "NAME|FILE", "a built-in species or a file of one; default oak",
         &j->species_list, 0, 0},
        {CLI_TILES, "--tiles", "DIR", "bark: a set of 'texkit tiles --kind frame'", &j->tiles, 0, 0},
        {CLI_INPUT, "--leaf", "PICTURE", "a spray of leaves, transparent around it", &j->leaf, 0, 0},
        {CLI_INT, "--sheet", "PIXELS", "width of the bark's picture, 128 to 8192; default 512",
         &j->sheet, 128, 8192},
        {CLI_FLAG, "--bare", NULL, "without leaves", &j->bare, 0, 0},
        {CLI_INT, "--pieces", "N", "maximum number of pieces, 8 to 65535; default 600", &j->pieces, 8,
         65535},
        {CLI_INT, "--level", "N", "divide each side of the quads by N, 1 to 16; default 1",
         &j->level, 1, MAX_LEVEL},
        {CLI_FLAG, "--capped", NULL, "close the foot of the trunk as well", &j->capped, 0, 0},
        {CLI_TEXT, "--wind", "SPEED", "metres per second, up to 50; default 0", &wind, 0, 0},
        {CLI_TEXT, "--seconds", "S", "length of the animation, 1 to 60; default 4", &seconds, 0, 0},
        {CLI_INT, "--rate", "FPS", "keys per second, 1 to 60; default 12", &j->rate, 1, 60},
        {CLI_FLAG, "--wind-attributes", NULL,
         ".glb: no skeleton; numbers at the vertices that let a shader move them", &j->wind_attributes,
         0, 0},
        {CLI_TEXT, "--pose", "AMOUNT",
         "bend the joints at random, by at most this many radians, 0 to 1", &bend, 0, 0},
        {CLI_INT, "--bones", "N", "maximum number of joints; default 128", &j->bones, 1, 65535},
        {CLI_INT, "--lods", "K", "K levels, 2 to 6: OUT, and beside it OUT-1.glb, OUT-2.glb ...", &j->lods, 2,
         MAX_LEVELS},
        {CLI_FLAG, "--collision", NULL, "beside OUT, OUT-collision.obj: trunk and main branches, closed",
         &j->collision, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (!cli_begin(&j->run, &tree_manual, options, argc, argv, &status)) {
        const int needs_glb = j->bones || seconds || j->rate || j->lods;
        const int needs_wind = seconds || j->rate;
        if (!j->rate) j->rate = 12;
        status = parse_number(&j->run, "--wind", wind, 0, 50, &j->wind);
        if (!status) status = parse_number(&j->run, "--seconds", seconds, 1, 60, &j->seconds);
        if (!status) status = parse_number(&j->run, "--pose", bend, 0, 1, &j->pose);
        if (!status && j->wind_attributes && (j->bones || j->wind > 0))
            status = cli_fail(&j->run, CLI_USAGE,
                              "--wind-attributes leaves out the skeleton; it does not go with --bones or --wind");
        if (!status && needs_wind && j->wind <= 0)
            status = cli_fail(&j->run, CLI_USAGE, "--seconds and --rate go with --wind SPEED");
        if (!status) status = run_job(j, needs_glb);
    }
    free_tree_job(j);
    return status;
}

static int run_forest(int argc, char **argv) {
    tree_job *j = new_tree_job(1);
    const char *wind = NULL, *spacing = NULL, *bend = NULL;
    int status;
    if (!j) return CLI_FAILED;
    const cli_option options[] = {
        {CLI_INT, "--count", "N", "how many trees, 1 to 1000000", &j->count, 1, 1000000},
        {CLI_TEXT, "--species", "A,B,...", "built-in species or files, at most 8; default oak",
         &j->species_list, 0, 0},
        {CLI_TEXT, "--spacing", "M", "metres between trees, 0.1 to 1000; default: by their height",
         &spacing, 0, 0},
        {CLI_INT, "--variants", "K", ".glb: so many different trees, 1 to 256, as meshes of plain nodes",
         &j->variants, 1, MAX_VARIANTS},
        {CLI_INT, "--pieces", "N", "maximum per tree, 8 to 65535; default 600", &j->pieces, 8,
         65535},
        {CLI_TILES, "--tiles", "DIR", "bark: a set of 'texkit tiles --kind frame'", &j->tiles, 0, 0},
        {CLI_INPUT, "--leaf", "PICTURE", "a spray of leaves, transparent around it", &j->leaf, 0, 0},
        {CLI_INT, "--sheet", "PIXELS", "width of the bark's picture, 128 to 8192; default 512",
         &j->sheet, 128, 8192},
        {CLI_FLAG, "--bare", NULL, "without leaves", &j->bare, 0, 0},
        {CLI_INT, "--level", "N", ".obj, .ply, variants: divide each side of the quads by N, 1 to 16; default 1",
         &j->level, 1, MAX_LEVEL},
        {CLI_FLAG, "--capped", NULL, ".obj, .ply, variants: close the feet of the trunks as well", &j->capped,
         0, 0},
        {CLI_FLAG, "--wind-attributes", NULL,
         "variants: numbers at the vertices that let a shader move them", &j->wind_attributes, 0, 0},
        {CLI_TEXT, "--wind", "SPEED",
         "bend as in wind of this speed, metres per second, up to 50; default 0", &wind, 0, 0},
        {CLI_TEXT, "--pose", "AMOUNT", "bend the joints at random, by at most this many radians, 0 to 1",
         &bend, 0, 0},
        {CLI_END, NULL, NULL, NULL, NULL, 0, 0},
    };
    if (!cli_begin(&j->run, &forest_manual, options, argc, argv, &status)) {
        status = parse_number(&j->run, "--wind", wind, 0, 50, &j->wind);
        if (!status) status = parse_number(&j->run, "--spacing", spacing, 0.1, 1000, &j->spacing);
        if (!status) status = parse_number(&j->run, "--pose", bend, 0, 1, &j->pose);
        if (!status && j->count == 0)
            status = cli_fail(&j->run, CLI_USAGE, "no number of trees given; add --count N");
        if (!status) status = run_job(j, 0);
    }
    free_tree_job(j);
    return status;
}

const command tree_command = {&tree_manual, run_tree};
const command forest_command = {&forest_manual, run_forest};
