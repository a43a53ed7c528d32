/* texpatch.c - the implementation of texpatch.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TEXPATCH_IMPLEMENTATION
#include "texpatch.h"
