#!/bin/sh
# texkit patch and texkit edges keep the contract of the command line; and their pictures hold what
# they should. tests/tool/check_patch.py tells what.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
texkit=$root/$OUT/asan/texkit # with the sanitizers
released=$root/build/texkit   # as users have it
python=/usr/bin/python3
check_patch="$python $root/tests/tool/check_patch.py"
export OMP_WAIT_POLICY=passive # the tool says so itself, and begins again
cd "$tmp" || exit 1

prefix=patch
# refuses STATUS TEXT ARGUMENTS...: it ends with that status and one line that holds this text. There
# are so many that nothing_changed, and not each of them, looks whether all files are as they were.
refuses() {
    check "status $1, \"$2\": $prefix $*" refuses_quickly "$@"
}
refuses_quickly() {
    want=$1 text=$2
    shift 2
    "$texkit" $prefix "$@" >out.log 2>err.log
    got=$?
    [ $got = "$want" ] || { echo "status $got"; cat err.log; return 1; }
    { read -r line && ! read -r more; } <err.log || { echo "not one line:"; cat err.log; return 1; }
    case $line in "texkit $prefix: "*"$text"*) ;; *) echo "$line"; return 1 ;; esac
    [ ! -s out.log ] || { cat out.log; return 1; }
}
nothing_changed() {
    [ "$before" = "$(all_files)" ] || { echo "files were made or changed"; ls -l; return 1; }
}
figures() { # NAME=VALUE...: these are in stats.json
    for wish in "$@"; do
        [ "$(figure "${wish%%=*}")" = "${wish#*=}" ] || { echo "not $wish"; cat stats.json; return 1; }
    done
}
is_true() { awk "BEGIN { exit !($*) }"; }
differ() { ! cmp -s "$1" "$2"; }
fails() { ! "$@"; }
one_by_one() { # COMMAND... -- NAME...: the command for each of the names in place of {}
    command=
    while [ "$1" != -- ]; do command="$command $1"; shift; done
    shift
    for name in "$@"; do $(echo "$command" | sed "s/{}/$name/g") || { echo "$name"; return 1; }; done
}

$check_patch draw .
"$root/build/draw" weave weave.png 64
"$root/build/draw" cells gray.png 64 1
"$root/build/draw" cells rgba.png 64 4
"$root/build/draw" sand tiny.png 24
size="--size 64x64"
maps="--maps bricks-normal.png,bricks-id.png,bricks-height.png --normal 1 --label 2 --data 3"

# ---- the main path
check "patch" run 0 bricks.png -o a.png $size --stats stats.json
check "tells what it made" grep -q '^a.png: 64 x 64 pixels, lattice .* s$' out.log
check "the size and the channels" $check_patch is a.png 64 64 3 8
check "the figures" figures command='"patch"' width=64 height=64 maps=1 exemplars=1 files=1 lattice=1
for key in seed threads read prepare synthesise draw encode total peak_bytes lattice_ax continuous; do
    check "--stats has $key" test -n "$(figure $key)"
done
check "file_bytes is the size of the file" figures file_bytes="$(wc -c <a.png)"
check "--stats is JSON" $python -m json.tool stats.json
check "pieces hang together" is_true "$(figure continuous) > 0.5 && $(figure continuous) < 1"
# the lattice of the bricks is that of steps (24, 0) and (12, 12): cells of 288 pixels
cell="($(figure lattice_ax)) * ($(figure lattice_by)) - ($(figure lattice_ay)) * ($(figure lattice_bx))"
check "the lattice of the bricks" is_true "($cell)^2 > 270^2 && ($cell)^2 < 306^2"
check "--quiet says nothing" sh -c "
    '$texkit' patch bricks.png -o q.png $size --quiet | wc -c | grep -qx 0 && cmp a.png q.png"
check "options anywhere" sh -c "
    '$texkit' patch --size=64x64 -o q.png --seed 1 -- bricks.png >out.log && cmp a.png q.png"
