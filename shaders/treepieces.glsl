/* treepieces.glsl - the trees of treepieces.h on the GPU
   SPDX-License-Identifier: MIT OR Unlicense

   WHAT IT DOES
     Skins pieces as treepieces_skin does, computes levels of tessellation and points of patches as
     treepieces_edge_level and treepieces_patch_point do, texture coordinates of bark as
     treepieces_quad_uv does, and the depth of leaf clouds. GLSL 4.30, no extensions.
     examples/forest_gl draws forests with it; its own shaders are in forest.glsl.

   HOW TO USE IT
     Paste it after #version into the stages that need it. It reads buffers that hold the arrays of
     treepieces.h unchanged. To use another binding, define its name before:

       TREEPIECES_BONES    0   vec4[3] per node: the output of treepieces_bones or treepieces_sway
       TREEPIECES_RECORDS  1   the words of all batches, one after the other
       TREEPIECES_KINDS    2   a treepieces_kind for each type of piece
       TREEPIECES_QUADS    3   a word per quad, type after type: tile_class + 256 band

     A type of piece is one instanced draw call of GL_PATCHES of 4 vertices: the vertices of treepieces_piece
     as attributes, the corners of its quads as indices. gl_InstanceID is the number of the record
     and, in the control shader, gl_PrimitiveID that of the quad. Vertex shader:

       treepieces_instance it = treepieces_find(kind, gl_InstanceID);
       treepieces_skin(kind, it, rim, position, normal, weights, world, world_normal);

     Tessellation control shader, with layout(vertices = 4), in invocation 0. Side k goes from corner k
     to corner k + 1; OpenGL numbers the sides differently:

       gl_TessLevelOuter[0] = treepieces_edge_level(lod, corner 0, corner 1);
       gl_TessLevelOuter[3] = treepieces_edge_level(lod, corner 1, corner 2);
       gl_TessLevelOuter[2] = treepieces_edge_level(lod, corner 2, corner 3);
       gl_TessLevelOuter[1] = treepieces_edge_level(lod, corner 3, corner 0);
       gl_TessLevelInner[0] = gl_TessLevelInner[1] = treepieces_inner_level(lod, corners);

     Tessellation evaluation shader, with layout(quads, equal_spacing, cw): as v points down, this
     gives triangles that are counter-clockwise seen from outside:

       treepieces_patch_point(positions, normals, shape, gl_TessCoord.xy, world, world_normal);

     Fragment shader: the texture is the sheet of treepieces_bark as an array texture whose layers are
     8 tiles high; GL_REPEAT horizontally, GL_CLAMP_TO_EDGE vertically.

   NO CRACKS
     A leaf rim and the root rim of the child on it, and the two patches that share an edge, compute
     the same numbers by the same instructions, all `precise`: they are equal to the bit.                           */

#ifndef TREEPIECES_BONES
#define TREEPIECES_BONES 0
#endif
#ifndef TREEPIECES_RECORDS
#define TREEPIECES_RECORDS 1
#endif
#ifndef TREEPIECES_KINDS
#define TREEPIECES_KINDS 2
#endif
#ifndef TREEPIECES_QUADS
#define TREEPIECES_QUADS 3
#endif

/* A type of piece. */
struct treepieces_kind {
    vec4 building[3]; /* of the leaf rims: translation, scale            */
    vec4 rotation[3]; /* unit quaternions                                */
    uint first;       /* word of its first record                        */
    uint stride;      /* words of a record                               */
    uint quads;       /* its first word in treepieces_quads              */
    uint leaves;      /* how many leaf rims                              */
};

layout(std430, binding = TREEPIECES_BONES) readonly buffer treepieces_bone_buffer {
    vec4 treepieces_bones[];
};
layout(std430, binding = TREEPIECES_RECORDS) readonly buffer treepieces_record_buffer {
    uint treepieces_records[];
};
layout(std430, binding = TREEPIECES_KINDS) readonly buffer treepieces_kind_buffer {
    treepieces_kind treepieces_kinds[];
};
layout(std430, binding = TREEPIECES_QUADS) readonly buffer treepieces_quad_buffer {
    uint treepieces_quads[];
};

/* ---- skinning ---- */

/* The contents of a record. */
struct treepieces_instance {
    uint own;       /* bone */
    uvec3 children; /* bones at leaf rims 0, 1, 2 */
    ivec3 turns;
};

treepieces_instance treepieces_find(int kind, int instance) {
    uint at = treepieces_kinds[kind].first + uint(instance) * treepieces_kinds[kind].stride;
    uint own = treepieces_records[at], near = treepieces_records[at + 1u];
    uint far = treepieces_records[at + 2u];
    return treepieces_instance(own, own + uvec3(near & 0xffffu, near >> 16, far & 0xffffu),
                               ivec3(far >> 16 & 15u, far >> 20 & 15u, far >> 24 & 15u));
}

