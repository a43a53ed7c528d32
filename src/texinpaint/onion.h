#ifndef TEXINPAINT_ONION_H
#define TEXINPAINT_ONION_H

#include "config.h"

/* ---- onion ---- */

#endif /* TEXINPAINT_ONION_H */
