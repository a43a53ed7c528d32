#!/bin/sh
# texkit tree and texkit forest keep the contract of the command line; and their files hold what they
# should: read by tests/tool/check_tree.py, which does the skinning itself, and by assimp.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
released=$root/build/texkit   # as users have it
draw=$root/build/draw
check_tree="/usr/bin/python3 $root/tests/tool/check_tree.py"
glbs=$root/$OUT/glb/tree # kept: .ci/run hands them to the Khronos validator and to three.js
rm -rf "$glbs" && mkdir -p "$glbs"
cd "$tmp" || exit 1

figures() { # NAME=VALUE...: these are in stats.json
    for wish in "$@"; do
        [ "$(figure "${wish%%=*}")" = "${wish#*=}" ] || { echo "not $wish"; cat stats.json; return 1; }
    done
}
keep() { # FILE.glb FILE.json: for the validator and three.js
    cp "$1" "$2" "$glbs/"
}

# ---- help
for command in tree forest; do
    check "$command: --help lists it" sh -c "'$texkit' --help | grep -q '^ *$command '"
    check "$command: --version names the header" \
        sh -c "'$texkit' $command --version | grep -q 'treepieces [0-9.]*'"
done

# ---- every species: a tree that is whole, at rest, in the wind, baked
"$texkit" tree -o n.glb --species none >out.log 2>err.log
check "an unknown species is refused with the names" grep -q 'there are oak' err.log
species=$(sed 's/.*there are //; s/,//g' err.log)
"$texkit" tree --help >help.log
count=0
for name in $species; do
    "$released" tree -o s.txt --species "$name" --quiet 2>err.log || continue
    count=$((count + 1))
    check "$name is in the help" grep -q "[ ,]$name[,.]" help.log
    check "$name in the wind" run 0 tree -o "$name.glb" --species "$name" --pieces 90 --wind 9 \
        --sheet 128 --seconds 2 --rate 6 --seed 3 --stats stats.json
    check "tells what it made" grep -q "^$name.glb: $name, .* m high, .* joints, 13 keys" out.log
    check "$name is whole, closed and moves" $check_tree skin "$name.glb" keys=13 seconds=2 \
        joints="$(figure joints)" pieces="$(figure pieces)" expect="$name.json"
    keep "$name.glb" "$name.json"
    check "$name baked" run 0 tree -o "$name.obj" --species "$name" --pieces 150 --capped --sheet 128
    check "is one closed surface" $check_tree obj "$name.obj" rims=0
    check "$name: its text makes the same tree" sh -c "
        '$released' tree -o a.glb --species '$name' --pieces 40 --quiet --sheet 128 &&
        '$released' tree -o b.glb --species ./s.txt --pieces 40 --quiet --sheet 128 && cmp a.glb b.glb"
    rm -f ./*.glb ./*.obj # run sums up all that is here
done
check "there are seven species at least, $count" [ $count -ge 7 ]

# ---- the skeleton
tree="tree --species oak --pieces 350"
check "at rest" run 0 $tree -o rest.glb --stats stats.json
check "has no clip" $check_tree skin rest.glb keys=0 joints="$(figure joints)"
check "tells figures" figures trees=1 keys=0
small="$tree --sheet 128"
check "--lods" run 0 $small -o lods.glb --lods 3 --wind 5 --seconds 1 --stats stats.json
check "tells the pieces of each level" grep -q "^lods-2.glb: 3[0-9] pieces" out.log
for level in lods lods-1 lods-2; do
    check "$level is whole, closed and moves" $check_tree skin $level.glb keys=13
done
check "--collision" run 0 $small -o hull.glb --collision
# each edge runs once to and once fro
check "is closed" awk '
    /^f/ { for (k = 2; k <= 4; k++) v[k - 2] = int($k)
           for (k = 0; k < 3; k++) { to = v[(k + 1) % 3]; n += ++way[v[k] " " to] > 1 || v[k] == to } }
    END { for (e in way) { split(e, p, " "); n += !((p[2] " " p[1]) in way); edges++ }
          exit n > 0 || edges < 1000 }' hull-collision.obj
check "and coarse" test "$(grep -c ^f hull-collision.obj)" -lt 1400
check "the first level is the tree without levels" run 0 $small -o alone.glb --wind 5 --seconds 1
check "to the byte" cmp lods.glb alone.glb
check "--bones" run 0 $small -o bones.glb --bones 25 --wind 6
check "leaves so many joints" $check_tree skin bones.glb joints=25 keys=49 seconds=4 expect=bones.json
keep bones.glb bones.json
check "--bones 1" run 0 $small -o one.glb --bones 1
check "leaves one" $check_tree skin one.glb joints=1
check "--pose" run 0 $small -o posed.glb --pose 0.2 --wind 3.5 --seconds 1.5 --rate 10
check "bends the joints" $check_tree skin posed.glb posed=1 keys=16 seconds=1.5 expect=posed.json
keep posed.glb posed.json
check "--bare" run 0 $small -o bare.glb --bare --wind 20 --seconds 1 --rate 3
check "has one material" $check_tree skin bare.glb materials=1 images=2 expect=bare.json
check "and a normal map of its bark" $check_tree relief bare.glb
keep bare.glb bare.json
check "--level and --capped" run 0 $small -o level.glb --level 2 --capped --bare --stats stats.json
check "divide the quads and close the foot" $check_tree skin level.glb rims=0
if has assimp; then
    for name in bones posed bare; do
        check "assimp reads $name.glb" assimp export $name.glb $name.assimp.json -fassjson
        check "as we do" $check_tree assimp $name.assimp.json expect=$name.json
    done
fi

# the clip, joint by joint, as the library moves the bones
sway=$root/$OUT/sway_bones
# shellcheck disable=SC2086 # flags are words
check "sway_bones builds" $CC -std=gnu99 $SANITIZE -ffp-contract=off -I"$root" -DTREEPIECES_IMPLEMENTED \
    "$root/tests/tool/sway_bones.c" "$root/$OUT/modules/treepieces.o" -o "$sway" -lm
for name in oak birch spruce; do
    "$sway" $name 120 5 9 3 8 >bones.json
    check "$name in the wind" run 0 tree -o sways-$name.glb --species $name --pieces 120 --sheet 128 --seed 5 \
        --wind 9 --seconds 3 --rate 8
    check "moves as the library moves it" $check_tree skin sways-$name.glb keys=25 bones=bones.json \
        expect=sways-$name.json
    keep sways-$name.glb sways-$name.json
done

rm -f ./*.glb ./*.assimp.json

# ---- baked
check "OBJ" run 0 $tree -o tree.obj --level 2 --stats stats.json
check "is a tree with leaves" $check_tree obj tree.obj materials=2 triangles="$(figure triangles)"
check "with its pictures beside it" test -s tree.mtl -a -s tree-bark.png -a -s tree-leaves.png
check "which the material names" sh -c "grep -q '^map_Kd tree-bark.png' tree.mtl &&
    grep -q '^map_d tree-leaves.png' tree.mtl"
check "OBJ in the wind" run 0 $small -o blown.obj --wind 20
check "is whole too" $check_tree obj blown.obj
check "and another" sh -c "! cmp -s tree.obj blown.obj"
check "PLY" run 0 $tree -o tree.ply --stats stats.json
check "has all triangles" sh -c "head -c 400 tree.ply | grep -aq 'element face $(figure triangles)'"
check "nothing is beside it" sh -c "! ls | grep -q 'tree-.*ply'"

rm -f ./*.obj ./*.ply

# ---- species from text
check "the species of the manual grows" run 0 tree -o acacia.glb --species "$root/docs/trees/acacia.txt" \
    --pieces 200 --sheet 128
check "and the manual tells its lines" awk 'NR == FNR { sub(/^ +/, ""); told[$0] = 1; next }
    /^[a-z]/ && !($0 in told) { print "not told: " $0; exit 1 }' "$root/docs/trees.md" "$root/docs/trees/acacia.txt"
check "the species as text" run 0 tree -o mine.txt --species birch
check "is refused with the line where it is wrong" sh -c "
    sed 's/^leaf_count .*/leaf_count many/' mine.txt >wrong.txt"
