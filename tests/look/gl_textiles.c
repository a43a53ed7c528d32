/* gl_textiles.c - shaders/textiles.glsl shows what textiles_draw_plane draws
   SPDX-License-Identifier: MIT OR Unlicense

   cc -I. tests/look/gl_textiles.c -o gl_textiles -lEGL -lOpenGL -lm && ./gl_textiles shaders/textiles.glsl

   Runs the shader without a window, on whatever driver EGL finds (Mesa's llvmpipe on machines without
   a graphics card), and prints "ok - what" or "not ok - what" for each test.

   Lookups: sets of smooth random pictures, each kind and packing, at views that meet texels exactly,
   between them, turned and enlarged; compared pixel by pixel with textiles_draw_plane. Translucent
   pictures are uploaded with colour multiplied by alpha, as textiles_draw_plane weights it.

   Levels: pictures whose mip-map levels show their number; it must be that of the view.

   Mip-maps: sets of pictures of few plain colours that agree along joints. Where all of the plane that
   a filter may see has one colour, the picture must show that colour; any other one was taken from a
   foreign tile. Without a gutter the test must find some, or it could not tell.                 */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"

#define GL_GLEXT_PROTOTYPES
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { VIEW = 128 }; /* pixels a side of what is rendered */

static int failures;

static void report(int good, const char *what, const char *figures) {
    printf("%s - %s%s%s\n", good ? "ok" : "not ok", what, figures[0] ? ": " : "", figures);
    failures += !good;
}

static void *need(void *p, const char *what) {
    if (p) return p;
    printf("not ok - %s\n", what);
    exit(1);
}

static void need_status(txm_status status, const txm_env *env, const char *what) {
    if (status == TXM_OK) return;
    printf("not ok - %s: %s\n", what, env->message);
    exit(1);
}

/* ---- OpenGL --------------------------------------------------------------------------- */

static int make_current(EGLDisplay display, EGLenum api, int major, int minor) {
    const EGLint profile[] = {EGL_CONTEXT_MAJOR_VERSION, major, EGL_CONTEXT_MINOR_VERSION, minor,
                              EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                              EGL_NONE};
    const EGLint embedded[] = {EGL_CONTEXT_MAJOR_VERSION, major, EGL_CONTEXT_MINOR_VERSION, minor,
                               EGL_NONE};
    if (!eglBindAPI(api)) return 0;
    EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT,
                                          api == EGL_OPENGL_API ? profile : embedded);
    return context != EGL_NO_CONTEXT &&
           eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context);
}

static EGLDisplay open_display(void) {
    typedef EGLDisplay (*get_display)(EGLenum, void *, const EGLint *);
    /* a cast between a function's and another function's type */
    get_display get = (get_display)eglGetProcAddress("eglGetPlatformDisplayEXT");
    EGLDisplay display = EGL_NO_DISPLAY;
    if (get) display = get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL);
    if (display == EGL_NO_DISPLAY || !eglInitialize(display, NULL, NULL)) return EGL_NO_DISPLAY;
    return display;
}

static char *read_text(const char *path) {
    FILE *file = need(fopen(path, "rb"), path);
    char *text = need(calloc(1, 1 << 18), "memory");
    const size_t size = fread(text, 1, (1 << 18) - 1, file);
    fclose(file);
    return need(size ? text : NULL, path);
}

static GLuint compile(GLenum type, const char *version, const char *middle, const char *body) {
    const char *parts[3] = {version, middle, body};
    char log[2000] = "";
    GLint good = 0;
    const GLuint shader = glCreateShader(type);
    glShaderSource(shader, 3, parts, NULL);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    glGetShaderInfoLog(shader, sizeof log, NULL, log);
    if (log[0]) fprintf(stderr, "%s\n", log);
    return good ? shader : 0;
}

static const char vertex_body[] =
    "void main() {\n"
    "    gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1);\n"
    "}\n";

