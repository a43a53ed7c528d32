/* even.c - evens the light of an exemplar; command.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"

#include <stdio.h>

int check_even(cli *run, int radius) {
    if (radius == EVEN_AUTO || radius == 0 || radius >= (int)TXM_EVEN_LEAST) return CLI_DONE;
    return cli_fail(run, CLI_USAGE, "--even %d: give %d or more pixels, or 0 to leave the light "
                    "as it is", radius, (int)TXM_EVEN_LEAST);
}

/* Half the smaller side, but no less than what is allowed. */
static int radius_for(const txm_image *image) {
    const int half = (image->width < image->height ? image->width : image->height) / 2;
    return half < (int)TXM_EVEN_LEAST ? (int)TXM_EVEN_LEAST : half;
}

int even_picture(cli *run, const char *path, int radius, const txm_image *mask, txm_image *image,
                 int *used) {
    txm_even_desc desc;
    float stops = 0;
    txm_status result = TXM_OK;
    memset(&desc, 0, sizeof desc);
    desc.image = *image;
    if (mask) desc.mask = *mask;
    *used = radius;
    if (radius == EVEN_AUTO) {
        result = txm_uneven(&desc, &run->env, &stops);
        if (result != TXM_OK) return check_result(run, result, path);
        *used = stops > 0 ? radius_for(image) : 0;
        if (stops > 0)
            cli_warn(run, "'%s': the light is uneven by %.1f stops, which would show as patches; "
                     "evened out as with --even %d, --even 0 leaves it as it is", path,
                     (double)stops, *used);
    }
    if (*used == 0) return CLI_DONE;
    desc.radius = (float)*used;
    return check_result(run, txm_even(&desc, &run->env, image), path);
}
