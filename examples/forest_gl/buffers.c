/* buffers.c - buffers and textures: what the shaders read
   SPDX-License-Identifier: MIT OR Unlicense  */
#include "forest_gl.h"

/* OpenGL takes offsets into buffers as pointers. */
void *at_offset(size_t bytes) {
    return (void *)bytes; /* NOLINT(performance-no-int-to-ptr) */
}

static void fill_buffer(forest_gl *f, int binding, const void *data, size_t bytes) {
    glBindBuffer(GL_SHADER_STORAGE_BUFFER, f->buffers[binding]);
    glBufferData(GL_SHADER_STORAGE_BUFFER, (GLsizeiptr)(bytes ? bytes : 16), bytes ? data : NULL,
                 binding == BONES || binding == NEAR ? GL_STREAM_DRAW : GL_STATIC_DRAW);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, (GLuint)binding, f->buffers[binding]);
}

/* The pieces: vertices, quads, building transforms, and the records of all instances. */
int upload_pieces(forest_gl *f) {
    const int types = f->forest->type_count;
    kind_data kinds[TREEPIECES_MAX_TYPES];
    size_t vertices = 0, quads = 0, words = 0;
    memset(kinds, 0, sizeof kinds);
    for (int t = 0; t < types; t++) {
        const treepieces_piece *p = treepieces_kit_piece(f->kit, t);
        vertices += (size_t)p->vertex_count;
        quads += (size_t)p->quad_count;
        words += (size_t)f->forest->batches[t].count * f->forest->batches[t].stride;
    }
    treepieces_vertex *all = (treepieces_vertex *)allocate(f, vertices, sizeof *all);
    uint16_t *corners = (uint16_t *)allocate(f, quads, 4 * sizeof *corners);
    uint32_t *looks = (uint32_t *)allocate(f, quads, sizeof *looks);
    uint32_t *records = (uint32_t *)allocate(f, words, sizeof *records);
    if (all && corners && looks && records) {
        vertices = quads = words = 0;
        for (int t = 0; t < types; t++) {
            const treepieces_piece *p = treepieces_kit_piece(f->kit, t);
            const treepieces_batch *b = &f->forest->batches[t];
            const size_t size = (size_t)b->count * b->stride;
            for (int k = 0; k < p->leaf_count; k++) {
                memcpy(kinds[t].building[k], p->building[k].translation, 3 * sizeof(float));
                kinds[t].building[k][3] = p->building[k].scale;
                memcpy(kinds[t].rotation[k], p->building[k].rotation, 4 * sizeof(float));
            }
            kinds[t].first = (uint32_t)words;
            kinds[t].stride = b->stride;
            kinds[t].quads = (uint32_t)quads;
            kinds[t].leaves = (uint32_t)p->leaf_count;
            f->first_index[t] = (int)(4 * quads);
            for (int q = 0; q < p->quad_count; q++, quads++) {
                for (int k = 0; k < 4; k++)
                    corners[4 * quads + (size_t)k] = (uint16_t)(vertices + p->quads[q].corners[k]);
                looks[quads] = p->quads[q].tile_class + 256u * p->quads[q].band;
            }
            memcpy(all + vertices, p->vertices, (size_t)p->vertex_count * sizeof *all);
            vertices += (size_t)p->vertex_count;
            if (size) memcpy(records + words, b->words, size * sizeof *records);
            words += size;
        }
        glBindBuffer(GL_ARRAY_BUFFER, f->vertices);
        glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)(vertices * sizeof *all), all, GL_STATIC_DRAW);
        glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, f->indices);
        glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)(4 * quads * sizeof *corners), corners,
                     GL_STATIC_DRAW);
        const GLsizei size = (GLsizei)sizeof *all;
        glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, size, NULL);
        glVertexAttribIPointer(1, 1, GL_INT, size, at_offset(offsetof(treepieces_vertex, rim)));
        glVertexAttribPointer(2, 3, GL_FLOAT, GL_FALSE, size,
                              at_offset(offsetof(treepieces_vertex, normal)));
        glVertexAttribPointer(3, 4, GL_FLOAT, GL_FALSE, size,
                              at_offset(offsetof(treepieces_vertex, weights)));
        for (GLuint i = 0; i < 4; i++) glEnableVertexAttribArray(i);
        fill_buffer(f, KINDS, kinds, sizeof kinds);
        fill_buffer(f, QUADS, looks, quads * sizeof *looks);
        fill_buffer(f, RECORDS, records, words * sizeof *records);
    }
    free(all);
    free(corners);
    free(looks);
    free(records);
    return !f->failed[0];
}