static const char fragment_body[] =
    "uniform textiles_plane tiles;\n"
    "uniform sampler2D atlas;\n"
    "uniform sampler2DArray slices;\n"
    "uniform isampler2D table;\n"
    "uniform vec2 first, across, down;\n"
    "out vec4 color;\n"
    "void main() {\n"
    "    vec2 at = first + gl_FragCoord.x * across + gl_FragCoord.y * down;\n"
    "    bool apart = tiles.packing == TEXTILES_SLICES;\n"
    "    if (tiles.kind == TEXTILES_TRIANGLE && apart)\n"
    "        color = textiles_triangle(slices, table, tiles, at);\n"
    "    else if (tiles.kind == TEXTILES_TRIANGLE)\n"
    "        color = textiles_triangle(atlas, table, tiles, at);\n"
    "    else if (apart)\n"
    "        color = textiles_square(slices, tiles, at);\n"
    "    else\n"
    "        color = textiles_square(atlas, tiles, at);\n"
    "}\n";

static GLuint link_program(const char *version, const char *library) {
    GLint good = 0;
    const GLuint vertex = compile(GL_VERTEX_SHADER, version, "", vertex_body);
    const GLuint fragment = compile(GL_FRAGMENT_SHADER, version, library, fragment_body);
    if (!vertex || !fragment) return 0;
    const GLuint program = glCreateProgram();
    glAttachShader(program, vertex);
    glAttachShader(program, fragment);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &good);
    return good ? program : 0;
}

/* ---- sets ----------------------------------------------------------------------------- */

typedef struct kind_of {
    const char *name;
    textiles_kind kind;
    int colors, variants, reduced, count;
} kind_of;

static const kind_of kinds[] = {
    {"wang, 2 colors", TEXTILES_WANG, 2, 1, 0, 16},
    {"wang, 3 colors", TEXTILES_WANG, 3, 1, 0, 81},
    {"wang, 2 colors, 3 variants", TEXTILES_WANG, 2, 3, 0, 48},
    {"wang, 2 colors, 2 variants", TEXTILES_WANG, 2, 2, 0, 32},
    {"corner, 2 colors", TEXTILES_CORNER, 2, 1, 0, 16},
    {"corner, 2 colors, 5 variants", TEXTILES_CORNER, 2, 5, 0, 80},
    {"corner, 3 colors", TEXTILES_CORNER, 3, 1, 0, 81},
    {"triangle, 2 colors", TEXTILES_TRIANGLE, 2, 1, 0, 24},
    {"triangle, 2 colors, 2 variants", TEXTILES_TRIANGLE, 2, 2, 0, 48},
    {"triangle, 2 colors, 5 variants, reduced", TEXTILES_TRIANGLE, 2, 5, 1, 80},
};
enum { KINDS = sizeof kinds / sizeof kinds[0] };

typedef void painter(const kind_of *k, const textiles_tile *tile, int index, int size, int x, int y,
                     uint8_t rgba[4]);

/* Smooth pictures, a different one for each tile; alpha varies like the colours. */
static void paint_glass(const kind_of *k, const textiles_tile *tile, int index, int size, int x, int y,
                        uint8_t rgba[4]) {
    (void)k;
    (void)tile;
    (void)size;
    for (int c = 0; c < 4; c++) {
        const uint64_t h = txm_hash((uint64_t)index * 4 + (uint64_t)c);
        const double phase = (double)(h & 1023) / 163, a = (double)(h >> 10 & 15) / 40 - 0.2;
        const double b = (double)(h >> 14 & 15) / 40 - 0.2;
        rgba[c] = (uint8_t)(128.5 + 120 * sin(phase + a * x + b * y));
    }
}

/* The same, opaque. */
static void paint_waves(const kind_of *k, const textiles_tile *tile, int index, int size, int x, int y,
                        uint8_t rgba[4]) {
    paint_glass(k, tile, index, size, x, y, rgba);
    rgba[3] = 255;
}

/* Each edge's colour from the middle of the tile to the edge, and at the corners discs that all tiles
   share; corner tiles: each corner's colour in its quarter. */
