#!/bin/sh
# The same bytes as tests/wide/golden/golden.txt says, module by module and case by case, from plain C
# as with SIMD. Builds differ in compiler, level of optimisation and leave to fuse multiply-add; those
# tried are the extremes, with FULL=1 all. Threads are tried with one build, and with the indices of each
# parallel loop taken backwards (0 below); `make test` tries 3, with the sanitizers.
. tests/kit/tap.sh
. tests/kit/library.sh

golden=tests/wide/golden
modules=$(sed 's/ .*//' $golden/golden.txt | uniq)

# build COMPILER "FLAGS" MODULE: links the golden program with the module compiled so
build() {
    library "$1" "$2" "$3" || { cat "$object.log"; return 1; }
    # shellcheck disable=SC2086 # flags are words
    $1 -std=gnu99 $2 -ffp-contract=off -D$(echo "$3" | tr '[:lower:]' '[:upper:]')_IMPLEMENTED -I. \
        -Itests/kit -I$golden "$golden/golden_$3.c" "$object" -o "$tmp/golden_$3" -lpthread -lm
}

# run MODULE HOW PROGRAM THREADS...
run() {
    module=$1 how=$2 program=$3
    shift 3
    for threads in "$@"; do
        check "the golden bytes of $module, $how, threads $threads" \
            $golden/compare.sh "$program $threads"
    done
}

# same COMPILER "FLAGS" THREADS...: all modules, built so, on so many threads
same() {
    cc=$1 flags=$2
    shift 2
    for module in $modules; do
        check "builds golden_$module, $cc $flags" build "$cc" "$flags" "$module" || continue
        run "$module" "$cc $flags" "$tmp/golden_$module" "$@"
    done
}

# is_tool_compiler COMPILER: "cc (Debian 12.2.0)" and "gcc (Debian 12.2.0)" are one
version() { "$1" --version | sed '1s/^[^ ]* //; 1q'; }
is_tool_compiler() { [ "$(version "$1")" = "$(version "$CC")" ]; }

# as the tool has them, at -O3
for module in $modules; do run "$module" "of the tool" build/golden/golden_$module 1 8 0; done

# -O2 of gcc and -O0 of clang are compiled for headers.sh as well; -O1 without SIMD
for cc in $(compilers); do
    levels="-O2"
    [ "$cc" = clang ] && levels="-O0"
    [ "$FULL" = 1 ] && levels="-O0 -O1 -O2"
    for level in $levels; do same "$cc" $level 2; done
    if grep -q '^flags.*\<fma\>' /proc/cpuinfo 2>/dev/null; then
        same "$cc" "-O3 -mfma -mavx2" 2
        [ "$FULL" = 1 ] || continue # plain -O3 is less of an extreme
    fi
    is_tool_compiler "$cc" || same "$cc" -O3 2
done
set -- $(compilers)
for name in $(grep -lE '^ +[A-Z]*_NO_SIMD' ./*.h); do
    module=$(basename "$name" .h)
    plain=-O1\ -D$(echo "$module" | tr '[:lower:]' '[:upper:]')_NO_SIMD
    check "builds golden_$module, $1 $plain" build "$1" "$plain" "$module" &&
        run "$module" "$1 $plain" "$tmp/golden_$module" 2
done

# the message tells module and case; lines that are missing or foreign are noticed
set -- $modules
build/golden/golden_"$1" 1 >"$tmp/lines"
name=$(sed -n '2s/ [^ ]*$//p' "$tmp/lines")
differs() {
    sed "$1" "$tmp/lines" >"$tmp/changed"
    $golden/compare.sh "cat $tmp/changed" && { echo "$1 goes unnoticed"; return 1; }
    $golden/compare.sh "cat $tmp/changed" | grep -q "^module ${name% *}, case ${name#* }: "
}
check "a different hash is noticed, with module and case" differs '2s/.$/x/'
check "a missing case is noticed, with module and case" differs 2d
check "a foreign case is noticed" sh -c "sed '2s/ / other-/' '$tmp/lines' >'$tmp/changed' &&
    ! $golden/compare.sh 'cat $tmp/changed'"

# the tool with OpenMP agrees with itself
build/draw cells "$tmp/cells.png" 64
build/draw sand "$tmp/sand.png" 64
/usr/bin/python3 tests/tool/check_inpaint.py mask disc 64 "$tmp/mask.png"
for threads in 1 2 8; do
    build/texkit learn "$tmp/cells.png" -o "$tmp/$threads.txs" --threads $threads --quiet
    build/texkit synth "$tmp/1.txs" -o "$tmp/$threads.png" --size 150x90 --threads $threads --quiet
    build/texkit relight "$tmp/1.png" --like "$tmp/cells.png" -o "$tmp/relit-$threads.png" \
        --threads $threads --quiet
    build/texkit erode "$tmp/1.png" --weathered "$tmp/cells.png" --level 0.7 -o "$tmp/eroded-$threads.png" \
        --threads $threads --quiet
    check "texkit relight, the same picture with --threads $threads" \
        cmp "$tmp/relit-1.png" "$tmp/relit-$threads.png"
    check "texkit erode, the same picture with --threads $threads" \
        cmp "$tmp/eroded-1.png" "$tmp/eroded-$threads.png"
    check "texkit learn, the same model with --threads $threads" \
        cmp "$tmp/1.txs" "$tmp/$threads.txs"
    check "texkit synth, the same picture with --threads $threads" \
        cmp "$tmp/1.png" "$tmp/$threads.png"
    build/texkit fill "$tmp/cells.png" --mask "$tmp/mask.png" -o "$tmp/filled-$threads.png" \
        --threads $threads --quiet
    check "texkit fill, the same picture with --threads $threads" \
        cmp "$tmp/filled-1.png" "$tmp/filled-$threads.png"
    build/texkit knit "$tmp/cells.png" "$tmp/sand.png" --layout "$tmp/mask.png" \
        -o "$tmp/knitted-$threads.png" --threads $threads --quiet
    check "texkit knit, the same picture with --threads $threads" \
        cmp "$tmp/knitted-1.png" "$tmp/knitted-$threads.png"
done

/usr/bin/python3 tests/tool/check_patch.py draw "$tmp"
for threads in 1 2 8; do
    build/texkit composite "$tmp/parts.png" --labels "$tmp/parts-labels.png" --size 150x90 --types 4 \
        -o "$tmp/$threads.png" --save "$tmp/$threads.txc" --threads $threads --quiet
    check "texkit composite, the same picture with --threads $threads" cmp "$tmp/1.png" "$tmp/$threads.png"
    check "texkit composite, the same composite with --threads $threads" \
        cmp "$tmp/1.txc" "$tmp/$threads.txc"
done

# no thread steps on another's data
if has clang; then
    for module in $modules; do
        check "$module is clean under the thread sanitizer" sh -c "
            clang -std=gnu99 -O1 -g -fsanitize=thread -ffp-contract=off -Isrc -I. -Itests/kit -I$golden \
                $golden/golden_$module.c -o '$tmp/tsan' -lpthread -lm && '$tmp/tsan' 4"
    done
fi