check "gray" run 0 gray.png -o gray-out.png --size 33x17
check "stays gray" $check_patch is gray-out.png 33 17 1 8
check "RGBA" run 0 rgba.png -o rgba-out.png --size 40x30
check "stays RGBA" $check_patch is rgba-out.png 40 30 4 8
check "16 bits" run 0 bricks-height.png -o deep.png --size 40x30 --sources deep.pfm
check "stay 16 bits" $check_patch is deep.png 40 30 1 16
check "are those of the exemplar" $check_patch near deep.pfm deep.png bricks-height.png 12
check "one pixel" run 0 bricks.png -o one.png --size 1x1
check "a strip" run 0 bricks.png -o strip.png --size 150x3
for extension in tga bmp jpg; do
    check "writes .$extension" run 0 bricks.png -o a.$extension $size
done
check "an odd name" run 0 bricks.png -o 'odd out;$(x).png' $size
refuses 2 "would destroy" bricks.png -o bricks.png $size
check "no temporary file is left" sh -c "! ls | grep -q tmp"

# ---- the same bytes, and others
for threads in 1 2 8; do
    check "--threads $threads" run 0 bricks.png -o t.png $size --threads $threads
    check "the same picture" cmp a.png t.png
done
check "--seed 2" run 0 bricks.png -o b.png $size --seed 2
check "another picture" differ a.png b.png

# ---- maps
mkdir m
check "--maps" run 0 bricks.png -o m/wall.png $size $maps --sources m/wall.pfm --stats stats.json
check "makes so many files" figures maps=4 files=5
check "each named by what tells it apart" test "$(echo m/*)" = \
    "m/wall-height.png m/wall-id.png m/wall-normal.png m/wall.pfm m/wall.png"
check "maps that only follow change nothing" cmp a.png m/wall.png
check "a label map keeps its channels" $check_patch is m/wall-id.png 64 64 1 8
check "a height map keeps its 16 bits" $check_patch is m/wall-height.png 64 64 1 16
check "labels are those of the places that --sources tells" \
    $check_patch sources m/wall.pfm m/wall-id.png bricks-id.png
check "so are colors, about" $check_patch near m/wall.pfm m/wall.png bricks.png 12
check "heights" $check_patch near m/wall.pfm m/wall-height.png bricks-height.png 12
check "and normals" $check_patch near m/wall.pfm m/wall-normal.png bricks-normal.png 6
check "no piece has been turned" $check_patch codes m/wall.pfm 'c == {0}'
check "labels of another picture are not" fails $check_patch sources m/wall.pfm m/wall-id.png \
    bricks-height.png
check "--sources in another folder" sh -c "mkdir s && '$texkit' patch bricks.png -o m/p.png \
    $size --sources '$tmp/s/p.pfm' --quiet && cmp s/p.pfm m/wall.pfm"
check "weights of maps" run 0 bricks.png -o w.png $size $maps --weights 0.5,0,2,0.25
check "change the picture" differ a.png w.png
check "--passes 0" run 0 bricks.png -o p.png $size $maps --passes 0 --sources p.pfm
check "labels are those of their places" $check_patch sources p.pfm p-id.png bricks-id.png
for passes in 0 1 16; do
    check "--passes $passes" run 0 gray.png -o p$passes.png $size --passes $passes
done
check "are three pictures" sh -c "! cmp -s p0.png p1.png && ! cmp -s p1.png p16.png"
check "--patch" run 0 bricks.png -o n.png $size --patch 16 --seed 4
check "a name with nothing of its own" run 0 bricks.png -o n.png $size --maps m/../bricks.png
check "is taken whole" $check_patch is n-bricks.png 64 64 3 8

