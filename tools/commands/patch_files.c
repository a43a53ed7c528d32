/* patch_files.c - the pictures of 'texkit patch', in and out
   SPDX-License-Identifier: MIT OR Unlicense */
#include "patch.h"
#include "files/image_io.h"

#include <stdio.h>

/* ---- the outputs' names ------------------------------------------------------------------- */

/* OUT-normal-2.png: level 2 of a map. */
static int name_output(patch_job *j, int map, int level, char path[MAX_PATH]) {
    char number[16] = "";
    if (level) snprintf(number, sizeof number, "-%d", level);
    return path_of_map(&j->run, map ? j->map_names[0].at[map - 1] : NULL, j->run.inputs[0], number,
                       path);
}

int patch_name_outputs(patch_job *j) {
    const int levels = 1 + j->lod, count = j->desc.map_count * levels;
    int status = CLI_DONE;
    file_extension(j->run.output, j->extension);
    j->paths = (char(*)[MAX_PATH])calloc((size_t)count + 1, MAX_PATH);
    if (!j->paths) return fail_memory(&j->run);
    for (int i = 0; i < count && !status; i++) {
        status = name_output(j, i / levels, i % levels, j->paths[i]);
        if (!status && i > 0) status = cli_writes(&j->run, j->paths[i]); /* the first is -o */
    }
    j->path_count = count;
    if (!status && j->sources) {
        if (strlen(j->sources) >= MAX_PATH)
            return cli_fail(&j->run, CLI_USAGE, "'%s': the path is too long", j->sources);
        memcpy(j->paths[j->path_count++], j->sources, strlen(j->sources) + 1);
    }
    if (!status)
        status = check_picture_path(&j->run, j->run.output, j->desc.width, j->desc.height, 0);
    return status;
}

/* ---- reading ------------------------------------------------------------------------------- */

/* Read a picture with so many channels of that sample type. */
static int read_as(patch_job *j, const char *path, int channels, txm_sample sample,
                   txm_image *image) {
    const int status = read_picture(&j->run, path, channels, sample, image);
    return !status && image->sample != sample ? widen_picture(&j->run, image) : status;
}

/* Normals that are treated as colors get colors of their own where they are turned or averaged. */
static void warn_of_map(patch_job *j, int map, const char *name, const txm_image *image) {
    const texpatch_map *kind = &j->maps[map];
    char option[24];
    if (kind->is_normal || kind->is_label || kind->is_data) return;
    snprintf(option, sizeof option, "--normal %d", map);
    warn_of_normals(&j->run, name, image, option);
}

/* Exemplar e and its maps; all exemplars have the channels and the depths of the first. */
static int read_exemplar(patch_job *j, int e) {
    texpatch_exemplar *x = &j->exemplars[e];
    const char *path = j->exemplar_names.at[e];
    int status = CLI_DONE;
    j->run.max_side = TEXPATCH_MAX_SIDE;
    x->maps = j->pictures[e];
    for (int m = 0; m < j->desc.map_count && !status; m++) {
        const txm_image *first = &j->pictures[0][m];
        txm_image *image = &j->pictures[e][m];
        const char *name = m ? j->map_names[e].at[m - 1] : path;
        if (e) status = read_as(j, name, first->channels, first->sample, image);
        else status = read_picture(&j->run, name, 0, TXM_U16, image);
        if (!status && !e) warn_of_map(j, m, name, image);
        if (!status && m)
            status = check_extent(&j->run, "the map", name, image, x->maps[0].width, x->maps[0].height,
                                  path);
    }
    j->run.max_side = 0;
    return status;
}

