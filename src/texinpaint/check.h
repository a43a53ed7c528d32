#ifndef TEXINPAINT_CHECK_H
#define TEXINPAINT_CHECK_H

#include "config.h"

/* ---- check ---- */

#endif /* TEXINPAINT_CHECK_H */