# ---- turned and mirrored
check "--turns 4 --mirror" run 0 bricks.png -o r.png $size $maps --turns 4 --mirror --sources r.pfm
check "some pieces are" $check_patch codes r.pfm 'len(c) > 2 and max(c) > 3 and max(c) < 8'
check "labels are those of their places" $check_patch sources r.pfm r-id.png bricks-id.png
check "normals turn with their pieces" $check_patch turned r.pfm r-normal.png bricks-normal.png 6
check "--directx" run 0 bricks.png -o d.png $size $maps --turns 4 --mirror --directx
check "turns the other way" differ d-normal.png r-normal.png
check "what it is told by the same pieces" cmp d.png r.png
check "--turns 2" run 0 bricks.png -o r2.png $size --turns 2 --sources r2.pfm
check "half turns alone" $check_patch codes r2.pfm 'c <= {0, 2}'
check "--mirror alone" run 0 bricks.png -o r3.png $size --mirror --sources r3.pfm
check "does not turn" $check_patch codes r3.pfm 'c <= {0, 4}'

# ---- exemplars
check "--exemplars" run 0 bricks.png -o e.png $size --exemplars weave.png --sources e.pfm \
    --maps 'bricks-id.png;gray.png' --label 1 --stats stats.json
check "counts them" figures exemplars=2
check "labels are those of their places" $check_patch sources e.pfm e-id.png bricks-id.png,gray.png
check "an exemplar of another kind is made alike" run 0 bricks-height.png -o e.png $size \
    --exemplars weave.png
check "16 bits stay" $check_patch is e.png 64 64 1 16
check "--mask" run 0 bricks.png -o k.png $size --mask left.png --sources k.pfm
check "nothing comes from where it is black" $check_patch within k.pfm 0 0 52 96

# ---- what it keeps to
check "--lattice none" run 0 bricks.png -o l.png $size --lattice none --stats stats.json
check "has none" figures lattice=0
check "--lattice of its own" run 0 bricks.png -o l.png $size --lattice 24,0,-12,12 --stats stats.json
check "has it" figures lattice=1
check "--lattice auto is the default" sh -c "
    '$texkit' patch bricks.png -o l.png $size --lattice auto --quiet && cmp a.png l.png"
check "--novelty" run 0 gray.png -o v.png --size 96x96 --novelty 1 --stats stats.json
new=$(figure continuous)
check "without" run 0 gray.png -o v.png --size 96x96 --stats stats.json
check "pieces are smaller with it" is_true "$new < $(figure continuous)"

# ---- across the borders
check "--tileable" run 0 bricks.png -o tile.png --size 72x60 --tileable $maps --sources tile.pfm
check "pieces go on across the borders" $check_patch joined tile.pfm xy 0.5
check "neighbours are alike there" one_by_one $check_patch wraps {}.png xy 1.2 -- tile tile-height
for axis in x y; do
    check "without it they do not, on $axis" fails $check_patch joined m/wall.pfm $axis 0.5
    check "--tileable-$axis" run 0 bricks.png -o s.png --size 66x66 --tileable-$axis --sources s.pfm
    check "pieces go on across this border" $check_patch joined s.pfm $axis 0.5
    check "neighbours are alike there" $check_patch wraps s.png $axis 1.2
done
check "but not across the other" fails $check_patch joined s.pfm x 0.5

# ---- levels of detail
check "--lod" run 0 bricks.png -o lod.png --size 75x50 $maps --lod 3
check "six times two" one_by_one test -s lod{}.png -- -1 -2 -3 -id-1 -id-2 -id-3 -normal-3 -height-3
check "the picture itself is as without" sh -c "
    '$texkit' patch bricks.png -o x.png --size 75x50 --quiet && cmp x.png lod.png"
check "each is half of the one before" $check_patch half lod.png lod-1.png color
check "and so on" $check_patch half lod-1.png lod-2.png color
check "with odd sides" $check_patch half lod-2.png lod-3.png color
check "labels are picked" $check_patch half lod-id.png lod-id-1.png label
check "normals stay unit vectors" $check_patch half lod-normal.png lod-normal-1.png normal
check "amounts of 16 bits are averaged as they are" $check_patch half lod-height.png \
    lod-height-1.png data

