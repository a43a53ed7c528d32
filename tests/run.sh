#!/bin/sh
# run.sh test|check [NAME...] - run the tests and count them
#
# make builds and runs what is needed (tests/build.mk says how), two at a time: every
# tests/unit/test_*.c is a cmocka program with the address and undefined-behaviour sanitizers; the
# scripts in tests/tool, tests/look and tests/wide print "ok - what" or "not ok - what" for each of
# their tests. test tries a sample in minutes, check everything. NAME picks some: texmath_cut,
# golden_texsyn, tool_cli ... Each line tells the seconds that a test kept a processor busy, the last
# line counts everything.
#
# run.sh --one DONE COMMAND... - run one of them: its output goes to a log beside DONE, and DONE is
# made if it passed
set -u

cd "$(dirname "$0")/.." || exit 1
CC=${CC:-cc} CXX=${CXX:-c++} BUILD=${BUILD:-build}
OUT=$BUILD/tests
export CC CXX BUILD OUT
export UBSAN_OPTIONS=print_stacktrace=1 CMOCKA_MESSAGE_OUTPUT=TAP LC_ALL=C

# count LOG: sets good and bad to the numbers of its tests; those that are left to make check are none
count() {
    good=$(grep '^ok' "$1" | grep -vc '# SKIP') bad=$(grep '^not ok' "$1" | grep -vc '# SKIP')
}

one() {
    done=$1 log=${1%.done}.log
    shift
    mkdir -p "${done%/*}" && rm -f "$done" || exit 1
    "$@" >"$log" 2>&1
    status=$?
    count "$log"
    if [ $status != 0 ] && [ "$bad" = 0 ]; then
        bad=1
        echo "not ok - it ended with status $status after $good tests" >>"$log"
    elif [ "$good$bad" = 00 ] && ! grep -q '^SKIP' "$log"; then
        bad=1
        echo "not ok - it tested nothing" >>"$log"
    fi
    times >"${done%.done}.times" # not in a pipe, whose shell has no children
    seconds=$(awk 'END { gsub("s", ""); split($1, u, "m"); split($2, s, "m")
        printf "%.1f", 60 * (u[1] + s[1]) + u[2] + s[2] }' "${done%.done}.times")
    name=${done%.done}
    printf '%-28s %4d passed %4d failed %7s s\n' "${name#"$OUT"/}" "$good" "$bad" "$seconds"
    if [ "$bad" = 0 ]; then
        echo "$seconds" >"$done"
    else # of a failed piece show what is not a passed test
        grep -v '^ok' "$log" | sed 's/^/    /' | tail -n 60
    fi
    exit 0
}

mode=${1:-test}
shift
[ "$mode" = --one ] && one "$@"

unset MAKEFLAGS MFLAGS MAKEOVERRIDES
start=$(date +%s)
jobs=$(nproc 2>/dev/null || echo 2)
mkdir -p "$OUT"
touch "$OUT/start"
passed=0 failed=0 before=0
make="make -s BUILD=$BUILD"
list=$OUT/$mode.list
# shellcheck disable=SC2086 # words
$make $mode-list >"$list" || exit 1
if [ $# -gt 0 ]; then
    for name in "$@"; do
        grep -E "/(test_)?$name\$" "$list" || { echo "no test has the name $name" >&2; exit 2; }
    done >"$OUT/some.list" || exit 2
    list=$OUT/some.list
fi
# shellcheck disable=SC2046,SC2086 # words
$make -k -j "$jobs" $(sed 's/$/.done/' "$list") 2>"$OUT/make.log" || {
    failed=1
    echo "not ok - make failed:"
    grep -v '^make' "$OUT/make.log" | sed 's/^/    /' | head -n 60
    grep '^make' "$OUT/make.log" | sed 's/^/    /' | tail -n 10
}
while read -r run; do
    good=0 bad=0
    [ ! -e "$run.log" ] || count "$run.log"
    if [ ! -e "$run.done" ] && [ $bad = 0 ]; then
        bad=1
        echo "not ok - ${run#"$OUT"/} has not run to its end"
    fi
    passed=$((passed + good)) failed=$((failed + bad))
    [ ! -e "$run.done" ] || [ "$run.done" -nt "$OUT/start" ] || before=$((before + good))
done <"$list"
[ $before = 0 ] || echo "$before of them passed before, and nothing that they depend on has changed"
echo "$(($(date +%s) - start)) s"
echo "$passed passed, $failed failed"
[ "$failed" = 0 ] && [ "$passed" -gt 0 ]
