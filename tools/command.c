/* command.c - what the commands of texkit share; command.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "files/image_io.h"

#include <cjson/cJSON.h>
#include <ctype.h>
#include <errno.h>
#include <stdio.h>

/* ---- failures ----------------------------------------------------------------------------- */

int fail_memory(cli *run) {
    return cli_fail(run, CLI_FAILED, "out of memory; %s", run->manual->smaller);
}

int check_result(cli *run, txm_status result, const char *what) {
    if (result == TXM_OK) return CLI_DONE;
    if (result == TXM_OUT_OF_MEMORY) return fail_memory(run);
    if (result == TXM_CANCELLED) return cli_fail(run, CLI_FAILED, "stopped; nothing was written");
    return cli_fail(run, CLI_FAILED, "'%s': %s", what, run->env.message);
}

/* ---- memory and pictures ------------------------------------------------------------------ */

void *new_array(size_t count, size_t size) {
    size_t bytes;
    return txm_mul(count, size, 1, &bytes) ? calloc(1, bytes ? bytes : 1) : NULL;
}

int new_picture(cli *run, int width, int height, int channels, txm_sample sample,
                txm_image *image) {
    return image_new(width, height, channels, sample, image) ? CLI_DONE : fail_memory(run);
}

/* Who reads a picture, for its warnings. */
typedef struct picture_reader {
    cli *run;
    const char *path;
} picture_reader;

static void warn_of_picture(void *user, const char *text) {
    const picture_reader *reader = (const picture_reader *)user;
    cli_warn(reader->run, "'%s': %s", reader->path, text);
}

int decode_picture(cli *run, const char *path, const unsigned char *bytes, size_t size, int channels,
                   txm_sample most, txm_image *image) {
    picture_reader reader = {run, path};
    image_job job = {0};
    const char *why;
    job.channels = channels;
    job.deep = most != TXM_U8;
    job.max_side = run->max_side;
    job.env = &run->env;
    job.warn = warn_of_picture;
    job.user = &reader;
    if (image_decode(&job, bytes, size, image, &why)) return CLI_DONE;
    if (job.is_cancelled) return check_result(run, TXM_CANCELLED, path);
    return cli_fail(run, CLI_FAILED, "cannot read '%s': %s", path, why);
}

int read_picture(cli *run, const char *path, int channels, txm_sample most, txm_image *image) {
    size_t size;
    unsigned char *bytes = file_read(path, &size);
    memset(image, 0, sizeof *image);
    if (!bytes) return cli_fail(run, CLI_FAILED, "cannot read '%s': %s", path, strerror(errno));
    const int status = decode_picture(run, path, bytes, size, channels, most, image);
    free(bytes);
    return status;
}

int check_extent(cli *run, const char *what, const char *path, const txm_image *image, int width,
                 int height, const char *like) {
    if (image->width == width && image->height == height) return CLI_DONE;
    return cli_fail(run, CLI_FAILED, "%s '%s' is %d x %d; make it %d x %d like %s", what, path,
                    image->width, image->height, width, height, like);
}

int widen_picture(cli *run, txm_image *image) {
    txm_image wide;
    if (image->sample != TXM_U8) return CLI_DONE;
    const int status =
        new_picture(run, image->width, image->height, image->channels, TXM_U16, &wide);
    const size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    const uint8_t *from = (const uint8_t *)image->pixels;
    for (size_t i = 0; i < count && !status; i++) {
        ((uint16_t *)wide.pixels)[i] = (uint16_t)(from[i] * 257);
    }
    if (status) return status;
    image_free(image);
    *image = wide;
    return CLI_DONE;
}

void warn_of_normals(cli *run, const char *path, const txm_image *image, const char *option) {
    if (txm_image_is_normals(image))
        cli_warn(run, "'%s' looks like a normal map but is treated as colors; if it is one, add %s", path,
                 option);
}

/* How white the lightest pixel of a mask is, in percent. */
static int lightest_of(const txm_image *mask) {
    double most = 0;
    for (int y = 0; y < mask->height; y++) {
        for (int x = 0; x < mask->width; x++) {
            const double v = txm_mask_value(mask, x, y);
            most = v > most ? v : most;
        }
    }
    return (int)(100 * most);
}