# a fence of thin wires; white is hidden between them
$check_patch fence fence.png
check "--lod of a cutout" run 0 fence.png -o fence-tile.png --size 91x64 --tileable-y --lod 4
check "no hidden color shows" one_by_one $check_patch colored fence-tile{}.png 60,120,40 -- "" -1 -2 -3 -4
check "--cutout" run 0 fence.png -o fence-cut.png --size 91x64 --tileable-y --lod 4 --cutout
check "the picture itself is as without" cmp fence-tile.png fence-cut.png
check "thin wires stay" one_by_one $check_patch covered fence-cut.png fence-cut{}.png 0.1 -- -1 -2 -3
check "which vanish without" fails $check_patch covered fence-tile.png fence-tile-3.png 0.1
refuses 2 "goes with --lod" bricks.png -o n.png $size --cutout

# ---- guided
check "--guide and --target" run 0 ramp.png -o g.png $size --guide ramp-guide.png \
    --target target.png --guide-weight 8
check "dark where it is to be" $check_patch darker g.png top.png 40
check "--target-mask" run 0 ramp.png -o gm.png $size --guide ramp-guide.png --target target.png \
    --target-mask disc.png
check "is not all that the target says" differ g.png gm.png
check "--keep" run 0 bricks.png -o kept.png $size --maps bricks-id.png,bricks-height.png --label 1 \
    --keep plain.png,plain-id.png,plain-height.png --keep-mask disc.png --sources kept.pfm
check "keeps" $check_patch kept kept.png plain.png disc.png
check "in all maps" $check_patch kept kept-id.png plain-id.png disc.png
check "and all bits" $check_patch kept kept-height.png plain-height.png disc.png
check "what was kept has no source" $check_patch codes kept.pfm 'c == {-1, 0}'

# ---- strokes
cat >strokes.json <<'END'
{"levels": 2, "smooth": 1, "background": 1, "disturb": 0.5, "strokes": [
    {"layer": 0, "closed": true, "points": [[0,0], [64,0], [64,30], [0,30]]}]}
END
check "--control" run 0 ramp.png -o c.png $size --control strokes.json --guide-weight 8 \
    --stats stats.json
check "counts the strokes" figures stroke_count=1
check "dark within the stroke" $check_patch darker c.png top.png 20
echo '{"strokes": [{"points": [[5,5], [60,50], [9.5,-20]]}]}' >open.json
check "an open stroke" run 0 ramp.png -o o.png $size --control open.json
check "another picture" differ c.png o.png
echo '{"strokes": []}' >none.json
check "no strokes" run 0 ramp.png -o o.png $size --control none.json
check "with more exemplars" run 0 ramp.png -o o.png $size --control open.json --exemplars bricks.png

# ---- windows of the plane. It takes whole cells, so most are made by the tool as released
window() { # FILE X Y W H OPTIONS...
    file=$1 area=$2,$3,$4,$5
    shift 5
    "$released" patch bricks.png -o "$file" --window "$area" --quiet "$@"
}
check "--window" window plane.png -20 -30 100 90 --stats stats.json --sources plane.pfm \
    --maps bricks-id.png --label 1
check "labels are those of their places" $check_patch sources plane.pfm plane-id.png bricks-id.png
check "pieces hang together" is_true "$(figure continuous) > 0.5"
check "another window, with the sanitizers" run 0 bricks.png -o window.png --window 10,5,40,50 --lod 1 \
    --stats stats.json
check "the same plane" $check_patch part plane.png window.png 30 35
check "with a coarser level" $check_patch half window.png window-1.png color
check "tells its cells" test "$(figure cell)" -gt 0
check "one pixel of it, with one thread" window window.png -20 -30 1 1 --threads 1
check "the same" $check_patch part plane.png window.png 0 0
check "the same window again, with another number of threads" sh -c "
    '$released' patch bricks.png -o again.png --window -20,-30,100,90 --threads 1 --quiet &&
    cmp plane.png again.png"
