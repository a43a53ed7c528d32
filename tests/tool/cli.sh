#!/bin/sh
# The command line keeps its contract: options, exit status, messages, formats, files after failure.
. tests/kit/tap.sh
. tests/kit/texkit.sh

texkit=$(pwd)/$OUT/asan/texkit   # with the sanitizers
released=$(pwd)/build/texkit     # as users have it
draw=$(pwd)/build/draw
shape=$(pwd)/build/shape
check_tiles="/usr/bin/python3 $(pwd)/tests/tool/check_tiles.py"
cd "$tmp" || exit 1

# refuses STATUS TEXT ARGUMENTS...: both in one test
refuses() {
    status=$1 text=$2
    shift 2
    check "status $status, \"$text\": texkit $(echo "$*" | tail -c 70)" \
        refuses_so "$status" "$text" "$@"
}

# kind FILE: width, height and channels in the header of a PNG, BMP, TGA or JPEG file
byte() { od -An -tu1 -j"$2" -N1 "$1" | tr -d ' '; }
word() { od -An -tu2 -j"$2" -N2 "$1" | tr -d ' '; }
png_is() { # FILE WIDTH HEIGHT COLOUR-TYPE, sizes under 256
    [ "$(byte "$1" 19) $(byte "$1" 23) $(byte "$1" 25)" = "$2 $3 $4" ]
}

"$draw" sand sand.png 48
"$draw" cells gray.png 48 1
"$draw" cells gray-alpha.png 48 2
"$draw" cells rgba.png 48 4
"$draw" sand tiny.png 8
cp sand.png 'odd name;$(x).png'
size="--size 40x30"

# ---- help and version
check "--help" run 0 --help
check "--help lists the commands" sh -c "grep -q learn out.log && grep -q synth out.log && grep -q patch out.log &&
    grep -q composite out.log &&
    grep -q edges out.log && grep -q tiles out.log && grep -q retile out.log &&
    grep -q inpaint out.log && grep -q ' fill ' out.log && grep -q ' knit ' out.log &&
    grep -q relight out.log && grep -q erode out.log && grep -q segment out.log &&
    grep -q tree out.log && grep -q forest out.log"
cp out.log overview.log
for words in "" help -h; do
    check "texkit $words" run 0 $words
    check "is the same overview" cmp out.log overview.log
done
check "--version" run 0 --version
check "--version names the headers" \
    grep -q '^texkit [0-9.]* (texmath [0-9.]*, texsyn [0-9.]*, texpatch [0-9.]*, texedges [0-9.]*, textiles [0-9.]*, trimesh_relax [0-9.]*, trimesh_cover [0-9.]*, texinpaint [0-9.]*, treepieces [0-9.]*)$' out.log
check "version" sh -c "cp out.log version.log; '$texkit' version | cmp - version.log"
for command in learn synth composite fill knit segment relight erode patch edges tiles retile inpaint tree forest; do
    check "$command --help" run 0 $command --help
    check "$command --help has an example" grep -q "  texkit $command .*-o" out.log
    input=sand.png
    case $command in tree | forest) input= ;; esac
    check "$command -h, behind other arguments" run 0 $command $input --seed 3 -h
    check "$command --version" run 0 $command --version
    check "help $command" run 0 help $command
    cp out.log help.log
    check "is its --help" sh -c "'$texkit' $command --help | cmp - help.log"
    check "no line of $command --help is wider than 100 columns" \
        sh -c "'$texkit' $command --help | awk 'length > 100 { exit 1 }'"
done

