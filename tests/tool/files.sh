#!/bin/sh
# What commands do to files: nothing that is read is written over, outputs appear whole or not at all and
# keep their mode, problems of paths are found before the work; lists of names, streams, signals.
. tests/kit/tap.sh
. tests/kit/texkit.sh

texkit=$(pwd)/$OUT/asan/texkit   # with the sanitizers
released=$(pwd)/build/texkit     # as users have it
draw=$(pwd)/build/draw
shape=$(pwd)/build/shape
cd "$tmp" || exit 1
size="--size 40x30"
fast="--size 16x16 --quality -2"

# refuses STATUS TEXT ARGUMENTS...: both in one test
refuses() {
    status=$1 text=$2
    shift 2
    check "status $status, \"$text\": texkit $(echo "$*" | tail -c 70)" \
        refuses_so "$status" "$text" "$@"
}

"$draw" sand sand.png 48
"$draw" cells cells.png 64
"$draw" cells cells-gray.png 64 1

# no_temporary: no temporary file lies anywhere here
no_temporary() { [ -z "$(find . -name '.texkit-*')" ] || { find . -name '.texkit-*'; return 1; }; }

# ---- what an output keeps
mode_of() { stat -c %a "$1"; }
echo old >mode.png
for mode in 640 604 600 755 666; do
    chmod $mode mode.png
    check "an output of mode $mode" run 0 synth sand.png -o mode.png $fast
    check "keeps it" test "$(mode_of mode.png)" = $mode
done
check "a new output has the mode that the umask says" sh -c "
    umask 027; '$texkit' synth sand.png -o new.png $fast --quiet && test \"\$(stat -c %a new.png)\" = 640"
cp sand.png read-only.png
chmod 444 read-only.png
refuses 1 "read-only" synth sand.png -o read-only.png $fast
refuses 1 "read-only" learn sand.png -o n.txs --stats read-only.png
refuses 1 "read-only" edges sand.png -o n.png --layers read-only.png
mkdir set
cp read-only.png set/tiles.json
chmod 444 set/tiles.json
refuses 1 "set/tiles.json" tiles cells.png -o set --kind frame --size 32
cp read-only.png out-1.png
chmod 444 out-1.png
refuses 1 "out-1.png" patch cells.png -o out.png --size 64x64 --lod 2
refuses 1 "read-only" segment cells.png -o read-only.png
check "a read-only input is no matter" run 0 synth read-only.png -o n.png $fast
if [ "$(id -u)" = 0 ]; then
    chown 12345:12345 mode.png
    check "an output of another user" run 0 synth sand.png -o mode.png $fast
    check "stays that user's" test "$(stat -c %u:%g mode.png)" = 12345:12345
fi
ln mode.png other-name.png
check "an output with two names" run 0 synth sand.png -o mode.png $fast --seed 2
check "is replaced under one of them" sh -c "! cmp -s mode.png other-name.png"

# ---- names and links
longest=$(printf 'x%.0s' $(seq 1 251)).png # 255 bytes
check "a name as long as can be" run 0 synth sand.png -o "$longest" $fast
refuses 1 "too long" synth sand.png -o "x$longest" $fast
refuses 1 "too long" learn sand.png -o n.txs --stats "x$longest"
refuses 1 "too long" patch cells.png -o "$longest" --size 64x64 --lod 1
refuses 1 "too long" tiles cells.png -o "x$longest" --kind frame --size 32
deep=.
for part in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15; do deep=$deep/$(printf 'd%.0s' $(seq 1 250)); done
mkdir -p "$deep"
check "a path as long as can be" run 0 synth sand.png -o "$deep/$(printf 'x%.0s' $(seq 1 200)).png" $fast
rm -r ./dddd*
ln -s not-there.png dangling.png
check "an output behind a link to nothing yet" run 0 synth sand.png -o dangling.png $fast
check "is where the link says" sh -c "test -L dangling.png && test -f not-there.png && ! test -L not-there.png"
ln -s nowhere/n.png lost.png
refuses 1 "cannot write 'lost.png'" synth sand.png -o lost.png $fast
ln -s loop.png loop.png
refuses 1 "cannot write 'loop.png'" synth sand.png -o loop.png $fast
refuses 1 "cannot write" synth sand.png -o sand.png/n.png $fast
refuses 1 "cannot write" synth sand.png -o n.png/ $fast
ln -s sink.png first.png
refuses 2 "written twice" edges sand.png -o first.png --layers sink.png
refuses 2 "written twice" edges sand.png -o sink.png --layers first.png
ln -s missing-set lost-set
refuses 1 "cannot write" tiles cells.png -o lost-set --kind frame --size 32
check "a set in a folder that is a link" sh -c "mkdir real; ln -s real linked
    '$texkit' tiles cells.png -o linked --kind frame --size 32 --quiet && test -f real/atlas.png && test -L linked"
