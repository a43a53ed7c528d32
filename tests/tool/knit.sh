#!/bin/sh
# texkit knit: what it joins, what it leaves alone, and what it refuses.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_inpaint.py" "$@"; }
cd "$tmp" || exit 1

"$root/build/draw" sand sand.png 96
"$root/build/draw" cells cells.png 96
"$root/build/draw" cells gray.png 96 1
"$root/build/draw" cells half-size.png 48
look picture deep 96 deep.png
look picture alpha 96 alpha.png
for kind in disc all none edge; do look mask $kind 96 mask-$kind.png; done
look mask disc 64 small.png
layout="--layout mask-disc.png"

check "two pictures" run 0 knit sand.png cells.png $layout -o a.png --stats stats.json
check "tells what it did" grep -q 'a.png: 96 x 96 pixels' out.log
for key in width height channels read knit peak_bytes; do
    check "--stats has $key" grep -q "\"$key\": " stats.json
done
for threads in 1 3; do
    check "--threads $threads" run 0 knit sand.png cells.png $layout -o t.png --threads $threads
    check "the same picture again" cmp a.png t.png
done
check "--seed 2" run 0 knit sand.png cells.png $layout -o s.png --seed 2
check "another picture" sh -c "! cmp -s a.png s.png"
check "a border as drawn" run 0 knit sand.png cells.png $layout -o r.png --roughness 0 --zone 1
check "one texture" run 0 knit sand.png sand.png --layout mask-edge.png -o e.png --textures same
check "B of another size" run 0 knit sand.png half-size.png $layout -o h.png
check "--relight" run 0 knit sand.png cells.png $layout -o l.png --relight
check "the light makes a difference" sh -c "! cmp -s a.png l.png"
check "an example of a border" run 0 knit sand.png cells.png $layout -o x.png --border a.png \
    --border-layout mask-disc.png
check "the example makes a difference" sh -c "! cmp -s a.png x.png"
check "gray and colour" run 0 knit gray.png sand.png $layout -o g.png --quality -2
check "8 and 16 bits" run 0 knit deep.png sand.png $layout -o d.png --quality -2
check "alpha" run 0 knit alpha.png sand.png $layout -o c.png --quality 1

refuses 2 "add --layout" knit sand.png cells.png -o n.png
refuses 2 "give both" knit sand.png cells.png $layout --border a.png -o n.png
refuses 2 "--zone" knit sand.png cells.png $layout -o n.png --zone 65
refuses 2 "--roughness" knit sand.png cells.png $layout -o n.png --roughness 33
refuses 2 "choose one of" knit sand.png cells.png $layout -o n.png --textures other
refuses 2 "end the name in" knit sand.png cells.png $layout -o n.xyz
refuses 2 "would destroy" knit sand.png cells.png $layout -o cells.png
refuses 2 "alpha" knit alpha.png sand.png $layout -o n.jpg
refuses 1 "No such file" knit sand.png missing.png $layout -o n.png
refuses 1 "No such file" knit sand.png cells.png --layout missing.png -o n.png
refuses 1 "make it 96 x 96" knit sand.png cells.png --layout small.png -o n.png
refuses 1 "make it 96 x 96" knit sand.png cells.png $layout --border a.png --border-layout small.png -o n.png
refuses 1 "layout: is all black" knit sand.png cells.png --layout mask-none.png -o n.png
refuses 1 "layout: is all white" knit sand.png cells.png --layout mask-all.png -o n.png
refuses 1 "shorter than 64" knit sand.png cells.png $layout --border a.png --border-layout mask-none.png -o n.png
