#!/bin/sh
# setup.sh PROFILE - make sure that what a make target needs is installed
#
# PROFILE is tool, demo, test, lint or ci (ci holds all the others). What is missing is installed by
# apt-get, with sudo if need be; without apt-get the script says what to install and fails. With
# everything in place it only looks, which takes a few hundredths of a second.
set -eu

profile=${1:?usage: setup.sh tool|demo|test|lint|ci}
missing= wanted=

has_header() { echo "#include <$1>" | ${CC:-cc} -E -xc - >/dev/null 2>&1; }
has_cxx_header() { find /usr/include /usr/local/include -path "*/$1" 2>/dev/null | grep -q .; }
# one of these files, patterns allowed
has_file() {
    for file in $1; do [ -e "$file" ] && return 0; done
    return 1
}
has_command() { command -v "$1" >/dev/null 2>&1; }
# a module of Debian's own python3, another python3 may come first in the path
has_python() { has_command /usr/bin/python3 && has_file "/usr/lib/python3*/*-packages/$1"; }

# need TEST NAME PACKAGE...: unless the test finds the name, the Debian packages are missing
need() { "$1" "$2" || missing="$missing $3"; }
# want: the same for what can be done without
want() { "$1" "$2" || { shift 2 && wanted="$wanted $*"; }; }

need has_header stb/stb_image.h libstb-dev
need has_header cjson/cJSON.h libcjson-dev
need has_header png.h libpng-dev
need has_header jpeglib.h libjpeg-dev
# TIFF and WebP could be left out
need has_header tiffio.h libtiff-dev
need has_header webp/encode.h libwebp-dev
case $profile in test | ci)
    need has_command g++ g++
    need has_header cmocka.h libcmocka-dev
    need has_cxx_header OpenImageIO/imagebuf.h libopenimageio-dev
    need has_python jsonschema python3-jsonschema
    # a virtual screen, for examples/brush; jobs of examples/plane.sh
    need has_command xvfb-run xvfb
    need has_command xauth xauth
    need has_command parallel parallel
    need has_command assimp assimp-utils # reads what texkit tree writes
esac
case $profile in test | lint | ci)
    need has_command sdl2-config libsdl2-dev # of examples/brush
esac
# of examples/forest_gl and of tests of shaders: OpenGL without a window, nor a graphics card
case $profile in demo | test | lint | ci)
    need has_header EGL/egl.h libegl-dev
    need has_header GL/glext.h libgl-dev
esac
case $profile in demo | ci)
    want has_command img2webp webp # animations
esac
case $profile in demo | test | ci)
    need has_file "/usr/lib*/libOpenGL.so /usr/lib/*/libOpenGL.so" libopengl-dev
    need has_file "/usr/share/glvnd/egl_vendor.d/*mesa.json" libegl-mesa0
    need has_file "/usr/lib*/dri/swrast_dri.so /usr/lib/*/dri/swrast_dri.so" libgl1-mesa-dri
esac
case $profile in lint | ci)
    need has_command cppcheck cppcheck
    need has_command clang-tidy clang-tidy
esac
case $profile in ci)
    need has_command clang clang
    need has_command clang++ clang
    need has_command llvm-symbolizer llvm
    need has_command pkg-config pkg-config
    need has_command chromium chromium # runs three.js
    # read what texkit tree and texkit forest write
    want has_command blender blender python3-numpy
    want has_command godot3-server godot3-server
    # compilers for other machines and what runs their programs, for tests/wide/machines.sh
    want has_command s390x-linux-gnu-gcc gcc-s390x-linux-gnu libc6-dev-s390x-cross
    want has_command aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    want has_command i686-linux-gnu-gcc gcc-i686-linux-gnu libc6-dev-i386-cross
    want has_command x86_64-w64-mingw32-gcc gcc-mingw-w64-x86-64-win32
    want has_command qemu-s390x qemu-user
    want has_command wine wine wine64
esac
[ -n "$missing$wanted" ] || exit 0

give_up() {
    echo "setup: $1; please install what these Debian packages hold:$missing" >&2
    exit 1
}
if ! has_command apt-get; then
    [ -n "$missing" ] || exit 0
    give_up "no apt-get here"
fi
root=
if [ "$(id -u)" != 0 ]; then
    has_command sudo || { [ -n "$missing" ] || exit 0; give_up "not root, and no sudo here"; }
    if [ -t 0 ]; then root=sudo; else root="sudo -n"; fi
fi

# install PACKAGES
install() {
    # shellcheck disable=SC2086 # the words of $root and of the packages are meant to be split
    $root env DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-install-recommends install \
        $1 </dev/null >"$log" 2>&1
}
# or after an update of the list of packages
install_or_update() {
    echo "setup: installing$1"
    install "$1" || { $root apt-get -qq update >/dev/null 2>&1 || true; install "$1"; }
}
log=$(mktemp)
trap 'rm -f "$log"' EXIT
[ -z "$missing" ] || install_or_update "$missing" || {
    tail -n 5 "$log" >&2
    give_up "apt-get could not install them"
}
[ -z "$wanted" ] || install_or_update "$wanted" ||
    echo "setup: going on without$wanted, which apt-get could not install"