refuses 1 "is not a number" tree -o n.glb --species wrong.txt
printf '\357\273\277like oak\r\nheight 9\r\n' >wrong.txt
refuses 1 "line 2: unknown key 'height'" tree -o n.glb --species wrong.txt
printf 'like oak\nname mine\nleaf_count 0\n' >mine.txt
check "a species like another" run 0 tree -o mine.glb --species mine.txt --pieces 60
check "is without its leaves" $check_tree skin mine.glb materials=1

# ---- pictures of the user
"$draw" sand bark.png 192
"$draw" cells leaf.png 64 4
check "tiles of bark" run 0 tiles bark.png -o bark --kind frame --size 48 --colors 1 --variants 4
check "--tiles and --leaf" run 0 $tree -o dressed.glb --tiles bark --leaf leaf.png
check "are in the file" $check_tree skin dressed.glb images=3 expect=dressed.json
keep dressed.glb dressed.json
check "--sheet" run 0 $tree -o small.obj --tiles bark --sheet 128
# a PNG's width and height
size_of() { od -An -tu1 -j16 -N8 "$1" | awk '{ print $3 * 256 + $4, $7 * 256 + $8 }'; }
check "is the sheet's width" test "$(size_of small-bark.png)" = "128 640"
check "another set is refused" run 0 tiles bark.png -o wang --kind wang --size 32
refuses 1 "framed" $tree -o n.glb --tiles wang
refuses 1 "name a folder" $tree -o n.glb --tiles missing
refuses 1 "cannot read" $tree -o n.glb --leaf missing.png

