"""pictures.py - pictures as people have them, for pictures.sh: pictures.py KIND FILE; and of what came out:
pictures.py is PNG KIND, pictures.py close PNG PNG"""
import os
import struct
import sys
import zlib

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
from png import Png

WIDTH, HEIGHT = 64, 48


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(rows, colour, bits, width, height, between=b""):
    head = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)
    packed = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + between + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


def stones():
    """Rows of gray that no turning or mirroring leaves alone."""
    state, rows = 1, []
    for y in range(HEIGHT):
        row = []
        for x in range(WIDTH):
            state = (state * 1103515245 + 12345) % 2 ** 31
            row.append(60 + (x * 2 + y) % 100 + (state >> 16) % 60)
        rows.append(row)
    return rows


def exif(orientation):
    entry = struct.pack("<HHIHH", 274, 3, 1, orientation, 0)
    return chunk(b"eXIf", b"II*\0\x08\0\0\0" + struct.pack("<H", 1) + entry + b"\0\0\0\0")


def make(kind):
    rows = stones()
    if kind == "upright":
        return png(rows, 0, 8, WIDTH, HEIGHT)
    if kind == "turned":  # orientation 6: its first row is the right side of the upright picture
        turned = [[rows[y][WIDTH - 1 - r] for y in range(HEIGHT)] for r in range(WIDTH)]
        return png(turned, 0, 8, HEIGHT, WIDTH, exif(6))
    if kind == "mask":  # white but for a strip, and of another gamma
        rows = [[255 if x > 3 else 0 for x in range(WIDTH)] for y in range(HEIGHT)]
    if kind in ("gamma", "mask"):
        return png(rows, 0, 8, WIDTH, HEIGHT, chunk(b"gAMA", struct.pack(">I", 100000)))
    if kind == "key":
        rows = [[0 if (x // 8 + y // 8) % 3 == 0 else v for x, v in enumerate(row)] for y, row in enumerate(rows)]
        return png(rows, 0, 8, WIDTH, HEIGHT, chunk(b"tRNS", b"\0\0"))
    if kind == "huge":
        return png([[0]], 2, 8, 60000, 60000)
    if kind == "long":
        return png([[0] * 20000], 0, 8, 20000, 1)
    if kind == "sum":
        data = bytearray(png(rows, 0, 8, WIDTH, HEIGHT))
        data[-14] ^= 1
        return bytes(data)
    raise SystemExit("pictures.py: " + kind)


if sys.argv[1] == "is":
    with open(sys.argv[2], "rb") as file:
        head = file.read(26)
    sys.exit(0 if {"gray": 0, "rgb": 2, "rgba": 6}[sys.argv[3]] == head[25] else 1)
if sys.argv[1] == "close":
    one, other = (b"".join(bytes(line) for line in Png(path).lines) for path in sys.argv[2:4])
    differences = [abs(a - b) for a, b in zip(one, other)]
    sys.exit(0 if len(one) == len(other) and sum(differences) < 6 * len(differences) else 1)
with open(sys.argv[2], "wb") as out:
    out.write(make(sys.argv[1]))
