/* camera.c - the view of a frame
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

static const float degree = 0.0174532925f, half_view = 19; /* degrees; the field of view is twice that, vertically */

/* Without --at look at the middle of the forest; without a distance, from where all of it is visible. */
void choose_view(forest_gl *f) {
    const float tall = f->high[1] - f->low[1], tan_up = tanf(half_view * degree);
    const float wide = 0.5f * (f->high[0] - f->low[0] + f->high[2] - f->low[2]);
    const float tan_right = tan_up * (float)f->o.width / (float)f->o.height;
    for (int k = 0; k < 3 && !f->o.has_at; k++) f->o.at[k] = 0.5f * (f->low[k] + f->high[k]);
    if (f->o.orbit[2] > 0) return;
    f->o.orbit[2] = 0.53f * txm_maxf(tall / tan_up, wide / tan_right) + 0.2f * wide;
}

/* A phase of something that happens so many times a second; with --loop, so that it ends where it began. */
static float phase_of(const forest_gl *f, double rate) {
    const double loop = (double)f->o.loop;
    const double turns = (loop > 0 ? floor(rate * loop + 0.5) / loop : rate) * f->now;
    return (float)(turns - floor(turns));
}

/* The uniform block of a frame: the camera orbits o.at. */
void aim_camera(forest_gl *f, int width, int height) {
    frame_data *d = &f->frame;
    const float a = f->o.orbit[0] * degree, e = f->o.orbit[1] * degree, distance = f->o.orbit[2];
    const float tan_up = tanf(half_view * degree), tan_right = tan_up * (float)width / (float)height;
    const float wide = 0.5f * (f->high[0] - f->low[0] + f->high[2] - f->low[2]);
    const float *middle = f->o.at;
    const float back[3] = {cosf(e) * sinf(a), sinf(e), cosf(e) * cosf(a)};
    const float right[3] = {cosf(a), 0, -sinf(a)};
    const float up[3] = {-sinf(e) * sinf(a), cosf(e), -sinf(e) * cosf(a)};
    for (int k = 0; k < 3; k++) {
        d->eye[k] = middle[k] + distance * back[k];
        d->right[k] = right[k];
        d->up[k] = up[k];
        d->forward[k] = -back[k];
    }
    d->eye[1] = txm_maxf(d->eye[1], 0.1f);
    d->eye[3] = f->o.is_bare ? 0 : f->o.cards;
    d->right[3] = tan_right;
    d->up[3] = tan_up;
    d->forward[3] = CLOUDS;
    d->box_scale[3] = 0.13f / (distance + wide + 30);
    d->lod[0] = f->o.level;
    d->lod[1] = f->o.half;
    d->lod[2] = 0.6f;
    d->lod[3] = (float)f->sheets[0].width;
    d->shimmer[0] = phase_of(f, 2.9);
    d->shimmer[1] = phase_of(f, 4.7);
    d->shimmer[2] = txm_minf(f->o.wind / 10, 1);
    f->near_plane = txm_clampf(0.02f * distance, 0.05f, 1);
    f->far_plane = distance + 4 * (wide + f->high[1]) + 500;
    const float n = f->near_plane, far = f->far_plane;
    const float z[2] = {-(far + n) / (far - n), -2 * far * n / (far - n)};
    for (int column = 0; column < 4; column++) {
        /* a column of the view matrix, whose rows are right, up and back */
        const float v[3] = {column < 3 ? right[column] : -dot(right, d->eye),
                            column < 3 ? up[column] : -dot(up, d->eye),
                            column < 3 ? back[column] : -dot(back, d->eye)};
        float *m = d->view_projection + 4 * column;
        m[0] = v[0] / tan_right;
        m[1] = v[1] / tan_up;
        m[2] = z[0] * v[2] + (column == 3 ? z[1] : 0);
        m[3] = -v[2];
    }
    glBindBuffer(GL_UNIFORM_BUFFER, f->block);
    glBufferData(GL_UNIFORM_BUFFER, sizeof *d, d, GL_STREAM_DRAW);
}

/* The uniform block of the sun's picture: parallel rays, all of the forest, no tessellation. */
void aim_sun(forest_gl *f) {
    frame_data *d = &f->frame;
    const float *sun = d->sun, level = sqrtf(sun[0] * sun[0] + sun[2] * sun[2]);
    const float right[3] = {sun[2] / level, 0, -sun[0] / level};
    float axes[3][3];
    for (int k = 0; k < 3; k++) {
        axes[0][k] = right[k];
        axes[2][k] = -sun[k]; /* depth grows away from the sun */
    }
    axes[1][0] = sun[1] * right[2] - sun[2] * right[1];
    axes[1][1] = sun[2] * right[0] - sun[0] * right[2];
    axes[1][2] = sun[0] * right[1] - sun[1] * right[0];
    memset(d->view_projection, 0, sizeof d->view_projection);
    d->view_projection[15] = 1;
    for (int a = 0; a < 3; a++) {
        float least = 1e9f, most = -1e9f;
        for (int corner = 0; corner < 8; corner++) {
            float p[3];
            for (int k = 0; k < 3; k++) p[k] = corner >> k & 1 ? f->high[k] : f->low[k];
            least = txm_minf(least, dot(p, axes[a]) - 1);
            most = txm_maxf(most, dot(p, axes[a]) + 1);
        }
        for (int k = 0; k < 3; k++)
            d->view_projection[4 * k + a] = 2 * axes[a][k] / (most - least);
        d->view_projection[12 + a] = -(most + least) / (most - least);
    }
    for (int k = 0; k < 3; k++) {
        d->right[k] = axes[0][k];
        d->up[k] = axes[1][k];
        d->forward[k] = axes[2][k];
        d->eye[k] = 1e6f * sun[k];
    }
    d->eye[3] = 0;
    d->forward[3] = CLOUDS;
    d->lod[0] = d->lod[1] = 1;
    d->lod[2] = 0;
    d->lod[3] = (float)f->sheets[0].width;
    glBindBuffer(GL_UNIFORM_BUFFER, f->block);
    glBufferData(GL_UNIFORM_BUFFER, sizeof *d, d, GL_STREAM_DRAW);
}