static void paint_plain(const kind_of *k, const textiles_tile *tile, int index, int size, int x, int y,
                        uint8_t rgba[4]) {
    static const uint8_t palette[9][4] = {
        {0, 0, 0, 255},     {255, 0, 0, 255},     {0, 255, 0, 255},
        {0, 0, 255, 255},   {255, 255, 0, 255},   {255, 0, 255, 255},
        {0, 255, 255, 255}, {255, 255, 255, 255}, {128, 0, 64, 255},
    };
    int color = 0; /* the discs */
    (void)index;
    if (k->kind == TEXTILES_TRIANGLE) {
        const int w[3] = {size - x - y, y, x};
        int least = 0;
        for (int c = 1; c < 3; c++) least = w[c] < w[least] ? c : least;
        /* the side across from the corner of least weight */
        if (w[0] < size * 3 / 4 && w[1] < size * 3 / 4 && w[2] < size * 3 / 4)
            color = 1 + tile->edges[(least + 1) % 3];
    } else if (k->kind == TEXTILES_CORNER) {
        const int right = 2 * x >= size, below = 2 * y >= size;
        color = 1 + tile->edges[below ? 3 - right : right];
    } else {
        const int u = 2 * x + 1 - size, v = 2 * y + 1 - size; /* from the middle */
        const int level = abs(u) > abs(v), near = level ? (u > 0 ? 1 : 3) : (v > 0 ? 2 : 0);
        if (2 * size - abs(u) - abs(v) > size * 5 / 8)
            color = 1 + tile->edges[near] + (level ? k->colors : 0);
    }
    memcpy(rgba, palette[color], 4);
}

static textiles_set *import(const kind_of *k, int size, painter *paint) {
    const int side = size + (k->kind == TEXTILES_TRIANGLE);
    const size_t bytes = (size_t)side * (size_t)side * 4;
    txm_image *tiles = need(calloc((size_t)k->count, sizeof *tiles), "memory");
    uint8_t *pixels = need(calloc((size_t)k->count, bytes), "memory");
    textiles_desc d = {0};
    d.kind = k->kind;
    d.size = size;
    d.colors = k->colors;
    d.variants = k->variants;
    d.reduced = k->reduced;
    txm_env env = {0};
    textiles_set *set = NULL;
    for (int round = 0; round < 2; round++) { /* blank pictures first: which tiles are there? */
        for (int t = 0; t < k->count; t++) {
            tiles[t].pixels = pixels + (size_t)t * bytes;
            tiles[t].width = tiles[t].height = side;
            tiles[t].channels = 4;
            textiles_tile tile;
            if (!round || !textiles_tile_at(set, t, &tile)) continue;
            for (int b = 0; b < side * side; b++)
                paint(k, &tile, t, size, b % side, b / side,
                      pixels + (size_t)t * bytes + 4 * (size_t)b);
        }
        textiles_set_free(set);
        need_status(textiles_import(&d, tiles, k->count, 1, &env, &set), &env, "import");
    }
    free(tiles);
    free(pixels);
    return set;
}

/* ---- rendering ------------------------------------------------------------------------ */

/* what a texture holds: bytes; floats, which drivers filter exactly; floats with colour multiplied
   by alpha */
typedef enum texels { BYTES, FLOATS, PREMULTIPLIED, TEXELS } texels;

/* a set, drawn and uploaded */
typedef struct scene {
    textiles_set *set;
    textiles_plane plane;
    textiles_layout layout;
    txm_image atlas;
    texels stored;
    GLuint texture, table;
} scene;

/* to colour multiplied by alpha, 0..1 */
static void premultiply(const uint8_t rgba[4], float to[4]) {
    const float alpha = (float)rgba[3] / 255;
    for (int c = 0; c < 3; c++) to[c] = (float)rgba[c] / 255 * alpha;
    to[3] = alpha;
}

/* The atlas as floats; the caller frees them. */
static float *multiplied_atlas(const scene *s) {
    const size_t count = (size_t)s->layout.width * (size_t)s->layout.height;
    const uint8_t *pixels = s->atlas.pixels;
    float *to = need(malloc(count * 4 * sizeof *to), "memory");
    for (size_t i = 0; i < count; i++) premultiply(pixels + 4 * i, to + 4 * i);
    return to;
}

