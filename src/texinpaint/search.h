#ifndef TEXINPAINT_SEARCH_H
#define TEXINPAINT_SEARCH_H

#include "config.h"

/* ---- search ---- */

#endif /* TEXINPAINT_SEARCH_H */
