#!/bin/sh
# Loaders of models and composites against hostile bytes, and public calls against pictures of all kinds: a
# few thousand here, many more with FULL=1.
. tests/kit/tap.sh

mkdir "$tmp/seeds"
for kind in sand:3 cells:1 blades:4; do
    name=${kind%:*}
    build/draw "$name" "$tmp/$name.png" 48 "${kind#*:}"
    build/texkit learn "$tmp/$name.png" -o "$tmp/seeds/$name.txs" --types 3 --quiet
done
/usr/bin/python3 tests/tool/check_patch.py draw "$tmp"
build/texkit composite "$tmp/parts.png" --labels "$tmp/parts-labels.png" -o "$tmp/c.png" --size 9x9 \
    --types 3 --save "$tmp/seeds/parts.txc" --quiet

runs=20000
[ "$FULL" = 1 ] && runs=60000
check "builds by itself" $CC -std=gnu99 $SANITIZE -DFUZZ_STANDALONE -ffp-contract=off -I. \
    tests/wide/fuzz/fuzz_texsyn_load.c -o "$OUT/fuzz_standalone" -lm &&
    check "$runs mutated models and composites" "$OUT/fuzz_standalone" $runs "$tmp"/seeds/*

# build NAME: fuzz_texsyn_NAME, which uses public calls alone, with the object of the unit tests
build() {
    # shellcheck disable=SC2086 # flags are words
    check "fuzz_texsyn_$1 builds by itself" $CC -std=gnu99 $SANITIZE -DFUZZ_STANDALONE -DTEXSYN_IMPLEMENTED \
        -ffp-contract=off -I. "tests/wide/fuzz/fuzz_texsyn_$1.c" "$OUT/modules/texsyn.o" -o "$OUT/fuzz_$1" -lm
}
runs=100
[ "$FULL" = 1 ] && runs=500
build weather && check "$runs pictures into relighting and erosion" "$OUT/fuzz_weather" $runs
build fill && check "$runs random fillings" "$OUT/fuzz_fill" $runs
build knit && check "$runs random knits" "$OUT/fuzz_knit" $runs
build segment && check "$runs random segmentations" "$OUT/fuzz_segment" $runs

if [ "$FULL" = 1 ] && has clang; then
    check "builds with libFuzzer" clang -std=gnu99 -O2 -g -ffp-contract=off \
        -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -I. \
        tests/wide/fuzz/fuzz_texsyn_load.c -o "$OUT/fuzz_libfuzzer" -lm &&
        check "300,000 runs of libFuzzer" "$OUT/fuzz_libfuzzer" -runs=300000 -seed=1 \
            -max_len=16384 -timeout=20 -rss_limit_mb=2000 -verbosity=0 \
            -artifact_prefix="$OUT/" "$tmp/seeds"
fi
