#!/bin/sh
# texkit retile keeps the contract of the command line; and its files hold what they should.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
prefix=retile
python=/usr/bin/python3
check_glb="$python $root/tests/tool/check_glb.py"
glbs=$root/$OUT/glb/retile # kept: .ci/run hands them to the Khronos validator
rm -rf "$glbs" && mkdir -p "$glbs"
cd "$tmp" || exit 1

# counts FILE: vertices and triangles of an OBJ or PLY file
counts() {
    case $1 in
    *.obj) echo "$(grep -c '^v ' "$1") $(grep -c '^f ' "$1")" ;;
    *) echo "$(ply_count vertex "$1") $(ply_count face "$1")" ;;
    esac
}
ply_count() { head -c 2000 "$2" | LC_ALL=C sed -n "/^end_header/q; s/^element $1 //p"; }
figures() { # NAME=VALUE...: these are in stats.json
    for wish in "$@"; do
        [ "$(figure "${wish%%=*}")" = "${wish#*=}" ] || { echo "not $wish"; cat stats.json; return 1; }
    done
}

# ---- meshes

# rings N M: a torus of N * M vertices and squares, with texture coordinates
rings() {
    awk -v n="$1" -v m="$2" 'BEGIN {
        pi = atan2(0, -1)
        for (i = 0; i < n; i++) for (j = 0; j < m; j++) {
            u = 2 * pi * i / n; v = 2 * pi * j / m
            printf "v %.6f %.6f %.6f\n", (1 + 0.4 * cos(v)) * cos(u), (1 + 0.4 * cos(v)) * sin(u), 0.4 * sin(v)
        }
        for (i = 0; i <= n; i++) for (j = 0; j <= m; j++) printf "vt %.6f %.6f\n", i / n, j / m
        for (i = 0; i < n; i++) for (j = 0; j < m; j++) {
            k = (i + 1) % n; l = (j + 1) % m
            t = i * (m + 1) + j + 1; s = t + m + 1
            printf "f %d/%d %d/%d %d/%d %d/%d\n", i * m + j + 1, t, k * m + j + 1, s, k * m + l + 1, s + 1, i * m + l + 1, t + 1
        }
    }'
}
rings 16 8 >torus.obj
cat >cube.obj <<'END'
v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
v 0 0 1
v 1 0 1
v 0 1 1
v 1 1 1
f 1 3 4 2
f 5 6 8 7
f 1 2 6 5
f 3 7 8 4
f 1 5 7 3
f 2 4 8 6
END
cat >colored.ply <<'END'
ply
format ascii 1.0
comment a sheet of two triangles
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 2
property list uchar int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 0 255 0
1 1 0 0 0 255
0 1 0 255 255 255
3 0 1 2
3 0 2 3
END

# ---- help
check "--help" run 0 --help
check "--help has an example" grep -q '  texkit retile .*-o' out.log
check "no line of --help is wider than 100 columns" sh -c "awk 'length > 100 { exit 1 }' out.log"
check "--version" run 0 --version
check "--version names the header" sh -c "'$texkit' --version | grep -q 'trimesh_relax [0-9.]*'"
check "texkit --help lists it" sh -c "'$texkit' --help | grep -q '^ *retile '"

# ---- formats
for from in torus.obj cube.obj colored.ply; do
    for to in obj ply glb; do
        name=${from%.*}.$to
        check "$from as .$to" run 0 $from -o "out-$name" --vertices 240 --stats stats.json
        check "tells what it made" grep -q "^out-$name: 240 vertices, .* triangles, quality 0" out.log
        check "240 vertices counted" figures vertices=240
        case $to in
        glb)
            check "the GLB is whole" $check_glb out-$name places=240 \
                triangles="$(figure triangles)" instances=0 images=0
            cp "out-$name" "$glbs/${from%.*}.glb"
            ;;
        *)
            if [ $name = torus.ply ]; then # vertices on texture seams are there twice
                check "they are in the file" test "$(ply_count vertex out-$name)" -gt 240
            else
                check "they are in the file" \
                    test "$(counts out-$name)" = "240 $(figure triangles)"
            fi
            check "file_bytes is its size" figures file_bytes="$(wc -c <out-$name)"
            check "and can be read" run 0 out-$name -o again.ply --vertices 150 --stats stats.json
            ;;
        esac
    done
