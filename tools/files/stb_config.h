/* stb_config.h - the stb libraries with the formats that we read, and no others
   SPDX-License-Identifier: MIT OR Unlicense */
#ifndef STB_CONFIG_H
#define STB_CONFIG_H

#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_ONLY_BMP
#define STBI_ONLY_TGA
#define STBI_ONLY_PNM

#include <stb/stb_image.h>
#include <stb/stb_image_write.h>

/* public, but declared nowhere */
STBIWDEF unsigned char *stbi_zlib_compress(unsigned char *data, int data_len, int *out_len,
                                           int quality);

#endif /* STB_CONFIG_H */
