#ifndef TEXMATH_CONFIG_H
#define TEXMATH_CONFIG_H

/* ---- configuration ------------------------------------------------------------------ */

#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define TEXMATH_VERSION "0.2.0"

/* what no input can make false: an error in the library */
#ifndef TXM_ASSERT
#include <assert.h>
#define TXM_ASSERT(x) assert(x)
#endif

#define TXM_PI 3.14159265358979323846

#endif /* TEXMATH_CONFIG_H */
