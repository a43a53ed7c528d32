/* command.h - what the commands of texkit share beyond cli.h
   SPDX-License-Identifier: MIT OR Unlicense

   A command is a manual and a function; cli.h tells how it reads its command line.             */
#ifndef COMMAND_H
#define COMMAND_H

#include "cli.h"

typedef struct command {
    const cli_manual *manual;
    int (*run)(int argc, char **argv); /* the arguments after the command's name; exit status */
} command;

/* commands/ */
extern const command learn_command, synth_command; /* clique.c */
extern const command fill_command;                 /* fill.c    */
extern const command segment_command;              /* segment.c */
extern const command knit_command;                 /* knit.c  */
extern const command composite_command;            /* composite.c */
extern const command relight_command;              /* relight.c */
extern const command erode_command;                /* erode.c   */
extern const command patch_command;                /* patch.c  */
extern const command straighten_command;           /* straighten.c */
extern const command edges_command;                /* edges.c  */
extern const command tiles_command;                /* tiles.c  */
extern const command retile_command;               /* retile.c */
extern const command inpaint_command;              /* inpaint.c */
extern const command tree_command, forest_command; /* tree.c   */

/* ---- failures: each prints a message and returns an exit status --------------------------- */

int fail_memory(cli *run);

/* The result of a library call; what: the file that it was about. Prints nothing for TXM_OK. */
int check_result(cli *run, txm_status result, const char *what);

/* ---- memory and pictures ------------------------------------------------------------------ */

/* count items, all bytes 0, for free(); NULL only without memory. */
void *new_array(size_t count, size_t size);

/* A picture of zeros; release it with image_free. An exit status. */
int new_picture(cli *run, int width, int height, int channels, txm_sample sample, txm_image *image);

/* Read a picture. channels: 0 keeps those of the file. most: TXM_U16 keeps 16 bits per sample if
   the file has them. An exit status. */
int read_picture(cli *run, const char *path, int channels, txm_sample most, txm_image *image);

/* The same for the bytes of a file that was read already. */
int decode_picture(cli *run, const char *path, const unsigned char *bytes, size_t size, int channels,
                   txm_sample most, txm_image *image);

/* Refuse a picture of another size. what: "the mask"; like: whose size it must have. */
int check_extent(cli *run, const char *what, const char *path, const txm_image *image, int width,
                 int height, const char *like);

/* Convert a picture of 8 bits a sample to 16; one that has 16 stays. An exit status. */
int widen_picture(cli *run, txm_image *image);

/* Warn of a picture that looks like a normal map but is not to be treated as one. option: how to say
   that it is, such as "--normal 2". */
void warn_of_normals(cli *run, const char *path, const txm_image *image, const char *option);

/* A mask of a command. Which pixels count is told by txm_mask_use in texmath.h, and only there. */
typedef struct mask_role {
    const char *what;  /* "the mask"                                                    */
    const char *white; /* what happens where it counts: "is filled"                      */
    txm_mask_use use;
    int is_optional;   /* the command has something to do if nothing of it counts        */
} mask_role;

/* Read the mask of a picture of that size, in all its channels and bits. One of another size is
   refused, and so is one with which nothing can be done; what else may not be meant is said in a
   warning. path NULL: none, mask stays. like: whose size it must have. */
int read_mask(cli *run, const mask_role *role, const char *path, int width, int height,
              const char *like, txm_image *mask);

/* Encode a picture in the format of the path's extension; *bytes is for free(). An exit status. */
int encode_picture(cli *run, const char *path, const txm_image *image, unsigned char **bytes,
                   size_t *size);

/* ---- uneven light: even.c ------------------------------------------------------------------ */

/* The option --even: CLI_INT, EVEN_AUTO if it is not given. */
enum { EVEN_AUTO = -1, EVEN_MOST = 1000000 };
#define EVEN_HELP "even out light that changes over R pixels; 0: never; default: if it shows"

/* Refuse, before any work, a radius that cannot be. An exit status. */
int check_even(cli *run, int radius);

/* Even the light of a picture of colours: with that radius, or if it needs it, with a warning. mask:
   NULL, or 1 channel that is white where the picture counts. *used: the radius, 0 if it was left as
   it is. An exit status. */
int even_picture(cli *run, const char *path, int radius, const txm_image *mask, txm_image *image,
                 int *used);

/* ---- values of options -------------------------------------------------------------------- */

/* Decimal numbers low..high with commas between them, such as "1,0.5". Returns how many, at most
   most, or 0 after a message that names the option. */
int parse_numbers(cli *run, const char *option, const char *text, int most, double low, double high,
                  double *values);

/* One such number, or none if text is NULL: then *value stays. An exit status. */
int parse_number(cli *run, const char *option, const char *text, double low, double high,
                 double *value);

/* The index of a name in a list that ends in NULL; -1 after a message that lists the names. */
int find_name(cli *run, const char *option, const char *name, const char *const *names);

/* "1,3": give these of --maps a mark; the numbers are low..high, high at most 15. A list that is NULL
   marks none. An exit status. */
int mark_maps(cli *run, const char *option, const char *list, int low, int high, int mark,
              int *marks);

/* ---- outputs ------------------------------------------------------------------------------ */

/* Refuse, before any work, an output path whose format cannot hold such a picture. 0: size or
   channels not known yet. */
int check_picture_path(cli *run, const char *path, int width, int height, int channels);

/* The same for a picture of such channels; one of 16 bits that the format cannot hold gets a warning. */
int check_picture_fits(cli *run, const char *path, int width, int height, const txm_image *image);

/* Encode the picture for the output's extension and write it. */
int finish_with_picture(cli *run, const txm_image *image);

/* The output's path with another ending in place of its extension, announced as an output. An exit
   status. */
enum { MAX_PATH = CLI_MAX_PATH };
int path_beside(cli *run, const char *ending, char path[MAX_PATH]);

/* The path of a map's result: OUT-normal.png for bricks-normal.png, a map of the picture bricks.png. The
   ending stands before the extension; map NULL: the picture's own. An exit status. */
int path_of_map(cli *run, const char *map, const char *picture, const char *ending,
                char path[MAX_PATH]);

/* What follows the last '/'. */
const char *name_in(const char *path);

/* ---- JSON --------------------------------------------------------------------------------- */

/* tiles.json of a folder of 'texkit tiles'; for cJSON_Delete. An exit status. */
struct cJSON;
int read_tiles_json(cli *run, const char *folder, struct cJSON **json);

/* The whole number low..high of that name, or the item itself if name is NULL. 0: there is none. */
int json_int(const struct cJSON *from, const char *name, int low, int high, int *value);

#endif /* COMMAND_H */
