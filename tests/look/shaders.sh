#!/bin/sh
# shaders/textiles.glsl shows what textiles_draw_plane draws, without seams and without colours of
# foreign tiles in mip-maps. tests/look/gl_textiles.c explains how; it runs on Mesa's software driver where
# there is no graphics card.
. tests/kit/tap.sh

gl=$OUT/gl_textiles
if [ ! "$gl" -nt tests/look/gl_textiles.c ] || [ ! "$gl" -nt textiles.h ] ||
    [ ! "$gl" -nt texmath.h ]; then
    # shellcheck disable=SC2086 # flags are words
    check "gl_textiles builds" $CC -std=c99 -O2 -ffp-contract=off -Wall -Wextra -I. \
        tests/look/gl_textiles.c -o "$gl" -lEGL -lOpenGL -lm || exit 1
fi
"$gl" shaders/textiles.glsl 2>&1 | sed '/^ok\|^not ok/!s/^/    # /'
