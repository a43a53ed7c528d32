/* textiles.glsl - the endless plane of textiles.h on the GPU
   SPDX-License-Identifier: MIT OR Unlicense

   WHAT IT DOES
     Colours of an endless plane covered by a tile set, without period. A hash of place and seed says
     which tile lies where, as in textiles_plane_tile and textiles_plane_triangle; its colour is read
     from an atlas or a texture array. Constant time: a few hashes and one texture lookup, for
     triangles also one texel of a table. GLSL 3.30 and GLSL ES 3.00, no extensions.

   HOW TO USE IT
     Paste it into a fragment shader after #version (ES: it sets high precision) and call one of

       vec4 textiles_square(sampler2D atlas, textiles_plane t, vec2 at)
       vec4 textiles_square(sampler2DArray slices, textiles_plane t, vec2 at)
       vec4 textiles_triangle(sampler2D atlas, isampler2D table, textiles_plane t, vec2 at)
       vec4 textiles_triangle(sampler2DArray slices, isampler2D table, textiles_plane t, vec2 at)

     at  the place on the plane in pixels of the tiles, x to the right, y downwards: a square or
         triangle has t.size of them a side. For example

       uniform textiles_plane tiles;
       uniform sampler2D albedo, bumps;
       in vec2 place;                                    // texture coordinates of a floor
       void main() {
           textiles_spot s = textiles_find_square(tiles, place, dFdx(place), dFdy(place));
           color = textiles_fetch(albedo, s) * shade(textiles_fetch(bumps, s));
       }

     where all maps of a set use the same spot. Outside uniform control flow pass the derivatives of
     the place yourself, as here.

     Drivers filter without looking at alpha. A picture with translucent parts is uploaded with its
     colour multiplied by alpha; the result is what textiles_draw_plane draws, multiplied likewise.

   UNIFORMS
     The fields of textiles_plane are those of textiles_plane and textiles_layout in textiles.h:

       kind, colors, variants, seed              of the plane
       packing, size, gutter, columns            of the layout
       pitch   pitch_x, pitch_y
       extent  width, height
       origin  the square (or lattice point) at place (0, 0). Floats are exact to about 1/500 of a
               pixel up to 2^14 pixels from there; to go farther, move the origin

     and the table is the one that textiles_plane_table returns, as a texture count x 1 of GL_R32I with
     GL_NEAREST filters.

   TEXTURES
     Upload the rows from the top, as textiles_draw_atlas draws them.
       TEXTILES_PACKED  GL_CLAMP_TO_EDGE; GL_TEXTURE_MAX_LEVEL = log2(gutter); on higher levels tiles mix
       TEXTILES_TORUS   GL_REPEAT; all levels if size is a power of two, else while it is even
       TEXTILES_SLICES  GL_TEXTURE_2D_ARRAY, GL_CLAMP_TO_EDGE, pitch.x x pitch.y, slice = tile;
                        GL_TEXTURE_MAX_LEVEL = log2(gutter); on higher levels joints show
     Filter with GL_LINEAR_MIPMAP_LINEAR. Bilinear filtering needs a gutter of 1 at least.
     Mipmaps: glGenerateMipmap, or means of 2 x 2 pixels.

     The lookup uses the derivatives of the place, not those of the texture coordinates, which jump
     between tiles. So no lines show along the joints.             */

#ifdef GL_ES
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp isampler2D;
#endif

const int TEXTILES_WANG = 0, TEXTILES_CORNER = 1, TEXTILES_TRIANGLE = 2;
const int TEXTILES_PACKED = 0, TEXTILES_TORUS = 1, TEXTILES_SLICES = 2;

struct textiles_plane {
    int kind, colors, variants;
    uint seed;
    int packing, size, gutter, columns;
    ivec2 pitch, extent, origin;
};

/* where to read the textures */
struct textiles_spot {
    int tile;
    vec2 uv;     /* in the atlas, or in the slice of number tile */
    vec2 dx, dy; /* derivatives of uv                            */
};

