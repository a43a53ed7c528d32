/* place.h - where the path of an output leads, and temporary files beside it
   SPDX-License-Identifier: MIT OR Unlicense

   An output is written to a temporary file in the folder that it will be in, then renamed. The folder
   is held open, and all names are relative to it: a path may be as long as the system allows, and what
   happens to the folder's own name meanwhile does not matter.                                      */
#ifndef PLACE_H
#define PLACE_H

#include <limits.h>
#include <sys/stat.h>

#ifndef NAME_MAX
#define NAME_MAX 255
#endif

enum { PLACE_TEMPORARY = 24 }; /* bytes for the name of a temporary file */

/* Where symbolic links lead in the end, also to a file that does not exist yet. */
typedef struct place {
    int is_device;           /* /dev/null, a pipe: written as it is. There is no folder */
    int folder;              /* an open descriptor, or -1 */
    char name[NAME_MAX + 1]; /* in the folder */
    int exists;
    struct stat info; /* of the file if it exists, else of the folder */
} place;

/* 0: nothing can be written there, errno says why. Else place_close releases it. */
int place_find(const char *path, place *p);

/* The same for a file without a name in that folder. */
int place_in_folder(const char *path, place *p);

void place_close(place *p);

/* Do they lead to the same file? */
int place_is_same(const place *a, const place *b);

/* NULL if a file can be made there and the one that exists may be replaced; else why not. */
const char *place_refusal(const place *p);

/* Make a temporary file with a name of its own; its descriptor, or -1 with errno set. */
int place_create(const place *p, char temporary[PLACE_TEMPORARY]);

/* Give the file the owner, as far as possible, and the mode of the one that it will replace. 0: it
   cannot have this mode. */
int place_keep_mode(const place *p, int file);

#endif /* PLACE_H */