# ---- the main path
check "learn" run 0 learn sand.png -o sand.txs
check "learn tells what it made" grep -q 'sand.txs: .* bytes' out.log
check "synth from a model" run 0 synth sand.txs -o a.png $size
check "the result has the size asked for and is RGB" png_is a.png 40 30 2
check "synth from a picture" run 0 synth sand.png -o b.png $size
check "the model's content counts, not its name" sh -c "cp sand.txs sand.png.bin; cp sand.png picture"
check "synth from a model of another name" run 0 synth sand.png.bin -o c.png $size
check "the same model, the same picture" cmp a.png c.png
check "synth from a picture without an extension" run 0 synth picture -o d.png $size
check "the same picture, the same result" cmp b.png d.png
check "a file name with odd characters" run 0 synth 'odd name;$(x).png' -o 'odd out.png' $size
check "one pixel" run 0 synth sand.txs -o one.png --size 1x1
check "a narrow strip" run 0 synth sand.txs -o strip.png --size 3x200
check "--tileable" run 0 synth sand.txs -o tile.png $size --tileable
check "--quality -2" run 0 synth sand.txs -o fast.png $size --quality -2
check "--quality=2" run 0 synth sand.txs -o best.png $size --quality=2
check "--quiet says nothing" sh -c "'$texkit' synth sand.txs -o q.png $size --quiet | wc -c | grep -qx 0"
check "options of learn" run 0 learn sand.png -o s.txs --max-distance 8 --types 4 --levels 1
check "an existing output is replaced" sh -c "
    echo old >over.png; '$texkit' synth sand.txs -o over.png $size --quiet && cmp a.png over.png"
check "an output behind a symbolic link" sh -c "
    echo old >target.png; ln -s target.png link.png
    '$texkit' synth sand.txs -o link.png $size --quiet && cmp a.png target.png && test -L link.png"
check "an output to /dev/null" sh -c "ln -s /dev/null null.png; '$texkit' synth sand.txs -o null.png $size --quiet"
check "no temporary file is left" sh -c "! ls | grep -q tmp"

# ---- options anywhere, in both spellings
for order in "sand.txs -o x.png --size 40x30 --seed 5" "--seed 5 --size 40x30 -o x.png sand.txs" \
    "-o x.png sand.txs --size=40x30 --seed=5" "--seed 1 --size 9x9 sand.txs -o x.png --size 40x30 --seed 5" \
    "--size 40x30 --seed 5 -o x.png -- sand.txs"; do
    rm -f x.png
    check "synth $order" run 0 synth $order
    [ -e first.png ] || cp x.png first.png
    check "makes the same picture" cmp first.png x.png
done
check "another seed, another picture" sh -c "! cmp -s a.png first.png"

# ---- the number of threads does not matter
for threads in 1 2 8; do
    check "learn --threads $threads" run 0 learn sand.png -o t$threads.txs --threads $threads
    check "makes the same model" cmp sand.txs t$threads.txs
    check "synth --threads $threads" run 0 synth sand.txs -o t$threads.png $size --threads $threads
    check "makes the same picture" cmp a.png t$threads.png
done

# ---- formats
for extension in png tga bmp jpg jpeg PNG; do
    check "writes .$extension" run 0 synth sand.txs -o f.$extension $size
    check "reads .$extension" run 0 synth f.$extension -o g.png --size 20x20
done
check ".png is PNG" test "$(byte f.png 1)" = 80
check ".bmp is BMP" test "$(byte f.bmp 0)$(byte f.bmp 1)" = 6677
check ".jpg is JPEG" test "$(byte f.jpg 0)$(byte f.jpg 1)" = 255216
check ".tga is TGA of 40 x 30" test "$(word f.tga 12) $(word f.tga 14)" = "40 30"
{ printf 'P6\n48 48\n255\n'; head -c 6912 /dev/urandom; } >noise.ppm
{ printf 'P5\n48 48\n255\n'; head -c 2304 /dev/urandom; } >noise.pgm
check "reads PPM" run 0 synth noise.ppm -o ppm.png $size
check "RGB stays RGB" png_is ppm.png 40 30 2
check "reads PGM" run 0 synth noise.pgm -o pgm.png $size
check "gray stays gray" png_is pgm.png 40 30 0
check "gray PNG" run 0 synth gray.png -o gray-out.png $size
check "gray PNG stays gray" png_is gray-out.png 40 30 0
check "RGBA PNG" run 0 synth rgba.png -o rgba-out.png $size
check "RGBA stays RGBA" png_is rgba-out.png 40 30 6
check "gray with alpha" run 0 synth gray-alpha.png -o ga-out.png $size
check "gray with alpha becomes RGBA" png_is ga-out.png 40 30 6
check "RGBA as TGA" run 0 synth rgba.png -o rgba.tga $size
check "RGBA as BMP" run 0 synth rgba.png -o rgba.bmp $size
check "and back from TGA" sh -c "'$texkit' synth rgba.tga -o r.png --size 9x9 --quiet"
check "RGBA comes back from TGA" png_is r.png 9 9 6

