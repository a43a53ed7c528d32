#ifndef TEXINPAINT_CREST_H
#define TEXINPAINT_CREST_H

#include "config.h"

/* ---- crest ---- */

#endif /* TEXINPAINT_CREST_H */