far=$(((1 << 40) - 3))
check "far away" window far.png $far -$far 48 40
check "a part of it" window window.png $((far + 3)) $((-far + 5)) 20 30
check "the same plane" $check_patch part far.png window.png 3 5
check "another seed" window window.png -20 -30 1 90 --seed 2
check "another plane" fails $check_patch part plane.png window.png 0 0

check "JPEG takes 8 of 16 bits, and it says so" warns "takes 8" patch bricks-height.png -o deep.jpg $size
check "so does TGA, for a map" warns "takes 8" patch bricks.png -o deep.tga $size --maps bricks-height.png

# ---- usage errors: status 2; there are many, and the sanitizers take their time to begin
sanitized=$texkit
[ "$FULL" = 1 ] || texkit=$released
before=$(all_files)
refuses 2 "no exemplar"
refuses 2 "add -o" bricks.png $size
refuses 2 "add --size" bricks.png -o n.png
refuses 2 "unexpected" bricks.png weave.png -o n.png $size
for bad in 0x0 64 64x -1x5 axb 99999999999x1; do refuses 2 "--size" bricks.png -o n.png --size $bad; done
refuses 2 "pixels in all" bricks.png -o n.png --size 100000x100000
for name in n.gif n.txs n; do refuses 2 "end the name" bricks.png -o $name $size; done
refuses 2 "65500" bricks.png -o n.jpg --size 70000x64
refuses 2 "alpha" rgba.png -o n.jpg $size
for bad in -1 17 x 1.5; do refuses 2 "--passes" bricks.png -o n.png $size --passes $bad; done
for bad in 0 -4 x 1000000; do refuses 2 "--patch" bricks.png -o n.png $size --patch $bad; done
for bad in 0 3 5 x; do refuses 2 "--turns" bricks.png -o n.png $size --turns $bad; done
for bad in -1 29 x; do refuses 2 "--lod" bricks.png -o n.png $size --lod $bad; done
refuses 2 "have 6 coarser levels" bricks.png -o n.png $size --lod 7
for bad in -0.1 1.1 x nan 0x1 1, ,1 " 1" 1e; do
    refuses 2 "--novelty" bricks.png -o n.png $size --novelty "$bad"
done
for bad in x 1,2 17 -1; do refuses 2 "--weights" bricks.png -o n.png $size --weights $bad; done
refuses 2 "above 0" bricks.png -o n.png $size $maps --weights 0,0
for bad in 4 -1 x 1.5 1,; do refuses 2 "--normal" bricks.png -o n.png $size $maps --normal $bad; done
refuses 2 "choose one" bricks.png -o n.png $size $maps --label 1
refuses 2 "choose one" bricks.png -o n.png $size $maps --data 2
refuses 2 "--directx goes with" bricks.png -o n.png $size --directx
for bad in off 24 24,0,12 24,0,48,0 0,0,0,0 1,2,3,4,5 24,0,12,x 99999,0,0,1; do
    refuses 2 "--lattice" bricks.png -o n.png $size --lattice $bad
done
for bad in 0,0,64 0,0,64,0 0,0,64,64,1 a,0,64,64 0,0,64,6x 0,1.5,64,64 1099511627777,0,64,64 \
    0,-1099511627777,64,64 99999999999999999999,0,64,64; do
    refuses 2 "--window" bricks.png -o n.png --window $bad
done
refuses 2 "pixels in all" bricks.png -o n.png --window 0,0,100000,100000
for bad in "$size" --tileable --tileable-x "--control strokes.json" \
    "--keep plain.png --keep-mask disc.png" "--guide ramp-guide.png --target target.png"; do
    refuses 2 "does not go with --window" bricks.png -o n.png --window 0,0,64,64 $bad
