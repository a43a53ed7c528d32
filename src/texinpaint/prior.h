#ifndef TEXINPAINT_PRIOR_H
#define TEXINPAINT_PRIOR_H

#include "crest.h"

/* ---- prior ---- */

#endif /* TEXINPAINT_PRIOR_H */
