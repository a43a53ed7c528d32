/* tiles.h - what the files of 'texkit tiles' share
   SPDX-License-Identifier: MIT OR Unlicense

   tiles.c holds the command, tiles_engines.c writes sets for other programs.                     */
#ifndef TILES_H
#define TILES_H

#include "command.h"
#include "textiles.h"

#include <stdio.h>

/* tiles.tsx of a set of squares: a tile set of Tiled with a Wang set. */
void print_tiled(FILE *to, const textiles_set *set, const textiles_layout *layout);

/* tiles.tres of a set of squares: a TileSet of Godot 4 with a terrain set. */
void print_godot(FILE *to, const textiles_set *set, const textiles_layout *layout);

#endif /* TILES_H */
