#!/bin/sh
# shaders/treepieces.glsl computes what treepieces.h does; tests/look/gl_treepieces.c explains how this
# is compared. examples/forest_gl draws pictures without a window, and reports errors. Mesa's software
# driver is enough for both.
. tests/kit/tap.sh

gl=$OUT/gl_treepieces forest=$PWD/build/examples/forest_gl shaders=$PWD/shaders kit=$PWD/tests/kit
if [ ! "$gl" -nt tests/look/gl_treepieces.c ] || [ -n "$(find examples/forest_gl -newer "$gl")" ] ||
    [ ! "$gl" -nt tests/kit/treekit.h ] || [ ! "$gl" -nt treepieces.h ] || [ ! "$gl" -nt texmath.h ]; then
    # shellcheck disable=SC2086 # flags are words
    check "gl_treepieces builds" $CC -std=c99 -O2 -ffp-contract=off -Wall -Wextra -I. \
        tests/look/gl_treepieces.c build/files/stb.o -o "$gl" -lEGL -lOpenGL -lcjson -lm || exit 1
fi
{ "$gl" || echo "not ok - gl_treepieces ended with status $?"; } 2>&1 | sed '/^ok\|^not ok/!s/^/    # /'

check "forest_gl builds" make -s "${forest#"$PWD/"}" || exit 1
cd "$tmp" || exit 1

# draw ARGUMENTS...: small pictures, so that it is quick
draw() { "$forest" --size 96x80 --smooth 1 --pieces 60 "$@" >out.log 2>err.log; }
# value NAME: a number that the last drawing printed
value() { sed -n "s/^$1 //p" out.log; }
# refuses TEXT ARGUMENTS...: it fails, TEXT is on stderr, and there is no picture
refuses() {
    text=$1
    shift
    rm -f no.png
    draw --headless no.png "$@" && { echo "it accepts $*"; return 1; }
    [ ! -e no.png ] || { echo "there is a picture"; return 1; }
    grep -q -- "$text" err.log || { echo "the message lacks '$text':"; cat err.log; return 1; }
}

pictures() {
    draw --species oak,pine,willow --count 5 --headless a.png || { cat err.log; return 1; }
    [ -s a.png ] && [ "$(value trees)" = 5 ] && [ "$(value draws)" -le 10 ] || return 1
    draw --species oak,pine,willow --count 5 --headless b.png && cmp a.png b.png || return 1
    draw --species oak,pine,willow --count 5 --seed 2 --headless b.png && ! cmp -s a.png b.png
}
check "forest_gl draws a forest, the same one again, and another one for another seed" pictures

calls() {
    draw --count 1 --pieces 600 --headless a.png && one=$(value draws) || return 1
    draw --count 300 --pieces 8 --headless a.png || { cat err.log; return 1; }
    [ "$(value trees)" = 300 ] && [ "$(value draws)" -le "$one" ] || { cat out.log; return 1; }
}
check "forest_gl needs no more draw calls for 300 trees than for one" calls

looks() {
    for option in --bare --wire "--time 3" "--wind 20" "--level 1" "--half 2" "--orbit 50,20,9" \
        "--orbit 40,3"; do
        # shellcheck disable=SC2086 # an option and its value
        draw --headless b.png $option && [ -s b.png ] || { echo "$option"; cat err.log; return 1; }
        ! cmp -s a.png b.png || { echo "$option changes nothing"; return 1; }
    done
}
draw --headless a.png
check "forest_gl: bare, levels in colours, time, wind, tessellation, other views" looks

