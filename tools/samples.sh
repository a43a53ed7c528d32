#!/bin/sh
# samples.sh - put sample exemplars of 256 x 256 pixels into build/samples/
#
# The photographs belong to Debian packages; they are taken from where the package puts them, or
# the package is downloaded and unpacked under build/packages/, never installed. With none of them
# in reach the project draws exemplars of its own. build/samples/list.txt names each picture, where
# it comes from and its licence, separated by tabs.
set -eu

build=${BUILD:-build}
samples=$build/samples
packages=$build/packages

# name, package, path, licence
photographs="
gravel  python3-skimage      usr/lib/python3/dist-packages/skimage/data/gravel.png  CC0-1.0
grass   python3-skimage      usr/lib/python3/dist-packages/skimage/data/grass.png   CC0-1.0
sand    extremetuxracer-data usr/share/games/etr/terrains/sand01.png                GPL-2+
pebbles extremetuxracer-data usr/share/games/etr/terrains/pebbles04.png             GPL-2+
lawn    extremetuxracer-data usr/share/games/etr/terrains/grass02.png               GPL-2+
clover  extremetuxracer-data usr/share/games/etr/terrains/grass03.png               GPL-2+
mud     extremetuxracer-data usr/share/games/etr/terrains/mud01.png                 GPL-2+
dirt    extremetuxracer-data usr/share/games/etr/terrains/dirt01.png                GPL-2+
rock    extremetuxracer-data usr/share/games/etr/terrains/rock07.png                GPL-2+
"

[ -s "$samples/list.txt" ] && exit 0
mkdir -p "$samples" "$packages"
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
    while read -r name package path licence; do
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
        "$build/crop" "$file" "$samples/$name.png" 256 || continue
        echo "$name${tab}photograph from $package, /$path$tab$licence" >>"$samples/list.part"
    done
}

if [ ! -s "$samples/list.part" ]; then
    echo "samples: no photographs in reach; drawing exemplars instead (tools/draw.c)"
    for name in $("$build/draw" list); do
        "$build/draw" "$name" "$samples/$name.png"
        echo "$name${tab}drawn by tools/draw.c, not a photograph${tab}as texkit" \
            >>"$samples/list.part"
    done
fi
mv "$samples/list.part" "$samples/list.txt"
