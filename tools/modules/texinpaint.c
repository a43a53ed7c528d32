/* texinpaint.c - the implementation of texinpaint.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TEXINPAINT_IMPLEMENTATION
#include "texinpaint.h"
