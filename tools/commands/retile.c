/* retile.c - texkit retile: a triangle mesh in, one of near-equilateral triangles out
   SPDX-License-Identifier: MIT OR Unlicense

   run_job at the end shows the steps: read, retile, dress (colors, texture coordinates, instances),
   measure, write.                                                                              */
#include "retile.h"
#include "files/image_io.h"

#include <stdio.h>

static const cli_manual retile_manual = {
    "retile", "MESH -o OUT --vertices N [options]",
    "cover a surface with near-equilateral triangles",
    "MESH is an OBJ, PLY, STL, OFF or GLB file; small faults are repaired (equal vertices welded,\n"
    "triangles oriented consistently, fins removed). OUT ends in .obj, .ply, .stl or .glb; it has\n"
    "exactly N vertices, not counting copies along texture seams. Texture coordinates, materials and\n"
    "colors of MESH, of vertices or faces, are carried over; a warning names what OUT cannot hold.\n"
    "With --texture, a material library or several materials, edges follow the seams between charts\n"
    "and materials (see --keep-seams). These options texture the triangles anew:\n"
    "--tiles DIR names a set of 'texkit tiles --kind triangle': every triangle gets a tile\n"
    "  whose edges match those of its neighbours.\n"
    "--patches PICTURE is a row of equilateral triangles, each with a gutter around it:\n"
    "  every triangle gets one of them at random.\n"
    "The picture is written beside OUT as OUT-atlas.png (that of --texture: OUT-texture.png),\n"
    "for an .obj with a material OUT.mtl; a .glb contains it too.\n"
    "--instances PATCH.ply puts objects on every triangle. PATCH lies on the triangle\n"
    "  (0,0), (1,0), (1/2,sqrt(3)/2), with z upwards. Its points become small spheres of\n"
    "  their color, tilted by nx ny nz or qx qy qz qw; a mesh is put on every triangle as it\n"
    "  is. A .glb holds the surface and instances (EXT_mesh_gpu_instancing); .ply and .obj\n"
    "  hold only the meshes or points.\n"
    "Any set of triangles will do. Vertices in the same place are welded, and on borders those\n"
    "that nearly are; sheets that share an edge are separated, one-sided ones cut, T-junctions\n"
    "stitched; crumbs are dropped where hundreds would take the vertices of the body. One\n"
    "warning line says what was done.\n"
    "'mended' of --stats counts vertices welded and unused, triangles degenerate and duplicate,\n"
    "fins, triangles reversed, vertices split; 'repaired' edges of more than two triangles,\n"
    "triangles left over there, edges cut, vertices close and stitched, pieces dropped.\n"
    "'quality' is twice the radius of the inscribed circle over that of the circumscribed one:\n"
    "1 for an equilateral triangle.\n",
    "  texkit retile bunny.obj -o bunny.glb --vertices 5000 --tiles gravel-triangles\n"
    "  texkit retile cell.ply -o cell.glb --vertices 800 --instances lipids.ply\n",
    1, "mesh", 0, "take fewer vertices", ".glb"};

/* ---- the command line ---------------------------------------------------------------------- */

/* Refuse, before any work, options that do not go together; name and announce the outputs. */
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
    if (j->keep_seams && j->no_seams)
        return cli_fail(run, CLI_USAGE, "choose one of --keep-seams and --no-keep-seams");
    if (j->dot && !j->instances) return cli_fail(run, CLI_USAGE, "--dot goes with --instances");
    if (j->curved && !j->instances)
        return cli_fail(run, CLI_USAGE, "--curved goes with --instances");
    const int has_picture = j->tiles || j->patches || j->texture;
    if (has_picture && j->instances && strcmp(j->extension, ".glb") != 0)
        return cli_fail(run, CLI_USAGE, "--instances with a texture needs an OUT in .glb; it holds "
                        "both");
    if (has_picture && !strcmp(j->extension, ".stl"))
        return cli_fail(run, CLI_USAGE, "an OUT in .stl holds no texture; name one in .obj, .ply or .glb");
    int status = CLI_DONE;
    if (has_picture && !(run->to_stdout && !strcmp(j->extension, ".glb"))) /* which contains it */
        status = path_beside(run, j->texture ? "-texture.png" : "-atlas.png", j->png_path);
    if (!status && has_picture && !strcmp(j->extension, ".obj"))
        status = path_beside(run, ".mtl", j->mtl_path);
    return status;
}

/* ---- reading ------------------------------------------------------------------------------- */

static int read_mesh(retile_job *j, const char *path, int flags, mesh_data *mesh) {
    const char *why;
    if (!mesh_read(path, flags, mesh, &why))
        return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", path, why);
    if (mesh->note[0]) cli_warn(&j->run, "'%s': %s", path, mesh->note);
    return CLI_DONE;
}