/* A list of masks or guides, one for each exemplar. */
static int read_for_exemplars(patch_job *j, const char *option, const char *list, int are_masks) {
    static const mask_role role = {"the mask", "is used", TXM_MASK_ALLOWS, 0};
    names n = {0};
    int status = patch_split(j, option, list, TEXPATCH_MAX_EXEMPLARS, &n);
    if (!status && n.count != j->desc.exemplar_count)
        status = cli_fail(&j->run, CLI_USAGE, "%s '%s': give %d, one for each exemplar", option,
                          list, j->desc.exemplar_count);
    for (int e = 0; e < n.count && !status; e++) {
        texpatch_exemplar *x = &j->exemplars[e];
        const int w = x->maps[0].width, h = x->maps[0].height;
        const char *like = j->exemplar_names.at[e];
        if (are_masks) {
            status = read_mask(&j->run, &role, n.at[e], w, h, like, &x->mask);
            continue;
        }
        status = read_as(j, n.at[e], j->exemplars[0].guide.channels, TXM_U8, &x->guide);
        if (!status) status = check_extent(&j->run, "the guide", n.at[e], &x->guide, w, h, like);
    }
    free(n.storage);
    return status;
}

static int read_sized(patch_job *j, const char *what, const char *path, int channels,
                      txm_sample sample, txm_image *image) {
    const int status = read_as(j, path, channels, sample, image);
    if (status) return status;
    return check_extent(&j->run, what, path, image, j->desc.width, j->desc.height, "--size");
}

static int read_kept(patch_job *j) {
    static const mask_role role = {"the mask", "is kept", TXM_MASK_ALLOWS, 1};
    names n = {0};
    texpatch_desc *d = &j->desc;
    int status = patch_split(j, "--keep", j->kept_list, TEXPATCH_MAX_MAPS, &n);
    if (!status && n.count != d->map_count)
        status = cli_fail(&j->run, CLI_USAGE, "--keep '%s': give %d, one for each map",
                          j->kept_list, d->map_count);
    for (int m = 0; m < n.count && !status; m++)
        status = read_sized(j, "the picture", n.at[m], j->pictures[0][m].channels,
                            j->pictures[0][m].sample, &j->kept[m]);
    free(n.storage);
    if (!status)
        status = read_mask(&j->run, &role, j->keep, d->width, d->height, "--size", &d->keep);
    d->kept = j->kept;
    return status;
}

/* Even the light of exemplar e; the maps of color follow, each by its own light. */
static int even_exemplar(patch_job *j, int e) {
    int used = 0, status = CLI_DONE;
    const txm_image *mask = j->exemplars[e].mask.pixels ? &j->exemplars[e].mask : NULL;
    for (int m = 0; m < j->desc.map_count && !status; m++) {
        const texpatch_map *kind = &j->maps[m];
        txm_image *image = &j->pictures[e][m];
        const char *path = m ? j->map_names[e].at[m - 1] : j->exemplar_names.at[e];
        if (kind->is_normal || kind->is_label || kind->is_data) continue;
        if (m && (image->channels < 3 || txm_image_is_normals(image))) continue;
        int own;
        status = even_picture(&j->run, path, m ? used : j->even, mask, image, &own);
        if (m == 0) used = own;
    }
    if (e == 0) cli_figure(&j->run, "even", used);
    return status;
}

/* Every exemplar with its maps, mask and guide, from straight in front. */
static int straighten_all(patch_job *j) {
    static const texpatch_map label = {0, 0, 1, 0}, data = {0, 0, 0, 1};
    int status = CLI_DONE;
    for (int e = 0; e < j->desc.exemplar_count && !status; e++) {
        texpatch_exemplar *x = &j->exemplars[e];
        straight_picture pictures[TEXPATCH_MAX_MAPS + 2];
        const txm_image mask = x->mask;
        double agreement;
        int count = 0;
        for (; count < j->desc.map_count; count++) {
            pictures[count].image = &j->pictures[e][count];
            pictures[count].map = &j->maps[count];
        }
        if (x->mask.pixels) {
            pictures[count].image = &x->mask;
            pictures[count++].map = &label;
        }
        if (x->guide.pixels) {
            pictures[count].image = &x->guide;
            pictures[count++].map = &data;
        }
        status = straighten(&j->run, j->exemplar_names.at[e], pictures, count, &mask, 0, 0,
                            &agreement);
    }
    return status;
}

