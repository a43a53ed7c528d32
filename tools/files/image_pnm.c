/* image_pnm.c - reads PBM, PGM and PPM, as text and binary, of any maximum
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

#include <assert.h>
#include <ctype.h>

int pnm_is(const unsigned char *bytes, size_t size) {
    return size >= 3 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
           (isspace(bytes[2]) || bytes[2] == '#');
}

typedef struct reader {
    const unsigned char *at, *end;
} reader;

/* White space, and comments from '#' to the end of the line. */
static void skip_space(reader *r) {
    int in_comment = 0;
    for (; r->at < r->end && (in_comment || isspace(*r->at) || *r->at == '#'); r->at++)
        in_comment = *r->at == '#' || (in_comment && *r->at != '\n' && *r->at != '\r');
}

/* The next decimal number; one above most counts as most + 1. 0: there is none. */
static int read_number(reader *r, uint32_t most, uint32_t *value) {
    skip_space(r);
    if (r->at == r->end || !isdigit(*r->at)) return 0;
    for (*value = 0; r->at < r->end && isdigit(*r->at); r->at++)
        if (*value <= most) *value = 10 * *value + (uint32_t)(*r->at - '0');
    if (*value > most) *value = most + 1;
    return 1;
}

/* A number of 1 bit as text needs no space around it. */
static int read_bit(reader *r, uint32_t *value) {
    skip_space(r);
    if (r->at == r->end || (*r->at != '0' && *r->at != '1')) return 0;
    *value = (uint32_t)(*r->at++ - '0');
    return 1;
}

typedef struct pnm {
    reader from;
    int is_bits, is_text; /* P1 and P4; P1 to P3                        */
    uint32_t most;        /* the sample that means white; 1 for bits    */
    size_t row_samples, row_bytes;
} pnm;

static void put(txm_image *image, void *row, size_t i, uint32_t value, uint32_t most) {
    const uint32_t v = value > most ? most : value;
    assert(most > 0);
    if (image->sample == TXM_U8) ((uint8_t *)row)[i] = (uint8_t)((v * 255 + most / 2) / most);
    else ((uint16_t *)row)[i] = (uint16_t)((v * 65535 + most / 2) / most);
}

static int read_text_row(pnm *p, txm_image *image, void *row) {
    for (size_t i = 0; i < p->row_samples; i++) {
        uint32_t value = 0;
        if (!(p->is_bits ? read_bit(&p->from, &value) : read_number(&p->from, p->most, &value)))
            return 0;
        put(image, row, i, p->is_bits ? 1 - value : value, p->most);
    }
    return 1;
}

static void read_binary_row(pnm *p, txm_image *image, void *row) {
    const unsigned char *at = p->from.at;
    for (size_t i = 0; i < p->row_samples; i++) {
        uint32_t value;
        if (p->is_bits) value = 1 - (at[i / 8] >> (7 - i % 8) & 1u);
        else if (p->most > 255) value = (uint32_t)at[2 * i] << 8 | at[2 * i + 1];
        else value = at[i];
        put(image, row, i, value, p->most);
    }
    p->from.at += p->row_bytes;
}

int pnm_read(image_source *s, txm_image *image) {
    pnm p;
    uint32_t width, height;
    const int kind = s->bytes[1] - '1', channels = kind % 3 == 2 ? 3 : 1;
    const uint32_t limit = INT32_MAX - 1;
    p.from.at = s->bytes + 2;
    p.from.end = s->bytes + s->size;
    p.is_bits = kind % 3 == 0;
    p.is_text = kind < 3;
    p.most = 1;
    if (!read_number(&p.from, limit, &width) || !read_number(&p.from, limit, &height) ||
        (!p.is_bits && !read_number(&p.from, 65535, &p.most)))
        return *s->why = image_damaged, 0;
    if (p.most < 1 || p.most > 65535)
        return *s->why = "its maximum is not 1 to 65535", 0;
    if (!image_check_size(s, width, height)) return 0;
    p.row_samples = (size_t)width * (size_t)channels;
    p.row_bytes = p.is_bits ? (p.row_samples + 7) / 8 : p.row_samples * (p.most > 255 ? 2 : 1);
    assert(p.row_samples > 0 && p.row_bytes > 0);
    if (!p.is_text && p.from.at < p.from.end) p.from.at++; /* one white space */
    /* a sample of text takes a byte at least */
    if ((size_t)(p.from.end - p.from.at) / (p.is_text ? p.row_samples : p.row_bytes) < height)
        return *s->why = image_damaged, 0;
    if (!image_begin(s, width, height, channels, p.most > 255 ? TXM_U16 : TXM_U8, image)) return 0;
    for (int y = 0; y < image->height; y++) {
        void *row = txm_image_row(image, y);
        if (!image_continue(s->job, s->why, (size_t)y, height, "read")) return 0;
        if (!p.is_text) read_binary_row(&p, image, row);
        else if (!read_text_row(&p, image, row)) return *s->why = image_damaged, 0;
    }
    return 1;
}
