/* check_brush.c - what examples/brush painted: check_brush PLAIN.png PAINTED.png SCRIPT LAYERS

   PLAIN is the window without the strokes of SCRIPT, PAINTED with them, LAYERS what the program
   printed about the gray layers. They must differ near the strokes only, and within them PAINTED must
   have the gray of their layers, which PLAIN does not have. */
#include "files/image_io.h"

#include <stdio.h>

enum {
    MAX_POINTS = 256,
    REACH = 4 + 8 + 23, /* pixels outside of a stroke that may change: its roughness, the border
                           of the guide, and the diagonal of the brush's MARGIN */
    INSIDE = 5          /* pixels from the edge that are certainly within, roughness included */
};

typedef struct stroke {
    int layer, is_closed, count;
    double width, x[MAX_POINTS], y[MAX_POINTS];
} stroke;

static int read_stroke(FILE *script, stroke *s) {
    static char line[1 << 14];
    char how[8];
    int used;
    do {
        if (!fgets(line, sizeof line, script)) return 0;
    } while (line[0] == '#');
    if (sscanf(line, "stroke %d %lf %7s%n", &s->layer, &s->width, how, &used) != 3) return 0;
    s->is_closed = how[0] == 'c';
    s->count = 0;
    for (const char *at = line + used; s->count < MAX_POINTS; at += used, s->count++) {
        if (sscanf(at, "%lf %lf%n", &s->x[s->count], &s->y[s->count], &used) != 2) break;
    }
    return s->count > 1;
}

/* How far a pixel is from the edge of what the stroke covers; less than 0 inside. */
static double outside(const stroke *s, double x, double y) {
    double nearest = 1e9;
    int crossings = 0;
    for (int i = 0; i < s->count - !s->is_closed; i++) {
        const int j = (i + 1) % s->count;
        const double ex = s->x[j] - s->x[i], ey = s->y[j] - s->y[i];
        const double dx = x - s->x[i], dy = y - s->y[i];
        const double t = fmin(1, fmax(0, (dx * ex + dy * ey) / (ex * ex + ey * ey)));
        nearest = fmin(nearest, hypot(dx - t * ex, dy - t * ey));
        if ((s->y[i] > y) != (s->y[j] > y)) crossings += dx < dy * ex / ey;
    }
    if (!s->is_closed) return nearest - 0.5 * s->width;
    return crossings % 2 ? -nearest : nearest;
}

static double luma(const txm_image *im, int x, int y) {
    return 255 * (0.2126 * (double)txm_image_get(im, x, y, 0) +
                  0.7152 * (double)txm_image_get(im, x, y, 1) +
                  0.0722 * (double)txm_image_get(im, x, y, 2));
}

int main(int argc, char **argv) {
    txm_image plain, painted;
    const char *why = NULL;
    static uint8_t near[4096 * 4096];
    double low[16], high[16];
    int levels = 0, k, wrong = 0, strokes = 0;
    long far = 0, changed = 0;
    static stroke s;
    FILE *script = argc == 5 ? fopen(argv[3], "r") : NULL;
    FILE *layers = argc == 5 ? fopen(argv[4], "r") : NULL;
    if (!script || !layers || !image_read(argv[1], 3, &plain, &why) ||
        !image_read(argv[2], 3, &painted, &why) || plain.width != painted.width ||
        plain.height != painted.height)
        return fprintf(stderr, "cannot read all: %s\n", why ? why : "another size?"), 2;
    while (levels < 16 &&
           fscanf(layers, "layer %d: gray %lf to %lf\n", &k, &low[levels], &high[levels]) == 3)
        levels++;

    for (; read_stroke(script, &s); strokes++) {
        double before = 0, after = 0;
        long inside = 0;
        for (int y = 0; y < plain.height; y++) {
            for (int x = 0; x < plain.width; x++) {
                const double d = outside(&s, x + 0.5, y + 0.5);
                if (d < REACH) near[y * plain.width + x] = 1;
                if (d > -INSIDE) continue;
                before += luma(&plain, x, y);
                after += luma(&painted, x, y);
                inside++;
            }
        }
        before /= (double)inside;
        after /= (double)inside;
        printf("layer %d, gray %.0f to %.0f: %.1f before, %.1f after\n", s.layer, low[s.layer],
               high[s.layer], before, after);
        if (!(after >= low[s.layer] && after <= high[s.layer])) wrong++;
        if (before >= low[s.layer] && before <= high[s.layer]) wrong++; /* shows nothing */
    }
    for (int y = 0; y < plain.height; y++) {
        for (int x = 0; x < plain.width; x++) {
            int differs = 0;
            for (k = 0; k < 3; k++)
                differs |= txm_image_get(&plain, x, y, k) < txm_image_get(&painted, x, y, k) ||
                           txm_image_get(&plain, x, y, k) > txm_image_get(&painted, x, y, k);
            if (!differs) continue;
            changed++;
            far += !near[y * plain.width + x];
        }
    }
    printf("%d strokes, %ld pixels changed, %ld of them far from all strokes\n", strokes, changed,
           far);
    return strokes == 0 || wrong || far || !changed;
}
