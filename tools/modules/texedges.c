/* texedges.c - the implementation of texedges.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TEXEDGES_IMPLEMENTATION
#include "texedges.h"