/* levels: of the mip-map, 0 = none */
static scene open_scene(const kind_of *k, int size, painter *paint, textiles_packing packing,
                        int gutter, int levels, texels stored) {
    scene s;
    txm_env env = {0};
    memset(&s, 0, sizeof s);
    s.set = import(k, size, paint);
    need_status(textiles_plane_make(s.set, 2003, &env, &s.plane), &env, "plane");
    need_status(textiles_layout_make(s.set, packing, gutter, &env, &s.layout), &env, "layout");
    const textiles_layout *l = &s.layout;
    s.atlas.width = l->width;
    s.atlas.height = l->height;
    s.atlas.channels = 4;
    s.atlas.pixels = need(malloc((size_t)l->width * (size_t)l->height * 4), "memory");
    need_status(textiles_draw_atlas(s.set, l, 0, &env, s.atlas), &env, "atlas");

    const GLenum target = packing == TEXTILES_SLICES ? GL_TEXTURE_2D_ARRAY : GL_TEXTURE_2D;
    const GLint wrap = packing == TEXTILES_TORUS ? GL_REPEAT : GL_CLAMP_TO_EDGE;
    const GLint format = stored == BYTES ? GL_RGBA8 : GL_RGBA32F;
    const GLenum type = stored == PREMULTIPLIED ? GL_FLOAT : GL_UNSIGNED_BYTE;
    float *multiplied = stored == PREMULTIPLIED ? multiplied_atlas(&s) : NULL;
    const void *pixels = multiplied ? (const void *)multiplied : s.atlas.pixels;
    s.stored = stored;
    glActiveTexture(packing == TEXTILES_SLICES ? GL_TEXTURE1 : GL_TEXTURE0);
    glGenTextures(1, &s.texture);
    glBindTexture(target, s.texture);
    if (packing == TEXTILES_SLICES)
        glTexImage3D(target, 0, format, l->pitch_x, l->pitch_y, l->count, 0, GL_RGBA,
                     type, pixels);
    else
        glTexImage2D(target, 0, format, l->width, l->height, 0, GL_RGBA, type, pixels);
    free(multiplied);
    glTexParameteri(target, GL_TEXTURE_WRAP_S, wrap);
    glTexParameteri(target, GL_TEXTURE_WRAP_T, wrap);
    glTexParameteri(target, GL_TEXTURE_MAX_LEVEL, levels);
    glTexParameteri(target, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(target, GL_TEXTURE_MIN_FILTER, levels ? GL_LINEAR_MIPMAP_LINEAR : GL_LINEAR);
    if (levels) glGenerateMipmap(target);

    int count = 0;
    const int32_t *table = textiles_plane_table(&s.plane, &count);
    glActiveTexture(GL_TEXTURE2);
    if (table) {
        glGenTextures(1, &s.table);
        glBindTexture(GL_TEXTURE_2D, s.table);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_R32I, count, 1, 0, GL_RED_INTEGER, GL_INT, table);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    }
    return s;
}

static void close_scene(scene *s) {
    glDeleteTextures(1, &s->texture);
    if (s->table) glDeleteTextures(1, &s->table);
    free(s->atlas.pixels);
    textiles_set_free(s->set);
}

/* pixel (x, y) of the view shows the place first + (x + 1/2) across + (y + 1/2) down, as seen from the
   tile origin */
typedef struct view {
    double first[2], across[2], down[2];
    int origin[2];
} view;

static void set_uniforms(GLuint program, const scene *s, const view *v) {
    const textiles_layout *l = &s->layout;
    const struct {
        const char *name;
        int value;
    } fields[] = {
        {"tiles.kind", (int)s->plane.kind}, {"tiles.colors", s->plane.colors},
        {"tiles.variants", s->plane.variants}, {"tiles.packing", (int)l->packing},
        {"tiles.size", l->size}, {"tiles.gutter", l->gutter},
        {"tiles.columns", l->columns}, {"atlas", 0},
        {"slices", 1}, {"table", 2},
    };
    glUseProgram(program);
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
        glUniform1i(glGetUniformLocation(program, fields[i].name), fields[i].value);
    glUniform1ui(glGetUniformLocation(program, "tiles.seed"), s->plane.seed);
    glUniform2i(glGetUniformLocation(program, "tiles.pitch"), l->pitch_x, l->pitch_y);
    glUniform2i(glGetUniformLocation(program, "tiles.extent"), l->width, l->height);
    glUniform2i(glGetUniformLocation(program, "tiles.origin"), v->origin[0], v->origin[1]);
    glUniform2f(glGetUniformLocation(program, "first"), (float)v->first[0], (float)v->first[1]);
    glUniform2f(glGetUniformLocation(program, "across"), (float)v->across[0], (float)v->across[1]);
    glUniform2f(glGetUniformLocation(program, "down"), (float)v->down[0], (float)v->down[1]);
}