int patch_read_all(patch_job *j) {
    static const mask_role target = {"the mask", "follows the target", TXM_MASK_ALLOWS, 1};
    texpatch_desc *d = &j->desc;
    int status = CLI_DONE;
    for (int e = 0; e < d->exemplar_count && !status; e++) status = read_exemplar(j, e);
    for (int m = 0; m < d->map_count && !status; m++) {
        const txm_image *image = &j->pictures[0][m];
        const char *path = j->paths[m * (1 + j->lod)];
        status = check_picture_fits(&j->run, path, d->width, d->height, image);
    }
    if (!status && j->masks) status = read_for_exemplars(j, "--mask", j->masks, 1);
    if (!status && j->guides) status = read_for_exemplars(j, "--guide", j->guides, 0);
    if (!status && j->straighten) status = straighten_all(j);
    if (!status && j->target)
        status = read_sized(j, "the target", j->target, j->exemplars[0].guide.channels, TXM_U8,
                            &d->guide);
    if (!status)
        status = read_mask(&j->run, &target, j->target_mask, d->width, d->height, "--size",
                           &d->guide_mask);
    if (!status && j->keep) status = read_kept(j);
    for (int e = 0; e < d->exemplar_count && !status; e++) status = even_exemplar(j, e);
    return status;
}

/* ---- where pixels come from ---------------------------------------------------------------- */

