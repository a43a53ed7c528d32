#ifndef TREEPIECES_SPECIES_H
#define TREEPIECES_SPECIES_H

#include "../treepieces.h"

/* ---- species: fields --------------------------------------------------------------------- */

/* One table drives reading, printing and checking. */
typedef enum tpc_kind { TPC_REAL, TPC_WHOLE, TPC_ENVELOPE, TPC_LEAF, TPC_CLOUD, TPC_BARK } tpc_kind;

typedef struct tpc_field {
    const char *key;
    size_t offset;
    tpc_kind kind;
    int count; /* of values */
    float low, high;
} tpc_field;

#define TPC_FIELD(key, kind, count, low, high) \
    { #key, offsetof(treepieces_species, key), kind, count, low, high }
#define TPC_ORDER(key, count, low, high) \
    { #key, offsetof(treepieces_order, key), TPC_REAL, count, low, high }

/* all but the name and the orders, which are read separately */
static const tpc_field tpc_fields[] = {
    TPC_FIELD(order_count, TPC_WHOLE, 1, 1, TREEPIECES_MAX_ORDERS),
    TPC_FIELD(flare, TPC_REAL, 1, 1, 4),
    TPC_FIELD(envelope, TPC_ENVELOPE, 1, 0, TREEPIECES_CYLINDER),
    TPC_FIELD(crown_base, TPC_REAL, 1, 0, 2),
    TPC_FIELD(crown_top, TPC_REAL, 1, 0.01f, 3),
    TPC_FIELD(crown_width, TPC_REAL, 1, 0.01f, 10),
    TPC_FIELD(shade, TPC_REAL, 1, 0, 1e6f),
    TPC_FIELD(phototropism, TPC_REAL, 1, 0, 1),
    TPC_FIELD(clearance, TPC_REAL, 1, 0, 10),
    TPC_FIELD(stiffness, TPC_REAL, 1, 0.01f, 100),
    TPC_FIELD(leaf_shape, TPC_LEAF, 1, 0, TREEPIECES_LEAF_COMPOUND),
    TPC_FIELD(leaf_count, TPC_WHOLE, 1, 0, 256),
    TPC_FIELD(leaf_size, TPC_REAL, 1, 0.01f, 4),
    TPC_FIELD(cloud_kind, TPC_CLOUD, 1, 0, TREEPIECES_CLOUD_STRIPS),
    TPC_FIELD(cloud, TPC_REAL, 1, 0.001f, 20),
    TPC_FIELD(cloud_flat, TPC_REAL, 1, 0.1f, 2),
    TPC_FIELD(bark_kind, TPC_BARK, 1, 0, TREEPIECES_BARK_PLATES),
    TPC_FIELD(leaf_color, TPC_REAL, 3, 0, 1),
    TPC_FIELD(bark_color, TPC_REAL, 3, 0, 1),
};

static const tpc_field tpc_order_fields[] = {
    TPC_ORDER(length, 1, 0.01f, 200),
    TPC_ORDER(length_spread, 1, 0, 1),
    TPC_ORDER(radius, 1, 0.001f, 1),
    TPC_ORDER(taper, 1, 0.02f, 1),
    TPC_ORDER(segments, 1, 1, 64),
    TPC_ORDER(start, 1, 0, 1),
    TPC_ORDER(side, 1, 0, 1),
    TPC_ORDER(pair, 1, 0, 1),
    TPC_ORDER(fork, 1, 0, 1),
    TPC_ORDER(triple, 1, 0, 1),
    TPC_ORDER(fork_angle, 1, 0, 90),
    TPC_ORDER(fork_ratio, 1, 0.1f, 1),
    TPC_ORDER(angle_base, 1, 0, 180),
    TPC_ORDER(angle_top, 1, 0, 180),
    TPC_ORDER(angle_spread, 1, 0, 180),
    TPC_ORDER(profile, 3, 0, 10),
    TPC_ORDER(roll, 1, -360, 360),
    TPC_ORDER(wander, 1, 0, 90),
    TPC_ORDER(tropism, 1, -1, 1),
    TPC_ORDER(sag, 1, -360, 360),
    TPC_ORDER(gravimorphism, 1, -1, 1),
    TPC_ORDER(flatten, 1, 0, 1),
    TPC_ORDER(leaves, 1, 0, 1),
    TPC_ORDER(leaves_start, 1, 0, 1),
};

#undef TPC_FIELD
#undef TPC_ORDER

enum {
    TPC_FIELDS = (int)(sizeof tpc_fields / sizeof tpc_fields[0]),
    TPC_ORDER_FIELDS = (int)(sizeof tpc_order_fields / sizeof tpc_order_fields[0]),
    TPC_NUMBER = 24 /* room for a number as text */
};

/* by treepieces_envelope, treepieces_leaf_shape, treepieces_cloud_kind and treepieces_bark_kind */
static const char *const tpc_envelope_names[] = {"free", "ellipsoid", "cone", "cylinder", NULL};
static const char *const tpc_leaf_names[] = {"oval",   "lobed",   "lance",   "heart",   "needle",
                                             "blossom", "palmate", "compound", NULL};
static const char *const tpc_cloud_names[] = {"round", "layers", "shoots", "strips", NULL};
static const char *const tpc_bark_names[] = {"furrowed", "smooth", "lenticels", "plates", NULL};

/* The names of the values of a field; NULL: they are numbers. */
static const char *const *tpc_names_of(const tpc_field *f) {
    return f->kind == TPC_ENVELOPE ? tpc_envelope_names
           : f->kind == TPC_LEAF   ? tpc_leaf_names
           : f->kind == TPC_CLOUD  ? tpc_cloud_names
           : f->kind == TPC_BARK   ? tpc_bark_names
                                   : NULL;
}

static float tpc_get(const tpc_field *f, const void *base, int i) {
    const char *at = (const char *)base + f->offset;
    float x;
    int n;
    if (f->kind != TPC_REAL) {
        memcpy(&n, at, sizeof n);
        return (float)n;
    }
    memcpy(&x, at + (size_t)i * sizeof x, sizeof x);
    return x;
}

static void tpc_set(const tpc_field *f, void *base, int i, float x) {
    char *at = (char *)base + f->offset;
    const int n = (int)x;
    if (f->kind == TPC_REAL) memcpy(at + (size_t)i * sizeof x, &x, sizeof x);
    else memcpy(at, &n, sizeof n);
}

/* ---- species: numbers as text ------------------------------------------------------------ */

/* x * 10^e, the powers up to 10^22 exact */
static double tpc_scale10(double x, int e) {
    for (; e >= 22; e -= 22) x *= 1e22;
    for (; e <= -22; e += 22) x /= 1e22;
    double power = 1;
    for (int k = e < 0 ? -e : e; k > 0; k--) power *= 10;
    return e < 0 ? x / power : x * power;
}

/* Read digits from *at on into *sum, as many as it holds exactly. Returns how many digits there
   are; *dropped counts those that *sum could not hold. */
static int tpc_read_digits(const char **at, const char *end, double *sum, int *dropped) {
    int count = 0;
    for (; *at < end && **at >= '0' && **at <= '9'; ++*at, count++) {
        if (*sum < 1e14) *sum = *sum * 10 + (**at - '0');
        else ++*dropped;
    }
    return count;
}

/* Read a decimal number, independent of the locale; 0 if the text is not a number. */
static int tpc_read_number(const char *at, const char *end, double *value) {
    const int negative = at < end && *at == '-';
    double sum = 0, exponent = 0;
    int dropped = 0, lost = 0, past = 0;
    if (at < end && (*at == '-' || *at == '+')) at++;
    int digits = tpc_read_digits(&at, end, &sum, &dropped);
    if (at < end && *at == '.') {
        at++;
        const int before = dropped;
        past = tpc_read_digits(&at, end, &sum, &dropped);
        digits += past;
        past -= dropped - before;
        dropped = before;
    }
    if (!digits) return 0;
    if (at < end && (*at == 'e' || *at == 'E')) {
        at++;
        const int down = at < end && *at == '-';
        if (at < end && (*at == '-' || *at == '+')) at++;
        if (!tpc_read_digits(&at, end, &exponent, &lost)) return 0;
        if (exponent > 9999) exponent = 9999;
        if (down) exponent = -exponent;
    }
    if (at != end) return 0;
    const double scaled = sum > 0 ? tpc_scale10(sum, (int)exponent + dropped - past) : 0;
    *value = negative ? -scaled : scaled;
    return 1;
}

/* Write `count` significant digits of x > 0; returns the power of ten of the first. */
static int tpc_write_digits(double x, int count, char *digits) {
    int power = 0;
    while (tpc_scale10(x, -power) >= 10) power++;
    while (tpc_scale10(x, -power) < 1) power--;
    double whole = floor(tpc_scale10(x, count - 1 - power) + 0.5);
    if (whole >= tpc_scale10(1, count)) {
        whole = tpc_scale10(1, count - 1);
        power++;
    }
    uint64_t n = (uint64_t)whole;
    for (int i = count; i-- > 0; n /= 10) digits[i] = (char)('0' + n % 10);
    return power;
}

/* Write x to `count` significant digits: 0.05, 12, 1.5e-7. */
static void tpc_write_rounded(float x, int count, char text[TPC_NUMBER]) {
    char digits[16], *to = text;
    const int power = tpc_write_digits(fabs((double)x), count, digits);
    const int plain = power >= -5 && power < 9;
    int at = plain ? power : 0; /* of the next digit */
    if (x < 0) *to++ = '-';
    if (at < 0) {
        *to++ = '0';
        *to++ = '.';
        for (int i = -1; i > at; i--) *to++ = '0';
    }
    for (int i = 0; i < count || at >= 0; i++, at--) {
        if (at == -1 && i) *to++ = '.';
        *to++ = (char)(i < count ? digits[i] : '0');
    }
    *to = 0;
    if (!plain) snprintf(to, (size_t)(text + TPC_NUMBER - to), "e%d", power);
}

/* Write the shortest text that reads back as x. */
static void tpc_write_number(float x, char text[TPC_NUMBER]) {
    if (!txm_is_finite((double)x) || x == 0) {
        snprintf(text, TPC_NUMBER, "%s", x == 0 ? "0" : x > 0 ? "inf" : x < 0 ? "-inf" : "nan");
        return;
    }
    for (int count = 1; count <= 9; count++) {
        double back = 0;
        tpc_write_rounded(x, count, text);
        tpc_read_number(text, text + strlen(text), &back);
        if (txm_float(back) == x) return;
    }
}

/* ---- species: checking ------------------------------------------------------------------- */

/* Write what the value of a field must be, for a message. */
static void tpc_write_range(const tpc_field *f, char *text, size_t capacity) {
    const char *const *names = tpc_names_of(f);
    char low[TPC_NUMBER], high[TPC_NUMBER];
    if (!names) {
        tpc_write_number(f->low, low);
        tpc_write_number(f->high, high);
        snprintf(text, capacity, "%s must be %s%s to %s", f->key,
                 f->kind == TPC_WHOLE ? "a whole number of " : "", low, high);
        return;
    }
    int n = snprintf(text, capacity, "%s must be one of", f->key);
    for (; *names && n > 0 && (size_t)n < capacity; names++)
        n += snprintf(text + n, capacity - (size_t)n, " %s", *names);
}

/* the first field that is out of its range, or NULL */
static const tpc_field *tpc_find_fault(const tpc_field *fields, int count, const void *base) {
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < fields[i].count; k++) {
            const float x = tpc_get(&fields[i], base, k);
            if (!(x >= fields[i].low && x <= fields[i].high)) return &fields[i];
        }
    }
    return NULL;
}