done
refuses 2 "go together" ramp.png -o n.png $size --guide ramp-guide.png
refuses 2 "go together" ramp.png -o n.png $size --target target.png
refuses 2 "go together" ramp.png -o n.png $size --keep plain.png
refuses 2 "go together" ramp.png -o n.png $size --keep-mask disc.png
refuses 2 "goes with --target" ramp.png -o n.png $size --target-mask disc.png
refuses 2 "goes with --target" ramp.png -o n.png $size --guide-weight 1
refuses 2 "leave out" ramp.png -o n.png $size --guide ramp-guide.png --target target.png --guide-weight 0
refuses 2 "makes its own" ramp.png -o n.png $size --guide ramp-guide.png --target target.png \
    --control strokes.json
refuses 2 ".pfm" bricks.png -o n.png $size --sources n.txt
refuses 2 "written twice" bricks.png -o n.png $size --maps bricks-id.png,m/../bricks-id.png
refuses 2 "written twice" bricks.png -o n.png $size --maps bricks-id.png --stats n-id.png
refuses 2 "the same file" bricks.png -o n.png $size --stats n.png
refuses 2 "empty" bricks.png -o n.png $size --maps bricks-id.png,
refuses 2 "at most" bricks.png -o n.png $size --exemplars a,b,c,d,e,f,g,h
refuses 2 "there are 2" bricks.png -o n.png $size --exemplars weave.png --maps bricks-id.png
refuses 2 "give all of each" bricks.png -o n.png $size --exemplars weave.png \
    --maps 'bricks-id.png,bricks-height.png;gray.png'
refuses 2 "one for each exemplar" bricks.png -o n.png $size --exemplars weave.png --mask left.png
refuses 2 "one for each map" bricks.png -o n.png $size --maps bricks-id.png --keep plain.png \
    --keep-mask disc.png

texkit=$sanitized
check "no file was made or changed" nothing_changed

