/* mesh_text.c - words and numbers of text files
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

/* To the next word of this line; a backslash at the end of a line joins the next one on. */
void text_skip_blanks(text *in) {
    while (in->at < in->end) {
        if (is_blank(*in->at)) {
            in->at++;
        } else if (*in->at == '\\') {
            const char *p = in->at + 1;
            if (p < in->end && *p == '\r') p++;
            if (p == in->end || *p != '\n') return;
            in->at = p + 1;
            in->line++;
        } else {
            return;
        }
    }
}

/* To the beginning of the next line. */
void text_skip_line(text *in) {
    for (;;) {
        const char *newline = (const char *)memchr(in->at, '\n', (size_t)(in->end - in->at));
        if (!newline) {
            in->at = in->end;
            return;
        }
        const char *last = newline;
        if (last > in->at && last[-1] == '\r') last--;
        const int goes_on = last > in->at && last[-1] == '\\';
        in->at = newline + 1;
        in->line++;
        if (!goes_on) return;
    }
}

/* To the next word, on whichever line. */
void text_skip_space(text *in) {
    while (in->at < in->end && (is_blank(*in->at) || *in->at == '\n')) {
        if (*in->at == '\n') in->line++;
        in->at++;
    }
}

int text_at_word_end(const char *p, const char *end) {
    return p == end || is_blank(*p) || *p == '\n' || *p == '\\';
}

/* For numbers that text_number cannot convert exactly itself. */
static int read_number_slowly(text *in, double *value) {
    char word[512], *stop;
    size_t n = 0;
    while (!text_at_word_end(in->at + n, in->end)) {
        if (n + 1 == sizeof word) return 0;
        word[n] = in->at[n];
        n++;
    }
    word[n] = 0;
    if (n == 0) return 0;
    *value = strtod(word, &stop);
    in->at += n;
    return stop == word + n;
}

/* The number that begins here, correctly rounded to double. A decimal number of up to 15 digits is an
   integer times or over a power of ten that doubles hold exactly: one operation, one rounding. */
int text_number(text *in, double *value) {
    static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                    1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    const char *p = in->at;
    const uint64_t exact = (uint64_t)1 << 53;
    uint64_t digits = 0;
    int exponent = 0, any = 0, negative = 0;
    if (p < in->end && (*p == '-' || *p == '+')) negative = *p++ == '-';
    for (; p < in->end && is_digit(*p) && digits < exact; p++, any = 1)
        digits = 10 * digits + (uint64_t)(*p - '0');
    if (p < in->end && *p == '.') {
        for (p++; p < in->end && is_digit(*p) && digits < exact; p++, any = 1, exponent--)
            digits = 10 * digits + (uint64_t)(*p - '0');
    }
    if (any && p < in->end && (*p == 'e' || *p == 'E')) {
        int e = 0, down = 0;
        p++;
        if (p < in->end && (*p == '-' || *p == '+')) down = *p++ == '-';
        any = 0;
        for (; p < in->end && is_digit(*p) && e < 1000; p++, any = 1) e = 10 * e + (*p - '0');
        exponent += down ? -e : e;
    }
    if (!any || digits >= exact || exponent < -22 || exponent > 22 || !text_at_word_end(p, in->end))
        return read_number_slowly(in, value);
    const double d = (double)digits;
    const double v = exponent < 0 ? d / powers[-exponent] : d * powers[exponent];
    *value = negative ? -v : v;
    in->at = p;
    return 1;
}

/* The same for a number that must be finite as a float. */
int text_to_float(double value, float *to) {
    *to = (float)value; /* too large: infinite, as in IEEE 754 */
    return txm_is_finite((double)*to);
}
