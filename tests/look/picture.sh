#!/bin/sh
# Synthesised pictures look like their exemplars, as far as figures tell: statistics within the
# exemplar's own sampling noise, no pasted blocks, a seamless wrap where one was asked for. Tiles lie
# side by side as if there were no joints. And all output formats hold the same picture.
# tests/look/oiio_compare.cpp explains the figures.
. tests/kit/tap.sh

compare=$OUT/oiio_compare
if [ ! "$compare" -nt tests/look/oiio_compare.cpp ]; then
    check "oiio_compare builds" $CXX -std=c++14 -O2 -Wall -Wextra tests/look/oiio_compare.cpp \
        -o "$compare" -lOpenImageIO -lOpenImageIO_Util || exit 1
fi

for name in sand blades clouds cells stripes; do
    build/draw $name "$tmp/$name.png" 160
done
build/draw cells "$tmp/gray.png" 160 1
build/draw cells "$tmp/rgba.png" 160 4
exemplars="sand blades clouds cells stripes gray rgba"
if [ "$FULL" = 1 ] && [ -e build/samples/list.txt ]; then
    for sample in build/samples/*.png; do
        name=photo-$(basename "$sample" .png)
        cp "$sample" "$tmp/$name.png"
        exemplars="$exemplars $name"
    done
fi

# alike EXEMPLAR PICTURE: the statistics of the exemplar, nothing copied
alike() {
    "$compare" texture "$1" "$2" 'mean<8' 'histogram<1.5' 'gradient<2' 'reach<2.5' \
        'autocorrelation<3' 'novelty>0.8'
}
# wraps PICTURE...: on both axes
wraps() { "$compare" wrap "$@" 'x>0.8' 'x<1.25' 'y>0.8' 'y<1.25'; }
fails() { ! "$@"; }

for name in $exemplars; do
    build/texkit learn "$tmp/$name.png" -o "$tmp/$name.txs" --quiet
    build/texkit synth "$tmp/$name.txs" -o "$tmp/$name-out.png" --size 256x256 --quiet
    check "$name: the statistics of the exemplar, nothing copied" \
        alike "$tmp/$name.png" "$tmp/$name-out.png"
    for seed in 1 2 3; do # one border is too few pixels to tell
        build/texkit synth "$tmp/$name.txs" -o "$tmp/tile$seed.png" --size 256x192 --tileable \
            --seed $seed --quiet
    done
    check "$name: wraps on both axes" wraps "$tmp/tile1.png" "$tmp/tile2.png" "$tmp/tile3.png"
done

# the figures tell: what must not pass does not
for name in sand blades cells; do
    "$compare" shuffle "$tmp/$name-out.png" "$tmp/shuffled.png"
    check "$name: shuffled pixels are not alike" fails alike "$tmp/$name.png" "$tmp/shuffled.png"
    check "$name: a copy is not new" fails alike "$tmp/$name.png" "$tmp/$name.png"
    check "$name: the exemplar itself does not wrap" fails wraps "$tmp/$name.png"
done
check "sand is not cells" fails alike "$tmp/sand.png" "$tmp/cells-out.png"
check "cells are not blades" fails alike "$tmp/cells.png" "$tmp/blades-out.png"

# joins PICTURE SIZE: the joints of its tiles do not show. Small tiles have few pixels at joints.
joins() {
    if [ "$2" -ge 64 ]; then "$compare" seam "$1" "$2" 'x>0.85' 'x<1.2' 'y>0.85' 'y<1.2' 'beside<1.2'
    else "$compare" seam "$1" "$2" 'x>0.7' 'x<1.3' 'y>0.7' 'y<1.3' 'beside<1.3'
    fi
}
for name in $exemplars; do
    case $name in photo-*) size=64 ;; *) size=32 ;; esac
    for kind in wang corner frame; do
        build/texkit tiles "$tmp/$name.png" -o "$tmp/$name-$kind" --kind $kind --size $size \
            --variants 2 --quiet
        check "$name: no joints between $kind tiles" joins "$tmp/$name-$kind/preview.png" $size
    done
    # of drawn sand every pixel is for itself
    case $name in sand | photo-sand) continue ;; esac
    "$compare" shuffle "$tmp/$name.png" "$tmp/shuffled.png" 32
    check "$name: squares of the exemplar show theirs" fails joins "$tmp/shuffled.png" 32
    "$compare" shuffle "$tmp/$name-corner/preview.png" "$tmp/shuffled.png" $size
    check "$name: so do tiles that do not match" fails joins "$tmp/shuffled.png" $size
done

build/texkit synth "$tmp/sand.txs" -o "$tmp/f.png" --size 100x80 --quiet
for format in tga bmp; do
    build/texkit synth "$tmp/sand.txs" -o "$tmp/f.$format" --size 100x80 --quiet
    check "the same picture as .$format" "$compare" same "$tmp/f.png" "$tmp/f.$format" 'max<0.0001'
done
build/texkit synth "$tmp/sand.txs" -o "$tmp/f.jpg" --size 100x80 --quiet
check "nearly the same picture as .jpg" "$compare" same "$tmp/f.png" "$tmp/f.jpg" 'psnr>25'

# 16 bits: what others write is read and written again to the last bit
# shellcheck disable=SC2046 # words
check "copy_deep builds" $CC -std=c99 -O2 -Wall -Wextra -I. -Itools tests/look/copy_deep.c \
    build/files/image_*.o build/files/stb.o -o "$tmp/copy_deep" $(cat build/files/libraries) -lm
for input in "png 1" "png 3" "png 4" "pgm 1" "ppm 3"; do
    set -- $input
    "$compare" deep "$tmp/reference.png" "$2"
    "$compare" deep "$tmp/deep.$1" "$2"
    check "the same 16 bits from .$1 with $2 channels" sh -c "
        '$tmp/copy_deep' '$tmp/deep.$1' '$tmp/copy.png' &&
        '$compare' same '$tmp/reference.png' '$tmp/copy.png' 'max<1e-9' 'mean<1e-9'"
done
