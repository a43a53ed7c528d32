#ifndef TEXINPAINT_JOB_H
#define TEXINPAINT_JOB_H

#include "config.h"

/* ---- job ---- */

#endif /* TEXINPAINT_JOB_H */