/* Say what the user may not have meant with a mask of which so much counts, 0..1. */
static int check_share(cli *run, const mask_role *role, const char *path, const txm_image *mask,
                       double share) {
    enum { MUCH = 90 }; /* percent */
    const int replaces = role->use == TXM_MASK_REPLACES, allows = role->use == TXM_MASK_ALLOWS;
    char text[160];
    if (!replaces && !allows) return CLI_DONE; /* the library tells of a layout without a border */
    if (share <= 0) {
        snprintf(text, sizeof text, "nothing of it counts, for its lightest pixel is %d %% white; what "
                 "is at least half white %s", lightest_of(mask), role->white);
        if (!role->is_optional)
            return cli_fail(run, CLI_FAILED, "%s '%s': %s", role->what, path, text);
        cli_warn(run, "%s '%s': %s", role->what, path, text);
    } else if (share >= 1 && replaces) {
        return cli_fail(run, CLI_FAILED, "%s '%s' covers the whole picture; what is white %s, so leave "
                        "some of it black", role->what, path, role->white);
    } else if (share >= 1) {
        cli_warn(run, "%s '%s' is white everywhere: all %s", role->what, path, role->white);
    } else if ((replaces && share > MUCH / 100.0) ||
               (allows && !role->is_optional && share < 1 - MUCH / 100.0)) {
        cli_warn(run, "%s '%s' is white in %.2g %% of the picture; what is white %s: invert it if that "
                 "is not meant", role->what, path, 100 * share, role->white);
    }
    return CLI_DONE;
}

int read_mask(cli *run, const mask_role *role, const char *path, int width, int height,
              const char *like, txm_image *mask) {
    if (!path) return CLI_DONE;
    int status = read_picture(run, path, 0, TXM_U16, mask);
    if (!status) status = check_extent(run, role->what, path, mask, width, height, like);
    if (status) return status;
    unsigned char *bytes = (unsigned char *)new_array((size_t)width, (size_t)height);
    if (!bytes) return fail_memory(run);
    const double count = (double)txm_mask_read(mask, role->use, bytes);
    free(bytes);
    return check_share(run, role, path, mask, count / width / height);
}

int encode_picture(cli *run, const char *path, const txm_image *image, unsigned char **bytes,
                   size_t *size) {
    image_job job = {0};
    const char *why;
    char extension[8];
    file_extension(path, extension);
    job.env = &run->env;
    if (image_encode(&job, extension, image, bytes, size, &why)) return CLI_DONE;
    if (job.is_cancelled) return check_result(run, TXM_CANCELLED, path);
    return cli_fail(run, CLI_FAILED, "cannot write '%s': %s", path, why);
}

/* ---- values of options -------------------------------------------------------------------- */

/* Refuses what strtod accepts beyond decimal numbers: blanks, 0x1p3, nan, infinity. */
static int read_number(const char *text, char **end, double low, double high, double *value) {
    if (!isdigit((unsigned char)text[text[0] == '-'])) return 0;
    *value = strtod(text, end);
    for (const char *c = text; c < *end; c++) {
        if (*c == 'x' || *c == 'X') return 0;
    }
    return *value >= low && *value <= high;
}

int parse_numbers(cli *run, const char *option, const char *text, int most, double low, double high,
                  double *values) {
    const char *from = text;
    for (int n = 0; n < most; n++) {
        char *end;
        if (!read_number(from, &end, low, high, &values[n])) break;
        if (*end == 0) return n + 1;
        if (*end != ',') break;
        from = end + 1;
    }
    if (most == 1)
        cli_fail(run, CLI_USAGE, "%s '%s': give a number from %g to %g", option, text, low, high);
    else
        cli_fail(run, CLI_USAGE,
                 "%s '%s': give at most %d numbers from %g to %g, separated by commas", option,
                 text, most, low, high);
    return 0;
}

int parse_number(cli *run, const char *option, const char *text, double low, double high,
                 double *value) {
    if (!text || parse_numbers(run, option, text, 1, low, high, value)) return CLI_DONE;
    return CLI_USAGE;
}

int find_name(cli *run, const char *option, const char *name, const char *const *names) {
    char all[80] = "";
    for (int i = 0; names[i]; i++) {
        if (!strcmp(names[i], name)) return i;
        const size_t n = strlen(all);
        snprintf(all + n, sizeof all - n, "%s%s", i ? ", " : "", names[i]);
    }
    cli_fail(run, CLI_USAGE, "%s '%s': choose one of %s", option, name, all);
    return -1;
}

int mark_maps(cli *run, const char *option, const char *list, int low, int high, int mark,
              int *marks) {
    enum { MOST = 16 };
    double numbers[MOST];
    if (!list) return CLI_DONE;
    const int n = parse_numbers(run, option, list, MOST, low, high, numbers);
    if (!n) return CLI_USAGE;
    for (int i = 0; i < n; i++) {
        const int m = (int)numbers[i];
        if ((double)m != numbers[i])
            return cli_fail(run, CLI_USAGE, "%s '%s': give whole numbers, 0 for the picture itself, "
                            "1 for the first of --maps", option, list);
        marks[m] = mark;
    }
    return CLI_DONE;
}

/* ---- outputs ------------------------------------------------------------------------------ */

int check_picture_path(cli *run, const char *path, int width, int height, int channels) {
    const char *why;
    char extension[8];
    file_extension(path, extension);
    if (image_can_write(extension, width, height, channels, &why)) return CLI_DONE;
    return cli_fail(run, CLI_USAGE, "cannot write '%s': %s", path, why);
}

