/* forest.glsl - the shaders of examples/forest_gl
   SPDX-License-Identifier: MIT OR Unlicense

   Each stage is compiled from "#version 430 core", a define that chooses it, treepieces.glsl and this
   file:

     PIECE_VERTEX, PIECE_CONTROL, PIECE_EVALUATION, PIECE_WIRE (only with --wire), PIECE_FRAGMENT
                       an instanced draw call for each type of piece: skinning, tessellation, lighting
     CARD_VERTEX, CARD_GEOMETRY, CARD_FRAGMENT
                       the impostors: every leaf cloud along the view direction, each into its layer
     CLOUD_VERTEX, CLOUD_FRAGMENT
                       one instanced draw call for all clusters of leaves, with the impostors' depth
     NEAR_VERTEX, NEAR_FRAGMENT
                       the cards themselves of the clusters near the camera
     SHADOW_FRAGMENT   pieces in the picture of shadows; clusters: CLOUD_FRAGMENT with SHADOW defined
     LAND_VERTEX, LAND_FRAGMENT
                       ground and sky: one triangle that covers the picture                      */

layout(std140, binding = 0) uniform frame_block {
    mat4 view_projection;
    mat4 sun_projection; /* of the picture of shadows */
    vec4 eye;     /* w: up to this distance leaves are cards, metres */
    vec4 right;   /* w: tangent of half the horizontal field of view */
    vec4 up;      /* w: the same, vertical */
    vec4 forward; /* w: number of leaf clouds of a species */
    vec4 sun;     /* unit vector towards it */
    vec4 box_low; /* lower corner of the texture of light; w: size of its cells */
    vec4 box_scale; /* 1 / its size; w: density of the fog, 1 / m */
    vec4 lod;     /* maximum level, half distance, shape of Phong tessellation, pixels of the sheet */
    vec4 shimmer; /* of leaves: two phases in turns, strength 0 to 1 */
} frame;

/* a word per node: bits 0 to 3 the species, 4 to 7 its kind of bark, above a random number per tree */
layout(std430, binding = 4) readonly buffer look_buffer { uint looks[]; };
/* treepieces_cluster: node, along, radius, look; floats as their bits */
layout(std430, binding = 5) readonly buffer cluster_buffer { uvec4 clusters[]; };

layout(binding = 0) uniform sampler2DArray bark;
layout(binding = 1) uniform sampler2DArray leaves;
layout(binding = 2) uniform sampler2DArray impostors;
layout(binding = 3) uniform sampler2DArray depths;
layout(binding = 4) uniform sampler3D light; /* that reaches a place: from the sun, from the sky */
layout(binding = 6) uniform sampler2D shadows; /* depth of what the sun sees */

uniform int kind;

/* ---- light, for all fragment shaders ---- */

const vec3 sun_color = vec3(1.0, 0.86, 0.66) * 3.3;
const vec3 sky_color = vec3(0.50, 0.66, 1.0) * 0.72;
const vec3 land_color = vec3(0.25, 0.26, 0.12);

float hash(vec2 at) {
    uvec2 p = uvec2(ivec2(floor(at)));
    uint h = p.x * 0x9e3779b9u ^ p.y * 0x85ebca6bu;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return float((h ^ h >> 15) & 0xffffu) / 65535.0;
}

vec2 light_at(vec3 place) {
    vec2 open = texture(light, (place - frame.box_low.xyz) * frame.box_scale.xyz).rg;
    return max(open, vec2(0.03, 0.2)); /* indirect light */
}

#if defined(PIECE_FRAGMENT) || defined(CLOUD_FRAGMENT) || defined(NEAR_FRAGMENT) || defined(LAND_FRAGMENT)
/* How much of the sun is visible from a place, 0..1, by the picture of shadows. Shadows are the softer
   the further away what casts them is: `least` to `most` metres. bias: metres that do not shade. */
