/* inpaint_files.c - the files of 'texkit inpaint', in and out
   SPDX-License-Identifier: MIT OR Unlicense */
#define _XOPEN_SOURCE 700 /* POSIX: opendir */
#include "inpaint.h"

#include <dirent.h>
#include <stdio.h>

/* ---- the outputs' names ----------------------------------------------------------------------- */

int inpaint_name_outputs(inpaint_job *j) {
    int status = CLI_DONE;
    j->paths = (char(*)[MAX_PATH])new_array(TEXINPAINT_MAX_MAPS, MAX_PATH);
    if (!j->paths) return fail_memory(&j->run);
    for (int m = 0; m <= j->desc.map_count && !status; m++) {
        status = path_of_map(&j->run, m ? j->names[m - 1] : NULL, j->picture, "", j->paths[m]);
        if (!status && m) status = cli_writes(&j->run, j->paths[m]); /* the first is -o */
    }
    return status ? status : check_picture_path(&j->run, j->run.output, 0, 0, 0);
}

/* ---- reading --------------------------------------------------------------------------------- */

static int read_mesh(inpaint_job *j) {
    texinpaint_desc *d = &j->desc;
    const char *why;
    if (!mesh_read(j->mesh_path, 0, &j->mesh, &why))
        return cli_fail(&j->run, CLI_FAILED, "cannot read '%s': %s", j->mesh_path, why);
    if (j->mesh.note[0]) cli_warn(&j->run, "'%s': %s", j->mesh_path, j->mesh.note);
    if (!j->mesh.uvs)
        return cli_fail(&j->run, CLI_FAILED, "'%s' has no texture coordinates", j->mesh_path);
    const size_t corners = 3 * j->mesh.triangle_count;
    j->corners = (uint32_t *)new_array(corners, sizeof *j->corners);
    if (!j->corners) return fail_memory(&j->run);
    for (size_t c = 0; c < corners; c++) j->corners[c] = (uint32_t)c;
    d->mesh = mesh_view(&j->mesh);
    d->uv = j->mesh.uvs;
    d->uv_count = corners;
    d->uv_indices = j->corners;
    return CLI_DONE;
}

/* A map of the picture's size. */
static int read_map(inpaint_job *j, int map, txm_image *image) {
    const char *path = j->names[map];
    char option[24];
    const txm_image *first = &j->desc.image;
    const int status = read_picture(&j->run, path, 0, TXM_U16, image);
    if (status) return status;
    snprintf(option, sizeof option, "--normal %d", map + 1);
    if (!j->maps[map].is_normal && !j->maps[map].is_label)
        warn_of_normals(&j->run, path, image, option);
    return check_extent(&j->run, "the map", path, image, first->width, first->height, j->picture);
}

int inpaint_read_all(inpaint_job *j) {
    static const mask_role hole = {"the mask", "is replaced", TXM_MASK_REPLACES, 1};
    static const mask_role apart = {"the mask", "is not spread", TXM_MASK_REPLACES, 1};
    static const mask_role source = {"the source mask", "is copied from", TXM_MASK_ALLOWS, 0};
    texinpaint_desc *d = &j->desc;
    int status = read_picture(&j->run, j->picture, 0, TXM_U16, &d->image);
    const int w = d->image.width, h = d->image.height;
    if (!status)
        status = read_mask(&j->run, j->dilate ? &apart : &hole, j->mask, w, h, j->picture, &d->mask);
    if (!status) status = read_mask(&j->run, &source, j->source, w, h, j->picture, &d->source);
    for (int m = 0; m < d->map_count && !status; m++)
        status = read_map(j, m, &j->maps[m].image);
    for (int m = 0; m <= d->map_count && !status; m++) {
        const txm_image *in = m ? &j->maps[m - 1].image : &d->image;
        status = check_picture_fits(&j->run, j->paths[m], in->width, in->height, in);
        if (!status)
            status = new_picture(&j->run, in->width, in->height, in->channels, in->sample, &j->out[m]);
    }
    if (!status && j->mesh_path) status = read_mesh(j);
    return status;
}

