#!/bin/sh
# compare.sh CASES... - what golden programs print, compared with golden.txt
#
# Each argument is a golden program with its arguments in one word: "build/golden_texsyn 3". All lines
# of its module must be there and be equal; of those that are not, the message names module and case.
#
#   compare.sh --write PROGRAM...    writes golden.txt anew, on purpose: the commit says why
#   compare.sh --tap CASES...        with a line "ok - " or "not ok - " for each
#   compare.sh --some CASES...       the same for programs that are asked for some cases only
set -u
golden=$(dirname "$0")/golden.txt

if [ "${1:-}" = --write ]; then
    shift
    for program in "$@"; do "$program" 1 || exit 1; done >"$golden.new" && mv "$golden.new" "$golden"
    exit
fi

status=0 tap= some=
[ "${1:-}" = --some ] && some=yes
case ${1:-} in --tap | --some) tap=yes && shift ;; esac
for run in "$@"; do
    same=yes
    # shellcheck disable=SC2086 # program and arguments
    lines=$($run) || { echo "$run failed"; same=no; }
    module=$(echo "$lines" | sed -n '1s/ .*//p')
    [ -n "$module" ] && grep -q "^$module " "$golden" || { echo "$run: no such module"; same=no; }
    {
        if [ -n "$some" ]; then
            for case in $(echo "$lines" | cut -d ' ' -f 2); do grep "^$module $case " "$golden"; done
        else
            grep "^$module " "$golden"
        fi
        echo "$lines"
    } | awk -v run="$run" '
        { n[$1 " " $2]++; different[$1 " " $2] = n[$1 " " $2] > 1 && $3 != hash[$1 " " $2]
          hash[$1 " " $2] = $3 }
        END {
            for (c in n) {
                split(c, word, " ")
                if (n[c] != 2) print "module " word[1] ", case " word[2] ": only in one of golden.txt and " run
                else if (different[c]) print "module " word[1] ", case " word[2] ": other bytes than in golden.txt from " run
                if (n[c] != 2 || different[c]) bad = 1
            }
            exit bad
        }' || same=no
    case $tap$same in
    yesyes) echo "ok - the golden bytes of $module, ${run##*/}" ;;
    yesno) echo "not ok - the golden bytes of $module, ${run##*/}" ;;
    esac
    [ $same = yes ] || status=1
done
exit $status
