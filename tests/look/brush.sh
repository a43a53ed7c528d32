#!/bin/sh
# examples/brush in a window of a virtual screen: the strokes of a script become texture of their
# layers, and the texture away from them does not change. check_brush.c explains the numbers.
. tests/kit/tap.sh

brush=$(pwd)/build/examples/brush
check "brush builds" make -s build/examples/brush || exit 1
# shellcheck disable=SC2046 # words
check "check_brush builds" $CC -std=gnu99 -O2 -Wall -Wextra -I. -Itools tests/look/check_brush.c \
    build/files/image_*.o build/files/stb.o -o "$tmp/check_brush" $(cat build/files/libraries) -lm || exit 1
build/draw clouds "$tmp/clouds.png" 192
cd "$tmp" || exit 1

# paint NAME: play NAME.txt on a screen of its own; the picture is NAME.png, the output NAME.log
paint() {
    timeout 60 xvfb-run -a -s "-screen 0 640x640x24" "$brush" clouds.png --script "$1.txt" \
        --screenshot "$1.png" >"$1.log" 2>&1 || { cat "$1.log"; return 1; }
}
# refuses STATUS TEXT ARGUMENTS...: it exits with STATUS, prints TEXT, and writes no picture
refuses() {
    status=$1 text=$2
    shift 2
    timeout 60 xvfb-run -a -s "-screen 0 640x640x24" "$brush" "$@" >refuses.log 2>&1
    [ $? = "$status" ] && grep -q "$text" refuses.log && [ ! -e no.png ] ||
        { cat refuses.log; return 1; }
}
fails() { ! "$@"; }

cat >strokes.txt <<'END'
# layer, width, open or closed, points
stroke 3 40 open 80 100 160 60 260 90 340 60 430 110
stroke 0 40 open 70 400 150 440 230 410 300 450
stroke 0 16 closed 340 240 420 220 470 280 450 360 380 390 330 330
END
echo '# nothing' >plain.txt
cp strokes.txt again.txt

check "a window without strokes" paint plain
check "a window with strokes" paint strokes
check "each is reported" test "$(grep -c '^stroke [1-3]: .* ms$' strokes.log)" = 3
sed -n 's/^stroke/# stroke/p' strokes.log
check "they have changed their surroundings, to the gray of their layers" \
    ./check_brush plain.png strokes.png strokes.txt strokes.log
check "check_brush fails if nothing has changed" \
    fails ./check_brush plain.png plain.png strokes.txt strokes.log
sed 's/^stroke 3/stroke 0/' strokes.txt >other.txt
check "and for a stroke of another layer" fails ./check_brush plain.png strokes.png other.txt strokes.log
sed 2d strokes.txt >other.txt
check "and for a change far from all strokes" fails ./check_brush plain.png strokes.png other.txt strokes.log
check "the same strokes again" paint again
check "the same picture" cmp strokes.png again.png

echo 'stroke 9 40 open 80 100 160 60' >bad.txt
check "a bad script" refuses 1 "the script has a line" clouds.png --script bad.txt --screenshot no.png
check "no script" refuses 1 "cannot read the script" clouds.png --script no.txt --screenshot no.png
check "no exemplar" refuses 1 "^brush: " no-exemplar.png --script plain.txt --screenshot no.png
check "no arguments" refuses 2 "^usage: "
