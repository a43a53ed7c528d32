#ifndef TEXINPAINT_BALLOT_H
#define TEXINPAINT_BALLOT_H

#include "config.h"

/* ---- ballot ---- */

#endif /* TEXINPAINT_BALLOT_H */