/* 0..255, not rounded */
static void render(GLuint program, const scene *s, const view *v, float *rgba) {
    set_uniforms(program, s, v);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glReadPixels(0, 0, VIEW, VIEW, GL_RGBA, GL_FLOAT, rgba);
    for (int i = 0; i < VIEW * VIEW * 4; i++) rgba[i] *= 255.0f;
}

/* position (x, y) of the plane as textiles_draw_plane draws it */
static void probe(const scene *s, double x, double y, uint8_t rgba[4]) {
    const double step = 1.0 / 4096;
    txm_env env = {0};
    txm_image im = {0};
    im.pixels = rgba;
    im.width = im.height = 1;
    im.channels = 4;
    need_status(textiles_draw_plane(&s->plane, &s->layout, &s->atlas, x - step / 2, y - step / 2,
                                    step, &env, im),
                &env, "probe");
}

/* ---- lookups -------------------------------------------------------------------------- */

/* Do all channels of a rendered pixel agree with what was drawn? Straight colour was rounded to whole
   steps before it is multiplied here, and so was its alpha. */
static int agrees(const scene *s, const float rgba[4], const uint8_t want[4]) {
    const float limit = s->stored == PREMULTIPLIED ? 1.5f : 1.001f;
    float w[4] = {want[0] / 255.0f, want[1] / 255.0f, want[2] / 255.0f, want[3] / 255.0f};
    if (s->stored == PREMULTIPLIED) premultiply(want, w);
    int same = 1;
    for (int c = 0; c < 4; c++) same &= fabsf(rgba[c] - 255 * w[c]) <= limit;
    return same;
}

/* the share of pixels that agree */
static double compare(GLuint program, const scene *s, const view *v, int upright, float *rgba) {
    static uint8_t want[VIEW * VIEW * 4];
    const int n = s->layout.size, triangle = s->plane.kind == TEXTILES_TRIANGLE;
    /* the origin in pixels */
    const double ox = n * (v->origin[0] + (triangle ? v->origin[1] / 2.0 : 0));
    const double oy = n * v->origin[1] * (triangle ? sqrt(3.0) / 2 : 1);
    if (upright) {
        txm_env env = {0};
        txm_image im = {0};
        im.pixels = want;
        im.width = im.height = VIEW;
        im.channels = 4;
        need_status(textiles_draw_plane(&s->plane, &s->layout, &s->atlas, v->first[0] + ox,
                                        v->first[1] + oy, v->across[0], &env, im),
                    &env, "draw_plane");
    } else {
        for (int b = 0; b < VIEW * VIEW; b++) {
            const double x = b % VIEW + 0.5, y = b / VIEW + 0.5;
            probe(s, v->first[0] + ox + x * v->across[0] + y * v->down[0],
                  v->first[1] + oy + x * v->across[1] + y * v->down[1], want + 4 * b);
        }
    }
    render(program, s, v, rgba);
    int same = 0;
    for (int b = 0; b < VIEW * VIEW; b++) same += agrees(s, rgba + 4 * b, want + 4 * b);
    return same / (double)(VIEW * VIEW);
}

static void test_lookups(GLuint program, float *rgba) {
    static const char *const packings[] = {"packed", "torus", "slices"};
    static const view views[] = {
        {{-70, -90}, {1, 0}, {0, 1}, {0, 0}},                  /* step 1 */
        {{100, -31}, {1, 0}, {0, 1}, {-70000, 123456}},        /* far away */
        {{-12.3, 37.77}, {1, 0}, {0, 1}, {0, 0}},              /* between pixels */
        {{-60.1, -20.7}, {0.37, 0}, {0, 0.37}, {5, -9}},       /* enlarged */
        {{13.137, -70.241}, {0.8, 0.6}, {-0.6, 0.8}, {0, 0}},  /* turned */
        {{-50.7, 33.3}, {-0.21, 0.15}, {0.07, 0.31}, {0, 0}},  /* mirrored, squeezed, enlarged */
    };
    enum { UPRIGHT = 4, VIEWS = 6 };
    for (int i = 0; i < KINDS; i++) {
        for (int p = 0; p < 3; p++) {
            const kind_of *k = &kinds[i];
            if (p == TEXTILES_TORUS && k->kind == TEXTILES_TRIANGLE) continue;
            const int gutter = p == TEXTILES_TORUS ? 0 : i % 2 ? 8 : 1;
            double least[TEXELS] = {1, 1, 1};
            for (int stored = 0; stored < TEXELS; stored++) {
                painter *paint = stored == PREMULTIPLIED ? paint_glass : paint_waves;
                scene s = open_scene(k, 32, paint, (textiles_packing)p, gutter, 0, (texels)stored);
                for (int v = 0; v < VIEWS; v++) {
                    const double share = compare(program, &s, &views[v], v < UPRIGHT, rgba);
                    if (share < least[stored]) least[stored] = share;
                }
                close_scene(&s);
            }
            char what[120], figures[120];
            snprintf(what, sizeof what, "%s, %s: the shader shows the plane", k->name, packings[p]);
            snprintf(figures, sizeof figures,
                     "%.3f %% of the pixels, %.3f %% filtered in 8 bits, %.3f %% translucent",
                     100 * least[FLOATS], 100 * least[BYTES], 100 * least[PREMULTIPLIED]);
            report(least[FLOATS] >= 0.999 && least[BYTES] >= 0.999 && least[PREMULTIPLIED] >= 0.999,
                   what, figures);
        }
    }
}

