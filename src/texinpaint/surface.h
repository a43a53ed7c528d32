#ifndef TEXINPAINT_SURFACE_H
#define TEXINPAINT_SURFACE_H

#include "config.h"

/* ---- surface ---- */

#endif /* TEXINPAINT_SURFACE_H */
