#!/bin/sh
# Synthesised pictures look like their exemplars, as far as figures tell: statistics within the
# exemplar's own sampling noise, no pasted blocks, a seamless wrap where one was asked for. And all
# output formats hold the same picture. tests/oiio_compare.cpp explains the figures.
. tests/tap.sh

compare=$OUT/oiio_compare
if [ ! "$compare" -nt tests/oiio_compare.cpp ]; then
    check "oiio_compare builds" $CXX -std=c++14 -O2 -Wall -Wextra tests/oiio_compare.cpp \
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

for name in $exemplars; do
    build/texkit learn "$tmp/$name.png" -o "$tmp/$name.txs" --quiet
    build/texkit synth "$tmp/$name.txs" -o "$tmp/out.png" --size 256x256 --quiet
    check "$name: the statistics of the exemplar, nothing copied" \
        "$compare" texture "$tmp/$name.png" "$tmp/out.png" \
        'mean<8' 'histogram<3' 'gradient<3' 'reach<3' 'autocorrelation<3' 'novelty>0.7'
    build/texkit synth "$tmp/$name.txs" -o "$tmp/out.png" --size 250x200 --tileable --quiet
    check "$name: wraps on both axes" \
        "$compare" wrap "$tmp/out.png" 'x>0.8' 'x<1.25' 'y>0.8' 'y<1.25'
done

build/texkit synth "$tmp/sand.txs" -o "$tmp/f.png" --size 100x80 --quiet
for format in tga bmp; do
    build/texkit synth "$tmp/sand.txs" -o "$tmp/f.$format" --size 100x80 --quiet
    check "the same picture as .$format" "$compare" same "$tmp/f.png" "$tmp/f.$format" 'max<0.0001'
done
build/texkit synth "$tmp/sand.txs" -o "$tmp/f.jpg" --size 100x80 --quiet
check "nearly the same picture as .jpg" "$compare" same "$tmp/f.png" "$tmp/f.jpg" 'psnr>25'