/* ---- mip-maps ------------------------------------------------------------------------- */

/* Pixels that show a colour that does not occur nearby: *foreign, of *judged that lie in one colour and of
   which *joints have a joint in reach. */
static void judge(GLuint program, const scene *s, int level, int levels, float *rgba, int *judged,
                  int *joints, int *foreign) {
    const double step = 1 << level;
    /* how far filters see: 3/2 pixels of the level. Of triangles up to sqrt(3) times that, and of the
       next level besides, since lattice rows are closer than pixels. */
    int margin = 2 << level;
    if (s->plane.kind == TEXTILES_TRIANGLE) margin = level < levels ? 6 << level : 3 << level;
    const int side = (VIEW << level) + 2 * margin + 2;
    uint8_t *plane = need(malloc((size_t)side * (size_t)side * 4), "memory");
    uint8_t *numbers = need(malloc((size_t)side * (size_t)side), "memory");
    txm_env env = {0};
    txm_image im = {0};
    im.pixels = plane;
    im.width = im.height = side;
    im.channels = 4;
    /* whole pixels for squares: copies, no filter has mixed colours */
    const view v = {{-40.3, 17.6}, {step, 0}, {0, step}, {0, 0}};
    const double left = floor(v.first[0]) - margin, top = floor(v.first[1]) - margin;
    need_status(textiles_draw_plane(&s->plane, &s->layout, &s->atlas, left, top, 1, &env, im), &env,
                "draw_plane");
    for (int y = 0; y < side; y++) {
        for (int x = 0; x < side; x++) {
            int number;
            if (s->plane.kind == TEXTILES_TRIANGLE) {
                const double b = (top + y + 0.5) * 2 / sqrt(3.0) / s->layout.size;
                const double a = (left + x + 0.5) / s->layout.size - b / 2;
                number = (int)floor(a) * 2 + (int)floor(b) * 64 + (a - floor(a) + b - floor(b) >= 1);
            } else {
                number = (int)floor((left + x) / s->layout.size) +
                         (int)floor((top + y) / s->layout.size) * 32;
            }
            numbers[(size_t)y * (size_t)side + (size_t)x] = (uint8_t)number;
        }
    }
    render(program, s, &v, rgba);
    for (int b = 0; b < VIEW * VIEW; b++) {
        const int x = (int)floor(v.first[0] + (b % VIEW + 0.5) * step - left);
        const int y = (int)floor(v.first[1] + (b / VIEW + 0.5) * step - top);
        const size_t middle = (size_t)y * (size_t)side + (size_t)x;
        int one = 1, joint = 0;
        for (int w = y - margin; w <= y + margin && one; w++) {
            for (int u = x - margin; u <= x + margin && one; u++) {
                const size_t at = (size_t)w * (size_t)side + (size_t)u;
                one = memcmp(plane + 4 * at, plane + 4 * middle, 4) == 0;
                joint |= numbers[at] != numbers[middle];
            }
        }
        if (!one) continue;
        int off = 0;
        for (int c = 0; c < 4; c++)
            off |= fabsf(rgba[4 * b + c] - (float)plane[4 * middle + (size_t)c]) > 1.5f;
        ++*judged;
        *joints += joint;
        *foreign += off;
    }
    free(plane);
    free(numbers);
}