/* ---- the hash: txt_hash and the rest of textiles.h ------------------------------------ */

uint textiles_mix(uint h) {
    h ^= h >> 16;
    h *= 0x7feb352du;
    h ^= h >> 15;
    h *= 0x846ca68bu;
    return h ^ (h >> 16);
}

/* the hash in two steps, because many lookups are in one column */
uint textiles_column(uint seed, uint x) {
    return textiles_mix(x + seed);
}

uint textiles_at(uint column, uint what, uint y) {
    return textiles_mix(column ^ (y * 0x9e3779b9u + what * 0x85ebca6bu));
}

/* numbers of 0..n-1 from a hash, from its upper, and from its lower 16 bits */
int textiles_below(uint hash, int n) {
    return int((hash >> 8) * uint(n) >> 24);
}

int textiles_upper(uint hash, int n) {
    return int((hash >> 16) * uint(n) >> 16);
}

int textiles_lower(uint hash, int n) {
    return int((hash & 0xffffu) * uint(n) >> 16);
}

/* ---- which tile lies where ------------------------------------------------------------ */

/* The variant of a square. Those of a block of 2 x 2, a b above c d: a and d at random (of two
   variants d = a), b and c at random among those that are neither. */
int textiles_other(int k, int a, int d) {
    int low = min(a, d), high = max(a, d);
    if (k >= low) k++;
    return k >= high && low != high ? k + 1 : k;
}

int textiles_variant(textiles_plane t, uvec2 at) {
    int n = t.variants;
    if (n < 2) return 0;
    uint column = textiles_column(t.seed, at.x >> 1);
    uint h = textiles_at(column, 3u, at.y >> 1);
    int a = textiles_upper(h, n), d = n == 2 ? a : textiles_lower(h, n);
    bool right = (at.x & 1u) == 1u, below = (at.y & 1u) == 1u;
    if (right == below) return below ? d : a;
    uint g = textiles_at(column, 4u, at.y >> 1);
    int others = a != d ? n - 2 : n - 1;
    return textiles_other(right ? textiles_upper(g, others) : textiles_lower(g, others), a, d);
}

/* the tile of a square: textiles_plane_tile */
int textiles_tile(textiles_plane t, ivec2 square) {
    uvec2 at = uvec2(square);
    uint here = textiles_column(t.seed, at.x), next = textiles_column(t.seed, at.x + 1u);
    int c = t.colors, code;
    if (t.kind == TEXTILES_WANG) {
        code = textiles_below(textiles_at(here, 0u, at.y), c);
        code = code * c + textiles_below(textiles_at(next, 1u, at.y), c);
        code = code * c + textiles_below(textiles_at(here, 0u, at.y + 1u), c);
        code = code * c + textiles_below(textiles_at(here, 1u, at.y), c);
    } else {
        code = textiles_below(textiles_at(here, 2u, at.y), c);
        code = code * c + textiles_below(textiles_at(next, 2u, at.y), c);
        code = code * c + textiles_below(textiles_at(next, 2u, at.y + 1u), c);
        code = code * c + textiles_below(textiles_at(here, 2u, at.y + 1u), c);
    }
    return code * t.variants + textiles_variant(t, at);
}

/* The tile of the triangle (a, b), (a, b+1), (a+1, b), or turned (a+1, b+1), (a+1, b), (a, b+1):
   textiles_plane_triangle. Edges run from the lower to the higher rank. */
int textiles_symbol(textiles_plane t, uint hash, uvec3 from, uvec3 to) {
    bool against = from.z > to.z;
    if (from.z == to.z) against = from.x > to.x || (from.x == to.x && from.y > to.y);
    return 2 * textiles_below(hash, t.colors) + (against ? 1 : 0);
}