mkdir dropped
chmod 333 dropped # may be written to, not listed
check "a folder that may not be listed" run 0 synth sand.png -o dropped/n.png $fast
chmod 755 dropped

# ---- wrong paths are refused before the work: the work here would take minutes
at_once() { timeout 20 "$released" "$@" >out.log 2>err.log; [ $? = 1 ] && [ "$(wc -l <err.log)" = 1 ]; }
work="patch cells.png --size 6000x6000"
rm -f n.png
check "no such folder" at_once $work -o nowhere/n.png
check "a name that is too long" at_once $work -o "x$longest"
check "a read-only file" at_once $work -o read-only.png
check "the statistics" at_once $work -o n.png --stats nowhere/n.json
check "the sources" at_once $work -o n.png --sources nowhere/n.pfm
check "a level" at_once $work -o out.png --lod 1
check "a folder of the system" at_once $work -o /proc/n.png
check "a folder in a folder of the system" at_once tiles cells.png -o /proc/n --kind wang --variants 16
check "nothing was made" test ! -e n.png

# ---- all or none: files may not grow beyond some blocks, as on a full disk
full_disk() { # ARGUMENTS...: it ends with one line, and nothing has changed
    before=$(all_files)
    (ulimit -f 4 && "$released" "$@" >out.log 2>err.log)
    [ $? = 1 ] && [ "$(wc -l <err.log)" = 1 ] && says "cannot write" || { cat err.log; return 1; }
    [ "$before" = "$(all_files)" ] || { echo "files were made or changed"; ls -lA; return 1; }
}
echo old >old.png
echo old >old.json
check "no room for the picture" full_disk patch cells.png -o old.png --size 96x96 --stats old.json
check "no room for one of the levels" full_disk patch cells.png -o old.png --size 96x96 --lod 2
check "no room for a set" full_disk tiles cells.png -o full --kind wang --size 32
check "no room in a folder that is there" full_disk tiles cells.png -o set-2 --kind wang --size 32
check "no room for a mesh" full_disk tree -o full.glb --pieces 20
mkdir out-2
cp sand.png here.png
check "a device that is full: nothing else changes" run 1 synth sand.png -o here.png $fast --stats /dev/full
check "the picture is the old one" cmp sand.png here.png
ln -s /dev/full full.png
check "the picture goes to a full device" run 1 synth sand.png -o full.png $fast --stats old.json
check "the statistics are the old ones" grep -q old old.json
check "nothing temporary is left" no_temporary

# ---- two runs at once into one folder: the set is that of one of them
check "a set of seed 1" run 0 tiles cells.png -o both-1 --kind wang --size 32
check "a set of seed 2" run 0 tiles cells.png -o both-2 --kind wang --size 32 --seed 2
two_runs() {
    for try in 1 2 3; do
        "$released" tiles cells.png -o both --kind wang --size 32 --quiet --threads 1 &
        "$released" tiles cells.png -o both --kind wang --size 32 --quiet --threads 1 --seed 2 || return 1
        wait $! || return 1
        diff -r both both-1 >/dev/null || diff -r both both-2 || return 1
        rm -r both
    done
}
check "two runs at once" two_runs

