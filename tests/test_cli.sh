#!/bin/sh
# The command line keeps its contract: options, exit status, messages, formats, files after failure.
. tests/tap.sh

texkit=$(pwd)/$OUT/asan/texkit   # with the sanitizers
released=$(pwd)/build/texkit     # as users have it
draw=$(pwd)/build/draw crop=$(pwd)/build/crop
cd "$tmp" || exit 1

# run STATUS ARGUMENTS...: texkit must end with that status. After success stderr is empty. After a
# failure it holds one line that names the command, and no file was made or changed.
run() {
    want=$1
    shift
    before=$(find . -type f ! -name '*.log' -exec cksum {} + | sort)
    "$texkit" "$@" >out.log 2>err.log
    got=$?
    [ $got = "$want" ] || { echo "status $got instead of $want"; cat err.log; return 1; }
    if [ "$want" = 0 ]; then
        [ ! -s err.log ] || { echo "stderr is not empty:"; cat err.log; return 1; }
    else
        [ "$(wc -l <err.log)" = 1 ] || { echo "not one line on stderr:"; cat err.log; return 1; }
        grep -q '^texkit' err.log || { cat err.log; return 1; }
        [ ! -s out.log ] || { echo "stdout is not empty:"; cat out.log; return 1; }
        after=$(find . -type f ! -name '*.log' -exec cksum {} + | sort)
        [ "$before" = "$after" ] || { echo "files were made or changed"; ls -l; return 1; }
    fi
}

# says TEXT: the last message holds this text
says() { grep -qF -- "$1" err.log; }

# refuses STATUS TEXT ARGUMENTS...: both in one test
refuses() {
    status=$1 text=$2
    shift 2
    check "status $status, \"$text\": texkit $(echo "$*" | tail -c 70)" \
        refuses_so "$status" "$text" "$@"
}
refuses_so() {
    status=$1 text=$2
    shift 2
    run "$status" "$@" || return 1
    says "$text" || { echo "the message lacks '$text':"; cat err.log; return 1; }
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
check "--help lists the commands" sh -c "grep -q learn out.log && grep -q synth out.log"
check "--version" run 0 --version
check "--version names the headers" grep -q '^texkit [0-9.]* (texmath [0-9.]*, texsyn [0-9.]*)$' out.log
for command in learn synth; do
    check "$command --help" run 0 $command --help
    check "$command --help has an example" grep -q "  texkit $command .*-o" out.log
    check "$command -h, behind other arguments" run 0 $command sand.png --seed 3 -h
    check "$command --version" run 0 $command --version
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
check "the exemplar may be the output" sh -c "
    cp sand.png same.png; '$texkit' synth same.png -o same.png $size --quiet && cmp b.png same.png"
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
"$draw" cells mask.png 48 1
check "learn --mask" run 0 learn sand.png --mask mask.png -o masked.txs
{ printf 'P5\n48 48\n255\n'; head -c 2304 /dev/zero; } >black.pgm
{ printf 'P5\n48 40\n255\n'; head -c 1920 /dev/zero; } >short.pgm
refuses 1 "" learn sand.png --mask black.pgm -o n.txs
refuses 1 "48 x 48" learn sand.png --mask short.pgm -o n.txs
refuses 1 "cannot read" learn sand.png --mask missing.png -o n.txs

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
"$texkit" >out.log 2>err.log
check "no command: status 2" test $? = 2
check "no command: one line" test "$(wc -l <err.log)" = 1
refuses 2 "unknown command" frobnicate sand.png
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
refuses 2 "65535" synth sand.txs -o n.jpg --size 70000x10
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

# ---- stopped, out of memory (the tool as released)
stop() {
    "$released" synth sand.txs -o stopped.png --size 6000x6000 --quality 2 --quiet 2>err.log &
    child=$!
    sleep 0.3
    kill -TERM $child
    wait $child
    [ $? = 1 ] && says "stopped" && [ ! -e stopped.png ]
}
check "stopped by a signal: status 1 and nothing written" stop
starve() {
    (ulimit -v 200000 && "$released" synth sand.txs -o starved.png --size 8000x8000 \
        --threads 1 2>err.log)
    [ $? = 1 ] && says "memory" && [ "$(wc -l <err.log)" = 1 ] && [ ! -e starved.png ]
}
check "out of memory: status 1, one line" starve

# ---- the progress bar: on a terminal, for work of over a second, unless --quiet
if has script && script -qec true /dev/null >/dev/null 2>&1; then
    check "a progress bar on a terminal" sh -c "
        script -qec \"'$released' synth sand.txs -o bar.png --size 1600x1600 --threads 1\" \
            /dev/null | grep -q '##.*%'"
    check "no progress bar with --quiet" sh -c "
        ! script -qec \"'$released' synth sand.txs -o bar.png --size 1600x1600 --quiet\" \
            /dev/null | grep -q '%'"
fi