done
# other formats: the same torus without texture coordinates
awk '/^v / { print } /^f / { printf "f"; for (i = 2; i <= 5; i++) printf " %d", $i; print "" }' torus.obj >bare.obj
awk '/^v / { v[n++] = $2 " " $3 " " $4 } /^f / { f[m++] = "4 " $2 - 1 " " $3 - 1 " " $4 - 1 " " $5 - 1 }
    END { print "OFF # made by a test\n" n, m, 0; for (i = 0; i < n; i++) print v[i]
        for (i = 0; i < m; i++) print f[i] }' bare.obj >torus.off
check "a mesh as .off" run 0 torus.off -o off.obj --vertices 300
check "gives the same as the .obj" sh -c "'$texkit' retile bare.obj -o bare-out.obj --vertices 300 --quiet &&
    cmp bare-out.obj off.obj"
check "to .stl" run 0 torus.off -o torus.stl --vertices 300 --stats stats.json
check "whose size tells the triangles" test "$(wc -c <torus.stl)" = $((84 + 50 * $(figure triangles)))
check "from .stl" run 0 torus.stl -o stl.ply --vertices 200 --stats stats.json
check "it is one closed piece" figures vertices=200 euler=0 components=1 loops=0
check "from .glb" run 0 out-torus.glb -o glb.ply --vertices 200 --stats stats.json
check "it is one closed piece, too" figures vertices=200 euler=0 components=1 loops=0
check "an .stl holds no texture coordinates" warns "will hold no texture coordinates" retile torus.obj \
    -o t.stl --vertices 100
check "nor colors" warns "will hold no colors" retile colored.ply -o t.stl --vertices 100
refuses 2 "holds no texture; name one" torus.obj -o t.stl --vertices 100 --texture torus.obj
check "a wire of twelve sides, thinner than an edge" sh -c "awk 'BEGIN { n = 12; for (i = 0; i < 2 * n; i++)
    print \"v\", cos(i * 8 * atan2(1, 1) / n), sin(i * 8 * atan2(1, 1) / n), 2000 * (i >= n)
    for (i = 1; i <= n; i++) { j = i % n + 1; print \"f\", i, j, j + n, i + n; a = a \" \" n + 1 - i; b = b \" \" n + i }
    print \"f\" a; print \"f\" b }' >wire.obj"
check "loses volume, with a warning" warns "the volume has changed by -" retile wire.obj -o wire-out.obj \
    --vertices 2000
check "faces of two corners are left out" sh -c "cp bare.obj two.obj && echo 'f 1 2' >>two.obj"
check "with a warning" warns "left out: faces with less than three corners (1)" retile two.obj -o two-out.obj \
    --vertices 300
check "and nothing else changes" cmp two-out.obj bare-out.obj

# a mesh in map coordinates is retiled as the same one at the origin, whose squares lie up to 0.05 inside of
# the torus
away=5400000.125
awk -v away=$away '/^v / { printf "v %.6f %.6f %.6f\n", $2 + away, $3 + 455000, $4; next } { print }' bare.obj >away.obj
for to in obj ply stl glb; do
    check "far away, as .$to" run 0 away.obj -o away-out.$to --vertices 300 --stats stats.json
    check "as good" sh -c "awk 'BEGIN { exit !($(figure quality) > 0.97 && $(figure valence_6) > 0.7) }'"
    check "and again" run 0 away-out.$to -o again.obj --vertices 300 --stats stats.json
    check "closed" figures vertices=300 euler=0 loops=0
    check "where it was" awk -v away=$away '/^v / { x = $2 - away; y = $3 - 455000; d = sqrt(x * x + y * y) - 1
        d = sqrt(d * d + $4 * $4) - 0.4; if (d * d > 0.06 * 0.06) exit 1; n++ } END { exit n != 300 }' again.obj
done
check "the torus: Euler characteristic 0" run 0 torus.obj -o t.ply --vertices 301 --stats stats.json
check "and its other figures" figures command=\"retile\" vertices=301 triangles=602 euler=0 \
    components=1 loops=0 crease_edges=0 "mended=[0, 0, 0, 0, 0, 0, 0]" "repaired=[0, 0, 0, 0, 0, 0]"
