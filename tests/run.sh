#!/bin/sh
# run.sh [--full] [NAME...] - run the tests and count them
#
# Every tests/unit/test_*.c is a cmocka program, built here with the address and undefined-behaviour
# sanitizers, together with the files that its line "Built with:" names, if it has one; every
# script in tests/tool, tests/look and tests/wide prints "ok - what" or "not ok - what" for each of its tests. NAME
# picks some of them (cli, texmath ...). --full widens what the scripts try, as does naming some in
# WIDE, as CI does. The last line counts everything.
set -u

cd "$(dirname "$0")/.." || exit 1
FULL=${FULL:-0}
[ "${1:-}" = --full ] && FULL=1 && shift
CC=${CC:-cc} CXX=${CXX:-c++}
SANITIZE="-O1 -g -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=undefined"
OUT=build/tests
export CC CXX FULL OUT SANITIZE
export UBSAN_OPTIONS=print_stacktrace=1 CMOCKA_MESSAGE_OUTPUT=TAP LC_ALL=C
mkdir -p "$OUT"

# unit NAME: build and run one cmocka program; its log and status stay in $OUT
unit() {
    source=tests/unit/test_$1.c
    # shellcheck disable=SC2086 # flags are words
    if $CC -std=gnu99 $SANITIZE -ffp-contract=off -Wall -Wextra -Isrc -Itests/kit -Itools "$source" \
        $(sed -n 's/^   Built with: \([a-z_./* ]*[a-z]\).*/\1/p' "$source") \
        -o "$OUT/test_$1" -lcmocka -lpthread -lm >"$OUT/$1.log" 2>&1; then
        "$OUT/test_$1" >>"$OUT/$1.log" 2>&1
        echo $? >"$OUT/$1.status"
    else
        echo "of the compiler" >"$OUT/$1.status"
    fi
}
# script NAME: run one script; its log and status stay in $OUT
script() {
    case " ${WIDE:-} " in *" $1 "*) FULL=1 ;; esac
    sh tests/*/"$1.sh" >"$OUT/$1.log" 2>&1
    echo $? >"$OUT/$1.status"
}
case ${1:-} in
--unit) unit "$2"; exit 0 ;;
--script) script "$2"; exit 0 ;;
esac

passed=0 failed=0

# count NAME LOG STATUS: add up a log of "ok" lines; a crash or an empty log is a failure
count() {
    good=$(grep -c '^ok' "$2") bad=$(grep -c '^not ok' "$2")
    if [ "$bad" = 0 ] && { [ "$3" != 0 ] || [ "$good" = 0 ]; }; then
        bad=1
        echo "not ok - $1 ended with status $3 after $good tests"
    fi
    passed=$((passed + good)) failed=$((failed + bad))
    printf '%-14s %4d passed %4d failed\n' "$1" "$good" "$bad"
    # of a failed piece show what is not a passed test
    [ "$bad" = 0 ] || grep -v '^ok' "$2" | sed 's/^/    /' | tail -n 60
}

wanted() {
    [ -z "$names" ] && return 0
    case " $names " in *" $1 "*) return 0 ;; esac
    return 1
}
names=$*

# run_all KIND FILES...: those that are wanted, two at a time, counted in order afterwards
run_all() {
    kind=$1 chosen=
    shift
    for source in "$@"; do
        name=$(basename "${source%.*}")
        name=${name#test_}
        wanted "$name" || continue
        case $name in # the longest first, so that none is left to run alone
        headers | same_bytes) chosen="$name $chosen" ;;
        *) chosen="$chosen $name" ;;
        esac
        echo "before its end" >"$OUT/$name.status" # not that of an earlier run
    done
    # shellcheck disable=SC2086 # names are words
    [ -z "$chosen" ] || printf '%s\n' $chosen | xargs -n 1 -P 2 sh tests/run.sh "--$kind"
    for name in $chosen; do
        count "$name" "$OUT/$name.log" "$(cat "$OUT/$name.status")"
    done
}

run_all unit tests/unit/test_*.c

# the scripts use the tool as released and with the sanitizers, and the helpers of tools/
if ! { make -s all helpers && make -s BUILD="$OUT/asan" CFLAGS="$SANITIZE" all; } \
    >"$OUT/make.log" 2>&1; then
    count make "$OUT/make.log" 1
fi

run_all script tests/tool/*.sh tests/look/*.sh tests/wide/*.sh

echo "$passed passed, $failed failed"
[ "$failed" = 0 ] && [ "$passed" -gt 0 ]
