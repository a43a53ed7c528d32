#ifndef TREEPIECES_TEXT_H
#define TREEPIECES_TEXT_H

#include "species.h"
#include "presets.h"

/* ---- species: reading -------------------------------------------------------------------- */

typedef struct tpc_reader {
    const char *at, *end; /* rest of the line          */
    int line, order;      /* order -1: none begun      */
    int keys, crown_line; /* keys so far; line of the last crown_ key */
    const char *like;     /* NULL, or the text to read after this line */
    treepieces_species species;
    txm_env *env;
} tpc_reader;

typedef struct tpc_word {
    const char *at, *end;
} tpc_word;

static int tpc_is_blank(char c) {
    return c == ' ' || c == '\t';
}

static int tpc_is_word(const tpc_word *w, const char *text) {
    const size_t n = strlen(text);
    return (size_t)(w->end - w->at) == n && !memcmp(w->at, text, n);
}

/* Read the next word of the line; 0 if there is none. */
static int tpc_next_word(tpc_reader *r, tpc_word *w) {
    while (r->at < r->end && tpc_is_blank(*r->at)) r->at++;
    w->at = r->at;
    while (r->at < r->end && !tpc_is_blank(*r->at)) r->at++;
    w->end = r->at;
    return w->at < w->end;
}

enum { TPC_SHOWN = 28 /* of a word in a message, with its 0 */ };

/* Copy a word, which may contain anything or be NULL, for a message; returns its length there. */
static size_t tpc_show_word(const tpc_word *w, char shown[TPC_SHOWN]) {
    size_t n = 0;
    for (const char *p = w ? w->at : NULL; p && p < w->end; p++) {
        if (n + 4 >= TPC_SHOWN) {
            memcpy(shown + n, "...", 3);
            n += 3;
            break;
        }
        shown[n++] = (char)(*p > ' ' && *p < 127 ? *p : '?');
    }
    shown[n] = 0;
    return n;
}

/* Fail with "line 7: WORD: fault"; the word may be NULL. */
static txm_status tpc_fail_line(const tpc_reader *r, const tpc_word *w, const char *fault) {
    char line[220], shown[TPC_SHOWN];
    const size_t n = tpc_show_word(w, shown);
    snprintf(line, sizeof line, "line %d: %s%s%s", r->line, shown, n ? ": " : "", fault);
    return txm_fail(r->env, TXM_BAD_DATA, line);
}

/* Read value i of a field; the key is for messages. */
static txm_status tpc_read_value(tpc_reader *r, const tpc_word *key, const tpc_field *f, void *base,
                                 int i) {
    char range[120];
    tpc_word w;
    double x = -1;
    const char *const *names = tpc_names_of(f);
    if (!tpc_next_word(r, &w)) return tpc_fail_line(r, key, "a value is missing");
    for (int k = 0; names && names[k]; k++)
        if (tpc_is_word(&w, names[k])) x = k;
    if (!names && !tpc_read_number(w.at, w.end, &x)) return tpc_fail_line(r, &w, "is not a number");
    const float value = x > -1e9 && x < 1e9 ? txm_float(x) : x < 0 ? -1e9f : 1e9f;
    if (!(value >= f->low && value <= f->high) ||
        (f->kind != TPC_REAL && value != (float)(int)value)) {
        tpc_write_range(f, range, sizeof range);
        return tpc_fail_line(r, &w, range);
    }
    tpc_set(f, base, i, value == 0 ? 0 : value); /* no -0 */
    return TXM_OK;
}

