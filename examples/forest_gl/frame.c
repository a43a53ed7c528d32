/* frame.c - the draw calls of a frame
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

static void draw_strips(forest_gl *f, int program, int count) {
    glUseProgram(f->programs[program]);
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, count);
    f->draws++;
}

/* Render all leaf clouds as seen along the view, if the view has turned since the last time. */
static void draw_impostors(forest_gl *f) {
    static const float transparent[4] = {0, 0, 0, 0}, no_depth[4] = {-2, 0, 0, 0}, far = 1;
    const float turned = 1 - dot(f->seen_from, f->frame.forward);
    if (!f->card_count || (f->has_impostors && turned < 1e-6f)) return;
    glBindFramebuffer(GL_FRAMEBUFFER, f->card_frame);
    glViewport(0, 0, CLOUD_SIDE, CLOUD_SIDE);
    glEnable(GL_DEPTH_TEST);
    glClearBufferfv(GL_COLOR, 0, transparent);
    glClearBufferfv(GL_COLOR, 1, no_depth);
    glClearBufferfv(GL_DEPTH, 0, &far);
    draw_strips(f, CARD, f->card_count);
    glActiveTexture(GL_TEXTURE0 + IMPOSTORS);
    glGenerateMipmap(GL_TEXTURE_2D_ARRAY);
    memcpy(f->seen_from, f->frame.forward, sizeof f->seen_from);
    f->has_impostors = 1;
}

static void draw_pieces(forest_gl *f, GLuint program) {
    const GLint kind = glGetUniformLocation(program, "kind");
    glUseProgram(program);
    glPatchParameteri(GL_PATCH_VERTICES, 4);
    for (int t = 0; t < f->forest->type_count; t++) {
        const treepieces_batch *b = &f->forest->batches[t];
        const size_t first = (size_t)f->first_index[t];
        if (!b->count) continue;
        glUniform1i(kind, t);
        glDrawElementsInstanced(GL_PATCHES, 4 * b->quad_count, GL_UNSIGNED_SHORT,
                                at_offset(first * sizeof(uint16_t)), (GLsizei)b->count);
        f->draws++;
    }
}

/* Draw what the sun sees of the forest as it stands now: once, as the wind moves shadows too little. The
   impostors are drawn as seen from there. */
void draw_shadows(forest_gl *f) {
    const frame_data view = f->frame;
    aim_sun(f);
    f->has_impostors = 0;
    if (!f->o.is_bare) draw_impostors(f);
    glBindFramebuffer(GL_FRAMEBUFFER, f->shadow_frame);
    glViewport(0, 0, SHADOW_SIDE, SHADOW_SIDE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LEQUAL);
    glClear(GL_DEPTH_BUFFER_BIT);
    draw_pieces(f, f->programs[PIECE_SHADOW]);
    if (f->forest->cluster_count && !f->o.is_bare)
        draw_strips(f, CLOUD_SHADOW, (int)f->forest->cluster_count);
    f->has_impostors = 0;
    memcpy(f->frame.sun_projection, f->frame.view_projection, sizeof view.view_projection);
    memcpy(f->frame.view_projection, view.view_projection, sizeof view.view_projection);
}

/* Draw everything into a frame buffer of the given size. */
void draw_frame(forest_gl *f, GLuint target, int width, int height) {
    f->draws = 0;
    aim_camera(f, width, height);
    draw_impostors(f);
    glBindFramebuffer(GL_FRAMEBUFFER, target);
    glViewport(0, 0, width, height);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LEQUAL);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glEnable(GL_CULL_FACE);
    draw_pieces(f, f->programs[f->o.is_wire ? WIRE : PIECES]);
    glDisable(GL_CULL_FACE);
    if (f->forest->cluster_count && !f->o.is_bare)
        draw_strips(f, CLOUD, (int)f->forest->cluster_count);
    const int near_count = f->o.is_bare ? 0 : upload_near(f);
    if (near_count) draw_strips(f, NEAR_CARD, near_count);
    glUseProgram(f->programs[LAND]); /* last, because most of it is hidden */
    glDrawArrays(GL_TRIANGLES, 0, 3);
    f->draws++;
}