/* Data per node and per cluster, and the cards of the leaf clouds. */
int upload_trees(forest_gl *f) {
    const treepieces_forest *forest = f->forest;
    uint32_t *looks = (uint32_t *)allocate(f, forest->node_count, sizeof *looks);
    card_data *cards = (card_data *)allocate(f, (size_t)f->species_count * CLOUDS * 256, sizeof *cards);
    treepieces_card made[256];
    if (looks && cards) {
        for (int t = 0; t < forest->tree_count; t++) {
            const treepieces_tree *tree = &forest->trees[t];
            const uint32_t look = (uint32_t)tree->species |
                                  (uint32_t)f->species[tree->species].bark_kind << 4 |
                                  ((uint32_t)txm_hash(tree->seed + (uint64_t)t) & 0xffffffu) << 8;
            for (uint32_t i = 0; i < tree->node_count; i++) looks[tree->first_node + i] = look;
        }
        for (int i = 0; i < f->species_count * CLOUDS; i++) {
            const int s = i / CLOUDS;
            const int count = treepieces_cloud(&f->species[s], (uint32_t)(i % CLOUDS), made);
            f->first_cards[i] = f->card_count;
            for (int k = 0; k < count; k++) {
                card_data *card = &cards[f->card_count++];
                memcpy(card->center, made[k].center, sizeof made[k].center);
                memcpy(card->right, made[k].right, sizeof made[k].right);
                memcpy(card->up, made[k].up, sizeof made[k].up);
                memcpy(card->normal, made[k].normal, sizeof made[k].normal);
                card->center[3] = (float)i;
                card->right[3] = (float)s;
            }
        }
        f->first_cards[f->species_count * CLOUDS] = f->card_count;
        fill_buffer(f, LOOKS, looks, forest->node_count * sizeof *looks);
        fill_buffer(f, CARDS, cards, (size_t)f->card_count * sizeof *cards);
        fill_buffer(f, CLUSTERS, forest->clusters, forest->cluster_count * sizeof *forest->clusters);
    }
    free(looks);
    free(cards);
    return !f->failed[0];
}

void upload_bones(forest_gl *f) {
    fill_buffer(f, BONES, f->bones, f->forest->node_count * TREEPIECES_BONE * sizeof(float));
}

/* List the cards of the clusters near the camera: number of the cluster, number of the card. Returns
   how many there are; those beyond MOST are left out, their impostors are as good. */
int upload_near(forest_gl *f) {
    enum { MOST = 1 << 17 };
    const treepieces_forest *forest = f->forest;
    int count = 0;
    uint32_t *list = NULL;
    for (int t = 0; t < forest->tree_count && f->o.cards > 0; t++) {
        const treepieces_tree *tree = &forest->trees[t];
        for (uint32_t i = 0; i < tree->cluster_count; i++) {
            const uint32_t number = tree->first_cluster + i;
            const treepieces_cluster *c = &forest->clusters[number];
            const int cloud = tree->species * CLOUDS + (int)(c->look % CLOUDS);
            float p[3];
            axis_point(f, c->node, c->along, p);
            for (int k = 0; k < 3; k++) p[k] -= f->frame.eye[k];
            if (dot(p, p) > f->o.cards * f->o.cards) continue;
            if (!list) list = (uint32_t *)allocate(f, MOST, 2 * sizeof *list);
            for (int k = f->first_cards[cloud]; k < f->first_cards[cloud + 1] && list && count < MOST; k++) {
                list[2 * count] = number;
                list[2 * count++ + 1] = (uint32_t)k;
            }
        }
    }
    if (count) fill_buffer(f, NEAR, list, (size_t)count * 2 * sizeof *list);
    free(list);
    return count;
}

