#!/usr/bin/python3
"""check_even.py WHAT FILES... - is the light of a picture as even as it should be?

    draw FOLDER          fair.png, lit evenly, and lit.png, the same with light that falls off to a side,
                         in 8 bits; lit-deep.png in 16 bits; lit-height.png, -normal.png, -gloss.png: a
                         gray map, a normal map and one of colors; mask.png leaves a red object out of
                         object.png
    slow PICTURE L M     the strongest of its slow waves, up to three along a side, is L to M levels of 255
    deep PICTURE         it has 16 bits, and more values than 8 bits have
    red PICTURE MOST     so many pixels are red
"""
import cmath
import os
import struct
import sys
import zlib

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
from png import Png, Wrong, need  # noqa: E402

SIDE = 96


def read(path):
    """Rows of tuples of 0..255."""
    png = Png(path)
    scale = 255 / (2 ** png.bits - 1)
    rows = []
    for line in png.lines:
        values = struct.unpack(">%d%s" % (png.width * png.channels, "BH"[png.bits // 16]), line)
        rows.append([[v * scale for v in values[i:i + png.channels]]
                     for i in range(0, len(values), png.channels)])
    return rows


def write(path, channels, bits, pixel):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    most, raw = 2 ** bits - 1, b""
    for y in range(SIDE):
        raw += b"\0"
        for x in range(SIDE):
            values = [min(max(int(v * most + 0.5), 0), most) for v in pixel(x, y)]
            raw += struct.pack(">%d%s" % (channels, "BH"[bits // 16]), *values)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(
            ">IIBBBBB", SIDE, SIDE, bits, {1: 0, 3: 2}[channels], 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def draw(folder):
    def grain(x, y, which):
        value = (x * 73856093 ^ y * 19349663 ^ which * 83492791) * 2654435761
        return (value >> 13) % 1024 / 1023

    def code(light):
        return 12.92 * light if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055

    def fair(x, y):
        return [0.1 + 0.2 * grain(x // 2, y // 2, 1) + 0.02 * grain(x, y, c) for c in range(3)]

    def fall(x):
        return 0.4 + 1.2 * x / SIDE

    def lit(x, y):
        return [code(v * fall(x)) for v in fair(x, y)]

    def is_object(x, y):
        return (x - 30) ** 2 + (y - 40) ** 2 < 250

    def path(name):
        return os.path.join(folder, name)

    write(path("fair.png"), 3, 8, lambda x, y: [code(v) for v in fair(x, y)])
    write(path("lit.png"), 3, 8, lit)
    write(path("lit-deep.png"), 3, 16, lit)
    write(path("lit-gloss.png"), 3, 8, lit)
    write(path("lit-height.png"), 1, 8, lambda x, y: [0.2 + 0.6 * x / SIDE])
    write(path("lit-normal.png"), 3, 8, lambda x, y: [0.35 + 0.3 * x / SIDE, 0.5, 0.97])
    write(path("object.png"), 3, 8, lambda x, y: [1, 0, 0] if is_object(x, y) else lit(x, y))
    write(path("mask.png"), 1, 8, lambda x, y: [0 if is_object(x, y) else 1])


def check_slow(path, least, most):
    rows = read(path)
    high, wide = len(rows), len(rows[0])
    gray = [[sum(p[:3]) / len(p[:3]) for p in row] for row in rows]
    strongest = 0
    for v in range(-3, 4):
        for u in range(0, 4):
            if not 0 < u * u + v * v <= 9:
                continue
            along = [cmath.exp(-2j * cmath.pi * u * x / wide) for x in range(wide)]
            total = sum(cmath.exp(-2j * cmath.pi * v * y / high) * sum(map(lambda a, b: a * b, row, along))
                        for y, row in enumerate(gray))
            strongest = max(strongest, 2 * abs(total) / (wide * high))
    need(float(least) <= strongest <= float(most), path, "has a slow wave of", strongest, "levels")


def check_deep(path):
    png = Png(path)
    need(png.bits == 16, path, "has", png.bits, "bits")
    values = {v for line in png.lines for v in struct.unpack(">%dH" % (len(line) // 2), line)}
    need(len(values) > 300, path, "has", len(values), "values")


def check_red(path, most):
    count = sum(p[0] > p[1] + 60 for row in read(path) for p in row)
    need(count <= int(most), path, "has", count, "red pixels")


def main():
    try:
        if sys.argv[1] == "draw":
            draw(sys.argv[2])
        else:
            globals()["check_" + sys.argv[1]](*sys.argv[2:])
    except Wrong as wrong:
        sys.exit("%s" % wrong)


main()