float sun_at(vec3 place, float bias, float least, float most) {
    vec3 at = (frame.sun_projection * vec4(place, 1.0)).xyz * 0.5 + 0.5;
    mat3 rows = transpose(mat3(frame.sun_projection)) * 0.5; /* pictures per metre */
    vec2 size = vec2(length(rows[0]), length(rows[1]));
    float deep = length(rows[2]), above = 0.0, count = 0.0;
    float turn = 6.283 * fract(52.983 * fract(dot(gl_FragCoord.xy, vec2(0.06711, 0.00584))));
    if (any(greaterThan(abs(at.xy - 0.5), vec2(0.5)))) return 1.0;
    at.z = min(at.z - bias * deep, 1.0);
    float soft = least, taps = 6.0, lit = 0.0;
    if (least < most) { /* how far away is what casts shadows here? */
        for (float k = 0.0; k < 6.0; k++) {
            float angle = turn + 2.4 * k, far = most * sqrt((k + 0.5) / 6.0);
            float depth = textureLod(shadows, at.xy + far * size * vec2(cos(angle), sin(angle)), 0.0).r;
            if (depth < at.z) {
                above += at.z - depth;
                count++;
            }
        }
        if (count == 0.0) return 1.0;
        soft = clamp(0.012 * above / (count * deep), least, most);
        taps = 12.0;
    }
    for (float k = 0.0; k < taps; k++) {
        float angle = turn + 2.4 * k, far = soft * sqrt((k + 0.5) / taps);
        lit += float(textureLod(shadows, at.xy + far * size * vec2(cos(angle), sin(angle)), 0.0).r >= at.z);
    }
    return lit / taps;
}
#endif

vec3 sky_towards(vec3 way) {
    float height = max(way.y, 0.0), glow = max(dot(way, frame.sun.xyz), 0.0);
    vec3 zenith = vec3(0.07, 0.20, 0.55), horizon = vec3(0.60, 0.74, 0.88);
    vec3 color = mix(horizon, zenith, 1.0 - exp(-4.0 * height));
    return color + vec3(1.0, 0.8, 0.5) * (0.10 * pow(glow, 6.0) + 0.25 * pow(glow, 48.0));
}

