#!/bin/sh
# headers.sh - paste src/NAME.h and its parts in src/NAME/ together: the root header NAME.h
# headers.sh --check - only say which root headers are not what it would write
# headers.sh --where NAME.h:LINE - the part and line that this line of a root header comes from
#
# Each line '#include "NAME/part.h"' of src/NAME.h becomes that part, from its first section rule to
# the line before its last #endif. A part may include only parts that stand before it.
set -eu
cd "$(dirname "$0")/.."

# paste NAME [LINE]: print the root header, or where its line comes from
paste() {
    awk -v name="$1" -v where="${2:-0}" '
        function fail(why) { print "headers.sh: " why >"/dev/stderr"; failed = 1; exit 1 }
        function put(line, file, number) {
            if (!where) print line
            else if (++count == where) { print file ":" number; exit 0 }
        }
        function paste_part(file, part, n, i, first, last, lines, quoted) {
            while ((getline lines[++n] <file) > 0) {
                if (lines[n] ~ /^\/\* ---- / && !first) first = n
                if (lines[n] ~ /^#endif/) last = n
                if (first || split(lines[n], quoted, "\"") != 3 || quoted[2] == "../" name ".h") continue
                if (!(quoted[2] in pasted)) fail(file ": " quoted[2] " does not stand before it")
            }
            if (!first || first > last) fail(file ": no section rule, or no #endif after it")
            for (i = first; i < last; i++) put(lines[i], file, i)
            pasted[part] = 1
        }
        /^#include "/ && split($0, word, "\"") == 3 && index(word[2], name "/") == 1 {
            paste_part("src/" word[2], substr(word[2], length(name) + 2))
            next
        }
        { put($0, FILENAME, FNR) }
        END { exit failed }' "src/$1.h"
}

if [ "${1:-}" = --where ]; then
    paste "$(basename "${2%%:*}" .h)" "${2##*:}"
    exit
fi
made=$(mktemp) status=0
trap 'rm -f "$made"' EXIT
for module in src/*.h; do
    header=$(basename "$module")
    paste "${header%.h}" >"$made"
    # a header that is right keeps its time, so that nothing is built again
    cmp -s "$made" "$header" && continue
    if [ "${1:-}" = --check ]; then
        echo "$header is not what 'make headers' writes" >&2
        status=1
    else
        cat "$made" >"$header"
    fi
done
exit $status
