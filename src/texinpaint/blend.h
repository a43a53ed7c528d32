#ifndef TEXINPAINT_BLEND_H
#define TEXINPAINT_BLEND_H

#include "config.h"

/* ---- blend ---- */

#endif /* TEXINPAINT_BLEND_H */
