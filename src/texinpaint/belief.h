#ifndef TEXINPAINT_BELIEF_H
#define TEXINPAINT_BELIEF_H

#include "config.h"

/* ---- belief ---- */

#endif /* TEXINPAINT_BELIEF_H */