# ---- forests
check "a forest" run 0 forest --count 30 -o forest.glb --species oak --pieces 250 --stats stats.json
check "is copies, in ten nodes" $check_tree forest forest.glb most_nodes=10 trees=30 \
    pieces="$(figure pieces)" nodes="$(figure nodes)" expect=forest.json
keep forest.glb forest.json
check "of three species" run 0 forest --count 30 -o three.glb --species oak,birch,mine.txt --pieces 200 \
    --pose 0.05 --wind 6
check "is copies in ten nodes too" $check_tree forest three.glb most_nodes=10 trees=30 expect=three.json
keep three.glb three.json
check "with tiles" run 0 forest --count 5 -o laid.glb --tiles bark --pieces 40 --bare
check "and without leaves" $check_tree forest laid.glb clouds=0 images=2
check "baked" run 0 forest --count 3 -o grove.obj --species oak,birch --pieces 120 --spacing 8
check "is a tree each" $check_tree obj grove.obj components=3 rims=3
check "as PLY" run 0 forest --count 3 -o grove.ply --species oak,birch --pieces 50
parts="forest --count 20 --species dead,dead --pose 0.1 --sheet 128"
check "all trees at once" run 0 $parts --pieces 40000 -o once.glb --stats stats.json
pieces=$(figure pieces)
check "or tree by tree" run 0 $parts --pieces 65535 -o parts.glb --threads 2 --stats stats.json
check "are the same forest" sh -c "cmp once.glb parts.glb && test $pieces = $(figure pieces)"
check "a thousand trees" "$released" forest --count 1000 -o many.glb --pieces 150 --quiet
check "are no more nodes" $check_tree forest many.glb most_nodes=10 trees=1000 expect=many.json
keep many.glb many.json

