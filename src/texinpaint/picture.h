#ifndef TEXINPAINT_PICTURE_H
#define TEXINPAINT_PICTURE_H

#include "config.h"

/* ---- picture ---- */

#endif /* TEXINPAINT_PICTURE_H */