/* Place 0..5 of the canonical rim; the constants are bit for bit those of treepieces.h. */
void treepieces_rim_vertex(int place, out vec3 position, out vec3 normal) {
    const float high = uintBitsToFloat(0x3f5db3d7u); /* sin 60  */
    const float outwards = uintBitsToFloat(0x3f7ebac2u), up = uintBitsToFloat(0x3dcbc89bu);
    const float cosines[6] = float[6](1.0, 0.5, -0.5, -1.0, -0.5, 0.5);
    const float sines[6] = float[6](0.0, high, high, 0.0, -high, -high);
    position = vec3(cosines[place], 0.0, -sines[place]);
    normal = vec3(outwards * cosines[place], up, -outwards * sines[place]);
}

vec3 treepieces_move_point(uint bone, vec3 p) {
    precise vec3 moved;
    for (uint k = 0u; k < 3u; k++) {
        vec4 row = treepieces_bones[3u * bone + k];
        moved[k] = ((row.x * p.x + row.y * p.y) + row.z * p.z) + row.w;
    }
    return moved;
}

/* squares of the lengths of a bone's columns */
vec3 treepieces_columns(uint bone) {
    vec3 a = treepieces_bones[3u * bone].xyz, b = treepieces_bones[3u * bone + 1u].xyz;
    vec3 c = treepieces_bones[3u * bone + 2u].xyz;
    precise vec3 squares = (a * a + b * b) + c * c;
    return squares;
}

/* n by the inverse transpose; as the columns are orthogonal, they are divided by their squares */
vec3 treepieces_move_normal(uint bone, vec3 n) {
    precise vec3 m = n / treepieces_columns(bone);
    precise vec3 moved;
    for (uint k = 0u; k < 3u; k++) {
        vec4 row = treepieces_bones[3u * bone + k];
        moved[k] = (row.x * m.x + row.y * m.y) + row.z * m.z;
    }
    return moved;
}

vec3 treepieces_unit(vec3 n) {
    precise float square = (n.x * n.x + n.y * n.y) + n.z * n.z;
    precise vec3 unit = n / sqrt(square);
    return unit;
}

vec3 treepieces_rotate(vec4 q, vec3 v) {
    vec3 t = 2.0 * cross(q.xyz, v);
    return v + q.w * t + cross(q.xyz, t);
}

/* v rotated about y by -60 degrees times turn */
vec3 treepieces_turn_back(int turn, vec3 v) {
    vec3 x, unused;
    treepieces_rim_vertex((6 - turn) % 6, x, unused);
    return vec3(x.x * v.x - x.z * v.z, v.y, x.x * v.z + x.z * v.x);
}

/* A vertex of a piece in the world; see treepieces_skin in treepieces.h. */
void treepieces_skin(int kind, treepieces_instance it, int rim, vec3 position, vec3 normal,
                     vec4 weights, out vec3 world, out vec3 world_normal) {
    /* a rim belongs to one bone; leaf rims are computed in the frame of the child, by the same
       instructions as the child's root rim */
    uint bone = it.own;
    vec3 p = position, n = normal;
    if (rim >= 0) {
        bone = it.children[rim / 6];
        treepieces_rim_vertex((rim + 6 - it.turns[rim / 6]) % 6, p, n);
    }
    precise vec3 at = treepieces_move_point(bone, p);
    precise vec3 up = treepieces_move_normal(bone, n);
    if (rim < 0 && weights.x < 1.0) {
        vec3 own = treepieces_columns(it.own);
        at *= weights.x;
        up *= weights.x * sqrt(own.x);
        for (int k = 0; k < int(treepieces_kinds[kind].leaves); k++) {
            vec4 building = treepieces_kinds[kind].building[k];
            vec4 back = treepieces_kinds[kind].rotation[k] * vec4(-1.0, -1.0, -1.0, 1.0);
            uint child = it.children[k];
            vec3 squares = treepieces_columns(child);
            float stretch = sqrt(squares.x * own.y / (own.x * squares.y)), w = weights[1 + k];
            vec3 q = treepieces_rotate(back, (position - building.xyz) / building.w);
            vec3 m = treepieces_rotate(back, normal);
            q = treepieces_turn_back(it.turns[k], q);
            m = treepieces_turn_back(it.turns[k], m);
            q.y *= stretch;
            m.y /= stretch;
            at += w * treepieces_move_point(child, q);
            up += w * sqrt(squares.x) * treepieces_move_normal(child, m);
        }
    }
    world = at;
    world_normal = treepieces_unit(up);
}

/* ---- level of detail ---- */

struct treepieces_lod {
    vec3 eye;
    float max_level, half_distance;
};

float treepieces_level(treepieces_lod lod, vec3 middle) {
    precise vec3 way = middle - lod.eye;
    precise float square = (way.x * way.x + way.y * way.y) + way.z * way.z;
    precise float level = lod.max_level * exp2(-min(sqrt(square) / lod.half_distance, 100.0));
    return clamp(ceil(level), 1.0, max(ceil(lod.max_level), 1.0)); /* exp2 may round up */
}

