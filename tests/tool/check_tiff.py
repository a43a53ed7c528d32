#!/usr/bin/python3
"""check_tiff.py PICTURE.tif PICTURE.ppm - does the BigTIFF of examples/join.c hold the same samples?"""
import struct
import sys

SIZES = {3: 2, 4: 4, 16: 8}


def tiff(path):
    with open(path, "rb") as file:
        data = file.read()
    order, version, offset_bytes, zero, directory = struct.unpack(">2sHHHQ", data[:16])
    assert (order, version, offset_bytes, zero) == (b"MM", 43, 8, 0), "not a BigTIFF, high byte first"
    tags = {}
    count, = struct.unpack_from(">Q", data, directory)
    for i in range(count):
        at = directory + 8 + 20 * i
        tag, kind, n = struct.unpack_from(">HHQ", data, at)
        place = at + 12
        if SIZES[kind] * n > 8:
            place, = struct.unpack_from(">Q", data, place)
        assert not tags or tag > max(tags), "tags rise"
        tags[tag] = struct.unpack_from(">%d%s" % (n, {3: "H", 4: "I", 16: "Q"}[kind]), data, place)
    (width,), (height,), bits, (channels,) = tags[256], tags[257], tags[258], tags[277]
    assert tags[259] == (1,) and tags[284] == (1,)
    assert len(bits) == channels and len(set(bits)) == 1
    (tile_width,), (tile_height,), size = tags[322], tags[323], bits[0] // 8
    across = -(-width // tile_width)
    assert len(tags[324]) == len(tags[325]) == across * -(-height // tile_height)
    rows = [bytearray(width * channels * size) for _ in range(height)]
    for k, (place, length) in enumerate(zip(tags[324], tags[325])):
        texel = channels * size
        assert length == tile_width * tile_height * texel and place + length <= len(data)
        left = k % across * tile_width
        used = min(tile_width, width - left)
        for y in range(min(tile_height, height - k // across * tile_height)):
            at = place + y * tile_width * texel
            rows[k // across * tile_height + y][left * texel:(left + used) * texel] = \
                data[at:at + used * texel]
    return width, height, channels, size, b"".join(rows)


def pnm(path):
    with open(path, "rb") as file:
        kind, size, maximum = (file.readline() for _ in range(3))
        width, height = map(int, size.split())
        return (width, height, {b"P5": 1, b"P6": 3}[kind.strip()], 1 if int(maximum) == 255 else 2,
                file.read())


assert tiff(sys.argv[1]) == pnm(sys.argv[2]), "other samples"
