/* image_jpeg.c - JPEG in and out, by libjpeg-turbo
   SPDX-License-Identifier: MIT OR Unlicense */
#include "image_formats.h"

#include <setjmp.h>
#include <stdio.h>
#include <jpeglib.h>
#include <jerror.h>

enum {
    QUALITY = 95,
    MOST_SCANS = 1000,    /* each goes over the whole picture: a small file could take hours */
    EXIF = JPEG_APP0 + 1, /* markers */
    PROFILE = JPEG_APP0 + 2,
    MARKER_BYTES = 0xffff
};

int jpeg_is(const unsigned char *bytes, size_t size) {
    return size >= 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff;
}

/* ---- reading ------------------------------------------------------------------------------ */

typedef struct reading {
    struct jpeg_decompress_struct c;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf home;
    image_source *s;
    txm_image *image;
    unsigned char *row; /* of CMYK */
    int is_whole;       /* all pixels were there                                       */
    int has_ended;      /* before the marker that ends a JPEG                          */
    int is_odd;         /* stray bytes                                                 */
    int is_broken;      /* pixels were lost                                            */
} reading;

static void go_home(j_common_ptr c) {
    reading *r = (reading *)c->client_data;
    longjmp(r->home, 1);
}

/* A warning, or a note for people who debug; they differ by the sign of the level. */
static void listen(j_common_ptr c, int level) {
    reading *r = (reading *)c->client_data;
    if (level >= 0) return;
    switch (c->err->msg_code) {
    case JWRN_JPEG_EOF: r->has_ended = 1; break;
    case JWRN_HIT_MARKER:
    case JWRN_HUFF_BAD_CODE:
    case JWRN_ARITH_BAD_CODE:
    case JWRN_BOGUS_PROGRESSION:
    case JWRN_MUST_RESYNC: r->is_broken = 1; break;
    default: r->is_odd = 1; break;
    }
}

static void stay_silent(j_common_ptr c) {
    (void)c;
}

static void watch(j_common_ptr c) {
    reading *r = (reading *)c->client_data;
    const struct jpeg_progress_mgr *p = &r->progress;
    const size_t parts = 1000, passes = p->total_passes > 0 ? (size_t)p->total_passes : 1;
    size_t done = p->pass_limit > 0 ? parts * (size_t)p->pass_counter / (size_t)p->pass_limit : 0;
    done += parts * (size_t)p->completed_passes;
    if (r->c.input_scan_number > MOST_SCANS) go_home(c);
    if (!image_continue(r->s->job, r->s->why, done, parts * passes, "read")) go_home(c);
}

/* Adobe's programs store the complement of ink. */
static void convert_cmyk(const reading *r, unsigned char *to) {
    const int is_inverted = r->c.saw_Adobe_marker != 0;
    for (size_t x = 0; x < r->c.output_width; x++, to += 3) {
        const unsigned char *p = r->row + 4 * x;
        for (int c = 0; c < 3; c++) {
            const int light = is_inverted ? p[c] : 255 - p[c], rest = is_inverted ? p[3] : 255 - p[3];
            to[c] = (unsigned char)((light * rest + 127) / 255);
        }
    }
}

/* Of a progressive file that breaks off, some scans may be missing; of one of several scans, channels. */
static int lacks_scans(const struct jpeg_decompress_struct *c) {
    for (int i = 0; i < c->num_components; i++) {
        if (!c->comp_info[i].quant_table) return 1;
        for (int k = 0; k < DCTSIZE2 && c->coef_bits; k++)
            if (c->coef_bits[i][k] != 0) return 1;
    }
    return 0;
}

static void look_at_markers(reading *r) {
    JOCTET *icc = NULL;
    unsigned size = 0;
    for (jpeg_saved_marker_ptr m = r->c.marker_list; m; m = m->next) {
        if (m->marker != EXIF || m->data_length < 6 || memcmp(m->data, "Exif\0", 5) != 0) continue;
        const int orientation = image_exif_orientation(m->data, m->data_length);
        if (orientation) r->s->orientation = orientation;
    }
    if (r->c.num_components == 4) {
        image_warn(r->s, "its inks (CMYK) became RGB without a colour profile; convert it if the colours "
                         "look wrong");
    } else if (jpeg_read_icc_profile(&r->c, &icc, &size)) {
        image_check_profile(r->s, icc, size);
        free(icc);
    }
}

static int read_head(reading *r) {
    struct jpeg_decompress_struct *c = &r->c;
    jpeg_mem_src(c, r->s->bytes, (unsigned long)r->s->size);
    jpeg_save_markers(c, EXIF, MARKER_BYTES);
    jpeg_save_markers(c, PROFILE, MARKER_BYTES);
    jpeg_read_header(c, TRUE);
    const int n = c->num_components;
    if (n != 1 && n != 3 && n != 4)
        return *r->s->why = "a JPEG that is neither gray, RGB nor CMYK; convert it to PNG", 0;
    c->out_color_space = n == 1 ? JCS_GRAYSCALE : n == 3 ? JCS_RGB : JCS_CMYK;
    return image_begin(r->s, c->image_width, c->image_height, n == 1 ? 1 : 3, TXM_U8, r->image);
}

