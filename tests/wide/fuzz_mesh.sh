#!/bin/sh
# The mesh readers against hostile bytes: some ten thousands of mutations here, a million with --full.
. tests/kit/tap.sh

mkdir "$tmp/seeds"
cat >"$tmp/seeds/all.obj" <<'END'
# texture coordinates, normals, colors, polygons, joined lines
mtllib x.mtl
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1.5 1e0 0 .5 .5 .5
v 0.25 0.125 -3.5e-2
v 0 1 0.1
vt 0 0
vt 1 0.5 0
vn 0 0 1
usemtl x
f 1/1/1 2/2/1 3//1 \
  4/1 5
f -1 -2 -3
END
cat >"$tmp/seeds/mesh.ply" <<'END'
ply
format ascii 1.0
comment of everything something
element vertex 4
property float x
property float y
property double z
property float nx
property float ny
property float nz
property uchar red
property uchar green
property uchar blue
property float s
property float t
element face 2
property list uchar int vertex_indices
element edge 1
property int vertex1
property list int float more
end_header
0 0 0 0 0 1 255 0 0 0 0
1 0 0 0 0 1 0 255 0 1 0
1 1 0 0 0 1 0 0 255 1 1
0 1 0.5 0 0 1 9 9 9 0 1
4 0 1 2 3
3 0 2 1
7 2 0.5 0.25
END
cat >"$tmp/seeds/points.ply" <<'END'
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float qx
property float qy
property float qz
property float qw
end_header
0 0 0 0 0 0 1
1 0 0 1 0 0 0
0.5 0.75 0 0 0.5 0 0.5
END
cat >"$tmp/seeds/text.stl" <<'END'
solid two
facet normal 0 0 1
 outer loop
  vertex 0 0 0
  vertex 1.5 0 0
  vertex 0 1e0 0
 endloop
endfacet
facet normal 0 0 1
 outer loop
  vertex 1.5 0 0
  vertex 455001,25 5.4D6 0
  vertex 0 1 0
 endloop
endfacet
endsolid two
END
cat >"$tmp/seeds/all.off" <<'END'
STCNOFF # all that there is
5 3 0

0 0 0  0 0 1  1 0 0 1  0 0
1 0 0  0 0 1  0 1 0 1  1 0
1 1 0  0 0 1  0 0 1 1  1 1 # a corner
0 1 0  0 0 1  1 1 1 1  0 1
0.5 0.5 1  0 0 1  1 1 1 1  0 1
4 0 1 2 3  255 0 0
3 0 1 4
2 1 2
END
cat >"$tmp/seeds/strips.ply" <<'END'
ply
format ascii 1.0
element vertex 6
property double x
property double y
property double z
element tristrips 1
property list int int64 vertex_indices
end_header
455001 5400000 210
455002 5400000 210
455001 5400001 210
455002 5400001 210
455001 5400002 210
455002 5400002 210.5
8 0 1 2 3 -1 2 3 4
END

with="tools/files/*.c" libraries="-lcjson -lpng -lz -ljpeg -lm"
runs=30000
[ "$FULL" = 1 ] && runs=300000
# shellcheck disable=SC2086 # flags are words, files a pattern
check "builds by itself" $CC -std=gnu99 $SANITIZE -DFUZZ_STANDALONE -ffp-contract=off -I. -Itools \
    tests/wide/fuzz/fuzz_mesh_decode.c $with -o "$OUT/fuzz_mesh" $libraries &&
    check "$runs mutated meshes" "$OUT/fuzz_mesh" $runs "$tmp"/seeds/*

# shellcheck disable=SC2086
if [ "$FULL" = 1 ] && has clang; then
    check "builds with libFuzzer" clang -std=gnu99 -O2 -g -ffp-contract=off \
        -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -I. -Itools \
        tests/wide/fuzz/fuzz_mesh_decode.c $with -o "$OUT/fuzz_mesh_libfuzzer" $libraries &&
        check "300,000 runs of libFuzzer" "$OUT/fuzz_mesh_libfuzzer" -runs=300000 -seed=1 \
            -max_len=4096 -timeout=20 -rss_limit_mb=2000 -verbosity=0 \
            -artifact_prefix="$OUT/" "$tmp/seeds"
fi
