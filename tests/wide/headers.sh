#!/bin/sh
# Every header compiles without a warning: by itself, twice in one unit, and in two units of one
# program of which one holds the implementation; as C and as C++.
. tests/kit/tap.sh
. tests/kit/library.sh

warn="$warn -Werror"
c_standards="c99 c11 c17 c2x" cxx_standards="c++11 c++14 c++17 c++20"

# two_units COMPILER STANDARD LANGUAGE NAME: one holds the implementation, one uses the header. Some
# warnings of gcc take an optimiser; once will do, and twice with FULL=1. That of C is the library that
# same_bytes.sh links as well.
two_units() {
    level=-O0
    [ "$1" = gcc ] || [ "$1$FULL" = g++1 ] && level=-O2
    if [ "$3" = c ]; then
        library "$1" $level "$4" && cat "$object.log" && [ ! -s "$object.log" ] || return 1
    else
        object=$tmp/whole.o
        $1 -std=$2 $warn $level -I. -x "$3" -c "$tmp/whole.x" -o "$object" || return 1
    fi
    $1 -std=$2 $warn $level -I. -x "$3" -c "$tmp/user.x" -o "$tmp/user.o" &&
        $1 "$object" "$tmp/user.o" -o "$tmp/program" -lm && "$tmp/program"
}

# matrix COMPILER STANDARD LANGUAGE: all forms of all headers. Which declarations are there, what an
# optimiser and the linker see does not change with the standard, so once for each language will do; in
# the other standards the words that are reserved and the warnings differ, and one form shows them.
matrix() {
    first=$FULL forms=whole-twice
    case $2 in c99 | c++11) first=1 ;; esac
    [ "$first" = 1 ] && forms='alone twice whole-twice windows'
    for header in *.h; do
        macro=$(basename "$header" .h | tr '[:lower:]' '[:upper:]')
        printf '#include "%s"\n' "$header" >"$tmp/alone.x"
        printf '#include "%s"\n#include "%s"\n' "$header" "$header" >"$tmp/twice.x"
        printf '#define %s_IMPLEMENTATION\n#include "%s"\n' "$macro" "$header" >"$tmp/whole.x"
        cat "$tmp/whole.x" "$tmp/alone.x" >"$tmp/whole-twice.x"
        { cat "$tmp/alone.x" && printf 'int main(void) { return 0; }\n'; } >"$tmp/user.x"
        {
            printf '#define %s_STATIC\n' "$macro"
            cat "$tmp/whole.x"
        } >"$tmp/static.x"
        {
            # as <windows.h> has them
            printf '#define %s\n' near far 'small char' 'interface struct' 'IN' 'OUT'
            printf '#define min(a, b) ((a) < (b) ? (a) : (b))\n'
            printf '#define max(a, b) ((a) > (b) ? (a) : (b))\n'
            cat "$tmp/whole.x"
        } >"$tmp/windows.x"
        for form in $forms; do
            check "$header $form, $1 $2" \
                $1 -std=$2 $warn -fsyntax-only -I. -x "$3" "$tmp/$form.x"
        done
        [ "$first" = 1 ] || continue
        check "$header static, $1 $2" \
            $1 -std=$2 $warn -Wno-unused-function -fsyntax-only -I. -x "$3" "$tmp/static.x"
        check "$header in two units, $1 $2" two_units "$1" "$2" "$3" "$(basename "$header" .h)"
    done
}

for cc in $(compilers); do
    for standard in $c_standards; do matrix "$cc" "$standard" c; done
    case $cc in gcc) cxx=g++ ;; clang) cxx=clang++ ;; *) cxx=$CXX ;; esac
    has "$cxx" || continue
    for standard in $cxx_standards; do matrix "$cxx" "$standard" c++; done
done
