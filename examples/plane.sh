#!/bin/sh
# plane.sh EXEMPLAR DIR [options] [-- OPTIONS OF texkit patch] - a texture of any size that does not
# repeat, made tile by tile in bounded memory and joined into one picture
#
#   --size WxH    pixels of the picture; default 16384x16384
#   --tile N      pixels a side of a tile, a multiple of 16; default 1024
#   --jobs N      tiles made at the same time; default: the number of cores
#   --share K/N   make only every Nth tile, starting with tile K (0..N-1), and do not join
#   --join FILE   the picture, .tif (BigTIFF), .ppm or .pgm; default DIR/plane.tif
#
# DIR receives tile-ROW-COLUMN.png. Tiles that exist already are not made again, so an interrupted
# run can be continued. Windows of the plane agree where they meet, so tiles can be made in any order,
# in parallel and on many machines. In the root folder of the repository, after make and make examples:
#
#   examples/plane.sh rust.png out/rust --jobs 8 -- --seed 7
#
# The same on a cluster of 64 machines, here with SLURM; DIR is on a disk that all of them share:
#
#   plane='sh examples/plane.sh rust.png out/rust --jobs 1'
#   tiles=$(sbatch --parsable --array=0-63 --cpus-per-task=1 --mem=2G --time=1:00:00 \
#       --wrap "$plane --share \$SLURM_ARRAY_TASK_ID/64 -- --seed 7")
#   sbatch --dependency=afterok:$tiles --mem=1G --wrap "$plane -- --seed 7"
#
# The last job finds all tiles there and joins them. TEXKIT and JOIN are the paths of the two programs.
set -eu

texkit=${TEXKIT:-build/texkit} join=${JOIN:-build/examples/join}

# called by the jobs below: plane.sh --make NAME:WINDOW EXEMPLAR DIR [OPTIONS OF texkit patch]
if [ "${1:-}" = --make ]; then
    name=${2%%:*} window=${2#*:} exemplar=$3 dir=$4
    shift 4
    # texkit writes a file completely or not at all, so a tile that exists is complete. 255 tells xargs
    # to start no other
    "$texkit" patch "$exemplar" -o "$dir/$name" --window "$window" --threads 1 --quiet "$@" && exit
    exit 255
fi

fail() { echo "plane.sh: $1" >&2; exit "${2:-2}"; }
number() { case $1 in '' | 0* | *[!0-9]* | ???????*) fail "$2: '$1' is not a number" ;; esac; }

case ${1:-} in '' | -*) sed -n '2,/^set/s/^# \{0,1\}//p' "$0"; exit 2 ;; esac
exemplar=$1 dir=${2:?give a folder}
shift 2
size=16384x16384 tile=1024 jobs='' share=0 shares=1 picture=$dir/plane.tif
while [ $# -gt 0 ]; do
    case $1 in
    --) shift; break ;;
    --size | --tile | --jobs | --share | --join) [ $# -gt 1 ] || fail "$1 lacks its value" ;;
    *) fail "unknown option $1; options of texkit patch come after --" ;;
    esac
    case $1 in
    --size) size=$2 ;;
    --tile) tile=$2 ;;
    --jobs) jobs=$2 ;;
    --share) share=${2%%/*} shares=${2#*/} ;;
    --join) picture=$2 ;;
    esac
    shift 2
done
width=${size%%x*} height=${size#*x} jobs=${jobs:-$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 1)}
number "$width" --size; number "$height" --size; number "$tile" --tile; number "$jobs" --jobs
number "$shares" --share; number "1$share" --share # it may be 0
[ "$share" -lt "$shares" ] || fail "--share: the last of $shares shares is $((shares - 1))"
[ -r "$exemplar" ] || fail "cannot read '$exemplar'" 1
columns=$(((width + tile - 1) / tile)) rows=$(((height + tile - 1) / tile))

# tiles of another picture would not match
mkdir -p "$dir"
made_of="$(cksum <"$exemplar") $size $tile $*"
[ -e "$dir/plane.txt" ] || {
    echo "$made_of" >"$dir/plane.txt.$$" && mv "$dir/plane.txt.$$" "$dir/plane.txt"
}
[ "$(cat "$dir/plane.txt")" = "$made_of" ] ||
    fail "'$dir' holds tiles of another exemplar, size or other options; name another folder" 1

# which tiles are missing: lines NAME:X,Y,WIDTH,HEIGHT
missing() {
    awk -v w="$width" -v h="$height" -v t="$tile" -v share="$share" -v shares="$shares" 'BEGIN {
        for (y = 0; y < h; y += t) for (x = 0; x < w; x += t) if (k++ % shares == share)
            printf "tile-%04d-%04d.png:%d,%d,%d,%d\n", y / t, x / t, x, y,
                x + t < w ? t : w - x, y + t < h ? t : h - y
    }' | while read -r line; do [ -s "$dir/${line%%:*}" ] || echo "$line"; done
}
list=$(missing)
if [ -n "$list" ]; then
    echo "$list" | if parallel --version 2>/dev/null | grep -q '^GNU'; then
        parallel --will-cite -q -j "$jobs" --halt soon,fail=1 \
            sh "$0" --make '{}' "$exemplar" "$dir" "$@"
    else
        xargs -P "$jobs" -I '{}' sh "$0" --make '{}' "$exemplar" "$dir" "$@"
    fi || fail "some tiles are missing; run it again to continue" 1
fi

[ "$shares" = 1 ] || exit 0
"$join" "$dir/part.${picture##*.}" "$columns" "$dir"/tile-????-????.png || exit 1
mv "$dir/part.${picture##*.}" "$picture"
echo "$picture: $width x $height pixels of $((columns * rows)) tiles"