# ---- failures of the work: status 1
before=$(all_files)
refuses 1 "No such file" missing.png -o n.png $size
refuses 1 "missing.png" bricks.png -o n.png $size --maps missing.png
refuses 1 "missing.png" bricks.png -o n.png $size --exemplars missing.png
refuses 1 "missing.json" bricks.png -o n.png $size --control missing.json
refuses 1 "32" tiny.png -o n.png $size
refuses 1 "make it 96 x 96" bricks.png -o n.png $size --maps weave.png
refuses 1 "make it 96 x 96" bricks.png -o n.png $size --mask disc.png
refuses 1 "make it 96 x 96" ramp.png -o n.png $size --guide target.png --target target.png
refuses 1 "make it 64 x 64" ramp.png -o n.png $size --guide ramp-guide.png --target ramp-guide.png
refuses 1 "make it 64 x 64" bricks.png -o n.png $size --keep bricks.png --keep-mask disc.png
refuses 1 "make it 64 x 64" bricks.png -o n.png $size --keep plain.png --keep-mask left.png
refuses 1 "cannot write" bricks.png -o nowhere/n.png $size
refuses 1 "cannot write" bricks.png -o n.png $size --sources nowhere/n.pfm
refuses 1 "cannot write" bricks.png -o n.png $size --stats nowhere/n.json
check "no file was made or changed" nothing_changed
check "a full disk: status 1" run 1 bricks.png -o n.png $size --maps bricks-id.png --stats /dev/full
mkdir n-id.png
refuses 1 "n-id.png" bricks.png -o n.png $size --maps bricks-id.png
rmdir n-id.png
mkdir n-id-1.png
refuses 1 "n-id-1.png" bricks.png -o n.png $size --maps bricks-id.png --lod 2
rmdir n-id-1.png
head -c 1000 bricks.png >cut.png
refuses 1 "cannot read 'cut.png'" cut.png -o n.png $size
refuses 1 "cannot read 'cut.png'" bricks.png -o n.png $size --maps cut.png
before=$(cksum n.png)
bad_strokes() { # TEXT JSON
    echo "$2" >bad.json
    refuses 1 "$1" bricks.png -o n.png $size --control bad.json
}
bad_strokes "not a JSON file" '{"strokes": ['
bad_strokes "not a list of strokes" '[1]'
bad_strokes "not a list of strokes" '{"levels": 3}'
bad_strokes 'unknown field "stroke"' '{"stroke": [], "strokes": []}'
bad_strokes '"levels"' '{"levels": 1, "strokes": []}'
bad_strokes '"levels"' '{"levels": 2.5, "strokes": []}'
bad_strokes '"smooth"' '{"smooth": -1, "strokes": []}'
bad_strokes '"least"' '{"least": "x", "strokes": []}'
bad_strokes '"background"' '{"levels": 3, "background": 3, "strokes": []}'
bad_strokes '"disturb"' '{"disturb": 5, "strokes": []}'
bad_strokes 'stroke 0: it must be an object' '{"strokes": [7]}'
bad_strokes 'stroke 1: "points"' '{"strokes": [{"points": [[1,2],[3,4]]}, {}]}'
bad_strokes 'stroke 0: "points"' '{"strokes": [{"points": [[1,2]]}]}'
bad_strokes 'stroke 0: "points"' '{"strokes": [{"points": [[1,2],[1,2]]}]}'
bad_strokes '3 or more' '{"strokes": [{"closed": true, "points": [[1,2],[3,4]]}]}'
bad_strokes 'point 1 must be' '{"strokes": [{"points": [[1,2],[3]]}]}'
bad_strokes 'point 1 must be' '{"strokes": [{"points": [[1,2],[3,4,5]]}]}'
bad_strokes 'point 0 must be' '{"strokes": [{"points": [[1,"x"],[3,4]]}]}'
bad_strokes 'point 0 must be' '{"strokes": [{"points": [[1,1e9],[3,4]]}]}'
bad_strokes 'point 0 must be' '{"strokes": [{"points": {"a": 1}}]}'
bad_strokes '"layer"' '{"strokes": [{"layer": 4, "points": [[1,2],[3,4]]}]}'
bad_strokes '"width"' '{"strokes": [{"width": 1, "points": [[1,2],[3,4]]}]}'
bad_strokes '"closed"' '{"strokes": [{"closed": 1, "points": [[1,2],[3,4]]}]}'
bad_strokes 'unknown field "colour"' '{"strokes": [{"colour": 1, "points": [[1,2],[3,4]]}]}'
printf '{"strokes": [{"points": [[1,2],[3,4]], "\001\n": 1}]}' >bad.json
refuses 1 "bad.json" bricks.png -o n.png $size --control bad.json

check "the output is as it was" test "$before" = "$(cksum n.png)"

# ---- edges
prefix=edges
"$root/build/draw" cells cells.png 96
check "edges" run 0 cells.png -o e.png --stats stats.json
check "tells what it found" grep -q '^e.png: [1-9][0-9]* lines of 4 layers, ' out.log
check "a picture" $check_patch is e.png 96 96 3 8
check "the figures" figures command='"edges"' width=96 height=96 levels=4 \
    file_bytes="$(wc -c <e.png)"
for key in seed threads read find encode total peak_bytes lines length lines_per_layer; do
    check "--stats has $key" test -n "$(figure $key)"
done
check "--stats is JSON" $python -m json.tool stats.json
check "--quiet says nothing" sh -c "
    '$texkit' edges cells.png -o q.png --quiet | wc -c | grep -qx 0 && cmp e.png q.png"
for options in "" "--levels 2" "--levels 7 --smooth 1.5" "--smooth 2 --least 40" \
    "--thresholds 0.25,0.5,0.875"; do
    check ".json, .svg, --layers: $options" sh -c "
        '$texkit' edges cells.png -o l.json --layers l.png $options --quiet &&
        '$texkit' edges cells.png -o l.svg $options --quiet"
    check "is JSON" $python -m json.tool l.json
    check "the lines enclose the pixels of the layers" $check_patch lines l.json l.png
    check "the same lines in both" $check_patch shapes l.svg l.json
