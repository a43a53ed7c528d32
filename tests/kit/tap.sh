# tap.sh - sourced by the test scripts: a scratch folder and one-line results
#
# $tmp is a folder that is removed at the end. Results are lines "ok - what" and "not ok - what",
# the latter followed by what the test printed.
# shellcheck shell=sh
set -u
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
trap 'exit 1' INT TERM
OUT=${OUT:-build/tests} CC=${CC:-cc} CXX=${CXX:-c++} FULL=${FULL:-0}
SANITIZE=${SANITIZE:--O1 -g -fsanitize=address,undefined -fno-sanitize-recover=undefined}
mkdir -p "$OUT"

# check WHAT COMMAND...: passes if the command succeeds
check() {
    what=$1
    shift
    if "$@" >"$tmp/check.log" 2>&1; then
        echo "ok - $what"
    else
        echo "not ok - $what"
        head -n 30 "$tmp/check.log" | sed 's/^/    # /'
        return 1
    fi
}

# has PROGRAM: is it installed?
has() { command -v "$1" >/dev/null 2>&1; }

# compilers: gcc and clang as far as they are here, or whatever $CC is
compilers() {
    for c in gcc clang; do has $c && echo $c; done
    has gcc || has clang || echo "$CC"
}