# ---- lists of names
cp cells.png 'rock,wet.png'
cp cells.png 'rock,wet-height.png'
cp cells-gray.png 'rock;dry.png'
cp cells-gray.png plain-height.png
patch="patch cells.png --size 32x32 --passes 1"
check "a comma behind a backslash" run 0 $patch -o comma.png --maps 'rock\,wet.png,plain-height.png'
check "two maps" test -f comma-rock,wet.png -a -f comma-plain-height.png
check "a comma in a name that is there" run 0 patch rock,wet.png --size 32x32 --passes 1 -o comma-2.png \
    --maps rock,wet-height.png,plain-height.png
check "two maps" test -f comma-2-height.png -a -f comma-2-plain-height.png
check "a semicolon" run 0 $patch -o semicolon.png --exemplars rock,wet.png --maps 'rock\;dry.png;rock;dry.png'
check "tiles --maps" run 0 tiles cells.png -o listed --kind frame --size 32 --maps 'rock\,wet.png,plain-height.png'
check "two maps" sh -c "test -f listed/atlas-3.png && ! test -e listed/atlas-4.png"
"$draw" discs 'used,cells.png' 64 -8,-8,80,80
"$draw" discs used-sand.png 48 -6,-6,60,60
check "--mask" run 0 $patch -o masked.png --exemplars sand.png --mask 'used\,cells.png,used-sand.png'
refuses 2 "empty" $patch -o n.png --maps 'plain-height.png,'
refuses 2 "empty" $patch -o n.png --maps ',plain-height.png'
refuses 1 "missing.png" $patch -o n.png --maps 'missing.png,plain-height.png'
refuses 2 "would destroy" $patch -o 'rock,wet.png' --maps 'rock\,wet.png'

# ---- streams
through() { # STATUS ARGUMENTS...: with sand.png as standard input, what comes out as stream
    want=$1
    shift
    "$texkit" "$@" <sand.png >stream 2>err.log
    [ $? = "$want" ] || { cat err.log; return 1; }
}
same() { cmp stream "$1" && [ ! -s err.log ]; }
check "synth - -o -" through 0 synth - -o - $fast
check "the same picture in a file" run 0 synth sand.png -o stream.png $fast
check "the same bytes, and nothing else" same stream.png
check "synth - -o bmp:-" through 0 synth - -o bmp:- $fast
check "the same picture in a file" run 0 synth sand.png -o stream.bmp $fast
check "the same bytes" same stream.bmp
check "learn - -o -" through 0 learn - -o -
check "the same model" run 0 learn sand.png -o stream.txs
check "the same bytes" same stream.txs
check "--stats -" through 0 synth - -o stream.png $fast --stats -
check "is JSON and nothing else" /usr/bin/python3 -m json.tool stream
check "another input from a stream" through 0 relight cells.png --like - -o n.png
check "edges -o svg:-" through 0 edges - -o svg:-
check "is SVG" grep -q '^<svg' stream
check "tree -o -" sh -c "'$texkit' tree -o - --pieces 20 >stream.glb && test \"\$(head -c 4 stream.glb)\" = glTF"
"$shape" torus stream.obj 8
check "retile - -o ply:-" sh -c "'$texkit' retile - -o ply:- --vertices 100 <stream.obj | head -1 | grep -q ply"
refuses 2 "one file" patch - -o n.png --size 32x32 --mask -
refuses 2 "written twice" synth sand.png -o - --stats - $fast
refuses 2 "standard output" patch cells.png -o - --size 32x32 --lod 1
refuses 2 "standard output" patch cells.png -o - --size 32x32 --maps plain-height.png
refuses 2 "standard output" tree -o obj:- --pieces 20
refuses 2 "name a folder" tiles cells.png -o - --kind wang
refuses 2 "end the name" synth sand.png -o gif:- $fast
check "from a file over itself" sh -c "'$texkit' synth - -o sand.png $fast <sand.png 2>err.log; test \$? = 2"
check "to a file that is read" sh -c "'$texkit' synth ./sand.png -o - $fast 1<>sand.png 2>err.log; test \$? = 2"
check "a reader that goes away: status 1, one line" sh -c "
    { '$released' synth sand.png -o bmp:- --size 600x600 --quality -2 --stats gone.json 2>err.log
      echo \$? >status.log; } | head -c 10 >/dev/null
    test \$(cat status.log) = 1 && test \$(wc -l <err.log) = 1 && ! test -e gone.json"