/* from radiance to a colour of the picture: fog, a filmic tone curve, sRGB */
vec4 seen(vec3 color, vec3 place) {
    vec3 way = place - frame.eye.xyz;
    float clear = exp(-frame.box_scale.w * length(way));
    color = mix(sky_towards(normalize(vec3(way.x, 0.0, way.z))), color, clear);
    color *= 0.82;
    color = color * (2.51 * color + 0.03) / (color * (2.43 * color + 0.59) + 0.14);
    return vec4(pow(clamp(color, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}

float noise(vec2 at) {
    vec2 f = fract(at), t = f * f * (3.0 - 2.0 * f);
    return mix(mix(hash(at), hash(at + vec2(1, 0)), t.x),
               mix(hash(at + vec2(0, 1)), hash(at + vec2(1, 1)), t.x), t.y);
}

/* ---- pieces ---- */

#ifdef PIECE_VERTEX
layout(location = 0) in vec3 position;
layout(location = 1) in int rim;
layout(location = 2) in vec3 normal;
layout(location = 3) in vec4 weights;
out vec3 vertex_place, vertex_normal;
out int vertex_instance;
out float vertex_radius; /* of the stem */

void main() {
    treepieces_instance it = treepieces_find(kind, gl_InstanceID);
    treepieces_skin(kind, it, rim, position, normal, weights, vertex_place, vertex_normal);
    vertex_instance = gl_InstanceID;
    vertex_radius = sqrt(treepieces_columns(rim < 0 ? it.own : it.children[rim / 6]).x);
}
#endif

#ifdef PIECE_CONTROL
layout(vertices = 4) out;
in vec3 vertex_place[], vertex_normal[];
in int vertex_instance[];
in float vertex_radius[];
out vec3 corner_place[], corner_normal[];
out float corner_radius[];
patch out vec4 tile_box;
patch out int tile_layer, tile_kind, patch_instance, patch_quad;
patch out float patch_level;

void main() {
    corner_place[gl_InvocationID] = vertex_place[gl_InvocationID];
    corner_normal[gl_InvocationID] = vertex_normal[gl_InvocationID];
    corner_radius[gl_InvocationID] = vertex_radius[gl_InvocationID];
    if (gl_InvocationID == 0) {
        treepieces_lod lod = treepieces_lod(frame.eye.xyz, frame.lod.x, frame.lod.y);
        vec3 a = vertex_place[0], b = vertex_place[1], c = vertex_place[2], d = vertex_place[3];
        bool is_outside = treepieces_is_outside(frame.view_projection, a, b, c, d);
        gl_TessLevelOuter[0] = is_outside ? 0.0 : treepieces_edge_level(lod, a, b);
        gl_TessLevelOuter[1] = is_outside ? 0.0 : treepieces_edge_level(lod, d, a);
        gl_TessLevelOuter[2] = is_outside ? 0.0 : treepieces_edge_level(lod, c, d);
        gl_TessLevelOuter[3] = is_outside ? 0.0 : treepieces_edge_level(lod, b, c);
        patch_level = treepieces_inner_level(lod, a, b, c, d);
        gl_TessLevelInner[0] = gl_TessLevelInner[1] = patch_level;
        treepieces_tile tile =
            treepieces_find_tile(kind, vertex_instance[0], gl_PrimitiveID, frame.lod.w);
        uint own = treepieces_records[treepieces_kinds[kind].first +
                                      uint(vertex_instance[0]) * treepieces_kinds[kind].stride];
        tile_box = tile.box;
        tile_layer = tile.layer + 5 * int(looks[own] & 15u); /* a sheet has 5 layers */
        tile_kind = int(looks[own] >> 4 & 15u);
        patch_instance = vertex_instance[0];
        patch_quad = gl_PrimitiveID;
    }
}
#endif

#ifdef PIECE_EVALUATION
layout(quads, equal_spacing, cw) in;
in vec3 corner_place[], corner_normal[];
in float corner_radius[];
patch in vec4 tile_box;
patch in int tile_layer, tile_kind, patch_instance, patch_quad;
patch in float patch_level;
precise out vec3 place, normal;
out vec2 tile_at, stem; /* stem: its radius, metres; kind of bark */
flat out int layer;
flat out float level;
#ifdef FEEDBACK
flat out int instance, quad;
out vec2 patch_at;
#endif

void main() {
    vec3 p[4] = vec3[4](corner_place[0], corner_place[1], corner_place[2], corner_place[3]);
    vec3 n[4] = vec3[4](corner_normal[0], corner_normal[1], corner_normal[2], corner_normal[3]);
    treepieces_patch_point(p, n, frame.lod.z, gl_TessCoord.xy, place, normal);
    gl_Position = frame.view_projection * vec4(place, 1.0);
    vec2 t = gl_TessCoord.xy;
    tile_at = mix(tile_box.xy, tile_box.zw, t);
    stem.x = mix(mix(corner_radius[0], corner_radius[3], t.x), mix(corner_radius[1], corner_radius[2], t.x), t.y);
    stem.y = float(tile_kind);
    layer = tile_layer;
    level = patch_level;
#ifdef FEEDBACK
    instance = patch_instance;
    quad = patch_quad;
    patch_at = gl_TessCoord.xy;
#endif
}
#endif

#ifdef PIECE_WIRE
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
in vec3 place[], normal[];
in vec2 tile_at[], stem[];
flat in int layer[];
flat in float level[];
out vec3 wire_place, wire_normal, wire_corner;
out vec2 wire_tile_at, wire_stem;
flat out int wire_layer;
flat out float wire_level;

void main() {
    for (int k = 0; k < 3; k++) {
        gl_Position = gl_in[k].gl_Position;
        wire_place = place[k];
        wire_normal = normal[k];
        wire_tile_at = tile_at[k];
        wire_stem = stem[k];
        wire_layer = layer[k];
        wire_level = level[k];
        wire_corner = vec3(k == 0, k == 1, k == 2);
        EmitVertex();
    }
}
#endif

#ifdef PIECE_FRAGMENT
#ifdef WIRE
#define place wire_place
#define normal wire_normal
#define tile_at wire_tile_at
#define stem wire_stem
#define layer wire_layer
#define level wire_level
in vec3 wire_corner;
#endif
in vec3 place, normal;
in vec2 tile_at, stem;
flat in int layer;
flat in float level;
out vec4 color;

/* What a tile is too small for: furrows and plates of thick stems, as a height; blotches, dark ones on the
   pale bark of birches; young bark, which is darker and browner; dirt near the ground. */
vec4 aged(vec3 at, float radius, int kind, float pale) {
    float young = 1.0 - smoothstep(0.012, 0.05, radius), light = smoothstep(0.3, 0.5, pale);
    vec3 far = vec3(at.x + at.z, at.y, at.x - at.z); /* two planes along the stem */
    float blotch = noise(far.xy / vec2(0.5, 0.35)) * 0.6 + noise(far.zy / vec2(0.13, 0.07) + 31.0) * 0.4;
    vec3 color = vec3(0.8 + 0.4 * blotch);
    float height = 0.0;
    float thick = smoothstep(0.03, 0.09, radius); /* thin ones move in the wind, through the noise */
    if (kind == 0 || kind == 3) {
        vec2 size = clamp(radius, 0.03, 0.4) * (kind == 0 ? vec2(0.22, 1.1) : vec2(0.32, 0.7));
        float one = abs(noise(far.xy / size + 2.0 * blotch) - 0.5);
        float two = abs(noise(far.zy / size + 2.0 * blotch + 17.0) - 0.5);
        float furrow = thick * (1.0 - smoothstep(0.0, kind == 0 ? 0.16 : 0.09, min(one, two)));
        height = -furrow;
        color *= 1.0 - (kind == 0 ? 0.55 : 0.4) * furrow;
        /* the plates of old pines are grey */
        if (kind == 3) color = mix(color, color * vec3(0.62, 0.80, 1.0), smoothstep(0.10, 0.2, radius));
    } else if (kind == 2) {
        float scar = light * smoothstep(0.60, 0.68, noise(far.xy / vec2(0.11, 0.045) + 7.0) * 0.5 +
                                                       noise(far.zy / vec2(0.3, 0.22) + 3.0) * 0.5);
        scar = max(scar, light * 0.8 * smoothstep(1.2, 0.1, at.y + 1.6 * blotch - 0.6));
        color = mix(color, vec3(0.06), 0.92 * scar);
    }
    color *= mix(vec3(1.0), vec3(0.55, 0.44, 0.36) * mix(1.0, 0.35, light), young);
    return vec4(color * mix(0.75, 1.0, smoothstep(0.0, 0.8, at.y)), height);
}

void main() {
    vec3 n = normalize(normal), albedo = texture(bark, vec3(tile_at, layer)).rgb;
    /* bump mapping: the brightness of the bark as height, a tenth of a tile deep */
    float height = sqrt(dot(albedo, vec3(0.3, 0.6, 0.1)));
    float pale = dot(textureLod(bark, vec3(0.5, 0.5, layer), 6.0).rgb, vec3(0.3, 0.6, 0.1));
    vec4 old = aged(place, stem.x, int(stem.y + 0.5), pale);
    albedo *= old.rgb;
    height += 0.7 * old.w;
    vec3 across = dFdx(place), along = dFdy(place), a = cross(along, n), b = cross(n, across);
    vec2 tile_across = dFdx(tile_at), tile_along = dFdy(tile_at);
    float area = dot(across, a);
    float tile_area = 64.0 * abs(tile_across.x * tile_along.y - tile_across.y * tile_along.x);
    vec3 slope = (dFdx(height) * a + dFdy(height) * b) / (abs(area) + 1e-20) * sign(area);
    slope *= 0.1 * sqrt(abs(area) / (tile_area + 1e-20));
    n = normalize(n - slope * min(1.0, 0.8 / (length(slope) + 1e-6)));

    vec2 open = light_at(place + n * frame.box_low.w);
    float facing = max(dot(n, frame.sun.xyz), 0.0), skywards = 0.5 + 0.5 * n.y;
    float sun = facing > 0.0 ? sun_at(place + 0.02 * n, 0.06, 0.01, 0.15) : 0.0;
    vec3 arriving = sun_color * facing * sun + sky_color * mix(0.35, 1.0, skywards) * open.g +
                    land_color * (1.0 - skywards) * (0.4 + 0.6 * open.r);
    arriving *= 0.55 + 0.45 * smoothstep(-0.1, 0.9, place.y); /* ambient occlusion near the ground */
#ifdef WIRE
    float fine = (level - 1.0) / max(ceil(frame.lod.x) - 1.0, 1.0); /* green, yellow, red */
    vec3 rings = pow(clamp(vec3(2.2 * fine, 1.8 - 1.8 * fine, 0.12), 0.0, 0.85), vec3(2.2));
    vec3 width = fwidth(wire_corner), edge = smoothstep(0.5 * width, 1.5 * width, wire_corner);
    albedo = rings * mix(0.25, 1.0, min(edge.x, min(edge.y, edge.z)));
    arriving = vec3(0.7 + 0.9 * max(dot(normalize(normal), frame.sun.xyz), 0.0));
#endif
    color = seen(albedo * arriving, place);
}
#endif

#ifdef SHADOW_FRAGMENT
void main() {
}
#endif

/* ---- impostors: leaf clouds along the view ---- */

#if defined(CARD_VERTEX) || defined(NEAR_VERTEX)
struct card_data {
    vec4 center, right, up, normal; /* w: layer, species, -, - */
};
layout(std430, binding = 6) readonly buffer card_buffer { card_data cards[]; };

/* The light of a card, from its own direction: the sun's, and what comes through when that is behind it */
float light_on(vec3 normal) {
    return 0.82 + 0.36 * clamp(0.35 + 0.65 * dot(normal, frame.sun.xyz), 0.0, 1.0) +
           0.2 * max(0.0, dot(frame.forward.xyz, frame.sun.xyz));
}
#endif

#if defined(CARD_FRAGMENT) || defined(NEAR_FRAGMENT)
/* the middle of a cloud is darker */
float depth_light(vec3 from_middle) {
    return 0.75 + 0.25 * min(1.0, dot(from_middle, from_middle));
}
#endif

#ifdef CARD_VERTEX
out vec3 card_at;
out vec2 card_leaf;
flat out ivec2 card_what; /* layer, species */
flat out float card_light;

void main() {
    card_data c = cards[gl_InstanceID];
    mat3 view = mat3(frame.right.xyz, frame.up.xyz, -frame.forward.xyz);
    vec3 center = c.center.xyz * view, right = c.right.xyz * view, up = c.up.xyz * view;
    vec2 side = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    float seen_area = right.x * up.y - right.y * up.x;
    bool is_edge_on = seen_area * seen_area <= 0.01 * dot(right, right) * dot(up, up);
    card_at = center + side.x * right + side.y * up;
    card_leaf = vec2(side.x, -side.y) * 0.5 + 0.5;
    card_what = ivec2(c.center.w, c.right.w);
    card_light = light_on(c.normal.xyz);
    gl_Position = is_edge_on ? vec4(2.0) : vec4(card_at.xy, -card_at.z * 0.5, 1.0);
}
#endif

#ifdef CARD_GEOMETRY
layout(triangles) in;
layout(triangle_strip, max_vertices = 3) out;
in vec3 card_at[];
in vec2 card_leaf[];
flat in ivec2 card_what[];
flat in float card_light[];
out vec3 at;
out vec2 leaf;
flat out int species;
flat out float lit;

void main() {
    for (int k = 0; k < 3; k++) {
        gl_Layer = card_what[k].x;
        gl_Position = gl_in[k].gl_Position;
        at = card_at[k];
        leaf = card_leaf[k];
        species = card_what[k].y;
        lit = card_light[k];
        EmitVertex();
    }
}
#endif

#ifdef CARD_FRAGMENT
in vec3 at;
in vec2 leaf;
flat in int species;
flat in float lit;
layout(location = 0) out vec4 color;
layout(location = 1) out float depth;

void main() {
    vec4 texel = texelFetch(leaves, ivec3(leaf * vec2(textureSize(leaves, 0).xy), species), 0);
    if (texel.a < 0.5) discard;
    color = vec4(min(texel.rgb * lit * depth_light(at), 1.0), 1.0);
    depth = at.z;
}
#endif

/* ---- clusters of leaves ---- */

#if defined(CLOUD_VERTEX) || defined(NEAR_VERTEX)
/* a tint per tree, and a smaller variation per cloud */
vec3 tint_of(uint look, uint cloud) {
    float warm = float(look >> 8 & 255u) / 255.0 - 0.5, other = float(cloud >> 8 & 255u) / 255.0 - 0.5;
    float bright = float(look >> 16 & 255u) / 255.0 - 0.5, own = float(cloud >> 16 & 255u) / 255.0 - 0.5;
    return vec3(1.0 + 0.20 * warm + 0.16 * other, 1.0, 1.0 - 0.25 * warm) *
           (1.0 + 0.20 * bright + 0.20 * own);
}

/* Leaves shimmer faster than twigs sway: -1 to 1 each across and along, other ones for each phase, turns */
vec2 shimmer_at(float phase) {
    vec2 turns = 6.2832 * (frame.shimmer.xy + vec2(phase, 1.7 * phase));
    return frame.shimmer.z * vec2(0.6 * sin(turns.x) + 0.4 * sin(turns.y), 0.6 * cos(turns.x) - 0.4 * sin(turns.y));
}

/* The normal of the crown's surface, as the light from the sky has it: towards where there is more;
   shorter where that is not clear. */
vec3 crown_normal(vec3 center, float radius) {
    vec3 n, wide = (1.5 * frame.box_low.w + 0.6 * radius) * frame.box_scale.xyz;
    vec3 at = (center - frame.box_low.xyz) * frame.box_scale.xyz;
    for (int k = 0; k < 3; k++) {
        vec3 off = vec3(k == 0, k == 1, k == 2) * wide;
        n[k] = textureLod(light, at + off, 0.0).g - textureLod(light, at - off, 0.0).g;
    }
    return n / (length(n) + 0.03);
}
#endif

#if defined(CLOUD_FRAGMENT) && !defined(SHADOW) || defined(NEAR_FRAGMENT)
/* The light that a leaf sends to the eye. n: the crown's surface, with some of the cloud's */
vec3 leaf_light(vec3 place, vec3 n) {
    vec2 open = light_at(place + n * frame.box_low.w);
    float sun = mix(sun_at(place, 0.12, 0.1, 0.1), open.r, 0.3);
    float facing = clamp(0.30 + 0.70 * dot(n, frame.sun.xyz), 0.0, 1.0), skywards = 0.5 + 0.5 * n.y;
    /* a leaf lit from behind is brighter and yellower than one that reflects */
    float through = clamp(0.2 + 0.8 * dot(normalize(place - frame.eye.xyz), frame.sun.xyz), 0.0, 1.0);
    return sun_color * sun * (0.85 * facing + 0.9 * through * vec3(1.0, 1.0, 0.25)) +
           sky_color * mix(0.35, 1.0, skywards) * (0.08 + 0.92 * open.g) * open.g * 1.3 +
           /* light that other leaves let through or scatter */
           (0.25 + sun_color * 0.16 * open.r) * (0.4 + 0.6 * open.g) * vec3(0.75, 1.0, 0.4) +
           land_color * 0.5 * (1.0 - skywards) * open.r;
}
#endif

/* Near the camera cards replace impostors: within a seventh of that distance some pixels show one, some
   the other. Is this one of those that show cards? */
#if defined(CLOUD_FRAGMENT) || defined(NEAR_FRAGMENT)
bool shows_cards(vec3 center) {
    float share = (1.0 - distance(center, frame.eye.xyz) / max(frame.eye.w, 1e-3)) * 7.0;
    return share > hash(gl_FragCoord.xy + 0.5) && frame.eye.w > 0.0;
}
#endif

#ifdef CLOUD_VERTEX
out vec2 at;
flat out vec4 sphere;
flat out int layer;
flat out vec3 tint, crown;
flat out vec2 flutter;

void main() {
    uvec4 c = clusters[gl_InstanceID];
    float along = uintBitsToFloat(c.y), radius = uintBitsToFloat(c.z);
    uint look = looks[c.x], clouds = uint(frame.forward.w);
    vec3 center = treepieces_move_point(c.x, vec3(0.0, along, 0.0));
    at = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    flutter = shimmer_at(float(c.w >> 24) / 256.0);
    center += 0.03 * radius * (flutter.x * frame.right.xyz + flutter.y * frame.up.xyz);
    sphere = vec4(center, radius);
    layer = int((look & 15u) * clouds + c.w % clouds);
    tint = tint_of(look, c.w);
    crown = crown_normal(center, radius);
    gl_Position = frame.view_projection *
                  vec4(center + radius * (at.x * frame.right.xyz + at.y * frame.up.xyz), 1.0);
}
#endif

#ifdef CLOUD_FRAGMENT
in vec2 at;
flat in vec4 sphere;
flat in int layer;
flat in vec3 tint, crown;
flat in vec2 flutter;
#ifndef SHADOW
out vec4 color;
#endif

void main() {
    /* the leaves of a cloud move against each other, less at its rim */
    vec2 shift = 0.02 * (1.0 - dot(at, at)) * (flutter.x * sin(9.0 * at.yx) + flutter.y * cos(7.0 * at.yx));
    vec3 texel = vec3((dot(at, at) < 1.0 ? at + shift : at) * 0.5 + 0.5, layer);
    vec4 leaf = texture(impostors, texel, -1.0);
    /* one threshold for all pixels would make smooth blobs of needles and small leaves */
    float least = 0.2 + 0.5 * hash(gl_FragCoord.yx + 3.5);
    if (leaf.a < least || shows_cards(sphere.xyz)) discard;
    vec4 near = textureGather(depths, texel);
    float depth = max(max(near.x, near.y), max(near.z, near.w));
    if (depth < -1.5) discard;
    mat3 view = mat3(frame.right.xyz, frame.up.xyz, frame.forward.xyz);
    gl_FragDepth = treepieces_impostor_depth(frame.view_projection, sphere.xyz, sphere.w, view,
                                             vec3(at, depth));
#ifndef SHADOW
    /* the impostor holds the shading of its cards; here: that of the crown */
    vec3 from_middle = view * vec3(at, -depth), place = sphere.xyz + sphere.w * from_middle;
    vec3 albedo = pow(leaf.rgb / leaf.a, vec3(2.2)) * tint;
    vec3 n = normalize(1.2 * crown + 0.55 * from_middle + vec3(0.0, 0.25, 0.0));
    color = seen(albedo * leaf_light(place, n), place);
#endif
}
#endif

#ifdef NEAR_VERTEX
layout(std430, binding = 7) readonly buffer near_buffer { uvec2 near[]; }; /* cluster, card */
out vec3 place, normal, from_middle;
out vec2 leaf;
flat out vec3 tint, center;
flat out float own_light;
flat out int species;

void main() {
    uvec4 c = clusters[near[gl_InstanceID].x];
    card_data card = cards[near[gl_InstanceID].y];
    float along = uintBitsToFloat(c.y), radius = uintBitsToFloat(c.z);
    vec2 side = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    center = treepieces_move_point(c.x, vec3(0.0, along, 0.0));
    vec3 at = card.center.xyz + side.x * card.right.xyz + side.y * card.up.xyz;
    vec2 flutter = shimmer_at(float(c.w >> 24) / 256.0 + 0.37 * float(near[gl_InstanceID].y));
    at += 0.25 * length(card.up.xyz) * (0.5 + 0.5 * side.y) * /* it hangs on its twig below */
          (flutter.x * card.normal.xyz + 0.4 * flutter.y * normalize(card.right.xyz));
    place = center + radius * at;
    from_middle = at;
    leaf = vec2(side.x, -side.y) * 0.5 + 0.5;
    species = int(card.right.w);
    tint = tint_of(looks[c.x], c.w);
    normal = 1.2 * crown_normal(center, radius) + 0.55 * at + vec3(0.0, 0.25, 0.0);
    own_light = light_on(card.normal.xyz);
    gl_Position = frame.view_projection * vec4(place, 1.0);
}
#endif

#ifdef NEAR_FRAGMENT
in vec3 place, normal, from_middle;
in vec2 leaf;
flat in vec3 tint, center;
flat in float own_light;
flat in int species;
out vec4 color;

void main() {
    vec4 texel = texture(leaves, vec3(leaf, species));
    /* cards seen edge on would be streaks */
    vec3 face = normalize(cross(dFdx(place), dFdy(place)));
    float turned = abs(dot(face, normalize(place - frame.eye.xyz)));
    if (texel.a < 0.5 || turned < 0.3 * hash(gl_FragCoord.yx) || !shows_cards(center)) discard;
    vec3 albedo = pow(min(texel.rgb * own_light * depth_light(from_middle), 1.0), vec3(2.2)) * tint;
    color = seen(albedo * leaf_light(place, normalize(normal)), place);
}
#endif

/* ---- ground and sky ---- */

#ifdef LAND_VERTEX
out vec2 at;

void main() {
    at = vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1);
    gl_Position = vec4(at, 1.0, 1.0);
}
#endif

#ifdef LAND_FRAGMENT
in vec2 at;
out vec4 color;

void main() {
    vec3 way = normalize(frame.forward.xyz + at.x * frame.right.w * frame.right.xyz +
                         at.y * frame.up.w * frame.up.xyz);
    gl_FragDepth = 1.0;
    if (way.y > -1e-4) { /* wooded hills, paler with distance */
        vec3 sky = sky_towards(way), haze = sky_towards(vec3(way.x, 0.0, way.z));
        vec2 round = way.xz / length(way.xz) * 4.0;
        for (float k = 0.0; k < 3.0; k++) {
            float ridge = 0.034 - 0.011 * k +
                          0.03 * (noise(round * (1.2 + 0.5 * k) + 9.0 * k + 40.0) - 0.5) +
                          0.005 * (noise(round * 9.0 + k) - 0.5) +
                          0.0016 * (noise(round * 61.0) - 0.5);
            float soft = smoothstep(ridge - 0.0006, ridge + 0.0006, way.y);
            sky = mix(mix(haze, vec3(0.06, 0.11, 0.07),
                          (0.22 + 0.16 * k) * smoothstep(0.0, 0.02, way.y)),
                      sky, soft);
        }
        color = seen(sky, frame.eye.xyz);
        return;
    }
    float far = frame.eye.y / -way.y;
    vec3 place = frame.eye.xyz + far * way;
    vec4 clip = frame.view_projection * vec4(place, 1.0);
    gl_FragDepth = min(0.5 + 0.5 * clip.z / clip.w, 1.0);

    /* meadow: octaves of noise, each faded out where a pixel is larger than its wavelength */
    float pixel = sqrt(abs(determinant(mat2(dFdx(place.xz), dFdy(place.xz)))));
    float sum = 0.0, weight = 0.30;
    for (float size = 9.0; size > 0.008; size *= 0.45, weight *= 0.97) {
        float wave = noise(place.xz / size + size * 37.0) - 0.5;
        sum += weight * wave * clamp(0.5 * size / pixel - 1.0, 0.0, 1.0);
    }
    float patches = noise(place.xz / 13.0) * 0.6 + noise(place.xz / 3.1 + 7.0) * 0.4;
    vec3 grass = mix(vec3(0.045, 0.085, 0.016), vec3(0.115, 0.130, 0.035), patches);
    vec2 open = light_at(place + vec3(0.0, 0.5 * frame.box_low.w, 0.0));
    vec3 litter = vec3(0.075, 0.056, 0.030);
    vec3 albedo = mix(litter, grass, smoothstep(0.35, 0.65, open.g + 0.5 * sum + 0.05));
    albedo *= max(1.0 + 1.1 * sum, 0.25);
    float sun = sun_at(place, 0.03, 0.02, 0.25);
    vec3 arriving = sun_color * frame.sun.y * sun * mix(0.75, 1.0, open.r) + sky_color * open.g;
    color = seen(albedo * arriving, place);
}
#endif
