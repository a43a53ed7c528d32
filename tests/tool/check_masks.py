#!/usr/bin/python3
"""check_masks.py WHAT FILES... - do masked pixels stay out of what texkit makes?

    draw FOLDER     object.png: a red disc on gray noise, as large as the disc of any mask; the masks of
                    all but the disc: hard.png, soft.png (antialiased), noise.png (as JPEG leaves it),
                    alpha.png (white paint, erased), deep.png (soft, 16 bits), part.png (red paint); hole-*.png:
                    of the disc alone
    red FILE...     no pixel of these is red
    flat FILE BITS  a normal map that is flat in every pixel
    bits FILE BITS  so many bits a sample, and with 16, samples that 8 bits do not have
"""
import os
import random
import struct
import sys
import zlib

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
from png import Png, Wrong, need  # noqa: E402

SIDE, X, Y, RADIUS = 128, 95.3, 98.6, 22.4


def write(path, channels, bits, samples):
    """samples: those of all pixels, row after row"""
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    head = struct.pack(">IIBBBBB", SIDE, SIDE, bits, kind, 0, 0, 0)
    n = SIDE * channels
    raw = b"".join(b"\0" + struct.pack(">%d%s" % (n, "BH"[bits // 16]), *samples[y * n:y * n + n])
                   for y in range(SIDE))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n")
        for name, data in ((b"IHDR", head), (b"IDAT", zlib.compress(raw)), (b"IEND", b"")):
            f.write(struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)))


def covered(i):
    """how much of a pixel lies in the disc, in sixteenths"""
    x, y = i % SIDE, i // SIDE
    return sum((x + (k % 4 + .5) / 4 - X) ** 2 + (y + (k // 4 + .5) / 4 - Y) ** 2 < RADIUS ** 2
               for k in range(16))


def draw(folder):
    noise = random.Random(3)
    disc = [covered(i) for i in range(SIDE * SIDE)]
    red = [c > 0 for c in disc]  # the object shows in every pixel that it touches
    gray = [noise.randrange(70, 160) for _ in disc]
    flat = [s for _ in disc for s in (128, 128, 255)]
    at = lambda name: os.path.join(folder, name)  # noqa: E731
    write(at("object.png"), 3, 8, [s for r, g in zip(red, gray) for s in ((230, 10, 20) if r else (g, g, g))])
    write(at("hard.png"), 1, 8, [0 if r else 255 for r in red])
    write(at("soft.png"), 1, 8, [255 - c * 255 // 16 for c in disc])
    write(at("noise.png"), 1, 8, [abs((0 if r else 255) - noise.randrange(40)) for r in red])
    write(at("alpha.png"), 4, 8, [s for r in red for s in (255, 255, 255, 0 if r else 255)])
    write(at("deep.png"), 1, 16, [65535 - c * 65535 // 16 for c in disc])
    write(at("part.png"), 3, 8, [s for r in red for s in ((255, 0, 0) if r else (255, 255, 255))])
    write(at("hole-hard.png"), 1, 8, [255 if r else 0 for r in red])
    write(at("hole-soft.png"), 1, 8, [c * 255 // 16 for c in disc])
    write(at("hole-alpha.png"), 2, 8, [s for r in red for s in (255, 255 if r else 0)])
    write(at("hole-deep.png"), 1, 16, [c * 65535 // 16 for c in disc])
    write(at("hole-most.png"), 1, 8, [0 if i % SIDE < 9 else 255 for i in range(SIDE * SIDE)])
    write(at("white.png"), 1, 8, [255] * len(disc))
    write(at("black.png"), 1, 8, [30] * len(disc))
    write(at("flat.png"), 3, 8, flat)
    write(at("flat16.png"), 3, 16, [s for _ in disc for s in (32768, 32768, 65535)])
    write(at("height.png"), 1, 16, [257 * g + noise.randrange(256) for g in gray])


def samples(path):
    p = Png(path)
    return p, [struct.unpack(">%d%s" % (p.width * p.channels, "BH"[p.bits // 16]), row) for row in p.lines]


def red(*files):
    for path in files:
        p, rows = samples(path)
        count = sum(row[i] - row[i + 1] > 40 for row in rows for i in range(0, len(row), p.channels))
        need(count == 0, path, "has", count, "pixels of the object")


def flat(path, bits):
    p, rows = samples(path)
    need(p.bits == int(bits), path, "has", p.bits, "bits")
    want = (128, 128, 255) if p.bits == 8 else (32768, 32768, 65535)
    found = {row[i:i + 3] for row in rows for i in range(0, len(row), p.channels)}
    need(found == {want}, path, "has", sorted(found)[:4])


def bits(path, count):
    p, rows = samples(path)
    need(p.bits == int(count), path, "has", p.bits, "bits")
    if p.bits == 16:
        fine = sum(s % 257 != 0 for row in rows for s in row)
        need(fine > p.width * p.height / 2, path, "is 8 bits widened:", fine, "finer samples")


if __name__ == "__main__":
    try:
        {"draw": draw, "red": red, "flat": flat, "bits": bits}[sys.argv[1]](*sys.argv[2:])
    except Wrong as wrong:
        sys.exit("check_masks: %s" % wrong)
