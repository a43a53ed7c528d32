/* treepieces.c - the implementation of treepieces.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TREEPIECES_IMPLEMENTATION
#include "treepieces.h"
