#!/bin/sh
# Every command of the tool once as users call it, with a look at what it made, and one refusal: what
# `make test` tries of the command line. The other scripts here try everything.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
python=/usr/bin/python3
check_tool() { # NAME ARGUMENTS...: tests/tool/check_NAME.py
    name=$1
    shift
    $python "$root/tests/tool/check_$name.py" "$@"
}
cd "$tmp" || exit 1

"$root/build/draw" sand sand.png 48
"$root/build/draw" cells cells.png 64
check_tool patch draw .
commands=$("$texkit" --help | sed -n 's/^  \([a-z]*\)  .*/\1/p')

check "learn" run 0 learn sand.png -o sand.txs --types 8
check "makes a model" test -s sand.txs
refuses 1 "No such file" learn missing.png -o n.txs

check "synth" run 0 synth sand.txs -o synth.png --size 40x30 --tileable
check "has the size and channels" check_tool patch is synth.png 40 30 3 8
refuses 2 "such as 512x512" synth sand.txs -o n.png --size 0x5

"$root/build/scan" ball ball 192
check "fill" run 0 fill ball.png --mask ball-mask.png -o filled.png
check "changes nothing else" check_tool inpaint kept ball.png ball-mask.png filled.png 0.5
refuses 2 "add --mask" fill ball.png -o n.png
check "composite" run 0 composite parts.png --labels parts-labels.png -o composite.png --size 60x50 \
    --save parts.txc --map map.png
check "has the size and channels" check_tool patch is composite.png 60 50 3 8
check "from what it saved, drawn as it was" run 0 composite parts.txc -o again.png --layout map.png
check "the same picture" cmp composite.png again.png
refuses 1 "more than 16 colours" composite parts.png --labels parts.png -o n.png --size 60x50

check "segment" run 0 segment parts.png -o segments.png --segments 3 --gray
check "has the size" check_tool patch is segments.png 96 96 1 8
refuses 2 "--segments" segment parts.png -o n.png --segments 99

check "knit" run 0 knit plain.png cells.png --layout top.png -o knit.png
check "has the size and channels" check_tool patch is knit.png 64 64 3 8
refuses 2 "--layout" knit plain.png cells.png -o n.png

check "relight" run 0 relight sand.png --like cells.png -o relit.png
check "has the size and channels" check_tool patch is relit.png 48 48 3 8
refuses 2 "--like" relight sand.png -o n.png

check "erode" run 0 erode sand.png --weathered cells.png --level 0.5 -o eroded.png
check "has the size and channels" check_tool patch is eroded.png 48 48 3 8
refuses 2 "--weathered" erode sand.png -o n.png

check "straighten" run 0 straighten bricks.png -o straight.png --stats stats.json
check "has the size it says" check_tool patch is straight.png "$(figure width)" "$(figure height)" 3 8
refuses 1 "No such file" straighten missing.png -o n.png

check "patch" run 0 patch bricks.png -o patch.png --size 64x64 --passes 1
check "has the size and channels" check_tool patch is patch.png 64 64 3 8
refuses 1 "No such file" patch missing.png -o n.png --size 64x64

check "edges" run 0 edges cells.png -o edges.png --levels 3
check "has the size of the exemplar" check_tool patch is edges.png 64 64 3 8
refuses 2 "--levels" edges cells.png -o n.png --levels 1

check "tiles" run 0 tiles cells.png -o wang --kind wang --size 32 --reduced
check "the set is whole and true" check_tool tiles wang --reduced
refuses 2 "--kind" tiles cells.png -o n --kind round

"$root/build/shape" torus torus.obj 16
check "retile" run 0 retile torus.obj -o torus.glb --vertices 200
check "has so many places" check_tool glb torus.glb places=200
refuses 1 "No such file" retile missing.obj -o n.obj --vertices 100

check "inpaint" run 0 inpaint --mesh ball.obj --texture ball.png --mask ball-mask.png -o whole.png
check "changes nothing that is known, and the rest" check_tool inpaint kept ball.png ball-mask.png whole.png
check "in a picture" run 0 inpaint ball.png --mask ball-mask.png -o flat.png
check "differs from that on the mesh" sh -c "! cmp -s whole.png flat.png"
refuses 2 "add --mask" inpaint ball.png -o n.png

check "tree" run 0 tree -o tree.glb --species oak --pieces 60 --sheet 128 --wind 5 --seconds 1 \
    --rate 4 --stats stats.json
check "is whole, closed and moves" check_tool tree skin tree.glb keys=5 seconds=1 \
    joints="$(figure joints)" pieces="$(figure pieces)"
refuses 1 "there are" tree -o n.glb --species none

check "forest" run 0 forest -o forest.glb --count 5 --species oak,birch --pieces 50 --sheet 128
check "is copies in ten nodes" check_tool tree forest forest.glb most_nodes=10 trees=5
refuses 2 "--count" forest -o n.glb

for command in $commands; do
    check "$command is tried here" grep -q "^check \"$command\" run 0 $command " "$root/tests/tool/quick.sh"
    check "$command --help" run 0 "$command" --help
done
refuses 2 "unknown command" frobnicate sand.png