/* An STL holds triangles only. */
static void warn_of_stl(retile_job *j) {
    const mesh_data *m = &j->input;
    const char *lost[3];
    int count = 0;
    if (strcmp(j->extension, ".stl") != 0) return;
    if (m->colors || m->face_colors) lost[count++] = "colors";
    if (m->uvs) lost[count++] = "texture coordinates";
    if (m->material_count > 1) lost[count++] = "materials";
    if (count == 0) return;
    cli_warn(&j->run, "'%s' will hold no %s%s%s%s%s; .obj and .glb do", j->run.output, lost[0],
             count > 1 ? " and no " : "", count > 1 ? lost[1] : "", count > 2 ? " and no " : "",
             count > 2 ? lost[2] : "");
}

/* The pixel of a row of so many at a texture coordinate; the row repeats beyond 0..1. */
static int pixel_at(float at, int size) {
    const float u = at < 0 || at > 1 ? at - floorf(at) : at;
    return (int)(txm_clampf(u, 0, 1) * (float)(size - 1) + 0.5f);
}

/* Do texture coordinates leave 0..1 by more than rounding, so that the picture repeats? */
static int leaves_picture(const mesh_data *m) {
    const float slack = 1e-3f;
    for (size_t i = 0; i < 6 * m->triangle_count && m->uvs; i++) {
        if (m->uvs[i] < -slack || m->uvs[i] > 1 + slack) return 1;
    }
    return 0;
}

/* Scales of edge lengths from a picture on the input's texture coordinates: 1 where it is black,
   1/4 where it is white. *scale is for free(). */
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
        const int x = pixel_at(m->uvs[2 * c], map.width), y = pixel_at(m->uvs[2 * c + 1], map.height);
        const unsigned char *row = (const unsigned char *)txm_image_row_const(&map, y);
        (*scale)[m->indices[c]] = txm_float(pow(0.25, row[x] / 255.0));
    }
    image_free(&map);
    return *scale ? CLI_DONE : fail_memory(&j->run);
}

/* ---- writing -------------------------------------------------------------------------------- */

