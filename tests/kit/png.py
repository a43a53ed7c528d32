"""png.py - what the checks of pictures share: saying what is wrong, and reading PNG."""
import struct
import zlib


class Wrong(Exception):
    pass


def need(truth, *what):
    if not truth:
        raise Wrong(" ".join(str(w) for w in what))


class Png:
    """A PNG of 8 or 16 bits that is not interlaced, of a path or in bytes; lines are the bytes of its
    rows."""

    def __init__(self, path, data=None):
        if data is None:
            with open(path, "rb") as file:
                data = file.read()
        need(data[:8] == b"\x89PNG\r\n\x1a\n", path, "is not PNG")
        self.width, self.height, self.bits, colour, _, _, interlace = struct.unpack(
            ">IIBBBBB", data[16:29])
        need(self.bits in (8, 16) and not interlace and colour in (0, 2, 4, 6), path, "is another PNG")
        self.channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
        at, self.packed, self.unpacked = 8, b"", None
        while at < len(data):
            length, name = struct.unpack(">I4s", data[at:at + 8])
            if name == b"IDAT":
                self.packed += data[at + 8:at + 8 + length]
            at += 12 + length

    @property
    def lines(self):
        if self.unpacked is None:
            self.unpacked = self.unpack(zlib.decompress(self.packed))
        return self.unpacked

    def unpack(self, raw):
        step = self.channels * self.bits // 8
        n = self.width * step
        need(len(raw) == (n + 1) * self.height, "a PNG of the wrong length")
        lines, above = [], bytearray(n)
        for y in range(self.height):
            how = raw[y * (n + 1)]
            row = bytearray(raw[y * (n + 1) + 1:(y + 1) * (n + 1)])
            for i in range(n if how else 0):
                a = row[i - step] if i >= step else 0
                b = above[i]
                if how == 1:
                    guess = a
                elif how == 2:
                    guess = b
                elif how == 3:
                    guess = (a + b) // 2
                else:
                    d = above[i - step] if i >= step else 0
                    pa, pb, pd = abs(b - d), abs(a - d), abs(a + b - 2 * d)
                    guess = a if pa <= pb and pa <= pd else b if pb <= pd else d
                row[i] = (row[i] + guess) & 255
            lines.append(bytes(row))
            above = row
        return lines
