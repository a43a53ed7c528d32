#!/bin/sh
# The golden bytes on other machines: programs for them, run by an emulator, in all cases that take it
# less than some ten seconds; with FULL=1 in all. Machines whose compiler or emulator is not here are
# skipped; tools/setup.sh ci installs them if it can.
#
#   s390x    the highest byte comes first, char is unsigned, gcc -std=c99 computes float in double
#   aarch64  char is unsigned; only plain C, as there is no SSE
#   i386     32 bits: pointers, size_t, long; with SSE2, as x87 computes in 80 bits
#   windows  64 bits, but long has 32; another C library. Under wine
. tests/kit/tap.sh

golden=tests/wide/golden

# cases_of MODULE: those to run, nothing for all. Those that are left out take a second or more here and
# twenty times as long under an emulator
cases_of() {
    [ "$FULL" = 1 ] && return
    case $1 in
    texsyn) echo "gray file relit eroded fill fill-rgba-16-bits" ;;
    texpatch) echo "tileable lattice lattice-given maps guided again half straight" ;;
    texinpaint) echo "wall crest smooth" ;;
    esac
}

# build COMPILER "FLAGS" MODULE PROGRAM: the module as users have it, as C99
build() {
    define=$(echo "$3" | tr '[:lower:]' '[:upper:]')
    printf '#define %s_IMPLEMENTATION\n#include "%s.h"\n' "$define" "$3" >"$tmp/module.c"
    # shellcheck disable=SC2086 # flags are words
    $1 -std=c99 $2 -ffp-contract=off -I. -c "$tmp/module.c" -o "$tmp/module.o" &&
        $1 -std=gnu99 $2 -ffp-contract=off -D${define}_IMPLEMENTED -I. -Itests/kit -I$golden \
            "$golden/golden_$3.c" "$tmp/module.o" -static -lpthread -lm -o "$4"
}

# the lines of a program, without the carriage returns of Windows
cat >"$tmp/emulate" <<'END'
#!/bin/sh
"$@" | tr -d '\r'
END
chmod +x "$tmp/emulate"

# machine NAME COMPILER "FLAGS" EMULATOR: all modules there
machine() {
    for tool in "$2" "$4"; do
        has "$tool" || { echo "SKIP $1: there is no $tool"; return; }
    done
    for module in $(sed 's/ .*//' $golden/golden.txt | uniq); do
        cases=$(cases_of "$module")
        check "builds golden_$module for $1" build "$2" "$3" "$module" "$tmp/golden_$module.exe" || continue
        check "the golden bytes of $module on $1" $golden/compare.sh ${cases:+--some} \
            "$tmp/emulate $4 $tmp/golden_$module.exe 1 $cases"
    done
}

export WINEPREFIX="$tmp/wine" WINEDEBUG=-all
machine s390x s390x-linux-gnu-gcc -O1 qemu-s390x
machine aarch64 aarch64-linux-gnu-gcc -O1 qemu-aarch64
machine "i386 with SSE2" i686-linux-gnu-gcc "-O1 -msse2 -mfpmath=sse" qemu-i386
machine windows x86_64-w64-mingw32-gcc -O1 wine