static void test_mipmaps(GLuint program, float *rgba) {
    static const char *const packings[] = {"packed", "torus", "slices"};
    for (int i = 0; i < KINDS; i++) {
        const kind_of *k = &kinds[i];
        if (k->variants > 1) continue; /* the same picture */
        for (int p = 0; p < 3; p++) {
            if (p == TEXTILES_TORUS && k->kind == TEXTILES_TRIANGLE) continue;
            for (int levels = 1; levels <= 3; levels += 2) {
                const int gutter = p == TEXTILES_TORUS ? 0 : 1 << levels;
                scene s = open_scene(k, 128, paint_plain, (textiles_packing)p, gutter, levels, BYTES);
                int judged = 0, joints = 0, foreign = 0;
                for (int level = 0; level <= levels; level++)
                    judge(program, &s, level, levels, rgba, &judged, &joints, &foreign);
                close_scene(&s);
                char what[120], figures[120];
                snprintf(what, sizeof what, "%s, %s: no foreign colour up to level %d", k->name,
                         packings[p], levels);
                snprintf(figures, sizeof figures, "%d pixels, %d of them at joints, %d foreign",
                         judged, joints, foreign);
                report(joints > 1000 && foreign == 0, what, figures);
            }
        }
        /* without a gutter the same test finds foreign colours */
        scene s = open_scene(k, 128, paint_plain, TEXTILES_PACKED, 0, 3, BYTES);
        int judged = 0, joints = 0, foreign = 0;
        for (int level = 0; level <= 3; level++)
            judge(program, &s, level, 3, rgba, &judged, &joints, &foreign);
        close_scene(&s);
        char what[120], figures[120];
        snprintf(what, sizeof what, "%s: without a gutter colours bleed", k->name);
        snprintf(figures, sizeof figures, "%d of %d at joints", foreign, joints);
        report(foreign > 100, what, figures);
    }
}

/* ---- which level ---------------------------------------------------------------------- */

/* Texels per pixel of the picture where the view has tile `rotation`, turned or not: low is the largest
   component of the two derivatives, high the length of the longer; drivers may take either. */
static void expect_level(const view *v, int triangle, int turned, int rotation, double *low,
                         double *high) {
    *low = *high = 0;
    for (int k = 0; k < 2; k++) {
        const double *d = k ? v->down : v->across;
        double du = d[0], dv = d[1];
        if (triangle) {
            const double b = d[1] * 2 / sqrt(3.0), a = d[0] - b / 2, sign = turned ? -1 : 1;
            const double w[3] = {sign * (-a - b), sign * b, sign * a}; /* of the face's corners */
            double tile[3];
            for (int c = 0; c < 3; c++) tile[(c + rotation) % 3] = w[c];
            du = tile[2];
            dv = tile[1];
        }
        *low = fmax(*low, fmax(fabs(du), fabs(dv)));
        *high = fmax(*high, hypot(du, dv));
    }
}

/* With pictures that show the number of their mip-map level, the level is that of the view, of
   triangles for each of the six ways that they can lie. */