# ---- signals: every command stops at once, at any time, and leaves nothing behind
"$released" learn cells.png -o model.txs --quiet
"$draw" bricks bricks.png 512
"$shape" torus torus.obj 200
stopped() { # SECONDS SIGNAL ARGUMENTS...
    pause=$1 signal=$2
    shift 2
    before=$(all_files)
    "$released" "$@" >out.log 2>err.log &
    child=$!
    sleep "$pause"
    from=$(date +%s%N)
    kill -"$signal" $child || { echo "it had ended before"; return 1; }
    wait $child
    got=$?
    took=$((($(date +%s%N) - from) / 1000000))
    if [ $got = 1 ]; then
        [ "$(wc -l <err.log)" = 1 ] && says "stopped; nothing was written" || { cat err.log; return 1; }
    else # on a busy machine it may not have begun
        [ $got -gt 128 ] && [ ! -s err.log ] || { echo "status $got"; cat err.log; return 1; }
    fi
    [ "$before" = "$(all_files)" ] || { echo "files were made or changed"; ls -lA; return 1; }
    [ $took -lt 2000 ] || { echo "it took $took ms"; return 1; } # 2 if nothing else runs
}
for pause in 0.05 0.3 0.7; do
    for signal in INT TERM; do
        check "patch stops after $pause s ($signal)" stopped $pause $signal $work -o n.png --lod 3
    done
done
while read -r arguments; do
    check "stops: $arguments" stopped 0.2 INT $arguments
done <<END
learn bricks.png -o n.txs --levels 6
synth model.txs -o n.png --size 4000x4000
fill bricks.png --mask bricks.png -o n.png
knit bricks.png bricks.png --layout bricks.png -o n.png
composite bricks.png --segments 3 -o n.png --size 2000x2000
tiles bricks.png -o n --kind wang --colors 4 --size 128
tree -o n.obj --pieces 20000 --level 16
forest -o n.obj --count 200
retile torus.obj -o n.obj --vertices 200000
END
# where hangups are ignored, as under nohup, texkit ignores them too
if [ -z "$(sh -c 'kill -HUP $$; echo ignored' 2>/dev/null)" ]; then
    check "a hangup ends it" stopped 0.2 HUP $work -o n.png
fi
check "nothing temporary is left" no_temporary

# ---- no input is written over, and no two outputs are one file, whatever links lead there
mkdir over over/set over/folder over/links
cd over || exit 1
for name in a.png a-height.png mask.png; do "$draw" cells $name 64; done
for name in set/atlas.png folder/atlas.png folder/atlas-2.png folder/preview.png out-height.png \
    out-1.png out-height-1.png out-atlas.png out-texture.png out-bark.png out-leaves.png \
    out-bark-2.png m.txs s.pfm; do
    cp mask.png $name
done
echo '{"strokes": [{"points": [[8,8], [50,40]]}]}' >strokes.json
echo '{}' >set/tiles.json
"$shape" torus mesh.obj 16
"$released" tree -o birch.txt --species birch --quiet
cp birch.txt out.mtl
for kind in png txs txt ply obj; do # hard links, links to links, and a folder by another name
    ln a.png links/hard.$kind
    ln -s hard.$kind links/soft.$kind
