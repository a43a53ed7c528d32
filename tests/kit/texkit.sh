# texkit.sh - sourced by the scripts that test the tool: runs of $texkit, with the command $prefix in
# front of the arguments if that is set
# shellcheck shell=sh
prefix=

# run STATUS ARGUMENTS...: texkit must end with that status. After success stderr is empty. After a
# failure it holds one line that names the command, and no file or folder was made or changed.
run() {
    want=$1
    shift
    [ "$want" = 0 ] || before=$(all_files)
    "$texkit" ${prefix:+"$prefix"} "$@" >out.log 2>err.log
    got=$?
    [ $got = "$want" ] || { echo "status $got instead of $want"; cat err.log; return 1; }
    if [ "$want" = 0 ]; then
        [ ! -s err.log ] || { echo "stderr is not empty:"; cat err.log; return 1; }
    else
        [ "$(wc -l <err.log)" = 1 ] || { echo "not one line on stderr:"; cat err.log; return 1; }
        grep -q '^texkit' err.log || { cat err.log; return 1; }
        [ ! -s out.log ] || { echo "stdout is not empty:"; cat out.log; return 1; }
        [ "$before" = "$(all_files)" ] || { echo "files were made or changed"; ls -l; return 1; }
    fi
}
# all_files: a line for each file and folder that changes if the file does. Where find can print when a
# file was changed, to the nanosecond, that will do: one process, for there are hundreds of runs
if find /dev/null -printf '%T@' >/dev/null 2>&1; then
    all_files() { find . -type d -print -o ! -name '*.log' -printf '%p %y %m %i %s %T@\n'; }
else
    all_files() {
        find . -type f ! -name '*.log' -exec cksum {} + | sort
        find . -type d | sort
    }
fi
# GNU's OpenMP reads this when a program starts; texkit would set it and start again
export OMP_WAIT_POLICY=passive GOMP_SPINCOUNT=20000

# says TEXT: the last message holds this text
says() { grep -qF -- "$1" err.log; }

# refuses_so STATUS TEXT ARGUMENTS...: it ends with that status, and the message holds this text
refuses_so() {
    status=$1 text=$2
    shift 2
    run "$status" "$@" || return 1
    says "$text" || { echo "the message lacks '$text':"; cat err.log; return 1; }
}

# refuses STATUS TEXT ARGUMENTS...: the same as a test of its own
refuses() {
    status=$1 text=$2
    shift 2
    check "status $status, \"$text\": $(echo "$*" | tail -c 70)" refuses_so "$status" "$text" "$@"
}

# warns TEXT ARGUMENTS...: it succeeds with one line on stderr, a warning that holds this text
warns() {
    text=$1
    shift
    "$texkit" "$@" >out.log 2>err.log || { cat err.log; return 1; }
    [ "$(wc -l <err.log)" = 1 ] && grep -q '^texkit [a-z]*: warning: ' err.log && says "$text" && return
    echo "not one warning that holds '$text':"
    cat err.log
    return 1
}

# figure NAME: its value in stats.json
figure() { sed -n "s/,*$//; s/^ *\"$1\": //p" stats.json; }

# stops OUT ARGUMENTS...: a signal ends the run of $released with status 1, a message and no OUT
stops() {
    out=$1
    shift
    "$released" "$@" -o "$out" --quiet 2>err.log &
    child=$!
    sleep 0.4
    kill -TERM $child
    wait $child
    [ $? = 1 ] && says "stopped" && [ ! -e "$out" ]
}
# starves KILOBYTES OUT ARGUMENTS...: with so little memory the run of $released ends with status 1, one
# line and no OUT
starves() {
    memory=$1 out=$2
    shift 2
    (ulimit -v "$memory" && "$released" "$@" -o "$out" --threads 1 2>err.log)
    [ $? = 1 ] && says "memory" && [ "$(wc -l <err.log)" = 1 ] && [ ! -e "$out" ]
}
# has_terminal: can a terminal be had for a progress bar?
has_terminal() { has script && script -qec true /dev/null >/dev/null 2>&1; }
# shows_bar ARGUMENTS...: $released draws a progress bar on a terminal
shows_bar() { script -qec "'$released' $* --threads 1" /dev/null | grep -q '##.*%'; }