# ---- masks
"$draw" discs mask.png 48 2,2,44,44
check "learn --mask" run 0 learn sand.png --mask mask.png -o masked.txs
{ printf 'P5\n48 48\n255\n'; head -c 2304 /dev/zero; } >black.pgm
{ printf 'P5\n48 40\n255\n'; head -c 1920 /dev/zero; } >short.pgm
refuses 1 "nothing of it counts" learn sand.png --mask black.pgm -o n.txs
refuses 1 "48 x 48" learn sand.png --mask short.pgm -o n.txs
refuses 1 "cannot read" learn sand.png --mask missing.png -o n.txs

# ---- relight and erode
check "relight" run 0 relight sand.png --like rgba.png -o relit.png --stats relit.json
check "relight keeps size and channels" png_is relit.png 48 48 2
check "relight tells what it made" grep -q 'relit.png: 48 x 48 pixels' out.log
check "relight --stats" sh -c "grep -q '\"gain\": ' relit.json && grep -q '\"cast\": ' relit.json"
check "relight gray with alpha" run 0 relight gray-alpha.png --like sand.png -o relit-ga.png
check "relight --strength 0 changes nothing" run 0 relight sand.png --like rgba.png -o same.bmp --strength 0
check "the same pixels" sh -c "'$texkit' relight sand.png --like sand.png -o sand.bmp --strength 0 --quiet &&
    cmp sand.bmp same.bmp"
check "relight with masks" run 0 relight sand.png --like rgba.png -o relit.png --mask mask.png --like-mask mask.png
refuses 1 "nothing of it counts" relight sand.png --like rgba.png -o n.png --mask black.pgm
refuses 1 "nothing of it counts" relight sand.png --like rgba.png -o n.png --like-mask black.pgm
refuses 1 "48 x 48" relight sand.png --like rgba.png -o n.png --like-mask short.pgm
refuses 1 "cannot read" relight sand.png --like missing.png -o n.png
refuses 2 "add --like" relight sand.png -o n.png
refuses 2 "no picture" relight --like sand.png -o n.png
refuses 2 "" relight sand.png --like rgba.png -o n.txs
for bad in -1 1.1 x; do refuses 2 "--strength" relight sand.png --like rgba.png -o n.png --strength $bad; done

check "erode" run 0 erode sand.png --weathered gray.png --level 0.5 -o worn.png --stats worn.json \
    --cracks cracks.png --intact intact.png
check "erode keeps size and channels" png_is worn.png 48 48 2
check "--cracks is gray, of the picture's size" png_is cracks.png 48 48 0
check "--intact is gray, of the exemplar's size" png_is intact.png 48 48 0
check "erode --stats" sh -c "grep -q '\"share\": 0.1' worn.json && grep -q '\"level\": 0.5' worn.json"
check "a model of the intact stone" run 0 learn gray.png --mask intact.png -o intact.txs
check "erode to level 0 changes nothing" run 0 erode sand.png --weathered gray.png --level 0 -o worn.bmp
check "the same pixels" cmp sand.bmp worn.bmp
check "erode by a picture of levels" run 0 erode rgba.png --weathered sand.png --level 1 -o worn.png --levels gray.png
check "erode, other cracks" run 0 erode sand.png --weathered gray.png --level 0.5 -o other.png --seed 2 --share 0.2 \
    --mask mask.png
refuses 1 "at least 32 x 32" erode sand.png --weathered tiny.png --level 1 -o n.png
refuses 1 "nothing of it counts" erode sand.png --weathered sand.png --level 1 -o n.png --mask black.pgm
refuses 1 "48 x 48" erode sand.png --weathered sand.png --level 1 -o n.png --levels short.pgm
refuses 1 "48 x 48" erode sand.png --weathered sand.png --level 1 -o n.png --mask short.pgm
refuses 1 "cannot read" erode sand.png --weathered missing.png --level 1 -o n.png
refuses 2 "add --weathered" erode sand.png --level 1 -o n.png
refuses 2 "add --level" erode sand.png --weathered gray.png -o n.png
refuses 2 "written twice" erode sand.png --weathered gray.png --level 1 -o n.png --cracks n.png
for bad in -1 1.1 x; do refuses 2 "--level" erode sand.png --weathered gray.png -o n.png --level $bad; done
for bad in 0 0.6 x; do refuses 2 "--share" erode sand.png --weathered gray.png -o n.png --level 1 --share $bad; done

