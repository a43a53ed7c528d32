#!/bin/sh
# The same models, pictures, tile sets and meshes, byte for byte, from each compiler, at each level of
# optimisation on 2 threads, at -O3 on 1, 2 and 8 and with the indices of each parallel loop taken
# backwards (0 below); and from plain C as with SIMD.
. tests/tap.sh

levels="-O0 -O3"
[ "$FULL" = 1 ] && levels="-O0 -O1 -O2 -O3"
grep -q '^flags.*\<fma\>' /proc/cpuinfo 2>/dev/null && levels="$levels -O3_-mfma_-mavx2"

expected=
for cc in $(compilers); do
    for level in $levels; do
        flags=$(echo "$level" | tr _ ' ')
        check "builds with $cc $flags" \
            $cc -std=gnu99 $flags -ffp-contract=off -I. -Itests tests/same_bytes.c \
            -o "$tmp/same_bytes" -lpthread -lm || continue
        numbers=2
        [ "$level" = -O3 ] && numbers="1 2 8 0"
        for threads in $numbers; do
            hash=$("$tmp/same_bytes" $threads)
            expected=${expected:-$hash}
            check "hash $hash, $cc $flags, threads $threads" \
                test -n "$hash" -a "$hash" = "$expected"
        done
    done
done

# without SIMD the same
set -- $(compilers)
check "builds without SIMD" \
    "$1" -std=gnu99 -O2 -DTEXSYN_NO_SIMD -DTEXTILES_NO_SIMD \
    -DTEXPATCH_NO_SIMD -ffp-contract=off -I. -Itests \
    tests/same_bytes.c -o "$tmp/plain" -lpthread -lm && {
    hash=$("$tmp/plain" 2)
    check "hash $hash, $1 -O2 without SIMD, threads 2" test -n "$hash" -a "$hash" = "$expected"
}

# the tool with OpenMP agrees with itself
build/draw cells "$tmp/cells.png" 64
for threads in 1 2 8; do
    build/texkit learn "$tmp/cells.png" -o "$tmp/$threads.txs" --threads $threads --quiet
    build/texkit synth "$tmp/1.txs" -o "$tmp/$threads.png" --size 150x90 --threads $threads --quiet
    check "texkit learn, the same model with --threads $threads" \
        cmp "$tmp/1.txs" "$tmp/$threads.txs"
    check "texkit synth, the same picture with --threads $threads" \
        cmp "$tmp/1.png" "$tmp/$threads.png"
done

# no thread steps on another's data
if [ "$FULL" = 1 ] && has clang; then
    check "clean under the thread sanitizer" sh -c "
        clang -std=gnu99 -O1 -g -fsanitize=thread -ffp-contract=off -I. -Itests \
            tests/same_bytes.c -o '$tmp/tsan' -lpthread -lm && '$tmp/tsan' 4"
fi