static txm_status tpc_read_name(tpc_reader *r, const tpc_word *key) {
    char *name = r->species.name;
    while (r->at < r->end && tpc_is_blank(*r->at)) r->at++;
    while (r->at < r->end && tpc_is_blank(r->end[-1])) r->end--;
    const size_t size = (size_t)(r->end - r->at);
    if (!size) return tpc_fail_line(r, key, "a value is missing");
    if (size >= TREEPIECES_MAX_NAME)
        return tpc_fail_line(r, key, "longer than 31 characters");
    memset(name, 0, TREEPIECES_MAX_NAME);
    memcpy(name, r->at, size);
    if (strlen(name) != size || !tpc_is_name(name))
        return tpc_fail_line(r, key, "contains a control character");
    r->at = r->end;
    return TXM_OK;
}

/* "order N" begins an order; order_count becomes at least N + 1. */
static txm_status tpc_begin_order(tpc_reader *r, const tpc_word *key) {
    static const tpc_field field = {"order", 0, TPC_WHOLE, 1, 0, TREEPIECES_MAX_ORDERS - 1};
    const txm_status status = tpc_read_value(r, key, &field, &r->order, 0);
    if (status != TXM_OK) return status;
    if (r->species.order_count <= r->order) r->species.order_count = r->order + 1;
    return TXM_OK;
}

/* "like NAME": its text is read after this line. Orders that it does not have keep their defaults. */
static txm_status tpc_begin_like(tpc_reader *r, const tpc_word *key) {
    tpc_word w;
    if (!tpc_next_word(r, &w)) return tpc_fail_line(r, key, "a value is missing");
    if (r->keys) return tpc_fail_line(r, key, "must come before all other keys");
    for (int i = 0; i < treepieces_preset_count(); i++) {
        if (!tpc_is_word(&w, tpc_presets[i].name)) continue;
        r->like = tpc_presets[i].text;
        return TXM_OK;
    }
    return tpc_fail_line(r, &w, "is not a built-in species");
}

/* How many letters must be inserted, removed or replaced to get from one word to the other. */
static int tpc_distance(const char *a, const char *b) {
    const int m = (int)strlen(a), n = (int)strlen(b);
    int row[TPC_SHOWN]; /* row[j]: from the letters of a so far to the first j of b */
    TXM_ASSERT(n < TPC_SHOWN);
    for (int j = 0; j <= n; j++) row[j] = j;
    for (int i = 1; i <= m; i++) {
        int diagonal = row[0];
        row[0] = i;
        for (int j = 1; j <= n; j++) {
            const int replaced = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
            if (replaced < row[j]) row[j] = replaced;
        }
    }
    return row[n];
}

/* Fail with "line 7: unknown key 'flair'", and the key that it was perhaps meant to be. */
static txm_status tpc_fail_key(const tpc_reader *r, const tpc_word *key) {
    static const char *const others[] = {"like", "order", "name"};
    char line[120], shown[TPC_SHOWN];
    const char *nearest = NULL;
    const int size = (int)tpc_show_word(key, shown);
    int least = size < 8 ? (size + 1) / 2 : 4; /* from this on it is another word */
    for (int i = 0; i < TPC_FIELDS + TPC_ORDER_FIELDS + 3; i++) {
        const int k = i - TPC_FIELDS, o = k - TPC_ORDER_FIELDS;
        const char *name = k < 0 ? tpc_fields[i].key : o < 0 ? tpc_order_fields[k].key : others[o];
        const int distance = tpc_distance(shown, name);
        if (distance < least) {
            least = distance;
            nearest = name;
        }
    }
    snprintf(line, sizeof line, "line %d: unknown key '%s'%s%s%s", r->line, shown,
             nearest ? "; did you mean '" : "", nearest ? nearest : "", nearest ? "'?" : "");
    return txm_fail(r->env, TXM_BAD_DATA, line);
}