# ---- segment
"$draw" bricks bricks.png 96
check "segment" run 0 segment bricks.png -o labels.png --stats segment.json
check "segment tells what it found" grep -q 'labels.png: [0-9]* texture' out.log
for key in segments areas seconds width transition not_counted; do
    check "segment --stats has $key" grep -q "\"$key\": " segment.json
done
check "labels are an indexed PNG" sh -c "test \"\$(od -An -tu1 -j25 -N1 labels.png | tr -d ' ')\" = 3"
check "segment --segments" run 0 segment bricks.png -o four.png --segments 4 --stats four.json
check "exactly so many" grep -q '"segments": 4' four.json
check "segment --gray" run 0 segment bricks.png -o gray-labels.png --gray --segments 3 --transition
check "gray labels are a gray PNG" sh -c "test \"\$(od -An -tu1 -j25 -N1 gray-labels.png | tr -d ' ')\" = 0"
check "segment to TGA and BMP" sh -c "'$texkit' segment bricks.png -o l.tga --quiet &&
    '$texkit' segment bricks.png -o l.bmp --quiet"
check "segment of one thread" sh -c "'$texkit' segment bricks.png -o one.png --segments 4 --threads 1 --quiet &&
    cmp one.png four.png"
refuses 2 "JPEG" segment bricks.png -o n.jpg
refuses 2 "--segments" segment bricks.png -o n.png --segments 17
refuses 1 "16 pixels" segment tiny.png -o n.png
refuses 1 "96 x 96" segment bricks.png --mask sand.png -o n.png

# ---- statistics
check "learn --stats" run 0 learn sand.png -o s.txs --stats learn.json
check "synth --stats" run 0 synth sand.txs -o s.png $size --stats synth.json
for key in command seed threads seconds total peak_bytes result model_bytes clique_types; do
    check "--stats has $key" sh -c "grep -q '\"$key\": ' learn.json && grep -q '\"$key\": ' synth.json"
done
check "model_bytes is the size of the file" \
    grep -q "\"model_bytes\": $(wc -c <s.txs)," learn.json
if has python3; then
    check "--stats is JSON" sh -c "python3 -m json.tool <learn.json && python3 -m json.tool <synth.json"
fi

# ---- usage errors: status 2
refuses 2 "unknown command" frobnicate sand.png
refuses 2 "unknown command" help frobnicate
refuses 2 "unexpected" help learn synth
refuses 2 "unknown command" --seed 1 learn sand.png -o n.txs
refuses 2 "no exemplar" learn
refuses 2 "no exemplar" learn -o n.txs
refuses 2 "add -o" learn sand.png
refuses 2 "needs a value" learn sand.png -o
refuses 2 "needs a value" learn sand.png -o --quiet
refuses 2 "is empty" learn sand.png -o ""
refuses 2 "unexpected" learn sand.png rgba.png -o n.txs
refuses 2 "unknown option" learn sand.png -o n.txs --size 10x10
refuses 2 "unknown option" learn sand.png -o n.txs --frob
refuses 2 "unknown option" learn sand.png -o n.txs -x
refuses 2 "no value" learn sand.png -o n.txs --quiet=1
refuses 2 ".txs" learn sand.png -o n.png
refuses 2 ".txs" learn sand.png -o n
refuses 2 "add --size" synth sand.txs -o n.png
for bad in 0x0 0x5 5x0 -1x5 5x-1 99999999x99999999 16777217x1 5 5x x5 5x5x5 5.5x5 axb 5x5a " 5x5" \
    "5 x5" "5x 5" 0x10 +5x5 99999999999999999999x1 5X5; do
    refuses 2 "such as 512x512" synth sand.txs -o n.png --size "$bad"
done
refuses 2 "pixels in all" synth sand.txs -o n.png --size 1000000x1000000
refuses 2 "65500" synth sand.txs -o n.jpg --size 70000x10
refuses 2 "65535" synth sand.txs -o n.tga --size 10x70000
for extension in gif txs "" png.gz; do
    refuses 2 "end the name in" synth sand.txs -o "n.$extension" $size
done
refuses 2 "end the name in" synth sand.txs -o png $size
refuses 2 "end the name in" synth missing.png -o n.xyz $size
for bad in -1 1.5 x "" 1x 18446744073709551616 " 1" +1; do
    refuses 2 "--seed" synth sand.txs -o n.png $size --seed "$bad"
