#!/bin/sh
# What examples/plane.sh makes tile by tile, in several jobs, is one window made at once, to the byte.
. tests/kit/tap.sh

root=$(pwd)
export TEXKIT="$root/build/texkit" JOIN="$root/build/examples/join"
plane=$root/examples/plane.sh
check "join builds" make -s build/examples/join || exit 1
build/draw cells "$tmp/cells.png" 96
cd "$tmp" || exit 1

# refuses TEXT COMMAND...: it fails and says so
refuses() {
    text=$1
    shift
    "$@" >refuses.log 2>&1 && { echo "did not fail"; return 1; }
    grep -qF -- "$text" refuses.log || { cat refuses.log; return 1; }
}
same_picture() { # PICTURE.ppm WHOLE.png: the samples
    "$JOIN" whole.ppm 1 "$2" && cmp "$1" whole.ppm
}

side=1024
check "one window" "$TEXKIT" patch cells.png -o whole.png --window 0,0,$side,$side --seed 7 \
    --passes 0 --quiet
check "4 tiles in 2 jobs" sh "$plane" cells.png tiles --size ${side}x$side --tile 512 --jobs 2 \
    --join tiles.ppm -- --seed 7 --passes 0
check "the same picture" same_picture tiles.ppm whole.png

# what is there is not made again
find tiles -name 'tile-*' -exec touch -t 200001010000 {} +
rm tiles/tile-0001-0000.png
check "goes on where it was" sh "$plane" cells.png tiles --size ${side}x$side --tile 512 --jobs 2 \
    --join again.tif -- --seed 7 --passes 0
check "one tile was made" test \
    "$(find tiles -name "tile-*" -newer cells.png)" = tiles/tile-0001-0000.png
check "the TIFF holds the same picture" "$root/tests/tool/check_tiff.py" again.tif tiles.ppm
check "other options, another folder" refuses "name another folder" \
    sh "$plane" cells.png tiles --size ${side}x$side --tile 512 -- --seed 8

# shares of a job array; last tiles that are smaller; GNU parallel not there
mkdir bin && printf '#!/bin/sh\nexit 127\n' >bin/parallel && chmod +x bin/parallel
small() { PATH=$tmp/bin:$PATH sh "$plane" cells.png small --size 300x220 --tile 160 "$@"; }
check "share 0 of 3" small --share 0/3
check "2 of 4 tiles" test "$(find small -name 'tile-*' | wc -l)" = 2
check "share 1 of 3" small --share 1/3
check "share 2 of 3" small --share 2/3
check "nothing is joined yet" test ! -e small/plane.tif
check "then it is" small --jobs 1
check "one window of it" "$TEXKIT" patch cells.png -o part.png --window 0,0,300,220 --quiet
check "as .ppm" small --join small.ppm
check "the same picture" same_picture small.ppm part.png
check "as TIFF too" "$root/tests/tool/check_tiff.py" small/plane.tif small.ppm

# failures
export TEXKIT=false
for make in parallel xargs; do
    [ $make = xargs ] && PATH=$tmp/bin:$PATH
    check "a tile that cannot be made, with $make" refuses "run it again to continue" \
        sh "$plane" cells.png broken --size 300x220 --tile 160
done
check "and no picture" test ! -e broken/plane.tif
for bad in "--size 0x4" "--size 7x" "--tile x" "--jobs -1" "--share 3/3" "--frob 1" "--size"; do
    # shellcheck disable=SC2086 # two words
    check "refuses $bad" refuses "plane.sh: " sh "$plane" cells.png no $bad
done
check "refuses a missing exemplar" refuses "cannot read" sh "$plane" no.png no
check "join refuses tiles of different kinds" refuses "its size or format" \
    "$JOIN" no.ppm 2 small/tile-0000-0000.png small/tile-0001-0000.png
check "join refuses an alpha channel in a PNM" refuses "no alpha" sh -c "
    '$root/build/draw' cells rgba.png 32 4 && '$JOIN' no.ppm 1 rgba.png"
check "no picture is left" test ! -e no.tif -a ! -e no.ppm
