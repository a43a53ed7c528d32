/* stb.c - the two stb libraries, compiled here once
   SPDX-License-Identifier: MIT OR Unlicense */
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include "stb_config.h"
