/* stb_config.h - the stb libraries with the formats that the examples read, and no others
   SPDX-License-Identifier: MIT OR Unlicense

   The tool writes TGA and BMP by them; image_io.h reads all pictures.                           */
#ifndef STB_CONFIG_H
#define STB_CONFIG_H

#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_BMP
#define STBI_ONLY_TGA
#define STBI_ONLY_PNM

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>

#endif /* STB_CONFIG_H */
