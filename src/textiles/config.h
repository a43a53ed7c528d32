#ifndef TEXTILES_CONFIG_H
#define TEXTILES_CONFIG_H

#include "../textiles.h"

/* ---- configuration ------------------------------------------------------------------ */

#if !defined(TEXTILES_NO_SIMD) && defined(__SSE2__)
#include <emmintrin.h>
#define TXT_SSE2 1
#if defined(__GNUC__)
#include <immintrin.h>
#define TXT_AVX2 1 /* compiled for AVX2 function by function, chosen when running */
#endif
#endif

#endif /* TEXTILES_CONFIG_H */
