#!/bin/sh
# --even of texkit learn, synth, patch and tiles: uneven light is found, said and taken out.
# tests/tool/check_even.py draws the exemplars.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_even.py" "$@"; }
cd "$tmp" || exit 1
look draw .
is() { [ "$1" = "$2" ] || { echo "$1 instead of $2"; return 1; }; }
differ() { ! cmp -s "$1" "$2"; }
tileable="--size 96x96 --tileable --passes 1"

# ---- patch
check "even light is left alone, in silence" run 0 patch fair.png -o a.png $tileable --stats stats.json
check "and --stats says so" is "$(figure even)" 0
check "--even 0 changes nothing" run 0 patch fair.png -o b.png $tileable --even 0
check "the same picture" cmp a.png b.png
check "uneven light left as it is" run 0 patch lit.png -o n.png $tileable --even 0
check "shows" look slow n.png 8 99
check "is found and said" warns "uneven by 1." patch lit.png -o e.png $tileable --stats stats.json
check "with half the side as the radius" is "$(figure even)" 48
check "and is gone" look slow e.png 0 6
check "any radius" run 0 patch lit.png -o r.png $tileable --even 20
check "is gone too" look slow r.png 0 6
check "16 bits" run 0 patch lit-deep.png -o d.png $tileable --even 48
check "stay 16 bits" look deep d.png
check "evened" look slow d.png 0 6
check "maps in register" run 0 patch lit.png -o m.png --size 96x96 --even 48 --normal 2 --passes 1 \
    --maps lit-height.png,lit-normal.png,lit-gloss.png
check "heights keep their slope" look slow m-height.png 8 99
check "a map of colors is evened" look slow m-gloss.png 0 6
check "colors that are data" run 0 patch lit.png -o m.png --size 96x96 --even 48 --data 1 \
    --maps lit-gloss.png --passes 1
check "are not" look slow m-gloss.png 8 99
check "what a mask leaves out" warns "uneven" patch object.png -o o.png $tileable --mask mask.png
check "does not count" look slow o.png 0 6
check "and is not there" look red o.png 0
check "labels are left alone" run 0 patch lit.png -o l.png $tileable --label 0
check "--quiet says nothing" run 0 patch lit.png -o q.png $tileable --quiet
check "and evens it" cmp q.png e.png
check "more exemplars, each by its own light" warns "lit.png" patch fair.png -o x.png $tileable \
    --exemplars lit.png
check "evened" look slow x.png 0 6
refuses 2 "8 or more" patch lit.png -o n.png $tileable --even 7
refuses 2 "--even" patch lit.png -o n.png $tileable --even -1

# ---- learn and synth
few="--types 4 --levels 2"
check "learn" warns "lit.png" learn lit.png -o e.txs $few
check "left as it is" run 0 learn lit.png -o n.txs $few --even 0
check "is another model" differ e.txs n.txs
check "the same as with that radius" run 0 learn lit.png -o r.txs $few --even 48
check "as it says" cmp e.txs r.txs
check "with a mask" warns "object.png" learn object.png -o o.txs $few --mask mask.png
check "synth" warns "lit.png" synth lit.png -o s.png --size 16x16 --quality -2
check "from a model" run 0 synth e.txs -o s.png --size 16x16 --quality -2
refuses 2 "texkit learn" synth e.txs -o n.png --size 16x16 --even 20
refuses 2 "8 or more" synth lit.png -o n.png --size 16x16 --even 3
refuses 2 "8 or more" learn lit.png -o n.txs --even 1

# ---- tiles
check "tiles" warns "lit.png" tiles lit.png -o evened --kind wang --size 32 --stats stats.json
check "evened" look slow evened/preview.png 0 6
check "by so much" is "$(figure even)" 48
check "left as they are" run 0 tiles lit.png -o tiles --kind wang --size 32 --even 0
check "are others" differ evened/atlas.png tiles/atlas.png
check "the edges' picture" warns "lit.png" tiles fair.png -o tiles --kind wang --size 32 \
    --edges fair.png,lit.png
check "more pictures" warns "lit.png" tiles fair.png -o tiles --kind wang --size 32 --more lit.png
refuses 2 "8 or more" tiles lit.png -o n --kind wang --size 32 --even 2