for key in seed threads read retile dress measure encode total peak_bytes edge_length quality \
    quality_least valence_6 edge_variation area_variation least_angle file_bytes; do
    check "--stats has $key" grep -q "\"$key\": " stats.json
done
check "--stats is JSON" $python -m json.tool stats.json
check "good triangles" sh -c "awk 'BEGIN { exit !($(figure quality) > 0.97 && $(figure valence_6) > 0.7) }'"
check "the cube" run 0 cube.obj -o c.obj --vertices 300 --stats stats.json
check "has 12 creases and Euler characteristic 2" figures crease_edges=12 euler=2 triangles=596
check "its corners stay" sh -c "
    for p in '0 0 0' '1 0 0' '0 1 0' '1 1 0' '0 0 1' '1 0 1' '0 1 1' '1 1 1'; do
        grep -q \"^v \$p\$\" c.obj || { echo \"no \$p\"; exit 1; }
    done"
check "the sheet" run 0 colored.ply -o s.ply --vertices 100 --stats stats.json
check "has one border" figures loops=1 euler=1 components=1
check "colors are carried" run 0 colored.ply -o s.glb --vertices 100
check "into the GLB" $check_glb s.glb places=100 colors=1
check "texture coordinates are carried" run 0 torus.obj -o uv.glb --vertices 300
check "into the GLB, seams doubled" sh -c "
    $check_glb uv.glb places=300 uvs=1 && $check_glb uv.glb | grep -q ' vertices=[34][1-9]'"
# seams, materials, colors of faces
printf 'P3\n2 2\n255\n255 0 0  0 255 0  0 0 255  9 9 9\n' >four.ppm
check "with a texture, edges follow its seams" run 0 torus.obj -o uv.obj --vertices 300 --crease 180 --texture four.ppm \
    --stats stats.json
check "which are no creases" figures seam_edges=24 crease_edges=0
check "so that no triangle leaves its chart" awk '/^vt / { u[++n] = $2; v[n] = $3 } /^f / {
    for (k = 0; k < 3; k++) { split($(2 + k), a, "/"); x[k] = u[a[2]]; y[k] = v[a[2]] }
    for (k = 0; k < 3; k++) { d = x[k] - x[(k + 1) % 3]; e = y[k] - y[(k + 1) % 3]
        if (d * d > 0.04 || e * e > 0.09) { print; exit 1 } } }' uv.obj
check "and seams lie where they were" awk '/^v / { y[++n] = $3; z[n] = $4 } /^vt / { u[++m] = $2 } /^f / {
    for (k = 2; k < 5; k++) { split($k, a, "/"); if ((u[a[2]] < 1e-5 || u[a[2]] > 1 - 1e-5)) {
        seen++; if (y[a[1]] ^ 2 > 1e-8) { print; exit 1 } } } } END { exit seen < 20 }' uv.obj
check "not with --no-keep-seams" run 0 torus.obj -o t.obj --vertices 300 --crease 180 --texture four.ppm --no-keep-seams \
    --stats stats.json
check "none" figures seam_edges=0
check "nor without a picture" run 0 torus.obj -o t.obj --vertices 300 --crease 180 --stats stats.json
check "none either" figures seam_edges=0
check "but with --keep-seams" run 0 torus.obj -o t.obj --vertices 300 --crease 180 --keep-seams --stats stats.json
check "all" figures seam_edges=24
# of so few vertices some numbers do with seams, some do not without them either: nobody knows which
check "seams that are too many are said not to be kept" sh -c "
    for n in 10 11 12 9 14 13 16; do
        '$texkit' retile torus.obj -o t.obj --vertices \$n --texture four.ppm 2>&1 |
            grep -q 'too few vertices to follow its seams' && exit 0
    done
    exit 1"
refuses 2 "choose one of --keep-seams and --no-keep-seams" torus.obj -o t.obj --vertices 300 --keep-seams \
    --no-keep-seams
