#!/usr/bin/python3
"""check_inpaint.py WHAT FILES... - do pictures of texkit inpaint hold what they should?

    kept HOLE MASK OUT [LEAST] where MASK is black OUT is HOLE, elsewhere it differs in a share of LEAST (0.9)
    near WHOLE MASK OUT MOST   where MASK is white OUT differs from WHOLE by so much (0..255), on average
    within MASK OUT LOW HIGH   where MASK is white the samples of OUT are LOW..HIGH
    mask KIND SIDE FILE        write a mask: "disc" of a third of the width, "all", "none", "alpha" (the disc in
                               alpha, RGBA), "edge" (a disc around the left border)
    picture KIND SIDE FILE     write a picture with a plain disc: "bars", "deep" (16 bits), "alpha", "normal",
                               "labels"
    unit FILE                  a normal map of unit vectors
    labels PICTURE OUT         OUT has no other values than PICTURE
"""
import os
import struct
import sys
import zlib

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
from png import Png, Wrong, need  # noqa: E402


def read(path):
    """rows of pixels, tuples of samples"""
    p = Png(path)
    rows = []
    for line in p.lines:
        v = struct.unpack(">%d%s" % (p.width * p.channels, "BH"[p.bits // 16]), line)
        rows.append([v[i:i + p.channels] for i in range(0, len(v), p.channels)])
    return p, rows


def write(path, rows, bits=8):
    channels = len(rows[0][0])
    raw = b"".join(b"\0" + b"".join(struct.pack(">%d%s" % (channels, "BH"[bits // 16]), *p)
                                    for p in row) for row in rows)
    head = struct.pack(">IIBBBBB", len(rows[0]), len(rows), bits, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for name, data in ((b"IHDR", head), (b"IDAT", zlib.compress(raw)), (b"IEND", b"")):
            file.write(struct.pack(">I", len(data)) + name + data +
                       struct.pack(">I", zlib.crc32(name + data)))


def kept(hole, mask, out, least=0.9):
    (a, h), (_, m), (b, o) = read(hole), read(mask), read(out)
    need((a.width, a.height, a.channels, a.bits) == (b.width, b.height, b.channels, b.bits),
         out, "has another form")
    missing = changed = 0
    for y in range(a.height):
        for x in range(a.width):
            if m[y][x][0] < 128:
                need(h[y][x] == o[y][x], "changed at", x, y)
            else:
                missing += 1
                changed += h[y][x] != o[y][x]
    need(changed >= float(least) * missing, "of", missing, "missing pixels only", changed, "were written")


def near(whole, mask, out, most):
    (a, w), (_, m), (_, o) = read(whole), read(mask), read(out)
    d = [abs(p - q) for y in range(a.height) for x in range(a.width) if m[y][x][0] >= 128
         for p, q in zip(w[y][x], o[y][x])]
    mean = sum(d) / len(d) * 255 / (2 ** a.bits - 1)
    need(mean <= float(most), "differs by", mean)


def within(mask, out, low, high):
    (a, o), (_, m) = read(out), read(mask)
    v = [s for y in range(a.height) for x in range(a.width) if m[y][x][0] >= 128 for s in o[y][x]]
    need(float(low) <= min(v) and max(v) <= float(high), "samples", min(v), "to", max(v))


def mask(kind, side, path):
    n = int(side)

    def inside(x, y):
        if kind in ("all", "none"):
            return kind == "all"
        cx = 0 if kind == "edge" else n / 2
        return (x + .5 - cx) ** 2 + (y + .5 - n / 2) ** 2 < (n / 6) ** 2
    if kind == "alpha":
        write(path, [[(255, 255, 255, 255 if inside(x, y) else 0) for x in range(n)] for y in range(n)])
    else:
        write(path, [[(255 if inside(x, y) else 0,) for x in range(n)] for y in range(n)])


def picture(kind, side, path):
    n = int(side)
    rows, bits = [], 16 if kind == "deep" else 8
    for y in range(n):
        row = []
        for x in range(n):
            dark = (x + y // 2) // 12 % 2
            grain = (x * 7919 + y * 104729) % 17
            if (x + .5 - n / 2) ** 2 + (y + .5 - n / 2) ** 2 < (n / 6) ** 2:
                row.append({"deep": (7,) * 3, "alpha": (0, 0, 0, 128), "normal": (128, 128, 255),
                            "labels": (3,)}.get(kind, (0, 0, 0)))
            elif kind == "deep":
                row.append((int((50000 if dark else 9000) + 131 * grain),) * 3)
            elif kind == "alpha":
                row.append((200, 60, 40, 255) if dark else (77, 77, 77, 0))
            elif kind == "normal":
                row.append((204, 128, 230) if dark else (128, 128, 255))
            elif kind == "labels":
                row.append((3 if dark else 11,))
            else:
                row.append((210 - grain, 200 - grain, 180) if dark else (40 + grain, 50, 90 + grain))
        rows.append(row)
    write(path, rows, bits)


def unit(path):
    a, rows = read(path)
    top = 2 ** a.bits - 1
    for row in rows:
        for p in row:
            length = sum((2 * s / top - 1) ** 2 for s in p[:3]) ** .5
            need(.97 < length < 1.03, "a normal of length", length)


def labels(before, after):
    (_, a), (_, b) = read(before), read(after)
    new = {p for row in b for p in row} - {p for row in a for p in row}
    need(not new, "new labels", sorted(new))


if __name__ == "__main__":
    try:
        {f.__name__: f for f in (kept, near, within, mask, picture, unit, labels)}[sys.argv[1]](*sys.argv[2:])
    except Wrong as wrong:
        sys.exit("check_inpaint: %s" % wrong)
