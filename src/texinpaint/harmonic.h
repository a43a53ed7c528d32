#ifndef TEXINPAINT_HARMONIC_H
#define TEXINPAINT_HARMONIC_H

#include "config.h"

/* ---- harmonic ---- */

#endif /* TEXINPAINT_HARMONIC_H */
