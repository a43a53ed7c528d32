#ifndef TEXINPAINT_JOIN_H
#define TEXINPAINT_JOIN_H

#include "config.h"

/* ---- join ---- */

#endif /* TEXINPAINT_JOIN_H */
