#!/bin/sh
# samples.sh - put sample pictures, most of 256 x 256 pixels, into build/samples/
#
# The photographs belong to Debian packages; they are taken from where the package puts them, or
# the package is downloaded and unpacked under build/packages/, never installed. With none of them
# in reach the project draws exemplars of its own. build/samples/list.txt has a line for each: role,
# path below build/samples/, title, where it comes from, licence, separated by tabs. Those of the
# other roles lie in folders of these names, out of the way of tests and benchmarks.
set -eu

build=${BUILD:-build}
samples=$build/samples
packages=$build/packages

# role, name, title, package, path, licence, times to shrink before cutting the middle out. The role
# "good": texsyn.h is made for it; "limit": it shows what texsyn.h cannot do; "layout": for texpatch.h;
# "scene": for texinpaint.h, up to 512 pixels; "more": for one section of the demo each.
photographs="
good  gravel  Gravel   python3-skimage      usr/lib/python3/dist-packages/skimage/data/gravel.png CC0-1.0 2
good  pebbles Pebbles  extremetuxracer-data usr/share/games/etr/terrains/pebbles04.png            GPL-2+ 1
good  sand    Sand     extremetuxracer-data usr/share/games/etr/terrains/sand01.png               GPL-2+ 1
good  lawn    Lawn     extremetuxracer-data usr/share/games/etr/terrains/grass02.png              GPL-2+ 1
good  clover  Clover   extremetuxracer-data usr/share/games/etr/terrains/grass03.png              GPL-2+ 1
good  mud     Mud      extremetuxracer-data usr/share/games/etr/terrains/mud01.png                GPL-2+ 1
good  frost   Frost    extremetuxracer-data usr/share/games/etr/terrains/pebbles05.png            GPL-2+ 1
good  lichen  Lichen   extremetuxracer-data usr/share/games/etr/terrains/rock05.png               GPL-2+ 1
limit grass   Blades   python3-skimage      usr/lib/python3/dist-packages/skimage/data/grass.png  CC0-1.0 1
limit brick   Bricks   python3-skimage      usr/lib/python3/dist-packages/skimage/data/brick.png  CC0-1.0 1
layout wall   Slates   extremetuxracer-data usr/share/games/etr/terrains/pave01.png               GPL-2+ 1
scene rocket  Rocket   python3-skimage      usr/lib/python3/dist-packages/skimage/data/rocket.jpg CC0-1.0 1
scene camera  Camera   python3-skimage      usr/lib/python3/dist-packages/skimage/data/camera.png CC0-1.0 1
more  autumn  Autumn   extremetuxracer-data usr/share/games/etr/terrains/grass01.png              GPL-2+ 1
more  cracked Cracks   extremetuxracer-data usr/share/games/etr/terrains/rock06.png               GPL-2+ 1
more  rock    Rock     extremetuxracer-data usr/share/games/etr/terrains/rock07.png               GPL-2+ 1
more  snow    Snow     extremetuxracer-data usr/share/games/etr/terrains/snow01.png               GPL-2+ 1
more  thaw    Thaw     extremetuxracer-data usr/share/games/etr/terrains/snowy_rock06.png         GPL-2+ 1
"

# nothing to do while the samples are there and this list of them is the same
[ -s "$samples/list.txt" ] && [ -z "$(find "$0" -newer "$samples/list.txt")" ] && exit 0
rm -rf "$samples"
mkdir -p "$samples/limit" "$samples/layout" "$samples/scene" "$samples/more" "$packages"
log=$packages/log.txt
tab=$(printf '\t')

# Download a package into $packages and unpack it there.
download() (
    command -v apt-get >/dev/null && command -v dpkg >/dev/null || exit 1
    cd "$packages"
    [ -d "$1" ] && exit 0
    echo "samples: downloading the Debian package $1"
    if ! apt-get -qq download "$1" >>log.txt 2>&1; then
        { apt-get -qq update || sudo -n apt-get -qq update; } >>log.txt 2>&1 || true
        apt-get -qq download "$1" >>log.txt 2>&1 || exit 1
    fi
    dpkg -x "$1"_*.deb "$1.part" && mv "$1.part" "$1" && rm -f "$1"_*.deb
)

: >"$log"
: >"$samples/list.part"
unreachable=
echo "$photographs" | {
    while read -r role name title package path licence shrink; do
        [ -n "$name" ] || continue
        file=/$path
        if [ ! -e "$file" ]; then
            case $unreachable in *" $package "*) continue ;; esac
            if ! download "$package"; then
                echo "samples: the Debian package $package is not in reach (see $log)"
                unreachable="$unreachable $package "
                continue
            fi
            file=$packages/$package/$path
        fi
        [ "$role" = good ] || name=$role/$name
        side=256
        [ "$role" != scene ] || side=512
        "$build/crop" "$file" "$samples/$name.png" $side "$shrink" || continue
        echo "$role$tab$name$tab$title${tab}photograph ${path##*/} of the Debian package \
$package$tab$licence" >>"$samples/list.part"
    done
}

if [ ! -s "$samples/list.part" ]; then
    echo "samples: no photographs in reach; drawing exemplars instead (tools/draw.c)"
    for name in $("$build/draw" list); do
        case $name in
        *-height) continue ;;
        weave | bricks) role=layout file=layout/$name ;;
        *) role=good file=$name ;;
        esac
        "$build/draw" "$name" "$samples/$file.png"
        echo "$role$tab$file$tab$name${tab}drawn by tools/draw.c, not a photograph${tab}\
as texkit" >>"$samples/list.part"
    done
fi
mv "$samples/list.part" "$samples/list.txt"
