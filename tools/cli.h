/* cli.h - what every texkit command shares: options, messages, progress, timing, files
   SPDX-License-Identifier: MIT OR Unlicense

   Each command in commands/ is one function. It declares its options as a table, lets cli_begin
   read the command line into variables of its own, does its work with cli.env as the environment
   of the library, and passes the bytes of its output to one of the cli_finish functions.
   Everything that all commands must do alike - exit status, one-line messages, --stats, --threads,
   no input written over, no file left behind after a failure - is here and only here.          */
#ifndef CLI_H
#define CLI_H

#include "env.h"
#include "extent.h"

#define TEXKIT_VERSION "0.2.0"

/* "0.2.0 (texmath 0.2.0, ...)" for --version; defined by texkit.c, which includes the headers. */
extern const char cli_versions[];

/* Exit status of the program. */
enum { CLI_DONE = 0, CLI_FAILED = 1, CLI_USAGE = 2 };

enum { CLI_MAX_STAGES = 8, CLI_MAX_FIGURES = 32, CLI_MAX_LIST = 8, CLI_MAX_PATH = 4096 };

/* ---- options ---------------------------------------------------------------------------- */

typedef enum cli_kind {
    CLI_FLAG,   /* int *: 1 if given                                           */
    CLI_TEXT,   /* const char **                                               */
    CLI_INT,    /* int *, min..max                                             */
    CLI_SEED,   /* uint64_t *                                                  */
    CLI_EXTENT, /* int[2], width and height, written WxH, min..max each        */
    CLI_INPUT,  /* const char **, a file that is read                          */
    CLI_INPUTS, /* the same, several of them with commas between, see cli_take_name */
    CLI_GROUPS, /* the same, semicolons between such lists                     */
    CLI_TILES,  /* const char **, a folder of 'texkit tiles' that is read      */
    CLI_OUTPUT, /* const char **, a file that is written                       */
    CLI_END     /* closes the table                                            */
} cli_kind;

typedef struct cli_option {
    cli_kind kind;
    const char *name;  /* "--size"                                          */
    const char *value; /* the name of its value in the help, or NULL        */
    const char *help;  /* one line                                          */
    void *target;      /* written only if the option is given               */
    int min, max;
} cli_option;

/* The manual of a command; --help prints it with the table of options. */
typedef struct cli_manual {
    const char *name;    /* "synth"                                         */
    const char *usage;   /* "EXEMPLAR|MODEL.txs -o OUT --size WxH"          */
    const char *summary; /* one line, also in the list of commands          */
    const char *details; /* lines of at most 100 columns, each ending in \n   */
    const char *example; /* the same                                        */
    int inputs;          /* how many input files it takes                   */
    const char *input;   /* what the first is called in messages; NULL: they may be left out */
    int makes_folder;    /* the output is a folder of files                 */
    const char *smaller; /* what to do if memory runs out                   */
    const char *stream;  /* the extension of what -o - writes; NULL: .png   */
} cli_manual;

/* ---- one run of one command --------------------------------------------------------------- */

typedef struct cli {
    const cli_manual *manual;

    /* from the command line */
    const char *inputs[4];
    const char *output; /* for -o - and -o png:- a name such as "-.png" */
    int to_stdout;
    const char *stats; /* NULL: none wanted */
    uint64_t seed;
    int threads, quiet, no_bar;

    int max_side; /* pixels: longer pictures are refused unread; 0: the readers' own limit. A
                     command sets it before it reads */
    txm_env env; /* for the calls into the library */

    /* the rest belongs to cli.c, progress.c and stats.c */
    char stream_name[16];
    double started, stage_started, shown;
    struct {
        const char *name;
        double seconds;
    } stages[CLI_MAX_STAGES];
    struct {
        const char *name;
        double values[CLI_MAX_LIST];
        int count; /* 0: a single number; else a list of so many */
    } figures[CLI_MAX_FIGURES];
    int stage_count, stage, figure_count, bar_is_on; /* stage: the number of the present one */
    env_memory memory;
} cli;

/* Read the arguments after the command's name and announce the files that they name. 0: continue;
   otherwise *status is the exit status, and any message or help has been printed. */
