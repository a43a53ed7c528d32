/* label_picture.c - label maps as pictures; label_picture.h tells which colour is which label
   SPDX-License-Identifier: MIT OR Unlicense */
#include "label_picture.h"
#include "files/image_io.h"

static int is_gray(uint32_t colour) {
    return colour % 256 * 0x10101 == colour;
}

/* The colour of a pixel; 0 in *visible if it is transparent. */
static uint32_t colour_at(const txm_image *im, const uint8_t *p, int *visible) {
    *visible = im->channels != 4 || p[3] >= 128;
    if (im->channels == 1) return p[0] * 0x10101u;
    return (uint32_t)p[0] << 16 | (uint32_t)p[1] << 8 | p[2];
}

static int find_colour(const label_colours *c, uint32_t colour) {
    for (int i = 0; i < c->count; i++)
        if (c->colour[i] == colour) return i;
    return -1;
}

/* Put a new colour in its place; 0 if there are too many already. */
static int add_colour(label_colours *c, uint32_t colour) {
    int i = c->count;
    if (c->count == MOST_LABELS) return 0;
    for (; i > 0 && c->colour[i - 1] > colour; i--) c->colour[i] = c->colour[i - 1];
    c->colour[i] = colour;
    c->count++;
    return 1;
}

void plain_labels(int count, label_colours *colours) {
    colours->count = count;
    for (int i = 0; i < count; i++) colours->colour[i] = (uint32_t)i * 0x10101u;
}

/* The colours of a picture, sorted. */
static int collect_colours(cli *run, const char *path, const txm_image *im, label_colours *c) {
    const int channels = im->channels;
    for (int y = 0; y < im->height; y++) {
        const uint8_t *p = (const uint8_t *)txm_image_row_const(im, y);
        for (int x = 0; x < im->width; x++, p += channels) {
            int visible;
            const uint32_t colour = colour_at(im, p, &visible);
            if (!visible || find_colour(c, colour) >= 0 || add_colour(c, colour)) continue;
            return cli_fail(run, CLI_FAILED,
                            "'%s': more than 16 colours; a picture of labels has one colour for "
                            "each label, without smooth edges: not JPEG but PNG", path);
        }
    }
    if (c->count == 0)
        return cli_fail(run, CLI_FAILED, "'%s': transparent everywhere; paint the labels", path);
    const uint32_t last = c->colour[c->count - 1];
    int all_gray = 1;
    for (int i = 0; i < c->count; i++) all_gray &= is_gray(c->colour[i]);
    if (all_gray && last % 256 < MOST_LABELS) plain_labels((int)(last % 256) + 1, c);
    return CLI_DONE;
}

int read_labels(cli *run, const char *path, label_colours *colours, txm_image *labels) {
    txm_image picture = {0};
    int status = read_picture(run, path, 0, TXM_U8, &picture);
    if (status) return status;
    picture = txm_image_resolve(picture);
    if (!colours->count) status = collect_colours(run, path, &picture, colours);
    if (!status) status = new_picture(run, picture.width, picture.height, 1, TXM_U8, labels);
    for (int y = 0; y < picture.height && !status; y++) {
        const uint8_t *p = (const uint8_t *)txm_image_row_const(&picture, y);
        uint8_t *to = (uint8_t *)labels->pixels + (size_t)y * (size_t)picture.width;
        for (int x = 0; x < picture.width && !status; x++, p += picture.channels) {
            int visible;
            const uint32_t colour = colour_at(&picture, p, &visible);
            const int label = visible ? find_colour(colours, colour) : (int)NO_LABEL;
            if (label < 0)
                status = cli_fail(run, CLI_FAILED,
                                  "'%s': the colour #%06lx at (%d, %d) is no label; use the colours "
                                  "of the labels, without smooth edges", path,
                                  (unsigned long)colour, x, y);
            to[x] = (uint8_t)label;
        }
    }
    image_free(&picture);
    return status;
}

int draw_labels(cli *run, const txm_image *labels, const label_colours *colours,
                txm_image *picture) {
    int channels = 1;
    for (int i = 0; i < colours->count; i++)
        if (!is_gray(colours->colour[i])) channels = 3;
    const int status = new_picture(run, labels->width, labels->height, channels, TXM_U8, picture);
    for (int y = 0; y < labels->height && !status; y++) {
        const uint8_t *from = (const uint8_t *)labels->pixels + (size_t)y * (size_t)labels->width;
        uint8_t *p = (uint8_t *)picture->pixels +
                     (size_t)y * (size_t)labels->width * (size_t)channels;
        for (int x = 0; x < labels->width; x++)
            for (int k = 0; k < channels; k++)
                *p++ = (uint8_t)(colours->colour[from[x]] >> 8 * (2 - k));
    }
    return status;
}