refuses 1 "has no texture coordinates and no materials" cube.obj -o t.obj --vertices 300 --keep-seams
check "two materials" sh -c "awk '/^f / { if (n++ == 0) print \"mtllib two.mtl\\nusemtl one\"; if (n == 65) print \"usemtl two\" }
    { print }' torus.obj >two.obj"
check "are kept" run 0 two.obj -o two-out.obj --vertices 400
check "with the name of their library" grep -qx 'mtllib two.mtl' two-out.obj
mkdir -p there
echo newmtl one >two.mtl
check "which another folder lacks" warns "names 'two.mtl', the materials of 'two.obj'" retile two.obj \
    -o there/two.obj --vertices 400
check "or has" sh -c "cp two.mtl there && '$texkit' retile two.obj -o there/two.obj --vertices 400 2>err.log && [ ! -s err.log ]"
check "in one group each" test "$(grep usemtl two-out.obj | tr '\n' ' ')" = 'usemtl one usemtl two '
check "each on its half" awk '/^v / { y[++n] = $3 } /^usemtl/ { one = $2 == "one" } /^f / { m = 0
    for (k = 2; k < 5; k++) { split($k, a, "/"); m += y[a[1]] }
    if (one ? m < -1e-6 : m > 1e-6) { print; exit 1 } }' two-out.obj
check "in a GLB as two primitives" warns "not kept in .glb: colors and pictures of 'two.mtl'" retile two.obj \
    -o two.glb --vertices 400
check "which is whole" $check_glb two.glb places=400
cp two.glb "$glbs/two-materials.glb"
check "a PLY has none" warns "not kept in .ply: materials (2)" retile two.obj -o two.ply --vertices 400
check "with a texture, both have it" run 0 two.obj -o two-tex.obj --vertices 400 --texture four.ppm
check "in the library" test "$(grep -c 'map_Kd two-tex-texture.png' two-tex.mtl)" = 2
check "coordinates that leave the picture" sh -c "awk '/^vt/ { print \$1, 8 * \$2, 4 * \$3; next } { print }' torus.obj >rep.obj"
check "make it repeat" run 0 rep.obj -o rep.glb --vertices 300 --crease 180 --texture four.ppm
check "both ways" grep -qa '"wrapS":10497,"wrapT":10497' rep.glb
sed -e 's/^property uchar .*//' -e '/^$/d' -e 's/^\(property list.*\)/\1\nproperty uchar red\nproperty uchar green\nproperty uchar blue/' \
    -e 's/^\([01] [01] 0\) .*/\1/' -e 's/^3 0 1 2/& 255 0 0/' -e 's/^3 0 2 3/& 0 0 255/' colored.ply >faces.ply
check "colors of faces" run 0 faces.ply -o faces-out.ply --vertices 100
check "stay colors of faces" sh -c "head -c 600 faces-out.ply | LC_ALL=C sed -n '/element face/,/end_header/p' | grep -q 'uchar red'"
check "or of a GLB's vertices" run 0 faces.ply -o faces.glb --vertices 100
check "which it has" $check_glb faces.glb places=100 colors=1
cp faces.glb "$glbs/face-colors.glb"
check "or of an OBJ's vertices" run 0 faces.ply -o faces.obj --vertices 100
check "some of them pure" sh -c "grep -q '^v .* 1 0 0\$' faces.obj && grep -q '^v .* 0 0 1\$' faces.obj"

check "no temporary file is left" sh -c "! ls | grep -q tmp"
check "--quiet says nothing" sh -c "
    '$texkit' retile cube.obj -o q.obj --vertices 50 --quiet | wc -c | grep -qx 0"
check "an odd name" run 0 cube.obj -o 'odd out;$(x).obj' --vertices 50

# ---- options
check "--method repel" run 0 torus.obj -o r.ply --vertices 201 --method repel --stats stats.json
check "the exact number" figures vertices=201 euler=0
check "--crease 180" run 0 cube.obj -o r.ply --vertices 201 --crease 180 --stats stats.json
check "no creases" figures crease_edges=0
check "--adapt 100" run 0 torus.obj -o adapt.ply --vertices 300 --adapt 100 --stats stats.json
check "--spacing 50" run 0 cube.obj -o spacing.ply --vertices 300 --spacing 50 --stats stats.json
check "another seed" run 0 torus.obj -o seed.ply --vertices 301 --seed 2
check "another mesh" sh -c "! cmp -s t.ply seed.ply"
for threads in 1 2 8; do
    for method in lattice repel; do
        check "--threads $threads, $method" run 0 torus.obj -o $method-$threads.glb --vertices 900 \
            --threads $threads --method $method
        check "the same bytes" cmp $method-1.glb $method-$threads.glb
    done
