#!/bin/sh
# Masks of all forms in every command that reads one, and what comes in with 16 bits or as normals.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_masks.py" "$@"; }
cd "$tmp" || exit 1
look draw .

patch="patch object.png --size 128x128 --passes 1"
for mask in hard soft noise alpha deep part; do
    check "patch --mask $mask" run 0 $patch -o p.png --mask $mask.png
    check "patch --keep-mask $mask" run 0 $patch -o k.png --mask hard.png --keep object.png --keep-mask $mask.png
    check "learn --mask $mask" run 0 learn object.png -o m.txs --mask $mask.png --types 3
    check "synth" run 0 synth m.txs -o s.png --size 64x64 --quality -2
    check "nothing of the object is used" look red p.png k.png s.png
done
for mask in hard soft alpha deep; do
    check "fill --mask $mask" run 0 fill object.png --mask hole-$mask.png -o f.png --quality -2
    check "inpaint --mask $mask" run 0 inpaint object.png --mask hole-$mask.png -o i.png
    check "nothing of the object is left" look red f.png i.png
done
check "noise is not a rim" sh -c "'$texkit' fill object.png --mask hole-hard.png --source noise.png -o a.png --quiet &&
    '$texkit' fill object.png --mask hole-hard.png --source hard.png -o b.png --quiet && cmp a.png b.png"

refuses 1 "nothing of it counts" $patch -o n.png --mask black.png
refuses 1 "lightest pixel is 11 % white" learn object.png -o n.txs --mask black.png
refuses 1 "nothing of it counts" segment object.png -o n.png --mask black.png
refuses 1 "covers the whole picture" fill object.png --mask white.png -o n.png
check "a mask that is inverted, it seems" warns "invert it" inpaint object.png --mask hole-most.png -o i.png
check "a mask that changes nothing" warns "white everywhere" $patch -o p.png --mask white.png
check "nothing is kept" warns "nothing of it counts" $patch -o k.png --mask hard.png --keep object.png --keep-mask black.png

# ---- depth
check "synth of 16 bits" run 0 synth height.png -o h.png --size 48x48 --quality -2
check "has 16 bits" look bits h.png 16
check "in JPEG it says so" warns "takes 8" synth height.png -o h.jpg --size 48x48 --quality -2
check "learn says what a model keeps" warns "add --deep" learn height.png -o h.txs --types 3
check "--deep" run 0 synth h.txs -o h.png --size 48x48 --quality -2 --deep
check "has 16 bits" look bits h.png 16
check "tiles with deep maps" run 0 tiles object.png -o t --kind wang --size 32 --maps height.png
check "have 8 and 16 bits" sh -c "/usr/bin/python3 '$root/tests/tool/check_masks.py' bits t/atlas.png 8 &&
    /usr/bin/python3 '$root/tests/tool/check_masks.py' bits t/atlas-2.png 16"
check "deep tiles" run 0 tiles height.png -o d --kind wang --size 32
check "have 16 bits, the preview too" sh -c "/usr/bin/python3 '$root/tests/tool/check_masks.py' bits d/atlas.png 16 &&
    /usr/bin/python3 '$root/tests/tool/check_masks.py' bits d/preview.png 16"

# ---- normal maps
turned="--turns 4 --mirror --normal 1"
check "patch with flat normals" run 0 $patch -o q.png $turned --maps flat.png
check "they stay flat" look flat q-flat.png 8
check "of 16 bits" run 0 $patch -o q.png $turned --maps flat16.png
check "they stay flat" look flat q-flat16.png 16
check "inpaint with flat normals" run 0 inpaint object.png --mask hole-hard.png -o i.png --maps flat.png --normal 1
check "they stay flat" look flat i-flat.png 8
check "normals without --normal" warns "add --normal 1" $patch -o q.png --maps flat.png
check "in inpaint" warns "add --normal 1" inpaint object.png --mask hole-hard.png -o i.png --maps flat.png