done
for bad in 0 -1 257 x 1.5 "" 2x; do
    refuses 2 "--threads" synth sand.txs -o n.png $size --threads "$bad"
done
for bad in 3 -3 x 0x1; do refuses 2 "--quality" synth sand.txs -o n.png $size --quality $bad; done
for bad in 1 61 0 x; do refuses 2 "--max-distance" learn sand.png -o n.txs --max-distance $bad; done
for bad in 0 61 x; do refuses 2 "--types" learn sand.png -o n.txs --types $bad; done
for bad in 0 7 x; do refuses 2 "--levels" learn sand.png -o n.txs --levels $bad; done
refuses 2 "the same file" learn sand.png -o n.txs --stats n.txs

# ---- failures of the work: status 1
refuses 1 "No such file" learn missing.png -o n.txs
refuses 1 "No such file" synth missing.txs -o n.png $size
refuses 1 "cannot read" learn . -o n.txs
refuses 1 "cannot write" learn sand.png -o nowhere/n.txs
refuses 1 "cannot write" synth sand.txs -o n.png $size --stats nowhere/n.json
mkdir folder.png
refuses 1 "cannot write" synth sand.txs -o folder.png $size
refuses 1 "16" learn tiny.png -o n.txs
refuses 2 "alpha" synth rgba.png -o n.jpg $size
check "a full disk: status 1" run 1 synth sand.txs -o s.png $size --stats /dev/full
: >empty.png
refuses 1 "empty" learn empty.png -o n.txs
refuses 1 "" synth empty.png -o n.png $size
head -c 3000 /dev/urandom >noise.png
refuses 1 "noise.png" learn noise.png -o n.txs
refuses 1 "noise.png" synth noise.png -o n.png $size
for file in sand.png f.jpg f.bmp f.tga noise.ppm noise.pgm; do
    bytes=$(wc -c <$file)
    for part in 1 10 50 90 99; do
        cut=cut-$part-percent-of-$file
        head -c $((bytes * part / 100)) $file >"$cut"
        refuses 1 "cannot read '$cut'" learn "$cut" -o n.txs
        rm "$cut"
    done
done
# a header that promises 30000 x 30000 pixels and has none
{ printf 'P6\n30000 30000\n255\n'; head -c 100 /dev/zero; } >huge.ppm
refuses 1 "huge.ppm" learn huge.ppm -o n.txs
{ printf 'P6\n2000000 2000000\n255\n'; head -c 100 /dev/zero; } >huge.ppm
refuses 1 "huge.ppm" learn huge.ppm -o n.txs

# ---- hostile models: never a crash, always one line
bytes=$(wc -c <sand.txs)
accepts_or_refuses() { # FILE: a picture, or status 1 and one line, but nothing else
    "$texkit" synth "$1" -o m.png --size 8x8 --quiet >out.log 2>err.log
    case $? in
    0) [ ! -s err.log ] ;;
    1) [ "$(wc -l <err.log)" = 1 ] ;;
    *) return 1 ;;
    esac || { cat err.log; return 1; }
}
for cut in 1 3 4 8 12 16 $((bytes / 4)) $((bytes / 2)) $((bytes - 4)) $((bytes - 1)); do
    head -c "$cut" sand.txs >cut.txs
    refuses 1 "cut.txs" synth cut.txs -o n.png $size
done
flips=40
[ "$FULL" = 1 ] && flips=400
changed_bytes() { # the first 16 bytes, then some all over the file
    i=0
    while [ $i -lt $flips ]; do
        at=$((i < 16 ? i : i * bytes / flips))
        cp sand.txs flip.txs
        printf "\\$(printf %o $((($(byte sand.txs $at) + 1 + i * 37) % 256)))" |
            dd of=flip.txs bs=1 seek=$at conv=notrunc 2>/dev/null
        accepts_or_refuses flip.txs || { echo "byte $at changed"; return 1; }
        i=$((i + 1))
    done
}
check "$flips models with one byte changed" changed_bytes
{ cat sand.txs; echo more; } >long.txs
check "a model with bytes behind its end" accepts_or_refuses long.txs
{ head -c 8 sand.txs; head -c 2000 /dev/urandom; } >random.txs
refuses 1 "random.txs" synth random.txs -o n.png $size

