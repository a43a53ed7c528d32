#ifndef TEXINPAINT_CHOOSE_H
#define TEXINPAINT_CHOOSE_H

#include "config.h"

/* ---- choose ---- */

#endif /* TEXINPAINT_CHOOSE_H */
