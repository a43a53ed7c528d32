#!/bin/sh
# Every command when memory runs out at one allocation after the other: status 1, one line, no output.
# tests/tool/check_starved.py runs the tool as released with tests/kit/starve.c, which needs glibc.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
released=$root/build/texkit checker=$root/tests/tool/check_starved.py draw=$root/build/draw
tries=$([ "$FULL" = 1 ] && echo 400 || echo 24)
if ! getconf GNU_LIBC_VERSION >/dev/null 2>&1; then
    echo "ok - starved # SKIP the C library is another"
    exit
fi
# shellcheck disable=SC2086 # flags are words
check "the library builds" $CC -std=gnu99 -O2 -fPIC -shared tests/kit/starve.c -o "$tmp/starve.so" || exit 1
# two materials with their labels, a mesh with a texture and a mask of it, a sphere, a hole
/usr/bin/python3 tests/tool/check_patch.py draw "$tmp"
mkdir "$tmp/run"
cd "$tmp/run" || exit 1
mv ../parts.png ../parts-labels.png .
"$draw" sand sand.png 64 3
"$draw" cells cells.png 64 4
"$root/build/scan" ball ball 64
"$root/build/shape" sphere sphere.obj 8
/usr/bin/python3 - <<'END'
with open("hole.pgm", "wb") as file:
    file.write(b"P5 64 64 255\n" + bytes(255 * (20 <= x < 34 and 24 <= y < 40) for y in range(64) for x in range(64)))
END
"$released" learn sand.png -o sand.txs --types 3 --quiet
"$released" tiles sand.png -o triangles --kind triangle --size 32 --colors 2 --quiet
for ending in tif webp jpg; do "$released" synth sand.txs -o "sand.$ending" --size 64x64 --quiet; done
for ending in ply glb stl; do "$released" retile sphere.obj -o "sphere.$ending" --vertices 100 --quiet; done

# starved WHAT ARGUMENTS...
starved() {
    what=$1
    shift
    check "$what" /usr/bin/python3 "$checker" "$released" "$tmp/starve.so" "$tries" "$@"
}
starved learn learn sand.png -o s.txs --types 3
for ending in tif webp jpg; do
    starved "$ending in" straighten "sand.$ending" -o s.png
    starved "$ending out" synth sand.txs -o "s.$ending" --size 64x48
done
starved fill fill sand.png --mask hole.pgm -o f.png
starved knit knit sand.png cells.png --layout hole.pgm -o k.png
starved segment segment parts.png -o s.png
starved composite composite parts.png --labels parts-labels.png -o c.png --size 9x9 --types 3 --save c.txc
starved relight relight sand.png --like cells.png -o r.png
starved erode erode sand.png --weathered cells.png --level 0.5 -o e.png
starved patch patch sand.png -o p.png --size 70x60 --maps cells.png --sources q.pfm --stats s.json
starved "patch, even" patch sand.png -o p.png --size 70x60 --even 9 --tileable
starved edges edges cells.png -o e.json
for kind in "frame --colors 1" wang corner "triangle --size 32"; do
    # shellcheck disable=SC2086 # a kind and its size
    starved "tiles, $kind" tiles sand.png -o t --size 16 --colors 2 --kind $kind
done
starved inpaint inpaint sand.png --mask hole.pgm -o i.png
starved "inpaint, pattern" inpaint sand.png --mask hole.pgm -o i.png --structure pattern --debug steps
starved "inpaint, mesh" inpaint --mesh ball.obj --texture ball.png --mask ball-mask.png -o i.png
for ending in ply glb stl obj; do starved "retile, $ending" retile "sphere.$ending" -o "r.$ending" --vertices 90; done
starved "retile, texture" retile ball.obj -o r.glb --vertices 90 --texture ball.png
starved "retile, tiles" retile sphere.obj -o r.glb --vertices 90 --tiles triangles
starved "retile, instances" retile sphere.obj -o r.glb --vertices 90 --instances sphere.ply
starved tree tree -o t.glb --pieces 60 --lods 2 --collision --wind 5
starved "tree, obj" tree -o t.obj --pieces 60
starved "tree, attributes" tree -o t.glb --pieces 60 --wind-attributes
starved forest forest -o f.glb --count 3 --pieces 40
starved "forest, variants" forest -o f.glb --count 4 --variants 2 --pieces 40