/* Can this name be written on a line? No control characters, no #, no blanks at its ends. */
static int tpc_is_name(const char name[TREEPIECES_MAX_NAME]) {
    int n = 0;
    while (n < TREEPIECES_MAX_NAME && name[n]) {
        const unsigned char c = (unsigned char)name[n++];
        if (c < ' ' || c == '#' || c == 127) return 0;
    }
    return n < TREEPIECES_MAX_NAME && (!n || (name[0] != ' ' && name[n - 1] != ' '));
}

static txm_status tpc_species_check(const treepieces_species *s, txm_env *env) {
    char line[200], range[120];
    if (!tpc_is_name(s->name))
        return txm_fail(env, TXM_BAD_ARGUMENT,
                        "a species name is too long, begins or ends with a blank, or contains # or a "
                        "control character");
    const char *name = s->name[0] ? s->name : "without a name";
    const tpc_field *fault = tpc_find_fault(tpc_fields, TPC_FIELDS, s);
    if (fault) {
        tpc_write_range(fault, range, sizeof range);
        snprintf(line, sizeof line, "species %s: %s", name, range);
        return txm_fail(env, TXM_BAD_ARGUMENT, line);
    }
    for (int k = 0; k < s->order_count; k++) {
        fault = tpc_find_fault(tpc_order_fields, TPC_ORDER_FIELDS, &s->orders[k]);
        if (!fault) continue;
        tpc_write_range(fault, range, sizeof range);
        snprintf(line, sizeof line, "species %s, order %d: %s", name, k, range);
        return txm_fail(env, TXM_BAD_ARGUMENT, line);
    }
    if (!(s->crown_base < s->crown_top)) {
        snprintf(line, sizeof line, "species %s: crown_top must be above crown_base", name);
        return txm_fail(env, TXM_BAD_ARGUMENT, line);
    }
    return TXM_OK;
}

#endif /* TREEPIECES_SPECIES_H */