done
ln -s links again
ln mesh.obj links/mesh.obj
ln birch.txt links/birch.txt
# keeps OUTPUT INPUT ARGUMENTS...: refused; the message names both
keeps() {
    output=$1 input=$2
    shift 2
    check "'$output' would destroy '$input': $*" keeps_both "would destroy" "$@"
}
# once OUTPUT OUTPUT ARGUMENTS...: the same of two outputs that are one file
once() {
    output=$1 input=$2
    shift 2
    check "'$output' is '$input' too: $*" keeps_both "written twice" "$@"
}
keeps_both() {
    text=$1
    shift
    run 2 "$@" || return 1
    says "'$output'" && says "'$input'" && says "$text" || { cat err.log; return 1; }
}

# -o and --stats of every command against its input
for way in ./a links/hard again/soft; do
    keeps $way.png a.png synth a.png -o $way.png $size
    keeps $way.png a.png patch a.png -o $way.png $size
    keeps $way.png a.png edges a.png -o $way.png
    keeps $way.png a.png relight b.png --like a.png -o $way.png
    keeps $way.png a.png erode b.png --weathered a.png --level 1 -o n.png --cracks $way.png
    keeps $way.png a.png learn a.png -o n.txs --stats $way.png
    keeps $way.png a.png tiles a.png -o n --kind wang --size 32 --stats $way.png
    keeps $way.png a.png tree -o n.obj --leaf a.png --stats $way.png
    keeps $way.png a.png forest --count 2 -o n.obj --leaf a.png --stats $way.png
done
for command in synth patch edges; do
    more=
    [ $command = edges ] || more=$size
    keeps a.png again/soft.png $command again/soft.png -o a.png $more
    keeps links/hard.png a.png $command a.png -o n.png $more --stats links/hard.png
done
keeps links/soft.txs a.png learn a.png -o links/soft.txs
keeps m.txs ./m.txs synth ./m.txs -o n.png $size --stats m.txs
keeps links/mesh.obj mesh.obj retile mesh.obj -o links/mesh.obj --vertices 200
keeps mesh.obj links/mesh.obj retile links/mesh.obj -o n.ply --vertices 200 --stats mesh.obj
keeps birch.txt links/birch.txt tree --species links/birch.txt -o birch.txt
keeps links/birch.txt birch.txt forest --count 2 --species oak,birch.txt -o n.ply --stats links/birch.txt
from_stdin() {
    "$texkit" synth /dev/stdin -o a.png $size --quiet <a.png 2>err.log
    [ $? = 2 ] && says "'a.png' would destroy '/dev/stdin'"
}
check "an input that comes in by /dev/stdin" from_stdin

# the other inputs of each, and the outputs whose names are derived
keeps links/hard.png ./a.png learn mask.png -o n.txs --mask ./a.png --stats links/hard.png
patch="patch a.png $size"
keeps a.png a.png $patch -o a.png --maps a-height.png
cp a-height.png mask-height.png
keeps a-height.png ./a-height.png patch mask.png $size -o a.png --maps mask-height.png,./a-height.png
keeps out-height.png ./out-height.png $patch -o out.png --maps a-height.png --mask ./out-height.png
keeps out-height.png ./out-height.png $patch -o out.png --exemplars mask.png \
    --maps 'a-height.png;./out-height.png'
keeps out-height.png ./out-height.png $patch -o out.png --exemplars ./out-height.png \
    --maps 'a-height.png;mask.png'
keeps out-1.png ./out-1.png $patch -o out.png --lod 2 --mask ./out-1.png
keeps out-height-1.png ./out-height-1.png $patch -o out.png --lod 1 --maps a-height.png \
    --guide mask.png --target ./out-height-1.png
keeps out-1.png ./out-1.png $patch -o out.png --lod 1 --guide ./out-1.png --target mask.png
keeps out-1.png ./out-1.png $patch -o out.png --lod 1 --guide mask.png --target mask.png \
    --target-mask ./out-1.png
keeps out-1.png ./out-1.png $patch -o out.png --lod 1 --keep ./out-1.png --keep-mask mask.png
keeps out-1.png ./out-1.png $patch -o out.png --lod 1 --keep mask.png --keep-mask ./out-1.png
keeps links/hard.txt ./a.png patch mask.png $size -o n.png --guide mask.png,./a.png --exemplars mask.png \
    --target mask.png --stats links/hard.txt
