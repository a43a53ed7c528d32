#!/bin/sh
# What the headers, the README and the change log say of themselves holds: the QUICK START block of
# each head comment builds and runs in a folder with nothing but the header and texmath.h, and
# versions agree everywhere.
#
#   manual.sh [HEADER.h...]   of these headers alone, as C; with FULL=1 with every compiler
. tests/kit/tap.sh

warn="-Wall -Wextra -Wpedantic -Werror"

# The lines between QUICK START and the next heading, without their common indentation.
quick_start() {
    awk '
        /QUICK START/ { inside = 1; next }
        inside && /^ ? ? ?[A-Z][A-Z]/ { exit }
        inside && /\*\/ *$/ { exit }
        inside {
            match($0, /^ */)
            if (NF && (!n || RLENGTH < least)) least = RLENGTH
            line[++n] = $0
        }
        END { for (i = 1; i <= n; i++) print substr(line[i], least + 1) }' "$1"
}

# said HEADER FILE: what the quick start of this header printed
said() {
    case $1 in
    texmath.h) grep -qx 'centre of the ramp: 0.5079' "$2" ;;
    texsyn.h) awk '/^[0-9]+ clique types, pixel \(5, 7\) is [0-9]+$/ {
        good = $1 >= 3 && $1 <= 60 && $NF <= 255 } END { exit !good }' "$2" ;;
    textiles.h) awk '/^16 tiles, atlas [0-9]+ x [0-9]+, tile [0-9]+ at \(5, 7\)/ {
        good = $4 * $6 >= 16 * 48 * 48 && $8 <= 15 } END { exit !good }' "$2" ;;
    *) test -s "$2" ;;
    esac
}

everything=
[ $# -gt 0 ] || { everything=yes; set -- *.h; }
compilers=$(compilers)
[ "$FULL" = 1 ] || compilers=${compilers%%
*}
both=$everything$FULL

for header in "$@"; do
    name=$(basename "$header" .h)
    macro=$(echo "$name" | tr '[:lower:]' '[:upper:]')
    folder=$tmp/$name
    mkdir "$folder"
    cp texmath.h "$folder"
    [ "$header" = texmath.h ] || cp "$header" "$folder"
    quick_start "$header" >"$folder/main.c"
    check "$header has a QUICK START" test -s "$folder/main.c"
    cp "$folder/main.c" "$folder/main.cpp"
    for cc in $compilers; do
        check "QUICK START of $header builds and runs, $cc" sh -c "
            cd '$folder' && $cc -std=c99 $warn main.c -o main -lm && ./main >said"
        check "it says what it should" said "$header" "$folder/said"
        [ "$both" != 0 ] || continue
        case $cc in gcc) cxx=g++ ;; clang) cxx=clang++ ;; *) cxx=$CXX ;; esac
        check "QUICK START of $header builds and runs as C++, and says the same, $cxx" sh -c "
            cd '$folder' && $cxx -std=c++11 $warn main.cpp -o main -lm && ./main >said++ && cmp said said++"
    done

    version=$(sed -n "s/^#define ${macro}_VERSION \"\([0-9.]*\)\".*/\1/p" "$header")
    check "$header has a version" test -n "$version"
    check "the first line of $header says v$version" \
        sh -c "head -n 1 '$header' | grep -qF '/* $header - v$version - '"
    check "line 2 of $header is its SPDX line" \
        sh -c "sed -n 2p '$header' | grep -q 'SPDX-License-Identifier: MIT'"
    check "CHANGELOG.md knows $header $version" grep -qF "\`$header\` $version" CHANGELOG.md
    check "README.md lists $header" grep -qF "\`$header\`" README.md
done

[ -n "$everything" ] || exit 0

# the C code of the README builds as it stands there
awk '/^```c$/ { inside = 1; next } /^```$/ { inside = 0 } inside' README.md >"$tmp/readme.c"
for cc in $compilers; do
    check "the C code of README.md builds, $cc" \
        $cc -std=c99 -Wall -Wextra -Werror -I. -c "$tmp/readme.c" -o "$tmp/readme.o"
done

tool=$(sed -n 's/^#define TEXKIT_VERSION "\(.*\)"/\1/p' tools/cli.h)
check "CHANGELOG.md knows texkit $tool" grep -qF "## $tool" CHANGELOG.md
for command in $(build/texkit --help | sed -n 's/^  \([a-z]*\)  .*/\1/p'); do
    check "README.md knows 'texkit $command'" grep -qF "texkit $command" README.md
    check "'texkit $command --help' shows an example" \
        sh -c "build/texkit $command --help | grep -A1 '^Example' | grep -q 'texkit $command'"
done