# ---- tiles: all kinds
"$draw" cells cells.png 96
"$draw" cells cells-gray.png 96 1
"$draw" clouds clouds.png 96
"$draw" sand other.png 100
# holds FOLDER NAME...: exactly these files
holds() {
    folder=$1
    shift
    [ "$(ls -A "$folder")" = "$(printf '%s\n' "$@" | sort)" ] || { ls -lA "$folder"; return 1; }
}
for kind in wang corner triangle frame; do
    check "tiles --kind $kind" run 0 tiles cells.png -o $kind --kind $kind --size 32
    check "tells what it made" grep -q "^$kind: .* tiles, atlas .* steps at joints" out.log
    engines="tiles.tres tiles.tsx"
    [ $kind = triangle ] && engines=
    check "makes the folder with these files" holds $kind atlas.png preview.png tiles.json $engines
    check "the set is whole and true" $check_tiles $kind
    $check_tiles $kind --damaged
done
# tiles_so WHAT OPTIONS...: a set with these options is as the schema and check_tiles.py want it
tiles_so() {
    rm -rf so
    run 0 tiles cells.png -o so --size 32 "$@" || return 1
    how=
    case "$*" in *--reduced*) how=--reduced ;; esac
    $check_tiles so $how
}
check "wang --reduced" tiles_so --kind wang --reduced
check "triangle --reduced" tiles_so --kind triangle --reduced
check "wang, 3 colors" tiles_so --kind wang --colors 3
check "corner, 3 colors, torus" tiles_so --kind corner --colors 3 --packing torus
check "wang, 2 variants, torus" tiles_so --kind wang --variants 2 --packing torus
check "triangle, 3 colors, 2 variants, gutter 13" \
    tiles_so --kind triangle --colors 3 --variants 2 --gutter 13
check "a gutter is rounded up to a power of two" grep -q '"gutter": 16' so/tiles.json
check "triangle, no gutter" tiles_so --kind triangle --gutter 0
check "triangle, slices" tiles_so --kind triangle --packing slices
check "wang, slices, gutter 1" tiles_so --kind wang --packing slices --gutter 1
check "frame, 1 color, 16 variants" tiles_so --kind frame --colors 1 --variants 16
check "corner, odd size" tiles_so --kind corner --size 45
check "wang, 8 pixels" tiles_so --kind wang --size 8
check "corner, 16 pixels, 3 colors" tiles_so --kind corner --size 16 --colors 3
check "frame, 11 pixels, no gutter" tiles_so --kind frame --size 11 --gutter 0
refuses 2 "of triangles at least 32" tiles cells.png -o n --kind triangle --size 31
refuses 2 "--size" tiles cells.png -o n --kind wang --size 7
check "wang, --repair none" tiles_so --kind wang --repair none
classes='0,0,0,0;0,1,0,0;1,1,0,1'
check "frame --classes" run 0 tiles cells.png -o classes --size 32 --kind frame \
    --classes "$classes" --variants 2
check "has these classes" $check_tiles classes --classes "$classes"
check "and not others" sh -c "! $check_tiles classes --classes '0,0,0,0;0,1,0,0;1,1,0,0'"
check "four variants of a frame" run 0 tiles cells.png -o variants --size 32 --kind frame \
    --colors 1 --variants 4
check "are four pictures" $check_tiles variants --different
check "gray" run 0 tiles cells-gray.png -o gray --kind wang --size 32
check "gray stays gray" test "$(byte gray/atlas.png 25) $(byte gray/preview.png 25)" = "0 0"
check "the gray set is whole" $check_tiles gray

# ---- tiles: the folder
check "a name that ends in /" run 0 tiles cells.png -o slash/ --kind frame --size 32
check "makes the same folder" holds slash atlas.png preview.png tiles.json tiles.tres tiles.tsx
mkdir there
echo old >there/atlas.png
echo mine >there/mine.txt
check "an existing folder" run 0 tiles cells.png -o there --kind wang --size 32
check "its other files stay" sh -c "grep -q mine there/mine.txt && cmp there/atlas.png wang/atlas.png"
check "nothing else is in it" holds there atlas.png mine.txt preview.png tiles.json tiles.tres \
    tiles.tsx
check "--quiet says nothing" sh -c "
    '$texkit' tiles cells.png -o q --kind frame --size 32 --quiet | wc -c | grep -qx 0"