/* ---- the pictures of --debug ------------------------------------------------------------------ */

void inpaint_show(void *user, const char *name, const txm_image *picture) {
    inpaint_job *j = (inpaint_job *)user;
    const size_t n = j->shown_count;
    const char *why;
    if (j->show_status) return;
    if ((n & (n - 1)) == 0) { /* room for 1, 2, 4, 8, ... */
        inpaint_shown *grown = (inpaint_shown *)realloc(j->shown, (n ? 2 * n : 1) * sizeof *grown);
        if (!grown) {
            j->show_status = fail_memory(&j->run);
            return;
        }
        j->shown = grown;
    }
    if (snprintf(j->shown[n].path, MAX_PATH, "%s/%02lu-%s.png", j->debug, (unsigned long)n + 1,
                 name) >= MAX_PATH)
        j->show_status = cli_fail(&j->run, CLI_USAGE, "'%s': the path is too long", j->debug);
    else if (!image_encode(NULL, ".png", picture, &j->shown[n].bytes, &j->shown[n].size, &why))
        j->show_status = cli_fail(&j->run, CLI_FAILED, "cannot write '%s': %s", j->shown[n].path, why);
    else j->shown_count++;
}

/* ---- writing --------------------------------------------------------------------------------- */

/* The pictures of --debug that are there may be written over: announce them. */
int inpaint_announce_shown(inpaint_job *j) {
    char path[MAX_PATH];
    int status = cli_checks_folder(&j->run, j->debug);
    DIR *folder = status ? NULL : opendir(j->debug);
    for (const struct dirent *e; folder && !status && (e = readdir(folder));) {
        const size_t digits = strspn(e->d_name, "0123456789");
        if (digits < 2 || e->d_name[digits] != '-') continue;
        if (snprintf(path, sizeof path, "%s/%s", j->debug, e->d_name) < MAX_PATH)
            status = cli_writes(&j->run, path);
    }
    if (folder) closedir(folder);
    return status;
}

/* Announce the pictures of --debug, whose names were not known before. */
static int add_shown(inpaint_job *j, cli_file *files, int *is_new) {
    int status = cli_makes_folder(&j->run, j->debug, is_new);
    for (size_t i = 0; i < j->shown_count && !status; i++) {
        files[i].name = j->shown[i].path;
        files[i].bytes = j->shown[i].bytes;
        files[i].size = j->shown[i].size;
        if (!cli_is_output(j->shown[i].path)) status = cli_writes(&j->run, j->shown[i].path);
    }
    return status;
}

int inpaint_write_outputs(inpaint_job *j) {
    const size_t maps = 1 + (size_t)j->desc.map_count, count = maps + j->shown_count;
    cli_file *files = (cli_file *)new_array(count, sizeof *files);
    unsigned char *bytes[TEXINPAINT_MAX_MAPS] = {NULL};
    double sum = 0;
    int is_new = 0, status = files ? CLI_DONE : fail_memory(&j->run);
    cli_stage(&j->run, "encode");
    for (size_t m = 0; m < maps && !status; m++) {
        files[m].name = m ? j->paths[m] : j->run.output;
        status = encode_picture(&j->run, files[m].name, &j->out[m], &bytes[m], &files[m].size);
        files[m].bytes = bytes[m];
        sum += (double)files[m].size;
    }
    cli_figure(&j->run, "file_bytes", sum);
    if (!status && j->debug) status = add_shown(j, files + maps, &is_new);
    if (!status) status = cli_finish_files(&j->run, files, (int)count);
    if (status && is_new) cli_removes_folder(j->debug);
    for (size_t m = 0; m < maps; m++) free(bytes[m]);
    free(files);
    return status;
}