/* In the output q is one step to the right of p, or below it: is it so in the exemplar too? */
static int goes_on(const texpatch_source *p, const texpatch_source *q, int is_down) {
    /* a step to the right, turned back by so many quarter turns; y points down */
    static const int turned[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
    if (p->exemplar < 0 || p->exemplar != q->exemplar || p->turn != q->turn) return 0;
    const int *step = turned[(p->turn + is_down) & 3];
    const float dx = q->x - p->x - (float)(p->turn >= 4 ? -step[0] : step[0]);
    const float dy = q->y - p->y - (float)step[1];
    return dx > -0.25f && dx < 0.25f && dy > -0.25f && dy < 0.25f;
}

double patch_continuous(const patch_job *j) {
    const size_t w = (size_t)j->desc.width, h = (size_t)j->desc.height;
    double pairs = 0, good = 0;
    for (size_t y = 0; y < h; y++) {
        for (size_t x = 0; x < w; x++) {
            const texpatch_source *p = &j->from[y * w + x];
            if (x + 1 < w) good += goes_on(p, p + 1, 0);
            if (y + 1 < h) good += goes_on(p, p + w, 1);
            pairs += (x + 1 < w) + (y + 1 < h);
        }
    }
    return pairs > 0 ? good / pairs : 1;
}

/* A PFM: floats with the low byte first, rows from bottom to top. */
static unsigned char *encode_sources(const patch_job *j, size_t *size) {
    const size_t w = (size_t)j->desc.width, h = (size_t)j->desc.height;
    char head[48];
    size_t bytes;
    const int n = snprintf(head, sizeof head, "PF\n%zu %zu\n-1.0\n", w, h);
    if (!txm_mul(w, h, 12, &bytes) || !txm_add(bytes, (size_t)n, size)) return NULL;
    unsigned char *file = (unsigned char *)malloc(*size), *to = file;
    if (!file) return NULL;
    memcpy(to, head, (size_t)n);
    to += n;
    for (size_t y = h; y-- > 0;) {
        for (size_t x = 0; x < w; x++) {
            const texpatch_source *p = &j->from[y * w + x];
            const float values[3] = {p->x, p->y,
                                     p->exemplar < 0 ? -1 : (float)(8 * p->exemplar + p->turn)};
            for (int k = 0; k < 3; k++) {
                uint32_t bits;
                memcpy(&bits, &values[k], sizeof bits);
                for (int b = 0; b < 4; b++) *to++ = (unsigned char)(bits >> (8 * b) & 255);
            }
        }
    }
    return file;
}

/* ---- writing ------------------------------------------------------------------------------- */

static int encode(patch_job *j, const txm_image *image, int index, cli_file *file,
                  unsigned char **bytes) {
    file->name = j->paths[index];
    const int status = encode_picture(&j->run, file->name, image, bytes, &file->size);
    file->bytes = *bytes;
    return status;
}

/* Encode level image of a cutout: its alpha scaled to the coverage of the picture. */
static int encode_cutout(patch_job *j, const txm_image *image, double coverage, int index,
                         cli_file *file, unsigned char **bytes) {
    txm_image level;
    int status = new_picture(&j->run, image->width, image->height, image->channels, image->sample,
                             &level);
    if (status) return status;
    memcpy(level.pixels, image->pixels,
           (size_t)image->width * (size_t)image->height * (size_t)image->channels *
               txm_sample_bytes(image->sample));
    status = check_result(&j->run, txm_image_set_coverage(&level, coverage, 0.5f, &j->run.env),
                          j->run.inputs[0]);
    if (!status) status = encode(j, &level, index, file, bytes);
    free(level.pixels);
    return status;
}

/* Encode a map and its coarser levels; each level is released once the next one is made. */
static int encode_levels(patch_job *j, int map, cli_file *files, unsigned char **bytes) {
    const int first = map * (1 + j->lod);
    const texpatch_map *kind = &j->maps[map];
    const int is_color = !kind->is_normal && !kind->is_label && !kind->is_data;
    txm_image *image = &j->out[map];
    const int is_cutout = j->cutout && is_color && txm_image_has_alpha(image);
    const double coverage = is_cutout ? txm_image_coverage(image, 0.5f) : 1;
    int status = encode(j, image, first, &files[first], &bytes[first]);
    for (int level = 1; level <= j->lod && !status; level++) {
        const int i = first + level;
        txm_image half;
        status = new_picture(&j->run, txm_level_side(image->width, 1),
                             txm_level_side(image->height, 1), image->channels, image->sample, &half);
        if (!status)
            status = check_result(
                &j->run, texpatch_half(image, kind, j->desc.tileable, &j->run.env, &half),
                j->run.inputs[0]);
        free(image->pixels);
        *image = half;
        if (!status && is_cutout)
            status = encode_cutout(j, image, coverage, i, &files[i], &bytes[i]);
        else if (!status) status = encode(j, image, i, &files[i], &bytes[i]);
    }
    return status;
}

int patch_write_outputs(patch_job *j) {
    const size_t count = (size_t)j->path_count;
    cli_file *files = (cli_file *)calloc(count, sizeof *files);
    unsigned char **bytes = (unsigned char **)calloc(count, sizeof *bytes);
    double sum = 0;
    int status = files && bytes ? CLI_DONE : fail_memory(&j->run);
    cli_stage(&j->run, "encode");
    for (int m = 0; m < j->desc.map_count && !status; m++)
        status = encode_levels(j, m, files, bytes);
    if (!status && j->sources) {
        cli_file *last = &files[count - 1];
        last->name = j->sources;
        last->bytes = bytes[count - 1] = encode_sources(j, &last->size);
        if (!last->bytes) status = fail_memory(&j->run);
    }
    for (size_t i = 0; i < count && !status; i++) sum += (double)files[i].size;
    cli_figure(&j->run, "files", (double)count);
    cli_figure(&j->run, "file_bytes", sum);
    if (!status) status = cli_finish_files(&j->run, files, (int)count);
    for (size_t i = 0; i < count && bytes; i++) free(bytes[i]);
    free(bytes);
    free(files);
    return status;
}
