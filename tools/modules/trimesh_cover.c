/* trimesh_cover.c - the implementation of trimesh_cover.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TRIMESH_COVER_IMPLEMENTATION
#include "trimesh_cover.h"