int textiles_triangle_tile(isampler2D table, textiles_plane t, ivec2 at, bool turned,
                           out int rotation) {
    uint one = turned ? 1u : 0u, a = uint(at.x), b = uint(at.y);
    uint here = textiles_column(t.seed, a), next = textiles_column(t.seed, a + 1u);
    /* the face's corners: where they lie, and their rank */
    uint near = turned ? next : here, far = turned ? here : next;
    uvec3 p0 = uvec3(a + one, b + one, textiles_at(near, 7u, b + one));
    uvec3 p1 = uvec3(a + one, b + 1u - one, textiles_at(near, 7u, b + 1u - one));
    uvec3 p2 = uvec3(a + 1u - one, b + one, textiles_at(far, 7u, b + one));
    int code = textiles_symbol(t, textiles_at(near, 9u, b), p0, p1);
    code = code * 2 * t.colors + textiles_symbol(t, textiles_at(here, 10u, b), p1, p2);
    code = code * 2 * t.colors + textiles_symbol(t, textiles_at(here, 8u, b + one), p2, p0);

    int entry = texelFetch(table, ivec2(code, 0), 0).r, tile = entry / 4;
    rotation = entry & 3;
    if (t.variants > 1) { /* even ones for one half of the triangles, odd ones for the other */
        uint h = textiles_at(here, 11u, b);
        tile += turned ? 2 * textiles_lower(h, t.variants / 2) + 1
                       : 2 * textiles_upper(h, (t.variants + 1) / 2);
    }
    return tile;
}

/* ---- where a tile lies in the picture: textiles_place --------------------------------- */

/* the place of a pair of colours in Wei's ring of pairs */
int textiles_ring(int a, int b) {
    if (a == b) return a > 0 ? (a + 1) * (a + 1) - 2 : 0;
    if (b == 0) return (a + 1) * (a + 1) - 1;
    return a > b ? a * a + 2 * b - 1 : 2 * a + b * b;
}

/* column and row of a tile in the torus */
ivec2 textiles_torus(textiles_plane t, int tile) {
    int code = tile / t.variants, c = t.colors, ring = c * c;
    int e0 = code / (ring * c), e1 = code / ring % c, e2 = code / c % c, e3 = code % c;
    ivec2 cell;
    if (t.kind == TEXTILES_WANG) {
        cell = ivec2(textiles_ring(e3, e1), textiles_ring(e0, e2));
    } else if (c == 3) {
        int left = textiles_ring(e0, e3), k = (textiles_ring(e1, e2) - left + ring) % ring;
        cell = ivec2(k, (left + ring * ring - k * (k - 1) / 2) % ring);
    } else {
        /* the 16 tiles of two colours by code, 4 row + column as hexadecimal digits */
        uint places = code < 8 ? 0x952c7140u : 0xaebd68f3u;
        int place = int(places >> uint(4 * (code & 7)) & 15u);
        cell = ivec2(place & 3, place >> 2);
    }
    return cell + ivec2(tile % t.variants * ring, 0);
}

/* Pixel position in its picture of pixel (0, 0) of a tile, and the step to the next. */
ivec2 textiles_place(textiles_plane t, int tile, out int direction) {
    direction = 1;
    if (t.packing == TEXTILES_SLICES) return ivec2(t.gutter);
    if (t.packing == TEXTILES_TORUS) return textiles_torus(t, tile) * t.pitch;
    bool two = t.kind == TEXTILES_TRIANGLE; /* to a cell, the second upside down */
    int cell = two ? tile / 2 : tile;
    ivec2 corner = ivec2(cell % t.columns, cell / t.columns) * t.pitch;
    if (!two || (tile & 1) == 0) return corner + t.gutter;
    direction = -1;
    return corner + t.pitch - 1 - t.gutter;
}

/* ---- lookups -------------------------------------------------------------------------- */