done
{ printf 'P5\n64 64\n255\n'; awk 'BEGIN { for (i = 0; i < 4096; i++) printf "%c", (i % 64 < 32 ? 1 : 127) }'; } \
    >density.pgm
check "--density" run 0 torus.obj -o density.ply --vertices 400 --density density.pgm

# ---- any surface
awk 'BEGIN { # a band with a half turn; two boxes with a wall in between; a long side against two short ones
    for (i = 0; i < 30; i++) {
        u = i * 0.20943951
        for (s = -1; s < 2; s += 2) {
            r = 2 + 0.4 * s * cos(u / 2)
            printf "v %g %g %g\n", r * cos(u), r * sin(u), 0.4 * s * sin(u / 2) >"moebius.obj"
        }
    }
    for (i = 0; i < 29; i++)
        printf "f %d %d %d %d\n", 2 * i + 1, 2 * i + 3, 2 * i + 4, 2 * i + 2 >"moebius.obj"
    print "f 59 2 1 60" >"moebius.obj"
    for (i = 0; i < 12; i++) print "v", i % 3, int(i / 3) % 2, int(i / 6) >"wall.obj"
    print "f 1 4 5 2\nf 2 5 6 3\nf 7 8 11 10\nf 8 9 12 11\nf 1 2 8 7\nf 2 3 9 8" >"wall.obj"
    print "f 4 10 11 5\nf 5 11 12 6\nf 1 7 10 4\nf 3 6 12 9\nf 2 5 11 8" >"wall.obj"
    print "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 1 0 0\nv 0 -1 0\nv 1 -1 0\nv 2 -1 0" >"long.obj"
    print "f 1 2 3 4\nf 6 7 5 1\nf 7 8 2 5" >"long.obj"
    for (i = 0; i < 400; i++) {
        x = 3 + i % 20 * 0.1; y = int(i / 20) * 0.1
        printf "v %g %g 0\nv %g %g 0\nv %g %g 0\nf -3 -2 -1\n", x, y, x + 0.001, y, x, y + 0.001 >"crumbs.obj"
    }
    print "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nf -4 -3 -2 -1" >"crumbs.obj"
}'
check "a Moebius band is cut" warns "edge of a one-sided surface cut" retile moebius.obj -o m.obj --vertices 200
check "a wall in a box" warns "4 edges of more than two triangles taken apart in pairs" \
    retile wall.obj -o m.obj --vertices 200
check "a T-junction" warns "1 T-junction stitched" retile long.obj -o m.obj --vertices 100 --stats stats.json
check "is closed" figures loops=1 components=1 "repaired=[0, 0, 0, 0, 1, 0]"
check "--weld 0" run 0 long.obj -o m.obj --vertices 100 --weld 0 --stats stats.json
check "welds nothing" figures components=2 loops=2
check "--weld 0.1%" run 0 cube.obj -o m.obj --vertices 100 --weld 0.1%
check "crumbs" warns "loose pieces dropped" retile crumbs.obj -o m.obj --vertices 500
check "--drop-below" warns "400 loose pieces dropped" retile crumbs.obj -o m.obj --vertices 500 \
    --drop-below 0.1% --stats stats.json
check "leaves the body" figures components=1 vertices=500
for bad in x -1 2% 5; do
    refuses 2 "--weld" cube.obj -o n.obj --vertices 100 --weld $bad
done
for bad in x -1 101% 2; do
    refuses 2 "--drop-below" cube.obj -o n.obj --vertices 100 --drop-below $bad
done

