#!/bin/sh
# Loaders of models and composites against hostile bytes, and public calls against pictures, masks,
# meshes and options of all kinds: for each program as many runs as take some 10 s here, ten times as
# many with FULL=1, from seed SEED. tests/wide/fuzz/fuzzkit.h tells more.
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

# fuzz NAME RUNS [ARGUMENT...]: fuzz_NAME.c with the object of the unit tests of its module, but for
# those that have none or look inside; the other arguments go to the program
fuzz() {
    name=$1 module=${1%%_*} runs=$2
    shift 2
    case $name in trimesh_*) module=$name ;; esac
    [ "$FULL" = 1 ] && runs=${runs}0
    with="$OUT/modules/$module.o -D$(echo "$module" | tr '[:lower:]' '[:upper:]')_IMPLEMENTED"
    case $name in texsyn_load | texmath) with= ;; esac
    # shellcheck disable=SC2086 # flags are words
    check "fuzz_$name builds by itself" $CC -std=gnu99 $SANITIZE -DFUZZ_STANDALONE -ffp-contract=off \
        -I. -Itests/kit "tests/wide/fuzz/fuzz_$name.c" $with -o "$OUT/fuzz_$name" -lm &&
        check "$runs runs of fuzz_$name" "$OUT/fuzz_$name" $runs "$@"
}
fuzz texsyn_load 10000 "$tmp"/seeds/*
fuzz texsyn_weather 75 "${SEED:-1}"
fuzz texsyn_fill 75 "${SEED:-1}"
fuzz texsyn_knit 75 "${SEED:-1}"
fuzz texsyn_segment 30 "${SEED:-1}"
fuzz texsyn_learn 50 "${SEED:-1}"
fuzz texpatch 125 "${SEED:-1}"
fuzz texedges 5000 "${SEED:-1}"
fuzz textiles 300 "${SEED:-1}"
fuzz texmath 10000 "${SEED:-1}"
fuzz texinpaint 50 "${SEED:-1}"
fuzz trimesh_relax 125 "${SEED:-1}"
fuzz trimesh_cover 500 "${SEED:-1}"
fuzz treepieces 6000 "${SEED:-1}"

# libFuzzer follows what the loader does with its bytes
if [ "$FULL" = 1 ] && has clang; then
    check "fuzz_texsyn_load builds with libFuzzer" clang -std=gnu99 -O1 -g -ffp-contract=off \
        -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -I. \
        tests/wide/fuzz/fuzz_texsyn_load.c -o "$OUT/fuzz_libfuzzer" -lm &&
        check "300,000 runs of libFuzzer" "$OUT/fuzz_libfuzzer" -runs=300000 -seed=1 \
            -max_len=16384 -timeout=20 -rss_limit_mb=2000 -verbosity=0 \
            -artifact_prefix="$OUT/" "$tmp/seeds"
fi
