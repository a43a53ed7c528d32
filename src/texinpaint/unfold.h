#ifndef TEXINPAINT_UNFOLD_H
#define TEXINPAINT_UNFOLD_H

#include "config.h"

/* ---- unfold ---- */

#endif /* TEXINPAINT_UNFOLD_H */