check "an odd name" run 0 tiles cells.png -o 'odd tiles;$(x)' --kind frame --size 32

# ---- tiles: maps and more pictures
check "--maps" run 0 tiles cells.png -o maps --kind wang --size 32 --maps clouds.png,cells-gray.png
check "an atlas for each map" holds maps atlas.png atlas-2.png atlas-3.png preview.png \
    tiles.json tiles.tres tiles.tsx
check "the set with maps is whole" $check_tiles maps
check "maps keep their channels" \
    test "$(byte maps/atlas-2.png 25) $(byte maps/atlas-3.png 25)" = "2 0"
check "--maps of the same picture" run 0 tiles cells.png -o twin --kind triangle --size 32 \
    --maps cells.png
check "is cut in register" cmp twin/atlas.png twin/atlas-2.png
check "--data" run 0 tiles cells.png -o data --kind wang --size 32 --maps clouds.png --data 1
for bad in x 1.5 -1 8 1,; do refuses 2 "--data" tiles cells.png -o n --kind wang --size 32 --data $bad; done
check "--more" run 0 tiles cells.png -o more --kind wang --size 32 --more other.png,clouds.png
check "--edges" run 0 tiles cells.png -o edges --kind wang --size 32 --edges cells.png,clouds.png
check "the set with chosen edges is whole" $check_tiles edges

# ---- tiles: the same bytes
for threads in 1 2 8; do
    check "tiles --threads $threads" run 0 tiles cells.png -o t$threads --kind wang --size 32 \
        --threads $threads
    check "makes the same files" diff -r wang t$threads
done
check "tiles --seed 1" run 0 tiles cells.png -o seed1 --kind triangle --size 32 --seed 1
check "is the default" diff -r triangle seed1
check "tiles --seed 2" run 0 tiles cells.png -o seed2 --kind triangle --size 32 --seed 2
check "another seed, another set" sh -c "! cmp -s triangle/atlas.png seed2/atlas.png"
check "the set of another seed is whole" $check_tiles seed2

# ---- tiles: statistics
check "tiles --stats" run 0 tiles cells.png -o wang --kind wang --size 32 --stats tiles-stats.json
for key in command seed threads seconds read cut measure draw encode total peak_bytes result tiles \
    atlas_width atlas_height joint_pairs joint_mean joint_worst; do
    check "tiles --stats has $key" grep -q "\"$key\": " tiles-stats.json
done
check "16 tiles, 4 x 4 cells of 48 pixels" sh -c "
    grep -q '\"tiles\": 16,' tiles-stats.json && grep -q '\"atlas_width\": 192,' tiles-stats.json"
check "tiles --stats is JSON" /usr/bin/python3 -m json.tool tiles-stats.json

# ---- tiles: usage errors and failures leave nothing behind
refuses 2 "no exemplar" tiles
refuses 2 "add -o" tiles cells.png --kind wang
refuses 2 "no kind" tiles cells.png -o n
refuses 2 "wang, corner, triangle, frame" tiles cells.png -o n --kind hexagon
refuses 2 "needs a value" tiles cells.png -o n --kind
refuses 2 "--colors 1" tiles cells.png -o n --kind wang --colors 1
for bad in 0 5 x 2.5; do refuses 2 "--colors" tiles cells.png -o n --kind wang --colors $bad; done
for bad in 0 17 x; do refuses 2 "--variants" tiles cells.png -o n --kind wang --variants $bad; done
for bad in 7 1025 x 64x64; do refuses 2 "--size" tiles cells.png -o n --kind wang --size $bad; done
for bad in -1 513 x; do refuses 2 "--gutter" tiles cells.png -o n --kind wang --gutter $bad; done
refuses 2 "packed, torus, slices" tiles cells.png -o n --kind wang --packing loose
refuses 2 "poisson, none" tiles cells.png -o n --kind wang --repair all
for bad in 0 0,0,0 0,0,0,0,0 '0,0,0,0;' ';0,0,0,0' 0,0,0,x 0,0,,0 '0,0,0,0;0,0,0' ' 0,0,0,0' \
    0,0,0,10 -1,0,0,0; do
    refuses 2 "--classes" tiles cells.png -o n --kind frame --classes "$bad"
