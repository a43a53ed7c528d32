#ifndef TEXINPAINT_FILL_H
#define TEXINPAINT_FILL_H

#include "config.h"

/* ---- fill ---- */

#endif /* TEXINPAINT_FILL_H */
