#!/bin/sh
# The headers at the root are what tools/headers.sh pastes together from src/; it tells where a line
# comes from, and refuses parts out of order.
. tests/kit/tap.sh

check "root headers equal what make headers writes" tools/headers.sh --check

# a part includes its siblings and, at the bottom, its own module; a module texmath.h and libc alone
foreign_includes() {
    awk '
        FNR == 1 {
            part = FILENAME
            sub(/^src\//, "", part)
            module = part
            sub(/(\.h|\/.*)$/, "", module)
        }
        /^# *include "/ {
            split($0, word, "\"")
            name = word[2]
            if (part ~ /\//) good = name == "../" module ".h" || name == "texmath.h" || name !~ /\//
            else good = index(name, module "/") == 1 || (name == "texmath.h" && module != "texmath")
            if (!good) { print FILENAME ":" FNR ": " $0; bad = 1 }
        }
        END { exit bad }' src/*.h src/*/*.h
}
check "no part includes another module, no module another but texmath.h" foreign_includes
# more than 1,000 lines are two ideas
not_too_long() {
    find src tools tests examples bench -name '*.[ch]' -o -name '*.cpp' -o -name '*.sh' -o -name '*.py' \
        -o -name '*.js' -o -name '*.mk' -o -name '*.awk' | xargs wc -l |
        awk '$2 != "total" && $1 > 1000 { print; bad = 1 } END { exit bad || NR < 100 }'
}
check "no file has more than 1,000 lines" not_too_long
vague() { ! find src -name '*.h' | grep -E '/(utils?|common|misc|helpers?)[.h_]'; }
check "no part is named utils, common or misc" vague
astray() { ! ls tests/*.[ch] tests/test_* 2>/dev/null; }
check "every test stands in a room of tests/" astray

# says_where HEADER LINE: the place it names holds this line of the header
says_where() {
    place=$(tools/headers.sh --where "$1:$2") || return 1
    [ "$(sed -n "$2p" "$1")" = "$(sed -n "${place##*:}p" "${place%:*}")" ] || {
        echo "not at $place"
        return 1
    }
}
for module in src/*.h; do
    header=$(basename "$module")
    lines=$(wc -l <"$header")
    check "--where finds lines of $header" eval \
        "says_where $header 1 && says_where $header $((lines / 2)) && says_where $header $lines"
done

# a small project, in which one thing at a time is wrong
mkdir -p "$tmp/tools" "$tmp/src/one"
cp tools/headers.sh "$tmp/tools"
printf '/* one.h */\n#include "one/low.h"\n#include "one/high.h"\n/* end */\n' >"$tmp/src/one.h"
printf '#ifndef L\n#include "../one.h"\n\n/* ---- low ---- */\nint low;\n#endif\n' >"$tmp/src/one/low.h"
printf '#ifndef H\n#include "low.h"\n\n/* ---- high ---- */\nint high;\n#endif\n' >"$tmp/src/one/high.h"
printf '/* one.h */\n/* ---- low ---- */\nint low;\n/* ---- high ---- */\nint high;\n/* end */\n' \
    >"$tmp/right.h"
check "pastes parts between rule and #endif" \
    sh -c "'$tmp/tools/headers.sh' && cmp '$tmp/one.h' '$tmp/right.h'"
echo "/* edited */" >>"$tmp/one.h"
check "--check tells an edited header" \
    sh -c "! '$tmp/tools/headers.sh' --check 2>'$tmp/log' && grep -q 'one.h is not' '$tmp/log'"

# refuses TEXT: it fails, and its message holds this text
refuses() {
    check "refuses: $1" \
        sh -c "! '$tmp/tools/headers.sh' 2>'$tmp/log' >&2 && grep -qF '$1' '$tmp/log'"
}
sed -i 's/low.h/higher.h/' "$tmp/src/one/high.h"
refuses "higher.h does not stand before it"
printf '#ifndef H\nint high;\n#endif\n' >"$tmp/src/one/high.h"
refuses "no section rule"
rm "$tmp/src/one/high.h"
refuses "src/one/high.h"