done
check "thresholds are those given" grep -q '"thresholds": \[0.25, 0.5, 0.875\]' l.json
check "a few lines with --smooth and --least" run 0 cells.png -o few.json --smooth 2 --least 40
check "more without" run 0 cells.png -o many.json
lines() { grep -c '"points"' "$1"; }
check "fewer" test "$(lines few.json)" -lt "$(lines many.json)"
check "--layer" run 0 cells.png -o layer.json --layer 2
check "only this one" sh -c "
    ! grep '\"layer\"' layer.json | grep -qv '\"layer\": 2,' && grep -q '\"layer\": 2,' layer.json"
check "all of it" test "$(lines layer.json)" = "$(grep -c '"layer": 2,' many.json)"
check "--layer in a picture" run 0 cells.png -o one.png --layer 1
check "is another" differ e.png one.png
check "--over picture" run 0 cells.png -o over.png --over picture
check "--over layers" run 0 cells.png -o layers.png --over layers
check "are others" differ over.png layers.png
check "--over black is the default" sh -c "
    '$texkit' edges cells.png -o q.png --over black --quiet && cmp e.png q.png"
check "gray" run 0 gray.png -o q.png --over picture
check "16 bits, of which lines need 8" warns "8 of them" edges bricks-height.png -o q.jpg --over picture
check "RGBA" run 0 rgba.png -o q.bmp --over picture
check "one layer fills a plain picture" run 0 plain.png -o plain.json --layers l.png
check "and its line goes round" $check_patch lines plain.json l.png
for threads in 1 8; do
    check "--threads $threads" run 0 cells.png -o t.json --threads $threads
    check "the same lines" cmp many.json t.json
done
before=$(all_files)
refuses 2 "no exemplar"
refuses 2 "add -o" cells.png
for bad in 0 1 17 x; do refuses 2 "--levels" cells.png -o n.png --levels $bad; done
for bad in -1 17 x 1,2; do refuses 2 "--smooth" cells.png -o n.png --smooth $bad; done
for bad in -1 x 1.5; do refuses 2 "--least" cells.png -o n.png --least $bad; done
for bad in -1 4 x; do refuses 2 "--layer" cells.png -o n.png --layer $bad; done
for bad in 0.5,0.5 0.5,0.4 -1 2 x 0.1,,0.2; do
    refuses 2 "--thresholds" cells.png -o n.png --thresholds $bad
done
refuses 2 "has 3 thresholds" cells.png -o n.png --levels 4 --thresholds 0.2,0.5
refuses 2 "black, picture, layers" cells.png -o n.png --over white
refuses 2 "only lines" cells.png -o n.svg --over picture
for name in n.gif n.txs n; do refuses 2 "end the name" cells.png -o $name; done
refuses 2 "end the name" cells.png -o n.png --layers n.svg
refuses 2 "written twice" cells.png -o n.png --layers n.png
refuses 2 "written twice" cells.png -o n.png --layers l.png --stats l.png
refuses 2 "unexpected" cells.png gray.png -o n.png
refuses 1 "No such file" missing.png -o n.png
refuses 1 "cannot write" cells.png -o nowhere/n.png
refuses 1 "cannot write" cells.png -o n.png --layers nowhere/n.png
refuses 1 "cannot read 'cut.png'" cut.png -o n.json
check "no file was made or changed" nothing_changed
check "a full disk: status 1" run 1 cells.png -o n.json --layers n.png --stats /dev/full

# ---- stopped, out of memory (the tool as released)
check "stopped by a signal: status 1 and nothing written" \
    stops stopped.png patch bricks.png --size 4000x4000
check "out of memory: status 1, one line" starves 300000 starved.png patch bricks.png --size 8000x8000
if has_terminal; then
    check "a progress bar on a terminal" shows_bar patch bricks.png -o bar.png --size 2000x2000
fi
