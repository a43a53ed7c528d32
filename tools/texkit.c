/* texkit.c - the texkit headers on the command line
   SPDX-License-Identifier: MIT OR Unlicense

   The table below lists the commands, which are in commands/. What they share is in cli.c,
   outputs.c, env.c and command.c; files/ reads and writes pictures and meshes; modules/ compiles
   the implementations. To see how a header is embedded, start with run_learn in
   commands/clique.c.                                                                           */
#include "command.h"

#include "texedges.h"
#include "texinpaint.h"
#include "texpatch.h"
#include "texsyn.h"
#include "textiles.h"
#include "treepieces.h"
#include "trimesh_cover.h"
#include "trimesh_relax.h"

#include <stdio.h>

const char cli_versions[] =
    TEXKIT_VERSION " (texmath " TEXMATH_VERSION ", texsyn " TEXSYN_VERSION
                   ", texpatch " TEXPATCH_VERSION ", texedges " TEXEDGES_VERSION
                   ", textiles " TEXTILES_VERSION ", trimesh_relax " TRIMESH_RELAX_VERSION
                   ", trimesh_cover " TRIMESH_COVER_VERSION ", texinpaint " TEXINPAINT_VERSION
                   ", treepieces " TREEPIECES_VERSION ")";

/* ---- the table of commands ---------------------------------------------------------------- */

static const command *const commands[] = {
    &learn_command,     &synth_command,   &fill_command,  &knit_command,    &segment_command,
    &composite_command, &relight_command, &erode_command,   &straighten_command, &patch_command,
    &edges_command,     &tiles_command,   &retile_command,  &inpaint_command,    &tree_command,
    &forest_command};

enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

static int print_overview(void) {
    printf("texkit COMMAND [INPUT...] [options]\n\nCommands:\n");
    for (int i = 0; i < COMMAND_COUNT; i++)
        printf("  %-11s %s\n", commands[i]->manual->name, commands[i]->manual->summary);
    printf("\n'texkit help COMMAND', or 'texkit COMMAND --help', shows the options of one; 'texkit version'\n"
           "the versions of tool and headers. As a picture, model or mesh, - is standard input; -o - is\n"
           "standard output, -o jpg:- in that format; --stats - goes there too. A comma in a file's name is\n"
           "written \\, in lists. Ctrl-C ends the work and leaves no file behind. Exit status: 0 done, 1 the\n"
           "work failed or was stopped, 2 the command line was wrong.\n\nExample:\n%s",
           synth_command.manual->example);
    return fflush(stdout) == 0 ? CLI_DONE : CLI_FAILED;
}

static int print_versions(void) {
    printf("texkit %s\n", cli_versions);
    return fflush(stdout) == 0 ? CLI_DONE : CLI_FAILED;
}

static const command *find_command(const char *name) {
    for (int i = 0; i < COMMAND_COUNT; i++)
        if (!strcmp(name, commands[i]->manual->name)) return commands[i];
    fprintf(stderr, "texkit: unknown command '%.60s'; see 'texkit help'\n", name);
    return NULL;
}

/* "texkit help", "texkit help COMMAND" */
static int help(int argc, char **argv) {
    char option[] = "--help", *only[] = {option};
    const command *c;
    if (argc == 0) return print_overview();
    if (argc > 1) {
        fprintf(stderr, "texkit help: unexpected argument '%.60s'; name one command\n", argv[1]);
        return CLI_USAGE;
    }
    c = find_command(argv[0]);
    return c ? c->run(1, only) : CLI_USAGE;
}

int main(int argc, char **argv) {
    env_let_threads_sleep(argv);
    if (argc < 2 || !strcmp(argv[1], "--help") || !strcmp(argv[1], "-h")) return print_overview();
    if (!strcmp(argv[1], "--version") || !strcmp(argv[1], "version")) return print_versions();
    if (!strcmp(argv[1], "help")) return help(argc - 2, argv + 2);
    const command *c = find_command(argv[1]);
    return c ? c->run(argc - 2, argv + 2) : CLI_USAGE;
}
