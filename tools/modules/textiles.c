/* textiles.c - the implementation of textiles.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TEXTILES_IMPLEMENTATION
#include "textiles.h"