# ---- mended
{ cat cube.obj; printf 'f 1 3 4 2\nv 9 9 9\nf 2 2 3\n'; } >dirty.obj
check "double faces, a vertex too many" warns "2 duplicate triangles removed" retile dirty.obj -o d.ply --vertices 100 --stats stats.json
check "are told" sh -c "grep -q '\"mended\": \[0, 1, [01], 2, 0, 0, 0\]' stats.json || {
    cat stats.json; exit 1; }"
sed 's/^f 2 4 8 6/f 6 8 4 2/' cube.obj >turned.obj
check "a side turned over" warns "2 triangles reversed" retile turned.obj -o d.ply --vertices 100 --stats stats.json
check "is told" figures "mended=[0, 0, 0, 0, 0, 2, 0]" euler=2

# ---- texture
"$root/build/draw" cells cells.png 96
"$texkit" tiles cells.png -o triangles --kind triangle --size 32 --quiet
"$texkit" tiles cells.png -o wang --kind wang --size 32 --quiet
"$texkit" tiles cells.png -o slices --kind triangle --size 32 --packing slices --quiet
{ printf 'P6\n192 44\n255\n'; head -c 25344 /dev/zero | tr '\0' Q; } >patches.ppm
check "--tiles as .glb" run 0 torus.obj -o tiles.glb --vertices 240 --tiles triangles
check "the picture is in it" $check_glb tiles.glb places=240 images=1 uris=0 uvs=1
check "and beside it" cmp tiles-atlas.png triangles/atlas.png
check "--tiles as .obj" run 0 cube.obj -o tiles.obj --vertices 100 --tiles triangles
check "names its material" grep -qx 'mtllib tiles.mtl' tiles.obj
check "which names the picture" grep -q 'map_Kd.* tiles-atlas.png' tiles.mtl
check "every corner has texture coordinates" sh -c "! grep '^f ' tiles.obj | grep -v '/.*/.*/'"
check "--tiles as .ply" run 0 cube.obj -o tiles.ply --vertices 100 --tiles triangles
check "--patches as .glb" run 0 torus.obj -o patches.glb --vertices 240 --patches patches.ppm
check "the picture of patches is in it" $check_glb patches.glb places=240 images=1 uvs=1
check "--texture as .glb" run 0 torus.obj -o texture.glb --vertices 240 --texture cells.png
check "the picture is in it" $check_glb texture.glb places=240 images=1 uvs=1
check "beside it as it was" cmp texture-texture.png cells.png
for threads in 1 2; do
    check "--tiles --threads $threads" run 0 torus.obj -o tiles-$threads.ply --vertices 240 \
        --tiles triangles --threads $threads
    check "the same bytes" cmp tiles-1.ply tiles-$threads.ply
done

# ---- instances
cat >points.ply <<'END'
ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
end_header
0.4 0.2 0 255 0 0
0.5 0.3 0.1 0 255 0
0.6 0.2 0 255 0 0
END
cat >blade.ply <<'END'
ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0.4 0.2 0
0.6 0.2 0
0.5 0.4 0
0.5 0.25 0.6
3 0 2 1
3 0 1 3
3 1 2 3
3 2 0 3
END
check "--instances of points" run 0 torus.obj -o points.glb --vertices 150 --instances points.ply \
    --stats stats.json
check "three on each of 300 triangles" figures instances=900
check "are in the file" $check_glb points.glb places=150 instances=900 prototypes=2
check "--instances of a mesh" run 0 torus.obj -o blades.glb --vertices 150 --instances blade.ply
check "is in the file" $check_glb blades.glb places=150 instances=300 prototypes=1
check "--instances as .ply" run 0 torus.obj -o points-out.ply --vertices 150 --instances points.ply
check "holds the points" test "$(ply_count vertex points-out.ply)" = 900
check "--instances of a mesh as .obj" run 0 torus.obj -o blades.obj --vertices 150 \
    --instances blade.ply
check "holds the things" test "$(counts blades.obj)" = "1200 1200"
check "--dot, --curved" run 0 torus.obj -o curved.glb --vertices 150 --instances points.ply --dot 20 \
    --curved
check "with a texture" run 0 torus.obj -o both.glb --vertices 150 --instances points.ply \
    --tiles triangles
