/* trimesh_relax.c - the implementation of trimesh_relax.h, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define TRIMESH_RELAX_IMPLEMENTATION
#include "trimesh_relax.h"