done
many=$(i=0; while [ $i -lt 64 ]; do printf '0,0,0,0;'; i=$((i + 1)); done)
refuses 2 "--classes" tiles cells.png -o n --kind frame --classes "${many}0,0,0,0"
refuses 2 "--maps" tiles cells.png -o n --kind wang --maps clouds.png --more other.png
refuses 2 "--maps" tiles cells.png -o n --kind wang --maps clouds.png --edges clouds.png,cells.png
refuses 2 "give 2 pictures" tiles cells.png -o n --kind wang --edges clouds.png
refuses 2 "give 3 pictures" tiles cells.png -o n --kind wang --colors 3 --edges clouds.png,cells.png
refuses 2 "at most 2" tiles cells.png -o n --kind wang --edges clouds.png,cells.png,other.png
refuses 2 "empty" tiles cells.png -o n --kind wang --more other.png,
refuses 1 "clouds.png,cells.png" tiles clouds.png,cells.png -o n --kind wang
refuses 1 "make it 96 x 96" tiles cells.png -o n --kind wang --size 32 --maps clouds.png,other.png
refuses 1 "missing.png" tiles cells.png -o n --kind wang --maps missing.png
refuses 1 "missing.png" tiles cells.png -o n --kind wang --more other.png,missing.png
refuses 1 "missing.png" tiles missing.png -o n --kind wang
# options that do not go together
refuses_with_any_status() {
    run 1 tiles cells.png -o n --size 32 --kind "$@" || run 2 tiles cells.png -o n --size 32 --kind "$@"
}
for bad in "frame --classes 0,0,0,3" "wang --classes 0,0,0,0" "corner --reduced" "frame --reduced" \
    "triangle --packing torus" "wang --reduced --packing torus" "frame --packing torus" \
    "corner --colors 4 --packing torus" "wang --packing torus --gutter 4" "wang --gutter 17" \
    "corner --edges clouds.png,cells.png"; do
    check "does not go together: $bad" refuses_with_any_status $bad
done
refuses 1 "64 pixels" tiles sand.png -o n --kind wang --size 32
refuses 1 "cannot write into 'sand.png'" tiles cells.png -o sand.png --kind wang --size 32
refuses 1 "cannot write" tiles cells.png -o nowhere/n --kind wang --size 32
refuses 1 "cannot write" tiles cells.png -o n --kind wang --size 32 --stats nowhere/n.json
mkdir taken taken/preview.png
refuses 1 "taken/preview.png" tiles cells.png -o taken --kind frame --size 32
check "a full disk: the folder is not made" run 1 tiles cells.png -o n --kind frame --size 32 \
    --stats /dev/full
check "a folder of the system: status 1" run 1 tiles cells.png -o /proc/n --kind frame --size 32
# root may write anywhere: without capabilities it may not
mkdir locked
chmod 555 locked
locked() {
    if [ "$(id -u)" != 0 ]; then "$texkit" "$@"
    else setpriv --bounding-set=-all --inh-caps=-all "$texkit" "$@"
    fi 2>err.log
    [ $? = 1 ] && says "cannot write" && [ "$(wc -l <err.log)" = 1 ] && [ -z "$(ls -A locked)" ]
}
check "a read-only folder" locked tiles cells.png -o locked --kind frame --size 32
check "a folder in a read-only folder" locked tiles cells.png -o locked/n --kind frame --size 32
chmod 755 locked
for part in 10 50 90; do
    head -c $(($(wc -c <cells.png) * part / 100)) cells.png >cut.png
    refuses 1 "cannot read 'cut.png'" tiles cut.png -o n --kind wang --size 32
    refuses 1 "cannot read 'cut.png'" tiles cells.png -o n --kind wang --size 32 --more cut.png
done

# ---- stopped, out of memory (the tool as released)
check "stopped by a signal: status 1 and nothing written" \
    stops stopped.png synth sand.txs --size 6000x6000 --quality 2
check "out of memory: status 1, one line" starves 200000 starved.png synth sand.txs --size 8000x8000

# ---- the progress bar: on a terminal, for work of over a second, unless --quiet
if has_terminal; then
    check "a progress bar on a terminal" shows_bar synth sand.txs -o bar.png --size 1600x1600
    check "no progress bar with --quiet" sh -c "
        ! script -qec \"'$released' synth sand.txs -o bar.png --size 1600x1600 --quiet\" \
            /dev/null | grep -q '%'"
fi