rm -f ./*.glb ./*.obj ./*.ply

# ---- forests of plain nodes
small_forest="forest --count 14 --pieces 60 --sheet 128"
check "--variants" run 0 $small_forest -o v.glb --species oak,birch --variants 4 --stats stats.json
check "are plain nodes of meshes" $check_tree variants v.glb nodes=14 variants=4 materials=4 images=6 \
    expect=variants.json triangles="$(figure triangles)" pieces="$(figure pieces)"
check "tells how many" grep -q '^v.glb: 14 trees, 4 different ones, ' out.log
keep v.glb variants.json
mv "$glbs/v.glb" "$glbs/variants.glb"
check "of one species, closed below" run 0 $small_forest -o one.glb --variants 1 --bare --capped --level 2
check "are one mesh" $check_tree variants one.glb nodes=14 variants=1 materials=1 rims=0
check "more than there are trees" run 0 $small_forest -o all.glb --variants 20 --bare --species oak,dead
check "are trees that all differ" $check_tree variants all.glb nodes=14 variants=14 materials=2
check "the tree of the same seed" run 0 tree -o tree.glb --pieces 60 --sheet 128 --seed 7
check "is the first variant" run 0 $small_forest -o seven.glb --variants 2 --seed 7
check "vertex by vertex" /usr/bin/python3 -c "
import sys
sys.path.insert(0, '$root/tests/tool')
from check_glb import Glb
a, b = Glb('tree.glb'), Glb('seven.glb')
for k in range(2):
    p, q = (g.json['meshes'][0]['primitives'][k]['attributes']['POSITION'] for g in (a, b))
    assert a.values(p) == b.values(q)"
for threads in 1 3; do
    check "$threads threads" run 0 $small_forest -o v$threads.glb --species oak,birch --variants 4 --threads $threads
    check "make the same file" cmp v.glb v$threads.glb
done
refuses 2 "--variants goes with" $small_forest -o n.obj --variants 2
refuses 2 "at least 2" $small_forest -o n.glb --variants 1 --species oak,birch
refuses 2 "--variants" $small_forest -o n.glb --variants 0

# ---- wind for shaders
for name in oak spruce dead; do
    check "$name with numbers for a shader" run 0 tree -o wind.glb --wind-attributes --species $name \
        --pieces 150 --sheet 128
    check "and with a skeleton" run 0 tree -o skin.glb --species $name --pieces 150 --sheet 128 --bones 150
    check "stand and move alike" $check_tree attributes wind.glb skin=skin.glb
    cp wind.glb "$glbs/wind-$name.glb" && echo '{"joints": 0}' >"$glbs/wind-$name.json"
done
check "variants with numbers for a shader" run 0 $small_forest -o windy.glb --variants 2 --wind-attributes \
    --seed 7 --species dead
check "are plain nodes too" $check_tree variants windy.glb nodes=14 variants=2
check "the same tree alone" run 0 tree -o wind.glb --wind-attributes --species dead --pieces 60 --sheet 128 --seed 7
check "has the same numbers" /usr/bin/python3 -c "
import sys
sys.path.insert(0, '$root/tests/tool')
from check_glb import Glb
a, b = Glb('wind.glb'), Glb('windy.glb')
for k in range(1, 4):
    p, q = (g.json['meshes'][0]['primitives'][0]['attributes']['TEXCOORD_%d' % k] for g in (a, b))
    assert a.values(p) == b.values(q)"
refuses 2 "--wind-attributes goes with" tree -o n.obj --wind-attributes
refuses 2 "--wind-attributes goes with --variants" $small_forest -o n.glb --wind-attributes
refuses 2 "does not go with --bones or --wind" tree -o n.glb --wind-attributes --wind 3
refuses 2 "does not go with --bones or --wind" tree -o n.glb --wind-attributes --bones 3

# ---- as other programs read them
programs=$tmp/programs
mkdir -p "$programs/home" && cp "$glbs"/variants.* "$glbs"/posed.* "$glbs"/willow.* "$programs/"
cd "$programs" || exit 1
if has assimp; then
    check "assimp reads the nodes" assimp export variants.glb variants.assimp.json -fassjson
    check "as we do" $check_tree placed variants.assimp.json expect=variants.json
else
    echo "ok - assimp reads the nodes # SKIP no assimp here"
fi
# reads PROGRAM: its log says so of each of the three
reads() { grep -A1 'ok - ' read.log; [ "$(grep -c "^ok - $1 reads" read.log)" = 3 ]; }
if has blender; then
    blender --background --python-exit-code 1 --python "$root/tests/tool/load_blender.py" -- \
        variants.glb posed.glb willow.glb >read.log 2>&1
    check "Blender reads nodes, skins and clips as we do" reads Blender
else
    echo "ok - Blender reads nodes, skins and clips # SKIP no blender here"
fi
# its editor imports, which some builds of it do not end with, and a script looks at what came out
godot_reads() {
    cp "$root/tests/tool/load_godot.gd" . && echo 'config_version=4' >project.godot || return 1
    HOME=$programs/home godot3-server --path . --editor --quit >read.log 2>&1 &
    child=$!
    tenths=0
    while [ "$(ls .import/*.md5 2>/dev/null | wc -l)" -lt 3 ] && [ $tenths -lt 600 ]; do
        sleep 0.1
        tenths=$((tenths + 1))
    done
    sleep 0.5
    kill $child 2>/dev/null
    wait $child 2>/dev/null
    HOME=$programs/home timeout 60 godot3-server --path . -s load_godot.gd >read.log 2>&1
    reads Godot
}
if has godot3-server; then
    check "Godot reads nodes, skins and clips as we do" godot_reads
else
    echo "ok - Godot reads nodes, skins and clips # SKIP no godot3-server here"
fi
cd "$tmp" || exit 1
rm -f ./*.glb

# ---- the same bytes
for threads in 1 2 5; do
    check "$threads threads" run 0 $small -o t$threads.glb --wind 5 --seconds 1 --threads $threads
    check "forest, $threads threads" run 0 forest --count 9 -o f$threads.glb --threads $threads --pieces 80 \
        --sheet 128
done
check "make the same tree" sh -c "cmp t1.glb t2.glb && cmp t1.glb t5.glb"
check "and the same forest" sh -c "cmp f1.glb f2.glb && cmp f1.glb f5.glb"
check "as does the tool of users" sh -c "
    '$released' $small -o r.glb --wind 5 --seconds 1 --quiet && cmp t1.glb r.glb"
check "another seed, another tree" sh -c "
    '$texkit' $small -o o.glb --wind 5 --seconds 1 --seed 2 --quiet && ! cmp -s t1.glb o.glb"

rm -f ./*.glb

# ---- usage
refuses 2 "add -o" tree
refuses 2 "unexpected" tree oak -o n.glb
refuses 2 "end the name in" tree -o n.png
refuses 2 ".txt" tree -o n
refuses 2 "end the name in" forest --count 3 -o n.txt
refuses 2 "--count" forest -o n.glb
refuses 2 "--pieces" tree -o n.glb --pieces 7
refuses 2 "--wind" tree -o n.glb --wind -1
refuses 2 "--wind" tree -o n.glb --wind gale
refuses 2 "--pose" tree -o n.glb --pose 2
refuses 2 "--seconds" tree -o n.glb --wind 5 --seconds 0.1
refuses 2 "--wind SPEED" tree -o n.glb --seconds 2
refuses 2 ".glb" tree -o n.obj --bones 20
refuses 2 ".glb" tree -o n.obj --lods 3
refuses 2 "--lods" tree -o n.glb --lods 1
refuses 2 "standard output" tree -o - --collision
refuses 2 "--spacing" forest --count 3 -o n.glb --spacing 0
refuses 2 "--level" forest --count 3 -o n.glb --level 2
refuses 2 "at most" forest --count 3 -o n.glb --species oak,oak,oak,oak,oak,oak,oak,oak,oak
refuses 2 "empty" forest --count 3 -o n.glb --species oak,
refuses 1 "cannot read" tree -o n.glb --species missing.txt
refuses 1 "cannot write" tree -o nowhere/n.glb
head -c 500 /dev/urandom >noise.txt
refuses 1 "noise.txt" tree -o n.glb --species noise.txt
: >empty.txt
check "an empty file is a species of defaults, or refused" sh -c "
    '$texkit' tree -o e.glb --species empty.txt --pieces 20 --quiet 2>err.log || [ \$? = 1 ]"
mkdir -p full && : >full/n-bark.png && mkdir full/n-leaves.png
refuses 1 "cannot write" tree -o full/n.obj