static int read_rows(reading *r) {
    struct jpeg_decompress_struct *c = &r->c;
    jpeg_start_decompress(c);
    if (c->output_components == 4) r->row = (unsigned char *)malloc(4 * (size_t)c->output_width);
    if (c->output_components == 4 && !r->row) return *r->s->why = image_no_memory, 0;
    while (c->output_scanline < c->output_height) {
        unsigned char *to = (unsigned char *)txm_image_row(r->image, (int)c->output_scanline);
        JSAMPROW row = r->row ? r->row : to;
        if (jpeg_read_scanlines(c, &row, 1) != 1) return *r->s->why = image_damaged, 0;
        if (r->row) convert_cmyk(r, to);
    }
    /* an arithmetic decoder goes on with zeros */
    if (r->is_broken || (r->has_ended && (c->arith_code || lacks_scans(c))))
        return *r->s->why = image_damaged, 0;
    r->is_whole = 1;
    return 1;
}

/* What follows the pixels cannot spoil them any more. */
static int read_all(reading *r) {
    if (setjmp(r->home)) return r->is_whole;
    jpeg_create_decompress(&r->c);
    r->c.progress = &r->progress;
    if (!read_head(r) || !read_rows(r)) return 0;
    look_at_markers(r); /* which finishing forgets */
    jpeg_finish_decompress(&r->c);
    return 1;
}

int jpeg_read(image_source *s, txm_image *image) {
    reading r;
    memset(&r, 0, sizeof r);
    r.s = s;
    r.image = image;
    r.c.err = jpeg_std_error(&r.errors);
    r.c.client_data = &r;
    r.errors.error_exit = go_home;
    r.errors.emit_message = listen;
    r.errors.output_message = stay_silent;
    r.progress.progress_monitor = watch;
    *s->why = image_damaged; /* unless it is said better */
    const int ok = read_all(&r);
    if (ok && r.has_ended) image_warn(s, "its end is missing; all pixels are there");
    else if (ok && r.is_odd) image_warn(s, "it holds stray bytes, which were skipped");
    jpeg_destroy_decompress(&r.c);
    free(r.row);
    return ok;
}

/* ---- writing ------------------------------------------------------------------------------ */

typedef struct writing {
    struct jpeg_compress_struct c;
    struct jpeg_error_mgr errors;
    struct jpeg_destination_mgr destination;
    jmp_buf home;
    image_target *t;
    unsigned char block[1 << 14]; /* filled, then appended to the output */
} writing;

static void leave(j_common_ptr c) {
    writing *w = (writing *)c->client_data;
    longjmp(w->home, 1);
}

static void open_block(j_compress_ptr c) {
    writing *w = (writing *)c->client_data;
    w->destination.next_output_byte = w->block;
    w->destination.free_in_buffer = sizeof w->block;
}

static boolean flush_block(j_compress_ptr c) {
    writing *w = (writing *)c->client_data;
    image_put(w->t, w->block, sizeof w->block);
    open_block(c);
    return TRUE;
}

static void close_block(j_compress_ptr c) {
    writing *w = (writing *)c->client_data;
    image_put(w->t, w->block, sizeof w->block - w->destination.free_in_buffer);
}

static int write_all(writing *w, const txm_image *image) {
    struct jpeg_compress_struct *c = &w->c;
    if (setjmp(w->home)) return 0;
    jpeg_create_compress(c);
    c->dest = &w->destination;
    c->image_width = (JDIMENSION)image->width;
    c->image_height = (JDIMENSION)image->height;
    c->input_components = image->channels;
    c->in_color_space = image->channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(c);
    jpeg_set_quality(c, QUALITY, TRUE);
    c->optimize_coding = TRUE;
    for (int i = 0; i < c->num_components; i++) /* colour as fine as brightness */
        c->comp_info[i].h_samp_factor = c->comp_info[i].v_samp_factor = 1;
    jpeg_start_compress(c, TRUE);
    while (c->next_scanline < c->image_height) {
        JSAMPROW row = (JSAMPROW)txm_image_row(image, (int)c->next_scanline);
        if (!image_continue(w->t->job, w->t->why, c->next_scanline, c->image_height, "encode")) return 0;
        jpeg_write_scanlines(c, &row, 1);
    }
    jpeg_finish_compress(c);
    return 1;
}

int jpeg_write(image_target *t, const txm_image *image) {
    writing *w = (writing *)calloc(1, sizeof *w);
    *t->why = image_no_memory;
    if (!w) return 0;
    w->t = t;
    w->c.err = jpeg_std_error(&w->errors);
    w->c.client_data = w;
    w->errors.error_exit = leave;
    w->errors.output_message = stay_silent;
    w->destination.init_destination = open_block;
    w->destination.empty_output_buffer = flush_block;
    w->destination.term_destination = close_block;
    const int ok = write_all(w, image);
    jpeg_destroy_compress(&w->c);
    free(w);
    return ok;
}