int check_picture_fits(cli *run, const char *path, int width, int height, const txm_image *image) {
    char extension[8];
    file_extension(path, extension);
    const int status = check_picture_path(run, path, width, height, image->channels);
    if (!status && image->sample == TXM_U16 && !image_takes_16_bits(extension))
        cli_warn(run, "'%s' takes 8 of the 16 bits a sample; use .png for all of them", path);
    return status;
}

int finish_with_picture(cli *run, const txm_image *image) {
    unsigned char *bytes;
    size_t size;
    cli_stage(run, "encode");
    int status = encode_picture(run, run->output, image, &bytes, &size);
    if (status) return status;
    cli_figure(run, "file_bytes", (double)size);
    status = cli_finish(run, bytes, size);
    free(bytes);
    return status;
}

static int fail_stream(cli *run, const char *what) {
    return cli_fail(run, CLI_USAGE, "standard output holds one file; name an OUT, for its name is "
                    "needed for that of '%s'", what);
}

int path_beside(cli *run, const char *ending, char path[MAX_PATH]) {
    char extension[8];
    if (run->to_stdout) return fail_stream(run, ending);
    file_extension(run->output, extension);
    const size_t n = strlen(run->output) - strlen(extension);
    if (n + strlen(ending) >= MAX_PATH)
        return cli_fail(run, CLI_USAGE, "'%s': the path is too long", run->output);
    snprintf(path, n + 1, "%s", run->output); /* without its extension */
    snprintf(path + n, MAX_PATH - n, "%s", ending);
    return cli_writes(run, path);
}

static int is_separator(char c) {
    return c == '-' || c == '_' || c == '.' || c == ' ';
}

/* The length of a file's name without its extension; *name begins after the last slash. */
static size_t stem_of(const char *path, const char **name) {
    const char *slash = strrchr(path, '/'), *dot;
    *name = slash ? slash + 1 : path;
    dot = strrchr(*name, '.');
    return dot && dot > *name ? (size_t)(dot - *name) : strlen(*name);
}

/* What distinguishes a map's name from its exemplar's: "normal" for bricks_normal.png beside
   bricks.png or bricks_albedo.png. The whole stem if that leaves nothing. */
static size_t own_name(const char *path, const char *exemplar, const char **name) {
    const char *other;
    const size_t n = stem_of(path, name), m = stem_of(exemplar, &other);
    size_t same = 0, cut = 0;
    while (same < n && same < m && (*name)[same] == other[same]) {
        same++;
        if (is_separator(other[same - 1])) cut = same;
    }
    if (same == m && same < n && is_separator((*name)[same])) cut = same + 1;
    if (cut >= n) cut = 0;
    *name += cut;
    return n - cut;
}

int path_of_map(cli *run, const char *map, const char *picture, const char *ending,
                char path[MAX_PATH]) {
    char extension[8];
    if (run->to_stdout && (map || *ending)) return fail_stream(run, map ? map : ending);
    file_extension(run->output, extension);
    const size_t n = strlen(run->output) - strlen(extension);
    const char *name = "";
    size_t length = 0;
    if (map) length = own_name(map, picture, &name);
    const int size = snprintf(path, MAX_PATH, "%.*s%s%.*s%s%s", (int)n, run->output, map ? "-" : "",
                              (int)length, name, ending, run->output + n);
    if (size < MAX_PATH) return CLI_DONE;
    return cli_fail(run, CLI_USAGE, "'%s': the path is too long", run->output);
}

const char *name_in(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* ---- JSON --------------------------------------------------------------------------------- */

int read_tiles_json(cli *run, const char *folder, cJSON **json) {
    char path[MAX_PATH];
    size_t size;
    if (snprintf(path, sizeof path, "%s/tiles.json", folder) >= (int)sizeof path)
        return cli_fail(run, CLI_USAGE, "'%s': the path is too long", folder);
    unsigned char *bytes = file_read(path, &size);
    if (!bytes)
        return cli_fail(run, CLI_FAILED, "cannot read '%s': %s; name a folder of 'texkit tiles'",
                        path, strerror(errno));
    *json = cJSON_ParseWithLength((const char *)bytes, size);
    free(bytes);
    return *json ? CLI_DONE : cli_fail(run, CLI_FAILED, "'%s': not a JSON file", path);
}

int json_int(const cJSON *from, const char *name, int low, int high, int *value) {
    const cJSON *item = name ? cJSON_GetObjectItemCaseSensitive(from, name) : from;
    if (!cJSON_IsNumber(item) || !(item->valuedouble >= low && item->valuedouble <= high)) return 0;
    *value = (int)item->valuedouble;
    return (double)*value == item->valuedouble;
}
