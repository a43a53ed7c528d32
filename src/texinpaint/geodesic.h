#ifndef TEXINPAINT_GEODESIC_H
#define TEXINPAINT_GEODESIC_H

#include "config.h"

/* ---- geodesic ---- */

#endif /* TEXINPAINT_GEODESIC_H */
