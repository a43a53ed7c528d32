#ifndef TEXINPAINT_VOTE_H
#define TEXINPAINT_VOTE_H

#include "config.h"

/* ---- vote ---- */

#endif /* TEXINPAINT_VOTE_H */
