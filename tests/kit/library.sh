# library.sh - sourced by test scripts that link the headers at the root, behind tap.sh
#
# library COMPILER "FLAGS" NAME: sets $object to the implementation of NAME.h, compiled so as C99 with
# all warnings; what the compiler said is in $object.log. Both are kept for other scripts, as long as
# no header is newer: at -O2 and -O3 the large headers take half a minute each.
# shellcheck shell=sh
warn="-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow"

library() {
    folder=$OUT/libraries/$(echo "$1$2" | tr -d ' ')
    object=$folder/$3.o
    [ -e "$object" ] && [ -z "$(find ./*.h -newer "$object")" ] && return
    mkdir -p "$folder"
    printf '#define %s_IMPLEMENTATION\n#include "%s.h"\n' \
        "$(echo "$3" | tr '[:lower:]' '[:upper:]')" "$3" >"$tmp/library.c"
    # shellcheck disable=SC2086 # flags are words
    $1 -std=c99 $2 -ffp-contract=off $warn -I. -c "$tmp/library.c" -o "$tmp/library.o" \
        >"$object.log" 2>&1 && mv "$tmp/library.o" "$object"
}