/* dx, dy: derivatives of the place at */
textiles_spot textiles_find_square(textiles_plane t, vec2 at, vec2 dx, vec2 dy) {
    textiles_spot s;
    int direction;
    vec2 square = floor(at / float(t.size));
    s.tile = textiles_tile(t, ivec2(square) + t.origin);
    vec2 scale = 1.0 / vec2(t.packing == TEXTILES_SLICES ? t.pitch : t.extent);
    vec2 inside = at - square * float(t.size);
    s.uv = (vec2(textiles_place(t, s.tile, direction)) + inside) * scale;
    s.dx = dx * scale;
    s.dy = dy * scale;
    return s;
}

/* Barycentric coordinates of corners 0, 1, 2 in a triangle of the lattice, up to a constant: linear
   in the lattice coordinates. */
vec3 textiles_shares(vec2 ab, bool turned) {
    vec3 w = vec3(-ab.x - ab.y, ab.y, ab.x);
    return turned ? -w : w;
}

/* Texel (i, j) of a tile from the shares of the face's corners: corner k shows corner k + rotation,
   j grows towards corner 1, i towards corner 2. */
vec2 textiles_texel(vec3 w, int rotation) {
    return rotation == 0 ? w.zy : rotation == 1 ? w.yx : w.xz;
}

textiles_spot textiles_find_triangle(isampler2D table, textiles_plane t, vec2 at, vec2 dx,
                                     vec2 dy) {
    textiles_spot s;
    int rotation, direction;
    const float slope = 0.57735026918962576; /* 1 / sqrt(3) */
    vec2 place = vec2(at.x - at.y * slope, at.y * (2.0 * slope)) / float(t.size);
    vec2 corner = floor(place), inside = place - corner;
    bool turned = inside.x + inside.y >= 1.0;
    s.tile = textiles_triangle_tile(table, t, ivec2(corner) + t.origin, turned, rotation);

    vec3 w = textiles_shares(inside, turned);
    w += turned ? vec3(-1.0, 1.0, 1.0) : vec3(1.0, 0.0, 0.0);
    ivec2 first = textiles_place(t, s.tile, direction);
    vec2 scale = 1.0 / vec2(t.packing == TEXTILES_SLICES ? t.pitch : t.extent);
    vec2 texel = textiles_texel(w, rotation) * float(t.size);
    s.uv = (vec2(first) + 0.5 + float(direction) * texel) * scale;

    scale *= float(direction);
    vec2 da = vec2(dx.x - dx.y * slope, dx.y * (2.0 * slope));
    vec2 db = vec2(dy.x - dy.y * slope, dy.y * (2.0 * slope));
    s.dx = textiles_texel(textiles_shares(da, turned), rotation) * scale;
    s.dy = textiles_texel(textiles_shares(db, turned), rotation) * scale;
    return s;
}

vec4 textiles_fetch(sampler2D atlas, textiles_spot s) {
    return textureGrad(atlas, s.uv, s.dx, s.dy);
}

vec4 textiles_fetch(sampler2DArray slices, textiles_spot s) {
    return textureGrad(slices, vec3(s.uv, float(s.tile)), s.dx, s.dy);
}

/* ---- the whole in one call ------------------------------------------------------------ */

vec4 textiles_square(sampler2D atlas, textiles_plane t, vec2 at) {
    return textiles_fetch(atlas, textiles_find_square(t, at, dFdx(at), dFdy(at)));
}

vec4 textiles_square(sampler2DArray slices, textiles_plane t, vec2 at) {
    return textiles_fetch(slices, textiles_find_square(t, at, dFdx(at), dFdy(at)));
}

vec4 textiles_triangle(sampler2D atlas, isampler2D table, textiles_plane t, vec2 at) {
    return textiles_fetch(atlas, textiles_find_triangle(table, t, at, dFdx(at), dFdy(at)));
}

vec4 textiles_triangle(sampler2DArray slices, isampler2D table, textiles_plane t, vec2 at) {
    return textiles_fetch(slices, textiles_find_triangle(table, t, at, dFdx(at), dFdy(at)));
}
