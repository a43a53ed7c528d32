/* mesh_text.c - words and numbers of text files
   SPDX-License-Identifier: MIT OR Unlicense */
#include "mesh_file.h"

text text_of(const void *bytes, size_t size) {
    static const unsigned char mark[3] = {0xef, 0xbb, 0xbf}; /* that some editors put before UTF-8 */
    text in;
    memset(&in, 0, sizeof in);
    in.at = (const char *)bytes;
    in.end = in.at + size;
    in.line = 1;
    if (size >= sizeof mark && !memcmp(bytes, mark, sizeof mark)) in.at += sizeof mark;
    return in;
}

void text_skip_blanks(text *in) {
    while (in->at < in->end) {
        if (is_blank(*in->at)) {
            in->at++;
        } else if (*in->at == '\\' && in->joins) {
            const char *p = in->at + 1;
            while (p < in->end && is_blank(*p)) p++;
            if (p < in->end && !is_line_end(*p)) return;
            in->at = p;
            text_end_line(in);
        } else {
            return;
        }
    }
}

void text_end_line(text *in) {
    const char *p = in->at;
    if (p == in->end) return;
    in->at += *p == '\r' && in->end - p > 1 && p[1] == '\n' ? 2 : 1;
    in->line++;
}

void text_skip_line(text *in) {
    while (in->at < in->end && !is_line_end(*in->at)) in->at++;
    text_end_line(in);
}

void text_skip_rest(text *in) {
    for (text_skip_blanks(in); in->at < in->end && !is_line_end(*in->at) && *in->at != '#';
         text_skip_blanks(in)) {
        in->at++; /* a backslash that is no word's end, too */
        while (!text_at_word_end(in->at, in->end)) in->at++;
    }
    text_skip_line(in);
}

void text_skip_space(text *in) {
    while (in->at < in->end) {
        if (is_blank(*in->at)) in->at++;
        else if (is_line_end(*in->at)) text_end_line(in);
        else return;
    }
}

int text_at_word_end(const char *p, const char *end) {
    return p == end || is_blank(*p) || is_line_end(*p) || *p == '\\';
}

/* Does this word, in lower case, say that there is no number: nan, -nan(ind), 1.#QNAN00? */
static int is_no_number(const char *word) {
    if (*word == '-' || *word == '+') word++;
    return !strncmp(word, "nan", 3) || (strstr(word, ".#") && !strstr(word, ".#inf"));
}

/* What strtod might take but is no decimal number: infinity and numbers in other bases. */
static int is_decimal(const char *word) {
    if (*word == '-' || *word == '+') word++;
    return is_digit(*word) ? word[1] != 'x' : *word == '.' && is_digit(word[1]);
}

/* For numbers that text_number cannot convert exactly itself, and for words that stand for some. */
static int read_number_slowly(text *in, double *value) {
    char word[512], *stop;
    size_t n = 0, commas = 0, points = 0;
    while (!text_at_word_end(in->at + n, in->end)) {
        char c = in->at[n];
        if (n + 1 == sizeof word) return 0;
        if (c >= 'A' && c <= 'Z') c = (char)(c + 'a' - 'A');
        if (c == 'd' && n && is_digit(in->at[n - (in->at[n - 1] == '.' && n > 1 ? 2 : 1)]))
            c = 'e'; /* 1.5D+00, as Fortran writes */
        points += c == '.';
        commas += c == ',';
        if (c == ',') c = '.';
        word[n++] = c;
    }
    word[n] = 0;
    if (n == 0 || commas > 1 || (commas && points)) return 0;
    if (is_no_number(word)) *value = NAN;
    else if (strstr(word, "inf")) *value = word[0] == '-' ? -INFINITY : INFINITY;
    else if (is_decimal(word)) {
        *value = strtod(word, &stop);
        if (stop != word + n) return 0;
    } else {
        return 0;
    }
    in->at += n;
    in->commas += commas;
    return 1;
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
    if (any && p < in->end && (*p == 'e' || *p == 'E' || *p == 'd' || *p == 'D')) {
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

int text_to_float(double value, float *to) {
    *to = (float)value; /* too large: infinite, as in IEEE 754 */
    return txm_is_finite((double)*to);
}
