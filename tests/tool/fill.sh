#!/bin/sh
# texkit fill: what it replaces, what it leaves alone, and what it refuses.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_inpaint.py" "$@"; }
cd "$tmp" || exit 1

"$root/build/draw" sand sand.png 96
"$root/build/draw" sand gray.png 96 1
look picture deep 96 deep.png
look picture alpha 96 alpha.png
for kind in disc all none alpha edge; do look mask $kind 96 mask-$kind.png; done
look mask disc 64 small.png
"$root/build/texkit" learn sand.png -o sand.txs --types 3 --quiet

check "a picture" run 0 fill sand.png --mask mask-disc.png -o a.png --stats stats.json
check "only the region changes" look kept sand.png mask-disc.png a.png 0.8
check "tells what it did" grep -q 'a.png: [0-9]* pixels filled' out.log
for key in width height channels filled fill peak_bytes; do
    check "--stats has $key" grep -q "\"$key\": " stats.json
done
check "a mask in alpha" run 0 fill sand.png --mask mask-alpha.png -o b.png
check "the same picture" cmp a.png b.png
for threads in 1 3; do
    check "--threads $threads" run 0 fill sand.png --mask mask-disc.png -o t.png --threads $threads
    check "the same picture again" cmp a.png t.png
done
check "--seed 2" run 0 fill sand.png --mask mask-disc.png -o s.png --seed 2
check "another picture" sh -c "! cmp -s a.png s.png"
for quality in -2 2; do
    check "--quality $quality" run 0 fill sand.png --mask mask-edge.png -o q.png --quality $quality
    check "at the border too only the region changes" look kept sand.png mask-edge.png q.png 0.8
done
check "gray" run 0 fill gray.png --mask mask-disc.png -o g.png
check "stays gray" look kept gray.png mask-disc.png g.png 0.8
check "16 bits" run 0 fill deep.png --mask mask-disc.png -o d.png
check "stay 16 bits" look kept deep.png mask-disc.png d.png 0.5
check "alpha" run 0 fill alpha.png --mask mask-disc.png -o c.png
check "stays alpha" look kept alpha.png mask-disc.png c.png 0.5
check "--model" run 0 fill sand.png --mask mask-disc.png -o m.png --model sand.txs
check "only the region changes with a model" look kept sand.png mask-disc.png m.png 0.8
check "--relight" run 0 fill sand.png --mask mask-disc.png -o l.png --model sand.txs --relight
refuses 2 "without --model" fill sand.png --mask mask-disc.png -o n.png --relight
check "--source" warns "white in 4.4 %" fill sand.png --mask mask-disc.png -o u.png --source mask-edge.png
check "the source makes a difference" sh -c "! cmp -s a.png u.png"

refuses 2 "add --mask" fill sand.png -o n.png
refuses 2 "--quality" fill sand.png --mask mask-disc.png -o n.png --quality 3
refuses 2 "end the name in" fill sand.png --mask mask-disc.png -o n.xyz
refuses 2 "alpha" fill alpha.png --mask mask-disc.png -o n.jpg
refuses 2 "would destroy" fill sand.png --mask mask-disc.png -o mask-disc.png
refuses 1 "No such file" fill missing.png --mask mask-disc.png -o n.png
refuses 1 "No such file" fill sand.png --mask missing.png -o n.png
refuses 1 "make it 96 x 96" fill sand.png --mask small.png -o n.png
refuses 1 "the source mask" fill sand.png --mask mask-disc.png --source small.png -o n.png
refuses 1 "nothing of it counts" fill sand.png --mask mask-none.png -o n.png
refuses 1 "covers the whole picture" fill sand.png --mask mask-all.png -o n.png
refuses 1 "the source mask" fill sand.png --mask mask-disc.png --source mask-none.png -o n.png
refuses 1 "channels" fill gray.png --mask mask-disc.png --model sand.txs -o n.png
refuses 1 "sand.png" fill sand.png --mask mask-disc.png --model sand.png -o n.png
