/* headless.c - pictures without a window
   SPDX-License-Identifier: MIT OR Unlicense  */
#define _XOPEN_SOURCE 600 /* clock_gettime */
#include "forest_gl.h"

#include <stb/stb_image_write.h>
#include <stdio.h>
#include <time.h>

int open_headless(forest_gl *f) {
    typedef EGLDisplay (*get_display)(EGLenum, void *, const EGLint *);
    const EGLint profile[] = {EGL_CONTEXT_MAJOR_VERSION, 4, EGL_CONTEXT_MINOR_VERSION, 3,
                              EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                              EGL_NONE};
    /* a cast from one function type to another */
    const get_display get = (get_display)eglGetProcAddress("eglGetPlatformDisplayEXT");
    f->display = get ? get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL) : EGL_NO_DISPLAY;
    if (f->display == EGL_NO_DISPLAY || !eglInitialize(f->display, NULL, NULL) ||
        !eglBindAPI(EGL_OPENGL_API))
        return fail(f, "no EGL that works without a window; Mesa's package is libegl-mesa0");
    const EGLContext context =
        eglCreateContext(f->display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, profile);
    if (context == EGL_NO_CONTEXT ||
        !eglMakeCurrent(f->display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
        return fail(f, "no OpenGL 4.3");
    return 1;
}

/* An off-screen frame buffer. */
static GLuint make_target(int width, int height) {
    GLuint frame, color, depth;
    glGenFramebuffers(1, &frame);
    glBindFramebuffer(GL_FRAMEBUFFER, frame);
    glGenRenderbuffers(1, &color);
    glBindRenderbuffer(GL_RENDERBUFFER, color);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color);
    glGenRenderbuffers(1, &depth);
    glBindRenderbuffer(GL_RENDERBUFFER, depth);
    glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
    return frame;
}

/* The file name of a picture: %d or %0Nd in the pattern is replaced by its number. 0: the pattern has
   another %. */
static int picture_path(const char *pattern, int number, char *path, size_t capacity) {
    const char *percent = strchr(pattern, '%');
    size_t digits = 0;
    if (!percent) return (size_t)snprintf(path, capacity, "%s", pattern) < capacity;
    const char *at = percent + 1;
    if (*at == '0') digits = (size_t)(*++at - '0');
    if (digits > 9 || (digits && *++at != 'd') || *at != 'd' || strchr(at, '%')) return 0;
    return (size_t)snprintf(path, capacity, "%.*s%0*d%s", (int)(percent - pattern), pattern,
                            (int)digits, number, at + 1) < capacity;
}

/* Average smooth x smooth samples for each pixel, and flip: OpenGL's first row is the lowest. */
static void downsample(const uint8_t *rgba, int width, int height, int smooth, uint8_t *rgb) {
    const int samples = smooth * smooth;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < 3 * width; x++) {
            int sum = samples / 2;
            for (int i = 0; i < samples; i++) {
                const int row = (height - 1 - y) * smooth + i / smooth;
                const int column = x / 3 * smooth + i % smooth;
                sum += rgba[4 * ((size_t)row * (size_t)(width * smooth) + (size_t)column) +
                            (size_t)(x % 3)];
            }
            rgb[(size_t)y * 3 * (size_t)width + (size_t)x] = (uint8_t)(sum / samples);
        }
    }
}

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int render_pictures(forest_gl *f) {
    const int width = f->o.width * f->o.smooth, height = f->o.height * f->o.smooth;
    uint8_t *pixels = (uint8_t *)allocate(f, (size_t)width * (size_t)height, 4);
    uint8_t *rgb = (uint8_t *)allocate(f, (size_t)f->o.width * (size_t)f->o.height, 3);
    const GLuint target = make_target(width, height);
    const double step = f->o.loop > 0 ? (double)f->o.loop / f->o.frames : 1 / 25.0;
    const double start = seconds();
    for (int i = 0; i < f->o.frames && pixels && rgb && !f->failed[0]; i++) {
        char path[1024];
        if (i > 0 && !advance_wind(f, f->o.time + i * step)) break;
        upload_bones(f);
        if (i == 0) draw_shadows(f);
        draw_frame(f, target, width, height);
        glReadPixels(0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, pixels);
        downsample(pixels, f->o.width, f->o.height, f->o.smooth, rgb);
        if (!picture_path(f->o.headless, i, path, sizeof path) ||
            !stbi_write_png(path, f->o.width, f->o.height, 3, rgb, 3 * f->o.width))
            fail(f, "cannot write '%s'", f->o.headless);
        else if (i == 0)
            printf("trees %d\npieces %u\nclouds %u\ndraws %d\n", f->forest->tree_count,
                   f->forest->node_count, f->forest->cluster_count, f->draws);
    }
    if (!f->failed[0]) printf("seconds %.3f\n", (seconds() - start) / f->o.frames);
    free(pixels);
    free(rgb);
    if (!f->failed[0] && glGetError() != GL_NO_ERROR) fail(f, "OpenGL reports an error");
    return !f->failed[0];
}
