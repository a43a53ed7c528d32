/* image_profile.c - is an embedded ICC profile that of sRGB?
   SPDX-License-Identifier: MIT OR Unlicense

   The primaries and the curve decide. Profiles without them, which hold tables, go by their name. */
#include "image_formats.h"

#include <math.h>

const char image_profile_warning[] =
    "its colour profile is not sRGB; colours are taken as they are, convert it if they look wrong";

enum {
    HEAD = 128,      /* bytes before the table of tags                            */
    TAG = 12,        /* name, offset, size                                        */
    MOST_TAGS = 1000,
    TYPE = 8,        /* bytes of a tag's type and of the four zeros after it      */
    CURVE_STEPS = 16 /* where curves are compared                                 */
};

typedef struct piece { /* what a tag holds */
    const unsigned char *bytes;
    size_t size;
} piece;

static uint32_t number(const unsigned char *p, int bytes) {
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) value = value << 8 | p[i];
    return value;
}

/* s15Fixed16Number */
static double fixed(const unsigned char *p) {
    const uint32_t value = number(p, 4);
    return (value < 0x80000000u ? (double)value : (double)value - 4294967296.0) / 65536;
}

static piece find_tag(const unsigned char *icc, size_t size, const char *name) {
    piece found = {NULL, 0};
    if (size < HEAD + 4) return found;
    const uint32_t count = number(icc + HEAD, 4);
    for (uint32_t i = 0; i < count && i < MOST_TAGS; i++) {
        const size_t at = HEAD + 4 + TAG * (size_t)i;
        if (at + TAG > size) break;
        if (memcmp(icc + at, name, 4) != 0) continue;
        const size_t from = number(icc + at + 4, 4), bytes = number(icc + at + 8, 4);
        if (from > size || bytes > size - from || bytes < TYPE) break;
        found.bytes = icc + from;
        found.size = bytes;
        break;
    }
    return found;
}

static int has_type(piece p, const char *type, size_t bytes) {
    return p.size >= TYPE + bytes && !memcmp(p.bytes, type, 4);
}

/* ---- curves: encoded 0..1 to linear 0..1 ----------------------------------------------------- */

static double srgb(double x) {
    return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

static double parametric(piece p, double x) {
    static const int counts[5] = {1, 3, 4, 5, 7};
    double v[7] = {1, 1, 0, 0, 0, 0, 0}; /* g a b c d e f of the specification */
    const uint32_t kind = number(p.bytes + TYPE, 2);
    if (kind > 4 || !has_type(p, "para", 4 + 4 * (size_t)counts[kind])) return -1;
    for (int i = 0; i < counts[kind]; i++) v[i] = fixed(p.bytes + TYPE + 4 + 4 * i);
    const double base = v[1] * x + v[2], power = base > 0 ? pow(base, v[0]) : 0;
    switch (kind) {
    case 0: return pow(x, v[0]);
    case 1: return base > 0 ? power : 0;
    case 2: return base > 0 ? power + v[3] : v[3];
    case 3: return x >= v[4] ? power : v[3] * x;
    default: return x >= v[4] ? power + v[5] : v[3] * x + v[6];
    }
}

static double table(piece p, double x) {
    const uint32_t count = number(p.bytes + TYPE, 4);
    const unsigned char *values = p.bytes + TYPE + 4;
    if (count == 0) return x;
    if (count > (p.size - TYPE - 4) / 2) return -1;
    if (count == 1) return pow(x, number(values, 2) / 256.0);
    const double at = x * (count - 1);
    const size_t i = (size_t)at < count - 1 ? (size_t)at : count - 2;
    const double a = number(values + 2 * i, 2), b = number(values + 2 * i + 2, 2);
    return (a + (b - a) * (at - (double)i)) / 65535;
}

/* Within what a gamma of 2.2 differs, which PNGs of sRGB are told to name. */
static int is_srgb_curve(piece p) {
    const double tolerance = 0.012;
    const int is_table = has_type(p, "curv", 4), is_formula = has_type(p, "para", 4);
    for (int i = 1; i < CURVE_STEPS && (is_table || is_formula); i++) {
        const double x = i / (double)CURVE_STEPS;
        const double y = is_table ? table(p, x) : parametric(p, x);
        if (!(fabs(y - srgb(x)) <= tolerance)) return 0;
    }
    return is_table || is_formula;
}

/* ---- primaries and names -------------------------------------------------------------------- */

static int is_colour(piece p, const double xyz[3]) {
    const double tolerance = 0.01;
    for (int i = 0; i < 3; i++)
        if (!(fabs(fixed(p.bytes + TYPE + 4 * i) - xyz[i]) <= tolerance)) return 0;
    return 1;
}

/* "sRGB" in the profile's description, in ASCII or UTF-16 */
static int is_named_srgb(piece name) {
    static const unsigned char wide[] = {'s', 0, 'R', 0, 'G', 0, 'B'};
    for (size_t i = TYPE; i + 4 <= name.size; i++) {
        if (!memcmp(name.bytes + i, "sRGB", 4)) return 1;
        if (i + sizeof wide <= name.size && !memcmp(name.bytes + i, wide, sizeof wide)) return 1;
    }
    return 0;
}

int image_profile_is_srgb(const unsigned char *icc, size_t size) {
    /* adapted to D50, as ICC has them */
    static const double primaries[3][3] = {
        {0.4361, 0.2225, 0.0139}, {0.3851, 0.7169, 0.0971}, {0.1431, 0.0606, 0.7141}};
    static const char *const names[3][2] = {{"rXYZ", "rTRC"}, {"gXYZ", "gTRC"}, {"bXYZ", "bTRC"}};
    const piece gray = find_tag(icc, size, "kTRC");
    if (gray.bytes) return is_srgb_curve(gray);
    for (int i = 0; i < 3; i++) {
        const piece colour = find_tag(icc, size, names[i][0]), curve = find_tag(icc, size, names[i][1]);
        if (!has_type(colour, "XYZ ", 12) || !curve.bytes)
            return is_named_srgb(find_tag(icc, size, "desc"));
        if (!is_colour(colour, primaries[i]) || !is_srgb_curve(curve)) return 0;
    }
    return 1;
}

void image_check_profile(const image_source *s, const unsigned char *icc, size_t size) {
    if (!image_profile_is_srgb(icc, size)) image_warn(s, image_profile_warning);
}