# brightness FILE X Y: of a pixel, 0..765
brightness() {
    python3 - "$@" "$kit" <<'END'
import sys
sys.path.insert(0, sys.argv[4])
from png import Png
p, x, y = Png(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
print(sum(p.lines[y][p.channels * x:p.channels * x + 3]))
END
}

# from above; -z is up. The sun stands at x 0.53, z 0.58, so that shadows go to the upper left
shadow() {
    "$forest" --shaders "$shaders" --species dead --count 1 --size 200x200 --smooth 1 --orbit 0,89,24 \
        --at 0,0,0 --wind 0 --headless s.png >out.log 2>err.log || { cat err.log; return 1; }
    for step in 8 14; do # 2/3 m and more from the middle of the foot, still on the trunk's shadow
        dark=$(brightness s.png $((100 - step)) $((100 - step))) || return 1
        light=$(brightness s.png $((100 + step)) $((100 + step)))
        [ $((10 * dark)) -lt $((7 * light)) ] || { echo "$step pixels from the foot: $dark, in the sun $light"; return 1; }
    done
}
check "forest_gl: the shadow of a trunk begins at its foot" shadow

near_leaves() {
    for metres in 0 4; do
        "$forest" --shaders "$shaders" --count 1 --pieces 400 --size 120x90 --smooth 1 --orbit 20,3,4 --at 0,9,3 \
            --cards $metres --headless n$metres.png >out.log 2>err.log || { cat err.log; return 1; }
        eval "calls$metres=$(value draws)"
    done
    # shellcheck disable=SC2154 # eval sets them
    [ $((calls4 - calls0)) = 1 ] || { echo "$calls0 and $calls4 draw calls"; return 1; }
    ! cmp -s n0.png n4.png
}
check "forest_gl: leaves near the camera are cards, with one draw call more" near_leaves

# cards and impostors of the same leaves are as bright: where they meet, no ring shows
same_light() {
    for species in oak birch; do
        for metres in 0 1000; do
            "$forest" --shaders "$shaders" --species $species --count 1 --pieces 600 --size 400x336 --smooth 2 \
                --orbit 30,5,25 --at 0,9,0 --cards $metres --headless n$metres.png >out.log 2>err.log ||
                { cat err.log; return 1; }
        done
        PYTHONPATH=$kit python3 - $species <<'END' || return 1
import sys
from png import Png, need
far, near = [[v for row in Png(f).lines for v in row] for f in ("n0.png", "n1000.png")]
other = [(a, b) for a, b in zip(far, near) if abs(a - b) > 4]
means = [sum(v) / len(other) for v in zip(*other)]
need(len(other) > 2000 and abs(means[0] - means[1]) < 6, sys.argv[1], len(other), means)
END
    done
}
check "forest_gl: cards are as bright as the impostors that they replace" same_light

frames() {
    draw --headless f%02d.png --frames 3 --wind 9 || { cat err.log; return 1; }
    [ -s f00.png ] && [ -s f02.png ] && [ ! -e f03.png ] && ! cmp -s f00.png f02.png
}
check "forest_gl: frames of an animation" frames

still() {
    for time in 0 0.13; do draw --headless "s$time.png" --wind 0 --time $time || { cat err.log; return 1; }; done
    cmp s0.png s0.13.png
}
check "forest_gl: without wind neither wood nor leaves move" still

# with --loop the picture after the last is the first: begun a picture later, the last is what the first
# was, but for shadows, which stay as they are in the first
loops() {
    for begin in l:0 m:0.5; do
        draw --headless "${begin%:*}%d.png" --time "${begin#*:}" --frames 4 --loop 2 --wind 9 --bare \
            --at 0,7,0 --orbit 0,5,30 || { cat err.log; return 1; }
    done
    PYTHONPATH=$kit /usr/bin/python3 -c '
from png import Png, need
def difference(a, b):
    rows = [b"".join(bytes(r) for r in Png(f).lines) for f in (a, b)]
    return sum(abs(x - y) for x, y in zip(*rows)) / len(rows[0])
for k in range(4):
    a, b, c = "l%d.png" % k, "l%d.png" % ((k + 1) % 4), "m%d.png" % k
    need(difference(b, c) < 0.5 * difference(a, b), b, "and", c, "differ, or nothing moves from", a)'
}
check "forest_gl: --loop" loops

# on a virtual screen; SDL treats the signal like a click on the close button of the window
window() {
    xvfb-run -a -s "-screen 0 640x480x24" sh -c '"$0" --size 160x120 --pieces 8 >out.log 2>err.log &
        sleep 6; kill $!; wait $!' "$forest" || { cat err.log; return 1; }
    [ ! -s err.log ]
}
if has xvfb-run && has sdl2-config; then
    check "forest_gl opens a window and closes it" window
fi

bad() {
    refuses "preset\|species" --species fern && refuses "cannot\|species" --species ./none.txt &&
        refuses "not a set of tiles" --bark . && refuses "cannot read" --leaf none.png &&
        refuses usage --count 0 && refuses usage --size 8 && refuses usage --orbit 1 &&
        refuses usage --frames 2 && refuses usage --nonsense && refuses usage --cards -1 && refuses usage --count &&
        refuses "cannot find" --shaders . && refuses usage --wind wet
}
check "forest_gl reports errors with a message" bad
