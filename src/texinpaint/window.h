#ifndef TEXINPAINT_WINDOW_H
#define TEXINPAINT_WINDOW_H

#include "config.h"

/* ---- window ---- */

#endif /* TEXINPAINT_WINDOW_H */
