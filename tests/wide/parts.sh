#!/bin/sh
# Every part of every module compiles alone, as C and as C++, with each compiler: so editors, linters
# and tests that look inside can read one room and not the whole house.
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
    case $cc in gcc) cxx=g++ ;; clang) cxx=clang++ ;; *) cxx=$CXX ;; esac
    has "$cxx" && alone "$cxx" c++11 c++
done
