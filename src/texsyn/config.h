#ifndef TEXSYN_CONFIG_H
#define TEXSYN_CONFIG_H

#include "../texsyn.h"

/* ---- configuration ------------------------------------------------------------------ */

#if !defined(TEXSYN_NO_SIMD) && defined(__SSE2__)
#include <emmintrin.h>
#define TXS_SSE2 1
#if defined(__GNUC__)
#include <immintrin.h>
#define TXS_AVX2 1 /* compiled for AVX2 function by function, chosen when running */
#ifdef __x86_64__
#define TXS_LANES 1 /* an address is as long as a lane */
#endif
#endif
#endif

#ifndef TEXSYN_ASSERT
#include <assert.h>
#define TEXSYN_ASSERT(x) assert(x)
#endif

/* ---- constants -------------------------------------------------------------------------- */

enum {
    TXS_MAX_BANDS = 4,
    TXS_MAX_LEVELS = 6,
    TXS_VALUES = 32,      /* gray levels of a band; fewer are clearly worse, the rows of the
                             sampler are as wide                                              */
    TXS_CLASSES = 9,      /* of a value or a difference in the kinds that take two            */
    TXS_DIFFERENCES = 63, /* -31..31                                                          */
    TXS_BINS = TXS_CLASSES * TXS_CLASSES, /* of the largest histogram                         */
    TXS_ONE = 65536,    /* sum of a normalised histogram                                    */
    TXS_MAX_TYPES = 96, /* clique types of one level                                        */
    TXS_MAX_ENDS = 160, /* ends of cliques at one pixel of one band                         */
    TXS_MAX_MEMBERS = 18, /* pixels of a clique                                             */
    TXS_LABELS = 9,     /* of a pixel by what its surroundings look like on the level above */
    TXS_LABEL_REACH = 2,   /* pixels: of what a label looks at                              */
    TXS_MAX_GRADIENT = 30752, /* the largest squared gradient: 2 (4 times 31)^2             */
    TXS_RESPONSES = 27, /* classes of a filter's response                                   */
    TXS_MAX_RESPONSE = 279, /* 9 pixels against 9                                           */
    TXS_MAX_FILTERS = 12, /* clique types that are filters, of one level                    */
    TXS_MAX_REACH = 60, /* pixels                                                           */
    TXS_NEAR = 10,      /* pixels: reach of all levels but the coarsest                     */
    TXS_ROW_BITS = 6,   /* their binary logarithm                                           */
    TXS_ROW = 1 << TXS_ROW_BITS, /* bytes of a table row for a difference                   */
    TXS_VALUE_BITS = 5, /* the logarithm of TXS_VALUES                                      */
    TXS_TABLE = (2 * TXS_CLASSES + TXS_DIFFERENCES) * TXS_ROW, /* bytes of one type's tables  */
    TXS_RESPONSE_ROW = 2 * (TXS_MAX_RESPONSE + TXS_VALUES) - 1, /* bytes of a filter's table,
                            of which there is one for each weight                           */
    TXS_ZERO = 64,       /* the byte in a row that stands for no energy                      */
    TXS_NAT = 16,        /* steps of a row's byte per nat of energy                          */
    TXS_FINE = 4,        /* steps of the summed energy per step of a byte                    */
    TXS_NEVER = 1600,    /* such steps: the energy of a value that a band lacks              */
    TXS_PRECISE = 256,   /* steps of a controlled potential per step of a byte               */
    TXS_NOISE = 8192,    /* entries of the noise table                                       */
    TXS_WINDOW = 64,     /* weight of one count in the running histograms                    */
    TXS_TASKS = 16,      /* shares of a pass, whatever the number of threads                 */
    TXS_SAMPLES = 24576, /* pixels counted per sweep: as many as matter                      */
    TXS_GRID = 8,        /* sub-lattices a side                                              */
    TXS_TOGETHER = 8,    /* pixels drawn together                                            */
    TXS_GROUP = 2,       /* sub-lattices between two looks at the histograms                 */
    TXS_PROPORTIONAL = 150, /* gains of the control, nats per unit of histogram error; see   */
    TXS_INTEGRAL = 40,      /* docs/choices.md                                               */
    TXS_TYPES = 24,      /* added per level unless the caller says otherwise                 */
    TXS_TYPES_GRAY = 36, /* if there is only one band                                       */
    TXS_TYPES_CUTOUT = 36, /* if some colours are hidden: shapes and colours take their share */
    TXS_COARSE = 8,      /* 1/TXS_NAT nat: steps of a stored potential; the control refines  */
    TXS_STEEPEST = 20,   /* such steps: the largest stored potential                         */
    TXS_UNSEEN = 1,      /* such steps: the potential of a bin that has none stored          */
    TXS_RARE = 3,        /* the smallest root whose bin has a stored potential               */
    TXS_SMALLEST = 64    /* pixels: a narrower canvas has no statistics to speak of          */
};

/* Learning. Ours, by the medians of several measures over the stochastic exemplars: the kinds of
   three and four pixels describe shapes and are preferred. */
#define TXS_THRESHOLD 0.005f   /* smallest distance of histograms that is worth a clique type    */
#define TXS_NOISE_SHARE 0.75f  /* the same in units of the expected sampling noise               */
#define TXS_CORNER_WEIGHT 2.0f /* of distances, pairs having 1                                   */
#define TXS_EDGE_WEIGHT 2.5f
#define TXS_CONTOUR_WEIGHT 2.5f /* filters and labels */

/* classes of a difference -31..31: fine where differences are frequent */
static const uint8_t txs_difference_class[TXS_DIFFERENCES + 1] = {
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 4,
    5, 5, 6, 6, 6, 7, 7, 7, 7, 7, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8, 8};

#endif /* TEXSYN_CONFIG_H */