static void test_levels(GLuint program, float *rgba) {
    static const char *const packings[] = {"packed", "torus", "slices"};
    static const view views[] = {
        {{3.1, 5.2}, {2, 0}, {0, 2}, {0, 0}},           {{3.1, 5.2}, {3, 0}, {0, 0.5}, {0, 0}},
        {{3.1, 5.2}, {0.5, 0}, {0, 3}, {0, 0}},         {{3.1, 5.2}, {2.1, 1.5}, {-0.1, 0.3}, {0, 0}},
        {{3.1, 5.2}, {0.2, -0.1}, {-1.9, 2.2}, {0, 0}},
    };
    for (int i = 0; i < KINDS; i++) {
        const kind_of *k = &kinds[i];
        for (int p = 0; p < 3; p++) {
            if (k->variants > 1 || (p == TEXTILES_TORUS && k->kind == TEXTILES_TRIANGLE)) continue;
            scene s = open_scene(k, 64, paint_plain, (textiles_packing)p, -1 + (p == 1), 3, FLOATS);
            const int slices = p == TEXTILES_SLICES, triangle = k->kind == TEXTILES_TRIANGLE;
            const int width = s.layout.pitch_x, depth = s.layout.count;
            for (int level = 0; level <= 3; level++) {
                const int w = (slices ? width : s.layout.width) >> level;
                const int h = (slices ? width : s.layout.height) >> level;
                const size_t count = (size_t)w * (size_t)h * (size_t)(slices ? depth : 1) * 4;
                float *plain = need(malloc(count * sizeof *plain), "memory");
                for (size_t c = 0; c < count; c++) plain[c] = (float)level;
                glActiveTexture(slices ? GL_TEXTURE1 : GL_TEXTURE0);
                if (slices)
                    glTexImage3D(GL_TEXTURE_2D_ARRAY, level, GL_RGBA32F, w, h, depth, 0, GL_RGBA,
                                 GL_FLOAT, plain);
                else
                    glTexImage2D(GL_TEXTURE_2D, level, GL_RGBA32F, w, h, 0, GL_RGBA, GL_FLOAT, plain);
                free(plain);
            }
            int good = 0, all = 0;
            for (size_t n = 0; n < sizeof views / sizeof views[0]; n++) {
                render(program, &s, &views[n], rgba);
                for (int b = 0; b < VIEW * VIEW; b++) {
                    const double x = b % VIEW + 0.5, y = b / VIEW + 0.5;
                    const view *v = &views[n];
                    const double px = v->first[0] + x * v->across[0] + y * v->down[0];
                    const double py = v->first[1] + x * v->across[1] + y * v->down[1];
                    int turned = 0, rotation = 0;
                    if (triangle) {
                        const double lb = py * 2 / sqrt(3.0) / 64, la = px / 64 - lb / 2;
                        turned = la - floor(la) + lb - floor(lb) >= 1;
                        textiles_plane_triangle(&s.plane, (int)floor(la), (int)floor(lb), turned,
                                                &rotation);
                    }
                    double low, high;
                    expect_level(v, triangle, turned, rotation, &low, &high);
                    const double shown = (double)rgba[4 * b] / 255;
                    good += shown >= fmax(log2(low), 0) - 0.1 && shown <= fmax(log2(high), 0) + 0.1;
                    all++;
                }
            }
            close_scene(&s);
            char what[120], figures[120];
            snprintf(what, sizeof what, "%s, %s: the mip-map level is that of the view", k->name,
                     packings[p]);
            snprintf(figures, sizeof figures, "%.3f %% of the pixels", 100.0 * good / all);
            report(good >= 0.999 * all, what, figures);
        }
    }
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: gl_textiles shaders/textiles.glsl\n");
        return 2;
    }
    char *library = read_text(argv[1]);
    EGLDisplay display = open_display();
    need(display, "EGL without a window");
    if (make_current(display, EGL_OPENGL_ES_API, 3, 0))
        report(link_program("#version 300 es\n", library) != 0, "compiles as GLSL ES 3.00", "");
    else report(0, "an OpenGL ES 3.0 context", "");
    need(make_current(display, EGL_OPENGL_API, 3, 3) ? display : NULL, "an OpenGL 3.3 context");
    const GLuint program = link_program("#version 330\n", library);
    report(program != 0, "compiles as GLSL 3.30", (const char *)glGetString(GL_RENDERER));
    if (!program) return 1;

    GLuint frame, target, array;
    glGenTextures(1, &target);
    glBindTexture(GL_TEXTURE_2D, target);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA32F, VIEW, VIEW, 0, GL_RGBA, GL_FLOAT, NULL);
    glGenFramebuffers(1, &frame);
    glBindFramebuffer(GL_FRAMEBUFFER, frame);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target, 0);
    glBindTexture(GL_TEXTURE_2D, 0);
    glGenVertexArrays(1, &array);
    glBindVertexArray(array);
    glViewport(0, 0, VIEW, VIEW);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);

    float *rgba = need(malloc(sizeof(float) * VIEW * VIEW * 4), "memory");
    test_lookups(program, rgba);
    test_levels(program, rgba);
    test_mipmaps(program, rgba);
    report(glGetError() == GL_NO_ERROR, "no OpenGL error", "");
    free(rgba);
    free(library);
    eglTerminate(display);
    return failures != 0;
}
