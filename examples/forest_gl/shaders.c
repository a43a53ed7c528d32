/* shaders.c - OpenGL programs, built from treepieces.glsl and forest.glsl
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

#include <stdio.h>

#ifndef FOREST_SHADERS
#define FOREST_SHADERS "/usr/local/share/texkit/shaders"
#endif

/* The text of a shader file, from the folder of --shaders, else from the source tree or from where
   make install puts it. */
char *read_shader(forest_gl *f, const char *name, const char *program) {
    char path[1024];
    const char *slash = strrchr(program, '/');
    const int length = slash ? (int)(slash - program) : 1;
    for (int i = 0; i < 3; i++) {
        if (f->o.shaders) snprintf(path, sizeof path, "%s/%s", f->o.shaders, name);
        else if (i == 0)
            snprintf(path, sizeof path, "%.*s/../../shaders/%s", length, slash ? program : ".", name);
        else if (i == 1) snprintf(path, sizeof path, "shaders/%s", name);
        else snprintf(path, sizeof path, "%s/%s", FOREST_SHADERS, name);
        char *text = read_file(path);
        if (text) return text;
    }
    fail(f, "cannot find shaders/%s; --shaders says where it is", name);
    return NULL;
}

int add_stage(forest_gl *f, GLuint program, GLenum type, const char *stage,
                     const char *defines, const char *library, const char *body) {
    char head[256];
    snprintf(head, sizeof head, "#version 430 core\n#define %s\n%s", stage, defines);
    const char *parts[3] = {head, library, body};
    GLint good = 0;
    const GLuint shader = glCreateShader(type);
    glShaderSource(shader, 3, parts, NULL);
    glCompileShader(shader);
    glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
    if (!good) {
        char log[300] = "";
        glGetShaderInfoLog(shader, sizeof log, NULL, log);
        fail(f, "%s: %s", stage, log);
    }
    glAttachShader(program, shader);
    glDeleteShader(shader); /* once the program is */
    return good;
}

static GLuint make_program(forest_gl *f, int number, const char *library, const char *body) {
    static const struct {
        int program;
        GLenum type;
        const char *name;
    } stages[] = {
        {PIECES, GL_VERTEX_SHADER, "PIECE_VERTEX"},
        {PIECES, GL_TESS_CONTROL_SHADER, "PIECE_CONTROL"},
        {PIECES, GL_TESS_EVALUATION_SHADER, "PIECE_EVALUATION"},
        {PIECES, GL_FRAGMENT_SHADER, "PIECE_FRAGMENT"},
        {WIRE, GL_VERTEX_SHADER, "PIECE_VERTEX"},
        {WIRE, GL_TESS_CONTROL_SHADER, "PIECE_CONTROL"},
        {WIRE, GL_TESS_EVALUATION_SHADER, "PIECE_EVALUATION"},
        {WIRE, GL_GEOMETRY_SHADER, "PIECE_WIRE"},
        {WIRE, GL_FRAGMENT_SHADER, "PIECE_FRAGMENT\n#define WIRE"},
        {CARD, GL_VERTEX_SHADER, "CARD_VERTEX"},
        {CARD, GL_GEOMETRY_SHADER, "CARD_GEOMETRY"},
        {CARD, GL_FRAGMENT_SHADER, "CARD_FRAGMENT"},
        {CLOUD, GL_VERTEX_SHADER, "CLOUD_VERTEX"},
        {CLOUD, GL_FRAGMENT_SHADER, "CLOUD_FRAGMENT"},
        {NEAR_CARD, GL_VERTEX_SHADER, "NEAR_VERTEX"},
        {NEAR_CARD, GL_FRAGMENT_SHADER, "NEAR_FRAGMENT"},
        {PIECE_SHADOW, GL_VERTEX_SHADER, "PIECE_VERTEX"},
        {PIECE_SHADOW, GL_TESS_CONTROL_SHADER, "PIECE_CONTROL"},
        {PIECE_SHADOW, GL_TESS_EVALUATION_SHADER, "PIECE_EVALUATION"},
        {PIECE_SHADOW, GL_FRAGMENT_SHADER, "SHADOW_FRAGMENT"},
        {CLOUD_SHADOW, GL_VERTEX_SHADER, "CLOUD_VERTEX"},
        {CLOUD_SHADOW, GL_FRAGMENT_SHADER, "CLOUD_FRAGMENT\n#define SHADOW"},
        {LAND, GL_VERTEX_SHADER, "LAND_VERTEX"},
        {LAND, GL_FRAGMENT_SHADER, "LAND_FRAGMENT"},
    };
    const GLuint program = glCreateProgram();
    GLint good = 1;
    for (size_t i = 0; i < sizeof stages / sizeof stages[0] && good; i++)
        if (stages[i].program == number)
            good = add_stage(f, program, stages[i].type, stages[i].name, "", library, body);
    if (good) {
        glLinkProgram(program);
        glGetProgramiv(program, GL_LINK_STATUS, &good);
        if (!good) {
            char log[300] = "";
            glGetProgramInfoLog(program, sizeof log, NULL, log);
            fail(f, "program %d: %s", number, log);
        }
    }
    return good ? program : 0;
}

int make_programs(forest_gl *f, const char *path) {
    char *library = read_shader(f, "treepieces.glsl", path);
    char *body = library ? read_shader(f, "forest.glsl", path) : NULL;
    for (int i = 0; i < PROGRAMS && body && !f->failed[0]; i++)
        f->programs[i] = make_program(f, i, library, body);
    free(library);
    free(body);
    return !f->failed[0];
}
