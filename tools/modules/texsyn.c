/* texsyn.c - the implementation of texsyn.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TEXSYN_IMPLEMENTATION
#include "texsyn.h"
