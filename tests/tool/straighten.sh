#!/bin/sh
# texkit straighten, and --straighten of texkit patch and tiles: the courses of a wall that was seen from
# the side lie straight. tests/tool/check_straighten.py draws the wall.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_straighten.py" "$@"; }
cd "$tmp" || exit 1
look draw .
is_true() { awk "BEGIN { exit !($*) }" || { echo "not $*"; return 1; }; }
check "the wall leans" look courses wall.png 0 0.4

# ---- texkit straighten
check "straighten" run 0 straighten wall.png -o a.png --stats stats.json
check "tells what it made" grep -q '^a.png: .* straight, ' out.log
check "courses are straight" look courses a.png 0.5 1
whole="$(figure width) * $(figure height)"
check "--stats says so" is_true "$(figure found) == 1 && $(figure agreement) > 0.9"
check "maps in register" run 0 straighten wall.png -o b.png --maps wall-height.png,wall-normal.png \
    --normal 2 --data 1
check "change nothing" cmp a.png b.png
check "heights follow" look register b.png b-height.png
check "flat normals stay flat" look flat b-normal.png
for threads in 1 8; do
    check "--threads $threads" run 0 straighten wall.png -o t.png --threads $threads
    check "the same picture" cmp a.png t.png
done
check "--mask" run 0 straighten object.png -o m.png --mask mask.png --stats stats.json
check "the pattern is found beside the object" is_true "$(figure found) == 1"
check "--focal" run 0 straighten wall.png -o f.png --focal 50
check "courses are straight, too" look courses f.png 0.5 1
check "--periods" run 0 straighten wall.png -o whole.png --periods --stats stats.json
check "courses are straight" look courses whole.png 0.5 1
check "and smaller" is_true "$(figure width) * $(figure height) < $whole"
check "no pattern" warns "nothing in it repeats" straighten noise.png -o n.png --stats stats.json
check "a copy" look courses n.png 0 0.2
check "--stats says that, too" is_true "$(figure found) == 0 && $(figure agreement) == 0"
refuses 2 "--focal" straighten wall.png -o x.png --focal 1
refuses 2 "--directx goes with" straighten wall.png -o x.png --directx
refuses 2 "choose one" straighten wall.png -o x.png --maps wall-height.png --data 1 --label 1

# ---- in front of other commands
check "patch" run 0 patch wall.png -o p.png --size 96x96 --straighten --passes 1 --even 0
check "courses are straight" look courses p.png 0.45 1
check "patch, without a pattern" warns "nothing in it repeats" patch noise.png -o n.png --size 32x32 \
    --straighten --passes 1
check "tiles" run 0 tiles wall.png -o wang --kind wang --size 48 --reduced --straighten --even 0
check "tiles, without a pattern" warns "nothing in it repeats" tiles noise.png -o none --kind wang \
    --size 32 --reduced --straighten