static txm_status tpc_read_key(tpc_reader *r, const tpc_word *key) {
    if (tpc_is_word(key, "like")) return tpc_begin_like(r, key);
    if (tpc_is_word(key, "order")) return tpc_begin_order(r, key);
    if (tpc_is_word(key, "name")) return tpc_read_name(r, key);
    const tpc_field *field = NULL;
    void *base = &r->species;
    for (int i = 0; i < TPC_FIELDS; i++)
        if (tpc_is_word(key, tpc_fields[i].key)) field = &tpc_fields[i];
    for (int i = 0; i < TPC_ORDER_FIELDS && !field; i++) {
        if (!tpc_is_word(key, tpc_order_fields[i].key)) continue;
        if (r->order < 0) return tpc_fail_line(r, key, "needs a line \"order N\" before it");
        field = &tpc_order_fields[i];
        base = &r->species.orders[r->order];
    }
    if (!field) return tpc_fail_key(r, key);
    if (!strncmp(field->key, "crown_", 6)) r->crown_line = r->line;
    for (int i = 0; i < field->count; i++) {
        const txm_status status = tpc_read_value(r, key, field, base, i);
        if (status != TXM_OK) return status;
    }
    return TXM_OK;
}

/* Read the line from r->at on: a key and its values, a comment, or nothing. */
static txm_status tpc_read_line(tpc_reader *r) {
    tpc_word key, rest;
    const char *comment = (const char *)memchr(r->at, '#', (size_t)(r->end - r->at));
    if (comment) r->end = comment;
    if (!tpc_next_word(r, &key)) return TXM_OK;
    const txm_status status = tpc_read_key(r, &key);
    if (status != TXM_OK) return status;
    if (tpc_next_word(r, &rest)) return tpc_fail_line(r, &key, "has too many values");
    r->keys++;
    return TXM_OK;
}

/* The end of the line that begins here: at \n, \r\n or \r, or at the end of the text. */
static const char *tpc_line_end(const char *at, const char *end) {
    while (at < end && *at != '\n' && *at != '\r') at++;
    return at;
}

/* Read a text whose missing keys keep the values of *species. */
static txm_status tpc_read_text(const char *text, size_t size, txm_env *env,
                                treepieces_species *species) {
    const char *at = text, *end = text + size;
    tpc_reader r;
    memset(&r, 0, sizeof r);
    r.order = -1;
    r.species = *species;
    r.env = env;
    while (at < end) {
        const char *line_end = tpc_line_end(at, end);
        r.at = at;
        r.end = line_end;
        r.line++;
        r.like = NULL;
        txm_status status = tpc_read_line(&r);
        if (status == TXM_OK && r.like)
            status = tpc_read_text(r.like, strlen(r.like), env, &r.species);
        if (status != TXM_OK) return status;
        at = line_end + (end - line_end > 1 && line_end[0] == '\r' && line_end[1] == '\n');
        if (at < end) at++;
    }
    if (!(r.species.crown_base < r.species.crown_top)) {
        r.line = r.crown_line;
        return tpc_fail_line(&r, NULL, "crown_top must be above crown_base");
    }
    *species = r.species;
    return TXM_OK;
}

/* Step over a byte order mark, which editors on Windows put before UTF-8. Other encodings of Unicode
   begin with marks of their own. */
static txm_status tpc_skip_mark(const char **text, size_t *size, txm_env *env) {
    const char *t = *text;
    if (*size >= 2 && (!memcmp(t, "\xff\xfe", 2) || !memcmp(t, "\xfe\xff", 2)))
        return txm_fail(env, TXM_BAD_DATA, "line 1: the text is UTF-16; save it as UTF-8");
    if (*size >= 3 && !memcmp(t, "\xef\xbb\xbf", 3)) {
        *text += 3;
        *size -= 3;
    }
    return TXM_OK;
}

