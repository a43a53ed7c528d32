#!/bin/sh
# Every part of every module compiles alone: so editors, linters and tests that look inside can read one
# room and not the whole house. What a part lacks every compiler misses, so one will do; what else they
# say of it, they say of the header that holds it. With FULL=1 as C and as C++ with each compiler.
. tests/kit/tap.sh

warn="-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Werror -Wno-unused-function"
[ -n "$(ls src/*/*.h)" ] || { echo "not ok - there are parts"; exit 1; }

# alone COMPILER STANDARD LANGUAGE: all parts, a file each that includes nothing else
alone() {
    for part in src/*/*.h; do
        echo "#include \"${part#src/}\"" >"$tmp/alone.x"
        check "$part alone, $1 $2" \
            $1 -std=$2 $warn -Wno-unused-const-variable -fsyntax-only -Isrc -x "$3" "$tmp/alone.x"
    done
}
for cc in $(compilers); do
    alone "$cc" c99 c
    [ "$FULL" = 1 ] || break
    case $cc in gcc) cxx=g++ ;; clang) cxx=clang++ ;; *) cxx=$CXX ;; esac
    has "$cxx" && alone "$cxx" c++11 c++
done
