/* command.c - what the commands of texkit share; command.h tells how it is used
   SPDX-License-Identifier: MIT OR Unlicense */
#include "command.h"
#include "image_io.h"

int fail_library(cli *run, txm_status status, const char *what) {
    if (status == TXM_CANCELLED) return cli_fail(run, CLI_FAILED, "stopped; nothing was written");
    if (status == TXM_OUT_OF_MEMORY)
        return cli_fail(run, CLI_FAILED, "'%s': out of memory; take a smaller size", what);
    return cli_fail(run, CLI_FAILED, "'%s': %s", what, run->env.message);
}

int read_image(cli *run, const char *path, int channels, txm_image *image) {
    const char *why;
    if (image_read(path, channels, image, &why)) return CLI_DONE;
    return cli_fail(run, CLI_FAILED, "cannot read '%s': %s", path, why);
}

int check_picture_path(cli *run, const char *path, int width, int height, int channels) {
    const char *why;
    char extension[8];
    file_extension(path, extension);
    if (image_can_write(extension, width, height, channels, &why)) return CLI_DONE;
    return cli_fail(run, CLI_USAGE, "cannot write '%s': %s", path, why);
}

int finish_with_picture(cli *run, const txm_image *image) {
    const char *why;
    char extension[8];
    unsigned char *bytes;
    size_t size;
    cli_stage(run, "encode");
    file_extension(run->output, extension);
    if (!image_encode(extension, image, &bytes, &size, &why))
        return cli_fail(run, CLI_FAILED, "cannot write '%s': %s", run->output, why);
    cli_figure(run, "file_bytes", (double)size);
    int status = cli_finish(run, bytes, size);
    free(bytes);
    return status;
}
