#!/bin/sh
# texkit composite: layouts learned and drawn, pictures of labels of all kinds, and what it refuses.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
released=$root/build/texkit
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_patch.py" "$@"; }
cd "$tmp" || exit 1
look draw .
size="--size 40x30 --types 2 --quality -2"
labels="--labels parts-labels.png"

# ---- from a picture
check "a picture" run 0 composite parts.png $labels -o a.png --size 60x50 --types 2 --save a.txc \
    --map a-map.png --stats stats.json
check "tells what it did" grep -q 'a.png: 60 x 50 pixels, 3 labels' out.log
check "has the size and channels" look is a.png 60 50 3 8
check "the map has the size, in colours" look is a-map.png 60 50 3 8
for key in learn layout synthesise labels levels clique_types model_bytes peak_bytes; do
    check "--stats has $key" grep -q "\"$key\": " stats.json
done
check "other seeds" run 0 composite parts.png $labels -o b.png $size --seed 9
check "--threads" run 0 composite parts.png $labels -o b.png --size 60x50 --types 2 --threads 3
check "the same picture" cmp a.png b.png
for field in auto none rows columns; do
    check "--field $field" run 0 composite parts.png $labels -o f.png $size --field $field
done
check "labels as numbers" run 0 composite parts.png --labels parts-numbers.png -o n.png $size --map n-map.png
check "the map has the numbers" look is n-map.png 40 30 1 8
for extension in png tga bmp jpg; do
    check "writes .$extension" run 0 composite a.txc -o "e.$extension" $size
done

check "--like" run 0 composite parts.png $labels -o l.png $size --like parts-numbers.png
refuses 1 "texkit relight" composite a.txc -o n.png $size --like parts.png
check "labels that are found" run 0 composite parts.png -o f.png $size --map f-map.png --save f.txc
check "the map has their numbers" look is f-map.png 40 30 1 8
check "so many as are asked for" run 0 composite parts.png -o f.png $size --segments 2 --stats stats.json
check "there are two" grep -q '"labels": 2' stats.json

# ---- what was saved, and drawn layouts
check "from what was saved" run 0 composite a.txc -o b.png --size 60x50 --save b.txc
check "the same picture" cmp a.png b.png
check "the same composite" cmp a.txc b.txc
cp a.txc other-name
check "of another name" run 0 composite other-name -o b.png --size 60x50
check "the same picture" cmp a.png b.png
check "drawn as it was" run 0 composite a.txc -o b.png --layout a-map.png --map b-map.png
check "the same picture" cmp a.png b.png
check "the same map" cmp a-map.png b-map.png
check "a drawing, while learning" run 0 composite parts.png $labels -o d.png --layout drawn.png --types 2
check "has its size" look is d.png 80 64 3 8
check "a drawing, from what was saved" run 0 composite a.txc -o d2.png --layout drawn.png
check "the same picture" cmp d.png d2.png
check "colours by --labels" run 0 composite a.txc $labels -o d2.png --layout drawn.png
check "the same picture" cmp d.png d2.png

# ---- refusals
refuses 2 "add --size" composite parts.png $labels -o x.png
refuses 2 "leave one out" composite parts.png $labels -o x.png $size --segments 3
for bad in 0 17 x; do refuses 2 "--segments" composite parts.png -o x.png $size --segments $bad; done
refuses 2 "auto, none, rows, columns" composite parts.png $labels -o x.png $size --field sideways
refuses 2 ".txc" composite parts.png $labels -o x.png $size --save x.txs
refuses 2 "end the name in" composite parts.png $labels -o x.gif $size
refuses 2 "end the name in" composite parts.png $labels -o x.png $size --map x.gif
refuses 2 "written twice" composite parts.png $labels -o x.png $size --map x.png
refuses 2 "would destroy" composite parts.png $labels -o parts-labels.png $size
refuses 1 "No such file" composite missing.png $labels -o x.png $size
refuses 1 "one colour for each label" composite parts.png --labels parts.png -o x.png $size
refuses 1 "make it 96 x 96" composite parts.png --labels drawn.png -o x.png $size
refuses 1 "is no label" composite parts.png $labels -o x.png --layout parts.png
refuses 1 "make it 40 x 30" composite parts.png $labels -o x.png $size --layout drawn.png
refuses 1 "has 2 labels" composite a.txc -o x.png --layout disc.png
head -c 200 a.txc >cut.txc
refuses 1 "cut.txc" composite cut.txc -o x.png $size
if [ "$FULL" = 1 ]; then
    check "a signal stops it" stops x.png composite parts.png $labels --size 2000x2000
    check "little memory" starves 100000 x.png composite a.txc --size 4000x4000
fi
