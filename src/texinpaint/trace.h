#ifndef TEXINPAINT_TRACE_H
#define TEXINPAINT_TRACE_H

#include "config.h"

/* ---- trace ---- */

#endif /* TEXINPAINT_TRACE_H */
