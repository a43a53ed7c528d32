#ifndef TEXINPAINT_STRIP_H
#define TEXINPAINT_STRIP_H

#include "config.h"

/* ---- strip ---- */

#endif /* TEXINPAINT_STRIP_H */
