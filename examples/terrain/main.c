/* terrain - three photographs in, mountains covered with texture that never repeats out
   SPDX-License-Identifier: MIT OR Unlicense

   terrain MEADOW ROCK SNOW OUT [SIZE]

   With photographs of the demo:
       make demo && build/examples/terrain out/lawn.png out/rock.png out/snow.png terrain

   A height field of SIZE x SIZE is generated (2048, or 64 to 4096); heights and slopes say where
   meadow, rock and snow lie. Of the photographs 256 x 256 pixels each are learned, side by side, as
   one composite texture of texsyn.h, with a label each; it then covers the field. Writes OUT-map.png,
   the texture seen from above, and OUT.png, the mountains in perspective.

   ground.c     heights, and what lies where
   view.c       light, and the picture in perspective                                            */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"

#include "terrain.h"

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>

enum { PHOTO = 256 };  /* pixels a side */
enum { QUALITY = -1 };/* of the texture, -2 to 2 */

/* Photograph number k goes into the example, whose left part is full; its pixels get label k. */
static void add_photo(const char *name, int k, unsigned char *example, unsigned char *label) {
    int width, height;
    unsigned char *photo = stbi_load(name, &width, &height, NULL, 3);
    need(photo != NULL, "cannot read a photograph");
    need(width >= PHOTO && height >= PHOTO, "a photograph is under 256 x 256");
    for (int y = 0; y < PHOTO; y++) {
        const int to = (y * LABELS + k) * PHOTO;
        memcpy(example + 3 * to, photo + (ptrdiff_t)3 * y * width, (size_t)3 * PHOTO);
        memset(label + to, k, PHOTO);
    }
    stbi_image_free(photo);
}

/* Learn the composite and cover the field with it. */
static void cover(char **names, const terrain *t, txm_env *env) {
    static unsigned char example[3 * LABELS * PHOTO * PHOTO], label[LABELS * PHOTO * PHOTO];
    const txm_image out = {t->texels, t->size, t->size, 3, TXM_U8, 0};
    const texsyn_composite_learn_desc learn = {
        .example = {example, LABELS * PHOTO, PHOTO, 3, TXM_U8, 0},
        .labels = {label, LABELS * PHOTO, PHOTO, 1, TXM_U8, 0}};
    texsyn_composite_desc desc = {.width = t->size,
                                  .height = t->size,
                                  .quality = QUALITY,
                                  .layout = {t->label, t->size, t->size, 1, TXM_U8, 0}};
    texsyn_composite *composite;
    for (int k = 0; k < LABELS; k++) add_photo(names[k], k, example, label);
    need(texsyn_composite_learn(&learn, env, &composite) == TXM_OK, env->message);
    desc.composite = composite;
    need(texsyn_composite_synthesize(&desc, env, out) == TXM_OK, env->message);
    texsyn_composite_free(composite);
}

#ifdef _OPENMP
static void on_all_cores(void *user, int count, void (*body)(void *, int), void *context) {
    (void)user;
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < count; i++) body(context, i);
}
#endif

int main(int argc, char **argv) {
    const int size = argc == 6 ? atoi(argv[5]) : 2048;
    if (argc < 5 || argc > 6 || size < 64 || size > 4096) {
        fprintf(stderr, "usage: terrain MEADOW ROCK SNOW OUT [SIZE]\n");
        return 2;
    }
    const size_t area = (size_t)size * (size_t)size;
    static unsigned char picture[WIDTH * HEIGHT * 3];
    terrain t = {size, malloc(area * sizeof(float)), malloc(area), malloc(3 * area),
                       malloc(3 * area * sizeof(float))};
    txm_env env = {0};
    char path[1024];
    need(t.height && t.label && t.texels && t.lit, "no memory");
#ifdef _OPENMP
    env.parallel_for = on_all_cores;
#endif
    make_ground(&t);
    cover(argv + 1, &t, &env);
    snprintf(path, sizeof path, "%s-map.png", argv[4]);
    need(stbi_write_png(path, size, size, 3, t.texels, 0), "cannot write the map");
    snprintf(path, sizeof path, "%s.png", argv[4]);
    render(&t, picture);
    need(stbi_write_png(path, WIDTH, HEIGHT, 3, picture, 0), "cannot write the picture");
    free(t.height);
    free(t.label);
    free(t.texels);
    free(t.lit);
    return 0;
}
