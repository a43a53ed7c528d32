#!/bin/sh
# The readers of pictures against hostile bytes: some ten thousands of mutated files of all formats here, a
# million with --full.
. tests/kit/tap.sh

libraries="$(cat build/files/libraries)" formats=
case $libraries in *tiff*) formats=-DTEXKIT_TIFF ;; esac
case $libraries in *webp*) formats="$formats -DTEXKIT_WEBP" ;; esac
with="tests/wide/fuzz/fuzz_image_decode.c tools/files/image_*.c $OUT/asan/files/stb.o"
flags="-std=gnu99 -ffp-contract=off -Isrc -Itools -Itests/kit $formats"

runs=20000
[ "$FULL" = 1 ] && runs=300000
# shellcheck disable=SC2086 # flags are words, files a pattern
check "builds by itself" $CC $flags $SANITIZE -DFUZZ_STANDALONE $with -o "$OUT/fuzz_image" $libraries -lm &&
    check "$runs mutated pictures" "$OUT/fuzz_image" $runs

# shellcheck disable=SC2086
if [ "$FULL" = 1 ] && has clang; then
    mkdir "$tmp/seeds"
    for extension in png jpg tga bmp tif webp; do
        build/texkit synth docs/gravel.png -o "$tmp/seeds/a.$extension" --size 32x32 --quality -2 --quiet
    done
    check "builds with libFuzzer" clang -O2 -g $flags -fsanitize=fuzzer,address,undefined \
        -fno-sanitize-recover=undefined tests/wide/fuzz/fuzz_image_decode.c tools/files/image_*.c \
        build/files/stb.o -o "$OUT/fuzz_image_libfuzzer" $libraries -lm &&
        check "300,000 runs of libFuzzer" "$OUT/fuzz_image_libfuzzer" -runs=300000 -seed=1 \
            -max_len=16384 -timeout=20 -rss_limit_mb=2000 -verbosity=0 \
            -artifact_prefix="$OUT/" "$tmp/seeds"
fi
