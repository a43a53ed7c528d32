#!/bin/sh
# tree_pictures.sh [FOLDER] - draw the pictures of docs/trees.md into FOLDER, docs/trees if none is given
#
# Needs OpenGL, as examples/forest_gl does, and `make examples helpers`.
set -eu
cd "$(dirname "$0")/.."
out=${1:-docs/trees} build=${BUILD:-build} side=200
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
mkdir -p "$out"

# picture NAME OPTIONS...: one tree, as a JPEG
picture() {
    name=$1
    shift
    "$build/examples/forest_gl" --shaders shaders --headless "$tmp/tree.png" --count 1 --pieces 2500 \
        --size "${side}x$side" "$@" >"$tmp/log" || { cat "$tmp/log"; exit 1; }
    "$build/crop" "$tmp/tree.png" "$out/$name.jpg" "$side"
    echo "$out/$name.jpg"
}

# row NAME SPECIES LINES OPTIONS VALUE...: what a key does to a species; in LINES it is VALUE
row() {
    row=$1 species=$2 lines=$3 options=$4 n=0
    shift 4
    for value; do
        n=$((n + 1))
        printf 'like %s\n%b\n' "$species" "$lines" | sed "s/VALUE/$value/" >"$tmp/key.txt"
        # shellcheck disable=SC2086 # the options are words
        picture "$row-$n" --species "$tmp/key.txt" $options
    done
}
row angle beech 'order 1\nangle_base VALUE\nangle_top VALUE' --bare 30 60 90
row tropism oak 'order 1\ntropism VALUE\norder 2\ntropism VALUE' --bare -0.15 0 0.2
row light maple 'phototropism VALUE' '' 0 0.2 0.6
row wander oak 'order 0\nwander VALUE\norder 1\nwander VALUE\norder 2\nwander VALUE' --bare 0 15 35
row orders maple 'order_count VALUE' --bare 2 3 5
row envelope beech 'envelope VALUE\ncrown_width 0.8' '' cone ellipsoid cylinder
row cloud maple 'cloud_kind VALUE' '' round layers strips
row leaves beech 'leaf_count VALUE' '' 6 20 60
row bark oak 'bark_kind VALUE' '--bare --orbit 10,2,5' furrowed lenticels plates

side=280
for step in 1 2 3; do
    awk -v last=$step '/^# step/ { step++ } step <= last' docs/trees/acacia.txt >"$tmp/acacia.txt"
    picture acacia-$step --species "$tmp/acacia.txt" --seed 2
done