int cli_begin(cli *run, const cli_manual *manual, const cli_option *options, int argc, char **argv,
              int *status);

/* Say in one line on stderr what failed and how to correct it; returns status. */
int cli_fail(cli *run, int status, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 4)))
#endif
    ;

/* Say in one line on stderr what the user may want to know, though the work goes on; not with
   --quiet. */
void cli_warn(cli *run, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 2, 3)))
#endif
    ;

/* Time from here on counts for this stage (a string literal), which may have been one before. */
void cli_stage(cli *run, const char *name);

/* A figure of the result for --stats (name: a string literal). */
void cli_figure(cli *run, const char *name, double value);

/* The same for a list of 1 to CLI_MAX_LIST numbers. */
void cli_figures(cli *run, const char *name, const int *values, int count);

/* Seconds since the command began. */
double cli_seconds(const cli *run);

/* ---- the files of a run: outputs.c --------------------------------------------------------

   No input may be written over, and no two outputs may be the same file, through whatever links.
   So every file is announced before any work. cli_begin does this for the inputs, -o, --stats and
   the options of kinds CLI_INPUT to CLI_OUTPUT; a command does it for the names that it derives
   from these. cli_finish and its like accept only outputs that were announced.

   As an input, "-" is standard input, for one file of a run (file_read knows it); as -o or --stats,
   standard output. What commands print on it is then discarded.                                */

/* This file will be read. An exit status. */
int cli_reads(cli *run, const char *path);

/* This file will be written; fails if it is one of the others or cannot be written. */
int cli_writes(cli *run, const char *path);

/* The same for a file in the output folder, which need not exist yet. */
int cli_writes_inside(cli *run, const char *name);

/* Copy the first name of a list and move *list to the next one, or to NULL after the last; a separator
   stands before *list then. One behind a backslash belongs to the name, and so does one between parts
   that together, but not alone, name a file. 0: the name is empty or too long. (names.c) */
int cli_take_name(const char **list, const char *separators, char name[CLI_MAX_PATH]);

/* Write the output and the statistics, both or neither; returns the exit status. */
int cli_finish(cli *run, const void *bytes, size_t size);

/* The same for several files: all or none. */
typedef struct cli_file {
    const char *name; /* its path; for cli_finish_folder, its name in the output folder */
    const void *bytes;
    size_t size;
    const file_extent *extents; /* instead of bytes: NULL, or extent_count of them, size bytes in all */
    int extent_count;
} cli_file;
int cli_finish_files(cli *run, const cli_file *files, int count);

/* The same for files in the output folder, which is made if it does not exist. */
int cli_finish_folder(cli *run, const cli_file *files, int count);

/* Before any work: can files be written to this folder, or can it be made? An exit status. */
int cli_checks_folder(cli *run, const char *path);

/* Make a folder unless it exists; *made tells whether it is new. An exit status. */
int cli_makes_folder(cli *run, const char *path, int *made);

/* Remove an empty folder. */
void cli_removes_folder(const char *path);

/* Has this very path been announced as an output? */
int cli_is_output(const char *path);

/* ---- between cli.c, progress.c, stats.c, stop.c and outputs.c -------------------------------- */

/* Announce the files that the command line names. */
int cli_announce(cli *run, const cli_option *own, const cli_option *common);

/* From here on SIGINT, SIGTERM and SIGHUP end the program with a message and status 1, within
   milliseconds, after cli_remove_unfinished; but while they are on hold, only when they are released. */
void cli_stop_by_signals(const cli *run);
void cli_stop_hold(void);
void cli_stop_release(void);

/* Remove what an output is not yet: temporary files, a new folder. Signal handlers may call it. */
void cli_remove_unfinished(void);

/* The environment of the library's calls: memory, threads, the progress bar. */
void cli_make_env(cli *run);

/* Remove the progress bar, if there is one. */
enum { CLI_BAR_COLUMNS = 60 };
void cli_clear_bar(cli *run);

/* Seconds on a clock that never goes back. */
double cli_now(void);

/* Stop the clock and remove the progress bar; with --stats, their text. Returns its size. */
size_t cli_end(cli *run, char *text, size_t capacity);

#endif /* CLI_H */
