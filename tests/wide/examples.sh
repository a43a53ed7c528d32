#!/bin/sh
# The examples: those that use nothing but the headers compile as at a user's, with the headers at the root
# and nothing else of this repository. Each does what its head comment says, and refuses what it cannot.
. tests/kit/tap.sh

warn="-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Werror"
mkdir "$tmp/include" && cp ./*.h "$tmp/include/"
build/draw bricks "$tmp/bricks.png" 96
build/draw bricks-height "$tmp/height.png" 96
build/draw clouds "$tmp/clouds.png" 96
build/shape blob "$tmp/blob.obj"
build/scan ball "$tmp/ball" 256

# example NAME: take the one that make has built from src/, of which the headers are made; see that it
# compiles with those, and explains itself if it is called without arguments
example() {
    files=examples/$1.c
    [ -e "$files" ] || files=$(echo "examples/$1"/*.c)
    # shellcheck disable=SC2086 # words
    check "$1 compiles with the headers alone" $CC -std=c99 -ffp-contract=off $warn -fsyntax-only \
        -I"$tmp/include" $files || exit 1
    cp "build/examples/$1" "$tmp/$1"
    check "$1 says how it is called" usage "$1"
}
usage() {
    "$tmp/$1" >"$tmp/out.log" 2>&1
    [ $? = 2 ] && grep -q "^usage: $1 " "$tmp/out.log"
}
# refuses TEXT COMMAND...: status 1, and TEXT on stderr
refuses() {
    text=$1
    shift
    "$@" >"$tmp/out.log" 2>"$tmp/err.log"
    [ $? = 1 ] && grep -q "$text" "$tmp/err.log" || { cat "$tmp/err.log"; return 1; }
}
# size FILE.png: its width and height
size() { od -An -tu1 -j16 -N8 "$1" | awk '{ print $3 * 256 + $4, $7 * 256 + $8 }'; }

synthesise() {
    (cd "$tmp" && ./synthesise clouds.png c.txs c.png) || return 1
    [ "$(head -c 4 "$tmp/c.txs")" = TXS2 ] && [ "$(size "$tmp/c.png")" = "512 512" ]
}
example synthesise
check "synthesise writes a model and a texture" synthesise
check "synthesise needs a photograph" refuses "^synthesise: " "$tmp/synthesise" none.png m.txs o.png

wall() {
    (cd "$tmp" && ./wall w bricks.png height.png && ./wall again bricks.png height.png) || return 1
    [ "$(size "$tmp/w-0.png")" = "512 512" ] && [ "$(size "$tmp/w-1.png")" = "512 512" ] &&
        [ ! -e "$tmp/w-2.png" ] && cmp "$tmp/w-0.png" "$tmp/again-0.png" && cmp "$tmp/w-1.png" "$tmp/again-1.png" &&
        ! cmp -s "$tmp/w-0.png" "$tmp/w-1.png"
}
example wall
check "wall writes all maps of a material, the same again" wall
check "wall needs maps of one size" refuses "^wall: " "$tmp/wall" "$tmp/bad" "$tmp/bricks.png" "$tmp/c.png"

# a field smaller than the default
terrain() {
    for kind in sand clouds cells; do build/draw $kind "$tmp/$kind-256.png" 256 || return 1; done
    (cd "$tmp" && ./terrain sand-256.png cells-256.png clouds-256.png t 128 &&
        ./terrain sand-256.png cells-256.png clouds-256.png again 128) || return 1
    [ "$(size "$tmp/t-map.png")" = "128 128" ] && [ "$(size "$tmp/t.png")" = "1200 600" ] &&
        cmp "$tmp/t-map.png" "$tmp/again-map.png"
}
example terrain
check "terrain writes a map and a picture, the same again" terrain
check "terrain needs photographs" refuses "^terrain: " "$tmp/terrain" none.png none.png none.png "$tmp/n"
check "terrain needs them large enough" refuses "under 256" "$tmp/terrain" "$tmp/clouds.png" "$tmp/clouds.png" \
    "$tmp/clouds.png" "$tmp/n"

strokes() {
    "$tmp/strokes" "$tmp/clouds.png" "$tmp/s.png" && [ "$(size "$tmp/s.png")" = "512 512" ]
}
example strokes
check "strokes writes a texture" strokes
check "strokes needs a photograph" refuses "^strokes: " "$tmp/strokes" none.png o.png

floor() {
    "$tmp/floor" "$tmp/clouds.png" "$tmp/f.png" && [ "$(size "$tmp/f.png")" = "960 540" ]
}
example floor
check "floor writes a picture" floor
check "floor needs a photograph" refuses "^floor: " "$tmp/floor" none.png o.png

# a scale is 5 vertices and 4 triangles; a closed surface of V vertices has 2 V - 4 triangles
scales() {
    "$tmp/scales" "$tmp/blob.obj" "$tmp/scales.obj" 300 || return 1
    [ "$(grep -c '^v ' "$tmp/scales.obj")" = $((5 * 596)) ] &&
        [ "$(grep -c '^f ' "$tmp/scales.obj")" = $((4 * 596)) ] && ! grep -q nan "$tmp/scales.obj"
}
example scales
check "scales puts one scale on each triangle" scales
check "scales needs a mesh" refuses "cannot read" "$tmp/scales" none.obj o.obj
check "scales needs vertices enough" refuses "^scales: " "$tmp/scales" "$tmp/blob.obj" o.obj 3

# every face has numbers of vertices and of texture coordinates that are there; bark may go round its
# sheet twice
tree() {
    (cd "$tmp" && mkdir -p t && ./tree birch t/birch 3) || return 1
    grep -qx 'mtllib birch.mtl' "$tmp/t/birch.obj" || return 1
    for picture in $(sed -n 's/^map_[A-Za-z]* //p' "$tmp/t/birch.mtl"); do
        [ -s "$tmp/t/$picture" ] || { echo "no $picture"; return 1; }
    done
    tr / ' ' <"$tmp/t/birch.obj" | awk '
        $1 == "v" { v++ }
        $1 == "vn" { n++ }
        $1 == "vt" { t++; if ($2 < 0 || $2 > 2 || $3 < 0 || $3 > 1) bad++ }
        $1 == "f" {
            f++
            for (i = 2; i <= 10; i += 3)
                if ($i < 1 || $i > v || $(i + 1) < 1 || $(i + 1) > t || $(i + 2) > n) bad++
        }
        END { print v, t, f, bad + 0; exit !(f > 1000 && v == n && !bad) }'
}
example tree
check "tree writes a mesh, its materials and their pictures" tree
check "tree knows its species" refuses 'no species "fern"' "$tmp/tree" fern "$tmp/fern"

# the disc is the mask of that box
remove() {
    /usr/bin/python3 tests/tool/check_inpaint.py mask disc 96 "$tmp/disc.png" &&
        "$tmp/remove" "$tmp/clouds.png" "$tmp/r.png" 32,32,32,32 &&
        /usr/bin/python3 tests/tool/check_inpaint.py kept "$tmp/clouds.png" "$tmp/disc.png" "$tmp/r.png"
}
example remove
check "remove writes a picture" remove
check "remove needs a photograph" refuses "^remove: " "$tmp/remove" none.png "$tmp/n.png" 1,1,5,5
check "remove needs boxes" refuses "a box is" "$tmp/remove" "$tmp/clouds.png" "$tmp/n.png" 1,1,5
check "remove leaves something" refuses "^remove: " "$tmp/remove" "$tmp/clouds.png" "$tmp/n.png" -99,-99,300,300

pillar() {
    (cd "$tmp" && ./pillar bricks.png p.png && ./pillar bricks.png p2.png clouds.png) || return 1
    [ "$(size "$tmp/p.png")" = "520 1040" ] && [ "$(size "$tmp/p2.png")" = "520 1040" ] &&
        ! cmp -s "$tmp/p.png" "$tmp/p2.png"
}
example pillar
check "pillar writes pictures" pillar
check "pillar needs a photograph" refuses "^pillar: " "$tmp/pillar" none.png "$tmp/n.png"
check "pillar needs one that is large enough" sh -c "build/draw bricks '$tmp/small.png' 24 &&
    ! '$tmp/pillar' '$tmp/small.png' '$tmp/n.png' 2>'$tmp/err.log' && grep -q 'at least 32 x 32' '$tmp/err.log'"

# of more files than one: built by make
repair() {
    build/examples/repair "$tmp/ball.obj" "$tmp/ball.png" "$tmp/ball-mask.png" "$tmp/b" || return 1
    /usr/bin/python3 tests/tool/check_inpaint.py kept "$tmp/ball.png" "$tmp/ball-mask.png" "$tmp/b.png" &&
        [ "$(size "$tmp/b-0.png")" = "1440 480" ] && [ "$(size "$tmp/b-1.png")" = "1440 480" ]
}
check "repair writes a texture and pictures" repair
check "repair needs coordinates" refuses "^repair: " build/examples/repair "$tmp/blob.obj" "$tmp/ball.png" \
    "$tmp/ball-mask.png" "$tmp/n"
check "repair needs a mask of the same size" refuses "^repair: " build/examples/repair "$tmp/ball.obj" \
    "$tmp/ball.png" "$tmp/clouds.png" "$tmp/n"
