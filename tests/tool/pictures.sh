#!/bin/sh
# What commands read and write: warnings, turned pictures, limits, the formats of other libraries.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
make_picture() { /usr/bin/python3 "$root/tests/tool/pictures.py" "$@"; }
cd "$tmp" || exit 1
for kind in upright turned gamma mask key huge long sum; do make_picture $kind $kind.png; done
size="--size 48x48"

check "a gamma of 1: one warning" warns "'gamma.png': its gamma" patch gamma.png -o a.png $size
check "none with --quiet" run 0 patch gamma.png -o b.png $size --quiet
check "the same picture" cmp a.png b.png
check "the same warning for a mask" warns "'mask.png': its gamma" \
    patch upright.png -o a.png $size --mask mask.png
check "and for a map" warns "'gamma.png': its gamma" patch upright.png -o a.png $size --maps gamma.png
check "and for an exemplar of learn" warns "'gamma.png': its gamma" learn gamma.png -o a.txs --even 0
check "and of synth" warns "'gamma.png': its gamma" synth gamma.png -o a.png --size 9x9 --even 0

check "an upright picture" run 0 patch upright.png -o a.png $size
check "the same picture, turned" run 0 patch turned.png -o b.png $size
check "the same result" cmp a.png b.png
check "a turned map of a turned picture" run 0 patch turned.png -o c.png $size --maps upright.png
check "lies in register" make_picture close c.png c-upright.png

check "a colour key" run 0 patch key.png -o k.png $size
check "makes RGBA" make_picture is k.png rgba
refuses 1 "60000 x 60000 pixels are too large" learn huge.png -o n.txs
refuses 1 "too large: at most" patch long.png -o n.png $size
refuses 1 "damaged" learn sum.png -o n.txs

check "JPEG" run 0 patch upright.png -o a.jpg $size
check "is read" run 0 patch a.jpg -o b.png $size
check "and is gray" make_picture is b.png gray
head -c $(($(wc -c <a.jpg) - 2)) a.jpg >end.jpg
check "without its end: one warning" warns "'end.jpg': its end is missing" patch end.jpg -o c.png $size
check "the same picture" cmp b.png c.png

check "a result" run 0 patch upright.png -o a.png $size
check "as it is read" run 0 patch a.png -o r.png --size 32x32
for extension in tif webp; do
    case $(cat "$root/build/files/libraries") in
    *${extension%p}*) ;;
    *) refuses 2 "was built without" patch upright.png -o n.$extension $size; continue ;;
    esac
    check ".$extension" run 0 patch upright.png -o a.$extension $size
    check "is read" run 0 patch a.$extension -o s.png --size 32x32
    [ $extension = webp ] || check "the same picture" cmp r.png s.png
done