/* An array texture. */
static void make_array(forest_gl *f, int number, GLenum format, int width, int height, int layers,
                       GLenum filter) {
    const int is_depth = format == GL_DEPTH_COMPONENT24;
    glActiveTexture(GL_TEXTURE0 + (GLenum)number);
    glBindTexture(GL_TEXTURE_2D_ARRAY, f->textures[number]);
    glTexImage3D(GL_TEXTURE_2D_ARRAY, 0, (GLint)format, width, height, layers, 0,
                 is_depth ? GL_DEPTH_COMPONENT : format == GL_R32F ? GL_RED : GL_RGBA,
                 is_depth ? GL_UNSIGNED_INT : format == GL_R32F ? GL_FLOAT : GL_UNSIGNED_BYTE, NULL);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, (GLint)filter);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER,
                    filter == GL_NEAREST ? GL_NEAREST : GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_S,
                    number == BARK ? GL_REPEAT : GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
}

static int upload_pictures(forest_gl *f) {
    const int n = f->species_count, side = f->sheets[0].width;
    const int width = f->leaves[0].width, height = f->leaves[0].height;
    make_array(f, BARK, GL_SRGB8_ALPHA8, side, side, n * TREEPIECES_OWN, GL_LINEAR_MIPMAP_LINEAR);
    glTexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAX_LEVEL, 6);
    for (int s = 0; s < n; s++)
        glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, s * TREEPIECES_OWN, side, side, TREEPIECES_OWN,
                        GL_RGB, GL_UNSIGNED_BYTE, f->sheets[s].pixels);
    glGenerateMipmap(GL_TEXTURE_2D_ARRAY);
    make_array(f, LEAVES, GL_RGBA8, width, height, n, GL_LINEAR_MIPMAP_LINEAR);
    for (int s = 0; s < n; s++)
        glTexSubImage3D(GL_TEXTURE_2D_ARRAY, 0, 0, 0, s, width, height, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                        f->leaves[s].pixels);
    glGenerateMipmap(GL_TEXTURE_2D_ARRAY);

    /* the impostors, and the frame buffer that renders them */
    const GLenum targets[2] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    make_array(f, IMPOSTORS, GL_RGBA8, CLOUD_SIDE, CLOUD_SIDE, n * CLOUDS, GL_LINEAR_MIPMAP_LINEAR);
    make_array(f, DEPTHS, GL_R32F, CLOUD_SIDE, CLOUD_SIDE, n * CLOUDS, GL_NEAREST);
    make_array(f, CARD_DEPTHS, GL_DEPTH_COMPONENT24, CLOUD_SIDE, CLOUD_SIDE, n * CLOUDS, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, f->card_frame);
    glFramebufferTexture(GL_FRAMEBUFFER, targets[0], f->textures[IMPOSTORS], 0);
    glFramebufferTexture(GL_FRAMEBUFFER, targets[1], f->textures[DEPTHS], 0);
    glFramebufferTexture(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, f->textures[CARD_DEPTHS], 0);
    glDrawBuffers(2, targets);
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
        return fail(f, "this OpenGL cannot render into array textures");
    return 1;
}

/* The picture of shadows, all lit until draw_shadows draws it. */
static void make_shadow_map(forest_gl *f) {
    static const float far = 1;
    glActiveTexture(GL_TEXTURE0 + SHADOWS);
    glBindTexture(GL_TEXTURE_2D, f->textures[SHADOWS]);
    glTexStorage2D(GL_TEXTURE_2D, 1, GL_DEPTH_COMPONENT24, SHADOW_SIDE, SHADOW_SIDE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glBindFramebuffer(GL_FRAMEBUFFER, f->shadow_frame);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, f->textures[SHADOWS], 0);
    glDrawBuffer(GL_NONE);
    glReadBuffer(GL_NONE);
    glClearBufferfv(GL_DEPTH, 0, &far);
}

static void create_objects(forest_gl *f) {
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glGenBuffers(BUFFERS, f->buffers);
    glGenBuffers(1, &f->block);
    glGenBuffers(1, &f->vertices);
    glGenBuffers(1, &f->indices);
    glGenTextures(TEXTURES, f->textures);
    glGenFramebuffers(1, &f->card_frame);
    glGenFramebuffers(1, &f->shadow_frame);
    glGenVertexArrays(1, &f->array);
    glBindVertexArray(f->array);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, f->block);
}

/* All OpenGL objects, filled; program: argv[0]. */
int upload_scene(forest_gl *f, const char *program) {
    create_objects(f);
    make_shadow_map(f);
    return make_programs(f, program) && upload_pieces(f) && upload_trees(f) && upload_pictures(f) &&
           make_light(f);
}