keeps strokes.json ./strokes.json $patch -o n.png --control ./strokes.json --stats strokes.json
keeps s.pfm ./s.pfm $patch -o n.png --mask ./s.pfm --sources s.pfm
keeps links/soft.png a.png edges a.png -o n.svg --layers links/soft.png
keeps a.png links/hard.png edges links/hard.png -o n.json --layers a.png
tiles="--kind wang --size 32"
keeps folder/atlas.png folder/atlas.png tiles folder/atlas.png -o folder $tiles
keeps folder//atlas-2.png folder/atlas-2.png tiles a.png -o folder/ $tiles --maps folder/atlas-2.png
keeps folder/preview.png ./folder/preview.png tiles a.png -o folder $tiles --more mask.png,./folder/preview.png
keeps folder/preview.png ./folder/preview.png tiles a.png -o folder $tiles \
    --edges mask.png,./folder/preview.png
keeps links/hard.txt ./a.png tiles mask.png -o n $tiles --more ./a.png --stats links/hard.txt
retile="retile mesh.obj --vertices 200"
keeps out-texture.png ./out-texture.png $retile -o out.ply --texture ./out-texture.png
keeps out-atlas.png ./out-atlas.png $retile -o out.glb --patches ./out-atlas.png
keeps out-texture.png ./out-texture.png $retile -o out.glb --texture mask.png --density ./out-texture.png
keeps out.mtl ./out.mtl $retile -o out.obj --texture mask.png --density ./out.mtl
keeps links/hard.ply ./a.png $retile -o links/hard.ply --density ./a.png
keeps set/tiles.json set/tiles.json $retile -o n.obj --tiles set --stats set/tiles.json
keeps ./set/atlas.png set/atlas.png $retile -o n.obj --tiles set --stats ./set/atlas.png
for trees in "tree" "forest --count 2"; do
    keeps out-bark.png ./out-bark.png $trees -o out.obj --leaf ./out-bark.png
    keeps out-leaves.png ./out-leaves.png $trees -o out.obj --leaf ./out-leaves.png
    keeps out.mtl ./out.mtl $trees -o out.obj --species ./out.mtl
    keeps set/tiles.json set/tiles.json $trees -o n.glb --tiles set --stats set/tiles.json
    keeps ./set/atlas.png set/atlas.png $trees -o n.glb --tiles set --stats ./set/atlas.png
done
keeps out-bark-2.png ./out-bark-2.png forest --count 2 -o out.obj --species oak,birch \
    --leaf ./out-bark-2.png
check "names that are not made are free" run 0 tree -o out.obj --bare --leaf ./out-leaves.png --pieces 20

# two outputs
once n.png ./n.png synth a.png -o ./n.png $size --stats n.png
once ./n.png again/../n.png synth a.png -o again/../n.png $size --stats ./n.png
rm -r links/*
ln mask.png links/one.png
ln mask.png links/two.png
ln -s one.png links/three.png
for pair in "two one" "three one" "three two"; do
    first=links/${pair% *}.png second=again/${pair#* }.png
    once $first $second edges a.png -o $first --layers $second
    once $first $second synth a.png -o $first $size --stats $second
done
ln -s two.png links/n.txs
once links/n.txs links/one.png learn a.png -o links/n.txs --stats links/one.png
once ./folder/atlas.png folder/atlas.png tiles a.png -o folder $tiles --stats ./folder/atlas.png
once ./out-height.png out-height.png $patch -o out.png --maps a-height.png --stats ./out-height.png
once ./n.pfm n.pfm $patch -o n.png --sources ./n.pfm --stats n.pfm
once ./out-atlas.png out-atlas.png $retile -o out.ply --tiles set --stats ./out-atlas.png
once ./out.mtl out.mtl tree -o out.obj --stats ./out.mtl
once ./out-leaves-2.png out-leaves-2.png forest --count 2 -o out.obj --species oak,birch \
    --stats ./out-leaves-2.png
cd ..
