#!/bin/sh
# texinpaint.h against strange pictures, masks and meshes: some hundreds here, more with --full.
. tests/kit/tap.sh

runs=300
[ "$FULL" = 1 ] && runs=2000
# shellcheck disable=SC2086 # flags are words
check "builds by itself" $CC -std=gnu99 $SANITIZE -O2 -DFUZZ_STANDALONE -ffp-contract=off -I. -Itests/kit \
    tests/wide/fuzz/fuzz_texinpaint.c -o "$OUT/fuzz_inpaint" -lm &&
    check "$runs inputs" "$OUT/fuzz_inpaint" $runs

if [ "$FULL" = 1 ] && has clang; then
    check "builds with libFuzzer" clang -std=gnu99 -O2 -g -ffp-contract=off \
        -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -I. \
        -Itests/kit tests/wide/fuzz/fuzz_texinpaint.c -o "$OUT/fuzz_inpaint_libfuzzer" -lm &&
        check "3,000 runs of libFuzzer" "$OUT/fuzz_inpaint_libfuzzer" -runs=3000 -seed=1 \
            -max_len=512 -timeout=60 -rss_limit_mb=2000 -verbosity=0 -artifact_prefix="$OUT/"
fi