/* symmetric in a and b */
float treepieces_edge_level(treepieces_lod lod, vec3 a, vec3 b) {
    precise vec3 middle = (a + b) / 2.0;
    return treepieces_level(lod, middle);
}

float treepieces_inner_level(treepieces_lod lod, vec3 a, vec3 b, vec3 c, vec3 d) {
    precise vec3 middle = ((a + b) + (c + d)) / 4.0;
    return treepieces_level(lod, middle);
}

/* Is a quad outside the view frustum, even if it bulges by half its size? */
bool treepieces_is_outside(mat4 view_projection, vec3 a, vec3 b, vec3 c, vec3 d) {
    vec3 middle = (a + b + c + d) / 4.0;
    vec3 sizes = max(max(abs(a - middle), abs(b - middle)), max(abs(c - middle), abs(d - middle)));
    float radius = 1.5 * length(sizes);
    mat4 rows = transpose(view_projection);
    for (int k = 0; k < 3; k++) {
        for (float side = -1.0; side < 2.0; side += 2.0) {
            vec4 plane = rows[3] + side * rows[k];
            if (dot(plane.xyz, middle) + plane.w < -radius * length(plane.xyz)) return true;
        }
    }
    return false;
}

/* Along a side at most two weights are not 0, so the result does not depend on the order of corners. */
vec3 treepieces_mix(vec4 w, vec3 a, vec3 b, vec3 c, vec3 d) {
    precise vec3 sum = (w.x * a + w.z * c) + (w.y * b + w.w * d);
    return sum;
}

vec4 treepieces_corner_weights(vec2 at) {
    precise vec2 back = 1.0 - at;
    precise vec4 w = vec4(back.x * back.y, back.x * at.y, at.x * at.y, at.x * back.y);
    return w;
}

/* (n . (p - corner)) n: p minus this is its projection onto the tangent plane of the corner */
vec3 treepieces_above(vec3 p, vec3 corner, vec3 n) {
    precise vec3 way = p - corner;
    precise vec3 above = ((n.x * way.x + n.y * way.y) + n.z * way.z) * n;
    return above;
}

/* Phong tessellation; shape 0 (flat) to 1. */
void treepieces_patch_point(vec3 p[4], vec3 n[4], float shape, vec2 at, out vec3 position,
                            out vec3 normal) {
    precise vec4 w = treepieces_corner_weights(at);
    precise vec3 flat_point = treepieces_mix(w, p[0], p[1], p[2], p[3]);
    precise vec3 above = treepieces_mix(
        w, treepieces_above(flat_point, p[0], n[0]), treepieces_above(flat_point, p[1], n[1]),
        treepieces_above(flat_point, p[2], n[2]), treepieces_above(flat_point, p[3], n[3]));
    precise vec3 moved = flat_point - shape * above;
    position = moved;
    normal = treepieces_unit(treepieces_mix(w, n[0], n[1], n[2], n[3]));
}

/* ---- bark ---- */

/* The tiles of a quad: u v of its corner 0, then of its corner 2, in a layer of the sheet. */
struct treepieces_tile {
    vec4 box;
    int layer;
};

/* pixels: width of the sheet; texture coordinates keep half a pixel inside. */
treepieces_tile treepieces_find_tile(int kind, int instance, int quad, float pixels) {
    uint at = treepieces_kinds[kind].first + uint(instance) * treepieces_kinds[kind].stride;
    uint word = treepieces_quads[treepieces_kinds[kind].quads + uint(quad)];
    uint cell = treepieces_records[at + 4u + uint(quad) / 4u] >> (8 * (quad & 3)) & 255u;
    uint band = treepieces_records[at + 3u] >> (8u * (word >> 8)) & 255u;
    int layer = int(word & 255u);
    vec2 first = vec2(cell & 7u, cell >> 3), size = vec2(1u << (band & 7u), 1u << (band >> 3 & 3u));
    if (layer >= 5) { /* an own class: a tile in the middle of 2 x 2 cells */
        first += 0.5;
        size = vec2(1.0);
    } else if (layer == 0 && (band & 32u) != 0u) {
        layer = 4;
    }
    vec4 box = vec4(first, first + size) / 8.0;
    return treepieces_tile(box + vec4(0.0, 0.5, 0.0, -0.5) / pixels, layer);
}

vec2 treepieces_tile_at(treepieces_tile tile, vec2 at) {
    return mix(tile.box.xy, tile.box.zw, at);
}

/* ---- leaf clouds ---- */

/* gl_FragDepth of a point of an impostor. center, radius: of the cloud; at.xy: -1..1 along right and up;
   at.z: from the depth picture of treepieces_impostor. */
float treepieces_impostor_depth(mat4 view_projection, vec3 center, float radius, mat3 view, vec3 at) {
    vec4 clip = view_projection * vec4(center + radius * (view * vec3(at.xy, -at.z)), 1.0);
    return 0.5 + 0.5 * clip.z / clip.w;
}