check "both are in the file" $check_glb both.glb places=150 instances=900 images=1
for threads in 1 2; do
    check "--instances --threads $threads" run 0 torus.obj -o i-$threads.glb --vertices 150 \
        --instances points.ply --threads $threads
    check "the same bytes" cmp i-1.glb i-$threads.glb
done
cp tiles.glb patches.glb texture.glb points.glb blades.glb both.glb uv.glb s.glb "$glbs/"

# the Khronos validator, if .ci/run has installed it
modules=$root/build/gltf/node_modules
if has node && [ -d "$modules/gltf-validator" ]; then
    check "the Khronos validator finds nothing" \
        node "$root/tests/tool/validate_glb.js" "$modules" "$glbs"/*.glb
else
    echo "# SKIP the Khronos validator: no node or no build/gltf (see .ci/run)"
fi

# ---- usage errors: status 2
refuses 2 "" 
refuses 2 "add -o" torus.obj --vertices 100
refuses 2 "add --vertices" torus.obj -o n.obj
for bad in 0 3 -1 x 1.5 "" 99999999999; do refuses 2 "--vertices" torus.obj -o n.obj --vertices "$bad"; done
for name in n.dae n.txs n n.png n.gltf; do refuses 2 "cannot write '$name'" torus.obj -o $name --vertices 100; done
refuses 2 "lattice, repel" torus.obj -o n.obj --vertices 100 --method magic
for bad in 0 181 x -5; do refuses 2 "--crease" torus.obj -o n.obj --vertices 100 --crease $bad; done
for bad in -1 101 x; do refuses 2 "--adapt" torus.obj -o n.obj --vertices 100 --adapt $bad; done
for bad in 24 401 0 x; do refuses 2 "--spacing" torus.obj -o n.obj --vertices 100 --spacing $bad; done
for bad in 0 257 x; do refuses 2 "--patch-count" torus.obj -o n.obj --vertices 100 --patch-count $bad; done
refuses 2 "choose one of" torus.obj -o n.glb --vertices 100 --tiles triangles --patches patches.ppm
refuses 2 "choose one of" torus.obj -o n.glb --vertices 100 --tiles triangles --texture cells.png
refuses 2 "--dot goes with --instances" torus.obj -o n.glb --vertices 100 --dot 10
refuses 2 "--curved goes with --instances" torus.obj -o n.glb --vertices 100 --curved
refuses 2 "needs an OUT in .glb" torus.obj -o n.obj --vertices 100 --instances points.ply --tiles triangles
refuses 2 "unknown option" torus.obj -o n.obj --vertices 100 --frob
refuses 2 "unexpected" torus.obj cube.obj -o n.obj --vertices 100

# ---- failures of the work: status 1
refuses 1 "No such file" missing.obj -o n.obj --vertices 100
refuses 1 "cannot write" torus.obj -o nowhere/n.obj --vertices 100
refuses 1 "cannot write" torus.obj -o n.obj --vertices 100 --stats nowhere/n.json
check "a full disk: status 1" run 1 torus.obj -o n.obj --vertices 100 --stats /dev/full
refuses 1 "; give " torus.obj -o n.obj --vertices 6
refuses 1 "missing/tiles.json" torus.obj -o n.glb --vertices 100 --tiles missing
refuses 1 "--kind triangle" torus.obj -o n.glb --vertices 100 --tiles wang
refuses 1 "--packing packed" torus.obj -o n.glb --vertices 100 --tiles slices
refuses 1 "gutters" torus.obj -o n.glb --vertices 100 --patches cells.png
refuses 1 "missing.png" torus.obj -o n.glb --vertices 100 --patches missing.png
refuses 1 "no texture coordinates" cube.obj -o n.glb --vertices 100 --texture cells.png
refuses 1 "no texture coordinates" cube.obj -o n.glb --vertices 100 --density cells.png
refuses 1 "missing.ply" torus.obj -o n.glb --vertices 100 --instances missing.ply
sed 's/^0.4 0.2 0 255/0.9 0.8 0 255/' points.ply >outside.ply
refuses 1 "outside the triangle" torus.obj -o n.glb --vertices 100 --instances outside.ply
mkdir broken
sed 's/"edges"/"corners"/' triangles/tiles.json >broken/tiles.json
cp triangles/atlas.png broken/
refuses 1 "broken/tiles.json" torus.obj -o n.glb --vertices 100 --tiles broken
head -c 500 triangles/tiles.json >broken/tiles.json
refuses 1 "not a JSON file" torus.obj -o n.glb --vertices 100 --tiles broken
cp triangles/tiles.json broken/ && head -c 300 triangles/atlas.png >broken/atlas.png
refuses 1 "broken/atlas.png" torus.obj -o n.glb --vertices 100 --tiles broken
mkdir n-atlas.png
refuses 1 "n-atlas.png" torus.obj -o n.glb --vertices 100 --tiles triangles
rmdir n-atlas.png

# ---- bad meshes
bad() { # TEXT FILE
    refuses 1 "$1" "$2" -o n.obj --vertices 60
}
: >empty.obj
bad "cannot read 'empty.obj'" empty.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\n' >points.obj
bad "no faces" points.obj
printf 'v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n' >nan.obj
bad "line 3" nan.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n' >index.obj
bad "line 4" index.obj
printf 'v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n' >flat.obj
bad "no area" flat.obj
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 -1 -1\nf 1 2 3\nf 1 2 4\nf 1 2 5\n' >book.obj
check "three triangles at an edge" warns "1 triangle left over there got a border" \
    retile book.obj -o book-out.obj --vertices 60
awk 'BEGIN {
    pi = atan2(0, -1); n = 12
    for (i = 0; i < n; i++) for (s = -0.3; s < 0.4; s += 0.6) {
        a = 2 * pi * i / n
        print "v", (1 + s * cos(a / 2)) * cos(a), (1 + s * cos(a / 2)) * sin(a), s * sin(a / 2)
    }
    for (i = 0; i < n - 1; i++) print "f", 2 * i + 1, 2 * i + 3, 2 * i + 4, 2 * i + 2
    print "f", 2 * n - 1, 2, 1, 2 * n
}' >band.obj
check "a one-sided band" warns "one-sided surface cut" retile band.obj -o band-out.obj --vertices 60
head -c 3000 /dev/urandom >noise.obj
bad "noise.obj" noise.obj
{ echo ply; head -c 3000 /dev/urandom; } >noise.ply
bad "noise.ply" noise.ply
bad "cells.png" cells.png
bad "cannot read '.'" .
sed 's/element vertex 4/element vertex 4000000000/' colored.ply >huge.ply
bad "huge.ply" huge.ply
sed 's/^3 0 2 3/3 0 2 7/' colored.ply >beyond.ply
bad "beyond.ply" beyond.ply
for part in 20 50 80 97; do # a cut OBJ may be a smaller mesh; a PLY tells how much there is
    head -c $(($(wc -c <colored.ply) * part / 100)) colored.ply >cut.ply
    bad "cut.ply" cut.ply
    head -c $(($(wc -c <t.ply) * part / 100)) t.ply >cut.ply
    bad "cut.ply" cut.ply
done
# one byte changed: a mesh, or status 1 and one line. A vertex may come to lie so far out that floats hold
# fewer places than vertices
accepts_or_refuses() {
    timeout 60 "$texkit" retile "$1" -o flip.glb --vertices 60 --quiet >out.log 2>err.log
    case $? in
    0) [ ! -s err.log ] && $check_glb flip.glb ;;
    1) [ "$(wc -l <err.log)" = 1 ] ;;
    *) return 1 ;;
    esac || { cat err.log; return 1; }
}
flips=24
[ "$FULL" = 1 ] && flips=200
"$texkit" retile torus.obj -o small.ply --vertices 40 --quiet
changed_bytes() {
    bytes=$(wc -c <small.ply) i=0
    while [ $i -lt $flips ]; do
        cp small.ply flip.ply
        printf "\\$(printf %o $(((i * 37 + 1) % 256)))" |
            dd of=flip.ply bs=1 seek=$((i * bytes / flips)) conv=notrunc 2>/dev/null
        accepts_or_refuses flip.ply || { echo "byte $((i * bytes / flips)) changed"; return 1; }
        i=$((i + 1))
    done
}
check "$flips meshes with one byte changed" changed_bytes