/* All instances as one mesh; spheres become points with a normal and a color. */
static int bake(retile_job *j, mesh_data *baked) {
    static float zero[3] = {0, 0, 0}, up[3] = {0, 0, 1};
    mesh_data points[MAX_PROTOTYPES];
    mesh_instances list[MAX_PROTOTYPES];
    const char *why;
    const int has_points = j->patch.positions != NULL; /* take_mesh leaves none */
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

/* Is there a file of this name in the folder of path? */
static int is_beside(const char *path, const char *name) {
    char other[CLI_MAX_PATH];
    const int folder = (int)(name_in(path) - path);
    if (snprintf(other, sizeof other, "%.*s%s", folder, path, name) >= (int)sizeof other) return 0;
    FILE *file = fopen(other, "rb");
    if (file) fclose(file);
    return file != NULL;
}

/* OBJ names the file of its materials, which stays where it is. */
static void warn_of_library(retile_job *j) {
    const char *library = j->output.library, *in = j->run.inputs[0], *out = j->run.output;
    if (library && !is_beside(out, library) && is_beside(in, library))
        cli_warn(&j->run, "'%s' names '%s', the materials of '%s': copy that file beside it", out,
                 library, in);
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
    scene.place = j->input.place;
    scene.repeats = leaves_picture(&j->output);
    if (j->png) scene.texture = j->png_path[0] ? name_in(j->png_path) : "texture";
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
    if (!status && j->png_path[0]) {
        files[count].name = j->png_path;
        files[count].bytes = j->png;
        files[count++].size = j->png_size;
    }
    cli_figure(run, "file_bytes", (double)files[0].size);
    if (!status) status = cli_finish_files(run, files, count);
    if (!status && !strcmp(j->extension, ".obj") && !scene.library) warn_of_library(j);
    free(bytes);
    free(mtl);
    mesh_free(&baked);
    return status;
}

/* ---- the command ---------------------------------------------------------------------------- */

/* Are the seams kept? By default where a picture lies on them, and where materials meet. */
static int wants_seams(const retile_job *j) {
    const mesh_data *m = &j->input;
    if (j->keep_seams || j->no_seams) return j->keep_seams;
    if (j->tiles || j->patches) return 0;
    return m->material_count > 1 || (m->uvs && (j->texture || m->library));
}

/* The seams of the input, in *seams for free(). */
static int find_seams(retile_job *j, uint32_t **seams) {
    mesh_data *m = &j->input;
    if (!m->uvs && !m->materials) {
        if (!j->keep_seams) return CLI_DONE;
        return cli_fail(&j->run, CLI_FAILED, "--keep-seams: '%s' has no texture coordinates and no "
                        "materials", j->run.inputs[0]);
    }
    *seams = (uint32_t *)new_array(m->triangle_count, 3 * sizeof(uint32_t));
    return *seams && mesh_seams(m, *seams) ? CLI_DONE : fail_memory(&j->run);
}

/* With seams; where they are too many for the vertices and nobody has asked for them, without. */
static int retile_surface(retile_job *j, uint32_t *seams) {
    j->desc.seams = wants_seams(j) ? seams : NULL;
    txm_status result = trimesh_retile(&j->desc, &j->run.env, &j->result);
    if (result == TXM_TOO_SMALL && j->desc.seams && !j->keep_seams) {
        j->desc.seams = NULL;
        result = trimesh_retile(&j->desc, &j->run.env, &j->result);
        if (result == TXM_OK)
            cli_warn(&j->run, "'%s': too few vertices to follow its seams; they are not kept",
                     j->run.inputs[0]);
    }
    return check_result(&j->run, result, j->run.inputs[0]);
}

enum { LARGE_CHANGE = 5 }; /* of the volume, in percent: worth a warning */

static void warn_of_volume(retile_job *j) {
    const double change = 100 * j->result->volume_change;
    if (change < LARGE_CHANGE && change > -LARGE_CHANGE) return;
    if (j->desc.crease_angle >= 180) return; /* edges were to be rounded off */
    cli_warn(&j->run, "the volume has changed by %.1f %%: parts of '%s' are too thin for edges of "
             "this length; more vertices keep more of it", change, j->run.inputs[0]);
}

static int retile(retile_job *j) {
    float *scale = NULL;
    uint32_t *seams = NULL;
    int status = CLI_DONE;
    if (j->density) status = read_density(j, &scale);
    if (!status) status = find_seams(j, &seams);
    if (!status) {
        cli_stage(&j->run, "retile");
        j->desc.surface = mesh_view(&j->input);
        j->desc.scale = scale;
        j->desc.seed = j->run.seed;
        j->desc.report = &j->report;
        status = retile_surface(j, seams);
    }
    free(scale);
    free(seams);
    if (status) return status;
    retile_tell_repairs(j);
    warn_of_volume(j);
    j->output.vertex_count = j->result->vertex_count;
    j->output.triangle_count = j->result->triangle_count;
    j->output.positions = j->result->positions;
    j->output.normals = j->result->normals;
    j->output.indices = j->result->indices;
    return CLI_DONE;
}

static void free_job(retile_job *j) {
    for (int i = 0; i < j->prototype_count; i++) mesh_free(&j->prototypes[i]);
    mesh_free(&j->input);
    mesh_free(&j->patch);
    trimesh_mesh_free(j->result);
    free(j->output.colors);
    free(j->output.uvs);
    free(j->output.face_colors);
    free(j->output.materials);
    free(j->sorted);
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
        {CLI_INT, "--crease", "DEGREES",
         "smallest angle of a crease, 1 to 180; default 50; 180 keeps none", &crease, 1, 180},
        {CLI_INT, "--adapt", "PERCENT", "shorter edges where the surface bends, 0 to 100", &adapt,
         0, 100},
        {CLI_INT, "--spacing", "PERCENT",
         "length of edges along creases and borders, 25 to 400 % of the others", &spacing, 25, 400},
        {CLI_TEXT, "--weld", "EPS",
         "weld vertices closer than this, in units of MESH or % of its size; 0 = none", &j->weld, 0,
         0},
        {CLI_TEXT, "--drop-below", "SHARE",
         "drop loose pieces of less than this part of the area, as 0.1%", &j->drop_below, 0, 0},
        {CLI_INPUT, "--density", "MAP",
         "picture on MESH's texture: shorter edges where it is lighter", &j->density, 0, 0},
        {CLI_TILES, "--tiles", "DIR", "texture: a triangle set of 'texkit tiles'", &j->tiles, 0, 0},
        {CLI_INPUT, "--patches", "PICTURE", "texture: triangles of this picture, chosen at random",
         &j->patches, 0, 0},
        {CLI_INT, "--patch-count", "N", "patches in PICTURE; default 4", &j->patch_count, 1, 256},
        {CLI_INT, "--gutter", "G", "pixels around each patch; default 8, or 0 if that does not fit",
         &j->gutter, 0, 8192},
        {CLI_INPUT, "--texture", "PICTURE", "texture: the one that MESH's coordinates are for",
         &j->texture, 0, 0},
        {CLI_FLAG, "--keep-seams", NULL,
         "edges follow seams between charts and materials, as with --texture",
         &j->keep_seams, 0, 0},
        {CLI_FLAG, "--no-keep-seams", NULL, "they do not", &j->no_seams, 0, 0},
        {CLI_INPUT, "--instances", "PATCH.ply", "points or a small mesh for every triangle",
         &j->instances, 0, 0},
        {CLI_INT, "--dot", "PERCENT", "radius of points, in % of an edge length; default: they touch",
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
    if (!status && j->instances) /* it lies on a triangle between 0 and 1 */
        status = read_mesh(j, j->instances, MESH_POINTS | MESH_UNMOVED, &j->patch);
    if (!status) warn_of_stl(j);
    if (!status) status = retile_repair_options(j);
    if (!status) status = retile(j);
    if (!status) status = retile_dress(j);
    if (!status) {
        cli_stage(&j->run, "measure");
        status = mesh_figures(&j->run, j->result, &j->report, mesh_place_scale(&j->input.place),
                              &quality, &valence_6);
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