TREEPIECES_API txm_status treepieces_species_parse(const char *text, size_t size, txm_env *env,
                                                   treepieces_species *species) {
    treepieces_species fresh;
    if (!species || (!text && size))
        return txm_fail(env, TXM_BAD_ARGUMENT, "text or species is NULL");
    memset(&fresh, 0, sizeof fresh);
    fresh.crown_top = 1; /* above crown_base until it is read */
    txm_status status = tpc_read_text(tpc_fresh, strlen(tpc_fresh), env, &fresh);
    for (int k = 1; k < TREEPIECES_MAX_ORDERS; k++)
        if (k >= fresh.order_count) fresh.orders[k] = fresh.orders[k - 1];
    if (status == TXM_OK) status = tpc_skip_mark(&text, &size, env);
    if (status == TXM_OK && size) status = tpc_read_text(text, size, env, &fresh);
    if (status != TXM_OK) return status;
    for (int k = fresh.order_count; k < TREEPIECES_MAX_ORDERS; k++)
        memset(&fresh.orders[k], 0, sizeof fresh.orders[k]);
    *species = fresh;
    return TXM_OK;
}

/* ---- species: printing ------------------------------------------------------------------- */

typedef struct tpc_writer {
    char *text;
    size_t capacity, length;
} tpc_writer;

static void tpc_write(tpc_writer *w, const char *text) {
    for (; *text; text++, w->length++)
        if (w->length + 1 < w->capacity) w->text[w->length] = *text;
}

static void tpc_write_fields(tpc_writer *w, const tpc_field *fields, int count, const void *base) {
    char number[TPC_NUMBER];
    for (int i = 0; i < count; i++) {
        const tpc_field *f = &fields[i];
        const char *const *names = tpc_names_of(f);
        tpc_write(w, f->key);
        for (int k = 0; k < f->count; k++) {
            const float x = tpc_get(f, base, k);
            tpc_write(w, " ");
            if (!names || !(x >= f->low && x <= f->high)) tpc_write_number(x, number);
            tpc_write(w, names && x >= f->low && x <= f->high ? names[(int)x] : number);
        }
        tpc_write(w, "\n");
    }
}

TREEPIECES_API size_t treepieces_species_print(const treepieces_species *species, char *text,
                                               size_t capacity) {
    tpc_writer w;
    char name[TREEPIECES_MAX_NAME + 1], order[32];
    if (!species) return 0;
    w.text = text;
    w.capacity = text ? capacity : 0;
    w.length = 0;
    memcpy(name, species->name, TREEPIECES_MAX_NAME);
    name[TREEPIECES_MAX_NAME] = 0;
    if (name[0]) {
        tpc_write(&w, "name ");
        tpc_write(&w, name);
        tpc_write(&w, "\n");
    }
    tpc_write_fields(&w, tpc_fields, TPC_FIELDS, species);
    for (int k = 0; k < species->order_count && k < TREEPIECES_MAX_ORDERS; k++) {
        snprintf(order, sizeof order, "\norder %d\n", k);
        tpc_write(&w, order);
        tpc_write_fields(&w, tpc_order_fields, TPC_ORDER_FIELDS, &species->orders[k]);
    }
    if (w.capacity) w.text[w.length < w.capacity ? w.length : w.capacity - 1] = 0;
    return w.length;
}

TREEPIECES_API txm_status treepieces_preset(const char *name, txm_env *env,
                                            treepieces_species *species) {
    char line[240];
    if (!name || !species) return txm_fail(env, TXM_BAD_ARGUMENT, "name or species is NULL");
    for (int i = 0; i < treepieces_preset_count(); i++) {
        if (strcmp(name, tpc_presets[i].name) != 0) continue;
        const char *text = tpc_presets[i].text;
        return treepieces_species_parse(text, strlen(text), env, species);
    }
    int n = snprintf(line, sizeof line, "no species \"%.24s\"; there are", name);
    for (int i = 0; i < treepieces_preset_count() && n > 0 && (size_t)n < sizeof line; i++)
        n += snprintf(line + n, sizeof line - (size_t)n, "%s %s", i ? "," : "",
                      tpc_presets[i].name);
    return txm_fail(env, TXM_BAD_ARGUMENT, line);
}

#endif /* TREEPIECES_TEXT_H */
