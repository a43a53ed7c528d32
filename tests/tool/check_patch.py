#!/usr/bin/python3
"""check_patch.py WHAT FILES... - do pictures of texkit patch and texkit edges hold what they should?

    draw FOLDER                        bricks.png and maps in register: -normal, -id, -height (16 bits);
                                       parts.png of three materials, with its labels
    is FILE WIDTH HEIGHT CHANNELS BITS
    sources S.pfm OUT EXEMPLAR,...     each pixel of OUT is that of the exemplar at the place S says
    near S.pfm OUT EXEMPLAR,... MOST   the same but for MOST, 0..255, on average
    turned S.pfm OUT NORMALS MOST      the same for a normal map that turns with its pieces
    within S.pfm X Y WIDTH HEIGHT      no pixel comes from elsewhere
    codes S.pfm TEST                   a Python expression of the set c of all third values
    part WHOLE PART X Y                PART is WHOLE's part at X, Y
    kept OUT PICTURE MASK              OUT is PICTURE where MASK is not 0
    wraps PICTURE AXES MOST            across these borders neighbours differ MOST times as inside
    joined S.pfm AXES LEAST            across these borders pieces go on LEAST times as often as inside
    half FINE COARSE HOW               COARSE is half of FINE; HOW: color, data, label, normal
    fence FILE                         thin slanting wires of about 60,120,40, white that is hidden between
    colored PICTURE R,G,B              wherever there is any alpha the color is this one within 9 levels
    covered PICTURE LEVEL MOST         alpha is half or more on the same share of pixels within MOST
    darker PICTURE MASK BY             where MASK is not 0, PICTURE is darker by so much on average
    lines LINES.json LAYERS.png        the lines enclose the layers' pixels, no others
    shapes LINES.svg LINES.json        the same lines
"""
import json
import math
import os
import struct
import sys
import xml.etree.ElementTree
import zlib

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
from png import Png, Wrong, need  # noqa: E402


# ---- files

class Picture(Png):
    """Rows of tuples."""

    def __init__(self, path):
        super().__init__(path)
        self.most = 2 ** self.bits - 1
        self.rows = []
        for line in self.lines:
            values = struct.unpack(">%d%s" % (self.width * self.channels, "BH"[self.bits // 16]), line)
            self.rows.append([values[i:i + self.channels]
                              for i in range(0, len(values), self.channels)])

    def size(self):
        return self.width, self.height

    def gray(self, x, y):
        return sum(self.rows[y][x][:3]) / min(self.channels, 3) * 255 / self.most

    def between(self, x, y):
        """Bilinear, at its scale; whole numbers are pixel centres."""
        x, y = min(max(x, 0), self.width - 1), min(max(y, 0), self.height - 1)
        i, j = min(int(x), max(self.width - 2, 0)), min(int(y), max(self.height - 2, 0))
        u, v = x - i, y - j
        k, m = min(i + 1, self.width - 1), min(j + 1, self.height - 1)
        return [(a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v for a, b, c, d in
                zip(self.rows[j][i], self.rows[j][k], self.rows[m][i], self.rows[m][k])]


def write_png(path, width, height, channels, bits, pixel):
    rows = bytearray()
    for y in range(height):
        rows.append(0)
        for x in range(width):
            value = pixel(x, y)
            rows += struct.pack(">%d%s" % (channels, "BH"[bits // 16]),
                                *(value if channels > 1 else [value]))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(
            ">IIBBBBB", width, height, bits, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(bytes(rows))) + chunk(b"IEND", b""))


def read_sources(path):
    """Rows from top to bottom of (x, y, code)."""
    with open(path, "rb") as file:
        data = file.read()
    kind, size, scale, values = data.split(b"\n", 3)
    width, height = (int(n) for n in size.split())
    need(kind == b"PF" and float(scale) == -1 and len(values) == 12 * width * height, path,
         "is no PFM of its size")
    floats = list(struct.iter_unpack("<3f", values))
    return [floats[y * width:(y + 1) * width] for y in range(height - 1, -1, -1)]


# ---- exemplars

def draw(folder):
    """Bricks of 24 x 12 pixels, every other row moved by half of one, each of its own tone."""
    side = 96

    def noise(x, y, which):
        return zlib.crc32(struct.pack("<iii", x, y, which)) & 255

    def brick(x, y):
        row = y // 12
        x += row % 2 * 12
        return x // 24, row, x % 24, y % 12

    def is_mortar(x, y):
        _, _, u, v = brick(x, y)
        return u < 3 or v < 3

    def color(x, y):
        i, j, _, _ = brick(x, y)
        tone = 60 + noise(x, y, 0) // 16 if is_mortar(x, y) else \
            130 + noise(i, j, 1) // 4 + noise(x, y, 0) // 12
        return tone, tone * 7 // 8, tone * 3 // 4

    def height(x, y):
        i, j, _, _ = brick(x, y)
        return 9000 + 37 * noise(x, y, 2) if is_mortar(x, y) else 40000 + 77 * noise(i, j, 1)

    def normal(x, y):
        """Edges of bricks slope: to the left at their left, up at their top."""
        _, _, u, v = brick(x, y)
        nx = -0.6 if u == 3 else 0.6 if u == 23 else 0
        ny = 0.6 if v == 3 else -0.6 if v == 11 else 0
        n = (nx, ny, 1)
        length = math.sqrt(sum(c * c for c in n))
        return tuple(int((c / length + 1) * 127.5 + 0.5) for c in n)

    write_png(folder + "/bricks.png", side, side, 3, 8, color)
    write_png(folder + "/bricks-normal.png", side, side, 3, 8, normal)
    write_png(folder + "/bricks-id.png", side, side, 1, 8, lambda x, y: 7 if is_mortar(x, y) else 200)
    write_png(folder + "/bricks-height.png", side, side, 1, 16, height)
    # sand of two colours, in patches and below a sky; what says so, in colour and as numbers
    def part(x, y):
        wave = math.sin(x / 7) + math.sin(y / 9) + math.sin((x + 2 * y) / 11)
        return 0 if y < 26 else 1 if wave > 0.2 else 2

    def sand(x, y):
        tone = noise(x // 2, y // 2, 3) // 6
        return ((120, 160, 230), (200 + tone, 150 + tone, 60 + tone), (30 + tone, 70 + tone, 20))[part(x, y)]

    shown = ((0, 0, 255), (255, 160, 0), (0, 120, 0))
    write_png(folder + "/parts.png", side, side, 3, 8, sand)
    write_png(folder + "/parts-labels.png", side, side, 3, 8, lambda x, y: shown[part(x, y)])
    write_png(folder + "/parts-numbers.png", side, side, 1, 8, part)
    write_png(folder + "/drawn.png", 80, 64, 3, 8, lambda x, y: shown[1 if x < 30 else 2 if y < 40 else 0])
    # darker to the right, and what says so; a target that asks for dark above
    write_png(folder + "/ramp.png", side, side, 3, 8,
              lambda x, y: tuple(c * (220 - 2 * x) // 255 for c in color(x, y)))
    write_png(folder + "/ramp-guide.png", side, side, 1, 8, lambda x, y: 220 - 2 * x)
    write_png(folder + "/target.png", 64, 64, 1, 8, lambda x, y: 50 if y < 32 else 200)
    write_png(folder + "/top.png", 64, 64, 1, 8, lambda x, y: 255 if y < 28 else 0)
    write_png(folder + "/left.png", side, side, 1, 8, lambda x, y: 255 if x < 52 else 0)
    write_png(folder + "/disc.png", 64, 64, 1, 8,
              lambda x, y: 255 if (x - 32) ** 2 + (y - 32) ** 2 < 200 else 0)
    for name, channels, bits, value in (("plain", 3, 8, (9, 99, 199)), ("plain-id", 1, 8, 77),
                                        ("plain-height", 1, 16, 12345)):
        write_png(folder + "/%s.png" % name, 64, 64, channels, bits, lambda x, y, v=value: v)


# ---- checks

def check_is(path, width, height, channels, bits):
    p = Picture(path)
    found = p.width, p.height, p.channels, p.bits
    need(found == (int(width), int(height), int(channels), int(bits)), path, "is", found)


def pairs(sources, out, exemplars):
    """(pixel of out, its source's (x, y, code), the exemplar) for all that were not kept."""
    s, o = read_sources(sources), Picture(out)
    need((len(s[0]), len(s)) == o.size(), sources, "is of another size than", out)
    e = [Picture(path) for path in exemplars.split(",")]
    for y in range(o.height):
        for x in range(o.width):
            code = s[y][x][2]
            need(code == int(code) and -1 <= code < 8 * len(e), "code", code, "at", x, y)
            if code < 0:
                continue
            p = e[int(code) // 8]
            need(-0.5 <= s[y][x][0] <= p.width - 0.5 and -0.5 <= s[y][x][1] <= p.height - 0.5,
                 "place", s[y][x], "at", x, y)
            yield o.rows[y][x], s[y][x], p


def check_sources(sources, out, exemplars):
    for pixel, (x, y, _), p in pairs(sources, out, exemplars):
        # half way between two pixels either may be meant
        near = {(min(max(math.floor(x + 0.5 + dx), 0), p.width - 1),
                 min(max(math.floor(y + 0.5 + dy), 0), p.height - 1))
                for dx in (-1e-3, 1e-3) for dy in (-1e-3, 1e-3)}
        need(any(p.rows[j][i] == pixel for i, j in near), pixel, "is not at", x, y, "of the exemplar")


def check_near(sources, out, exemplars, most):
    total = count = 0
    for pixel, (x, y, _), p in pairs(sources, out, exemplars):
        total += sum(abs(a - b) for a, b in zip(pixel, p.between(x, y))) * 255 / p.most
        count += len(pixel)
    need(total / count <= float(most), "differs by", total / count, "on average")


def check_turned(sources, out, normals, most):
    total = count = 0
    for pixel, (x, y, code), p in pairs(sources, out, normals):
        nx, ny, nz = (c - 127.5 for c in p.between(x, y))
        if int(code) & 4:
            nx = -nx
        for _ in range(int(code) & 3):
            nx, ny = -ny, nx
        total += sum(abs(a - b - 127.5) for a, b in zip(pixel, (nx, ny, nz)))
        count += 3
    need(total / count <= float(most), "differs by", total / count, "on average")


def check_within(sources, left, top, width, height):
    for row in read_sources(sources):
        for x, y, _ in row:
            need(int(left) <= round(x) < int(left) + int(width) and
                 int(top) <= round(y) < int(top) + int(height), "a pixel comes from", x, y)


def check_codes(sources, test):
    c = {int(s[2]) for row in read_sources(sources) for s in row}
    need(eval(test, {"c": c}), "codes are", sorted(c))


def check_part(whole, part, x, y):
    w, p = Picture(whole), Picture(part)
    x, y = int(x), int(y)
    for j, row in enumerate(p.rows):
        need(row == w.rows[y + j][x:x + p.width], "row", j, "of", part, "is not that of", whole)


def check_kept(out, picture, mask):
    o, k, m = Picture(out), Picture(picture), Picture(mask)
    same = other = 0
    for y in range(o.height):
        for x in range(o.width):
            if m.rows[y][x][0]:
                need(o.rows[y][x] == k.rows[y][x], "pixel", x, y, "was not kept")
                same += 1
            else:
                other += o.rows[y][x] != k.rows[y][x]
    need(same and other, "there is nothing to tell apart")


def difference(row, other):
    return sum(abs(a - b) for p, q in zip(row, other) for a, b in zip(p, q))


def seam(picture, axis):
    """How much neighbours across the border differ, against neighbours inside; bricks have mortar at
    some places only, so inside is the largest that a line of neighbours has."""
    p = Picture(picture)
    lines = p.rows if axis == "y" else [[row[x] for row in p.rows] for x in range(p.width)]
    inside = sorted(difference(a, b) for a, b in zip(lines, lines[1:]))
    return difference(lines[-1], lines[0]) / max(inside[-1 - len(inside) // 20], 1)


def check_wraps(picture, axes, most):
    for axis in axes:
        need(seam(picture, axis) <= float(most), axis, "differs", seam(picture, axis), "times as inside")


def check_joined(sources, axes, least):
    s = read_sources(sources)
    for axis in axes:
        lines = s if axis == "y" else [list(column) for column in zip(*s)]
        step = (1, 0) if axis == "x" else (0, 1)

        def going_on(line, following):
            return sum(p[2] == q[2] and abs(q[0] - p[0] - step[0]) + abs(q[1] - p[1] - step[1]) < 0.5
                       for p, q in zip(line, following)) / len(line)
        inside = sum(going_on(a, b) for a, b in zip(lines, lines[1:])) / (len(lines) - 1)
        across = going_on(lines[-1], lines[0])
        need(across >= float(least) * inside, axis, "goes on at", across, "of places, inside at", inside)


def check_half(fine, coarse, how):
    f, c = Picture(fine), Picture(coarse)
    need(c.size() == (max(1, f.width // 2), max(1, f.height // 2)), coarse, "is", c.size())
    need((c.channels, c.bits) == (f.channels, f.bits), coarse, "is of another kind")

    def linear(v):
        v /= f.most
        return v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4

    def srgb(v):
        return f.most * (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055)

    def covered(i, coarse, fine):
        """The pixels under pixel i, and how much of each."""
        low, high = i * fine / coarse, (i + 1) * fine / coarse
        for k in range(int(low), math.ceil(high - 1e-9)):
            yield k, min(high, k + 1) - max(low, k)

    for y in range(c.height):
        for x in range(c.width):
            parts = [(f.rows[v][u], a * b) for v, a in covered(y, c.height, f.height)
                     for u, b in covered(x, c.width, f.width)]
            pixel, slack = c.rows[y][x], 1 + f.most // 1000
            if how == "label":
                need(pixel in [p for p, _ in parts], pixel, "is none of", parts)
                continue

            def mean(value, parts=parts):
                return sum(w * value(p) for p, w in parts) / sum(w for _, w in parts)
            if how == "data":
                want = [mean(lambda p, k=k: p[k]) for k in range(f.channels)]
            elif how == "color":
                want = [srgb(mean(lambda p, k=k: linear(p[k]))) for k in range(f.channels)]
            else:
                n = [mean(lambda p, k=k: 2 * p[k] / f.most - 1) for k in range(3)]
                length = math.sqrt(sum(v * v for v in n)) or 1
                want = [(v / length + 1) * f.most / 2 for v in n]
            need(all(abs(a - b) <= slack for a, b in zip(pixel, want)), "pixel", x, y, "is", pixel,
                 "instead of", want)


def check_fence(path):
    def pixel(x, y):
        tone = zlib.crc32(struct.pack("<ii", x, y)) & 3
        wire = (x + 2 * y) % 13 < 3 or (3 * x - y) % 17 < 3
        rim = (x + 2 * y) % 13 == 3
        return (60 + tone, 120 + tone, 40 - tone, 255 if wire else 90) if wire or rim else (255, 255, 255, 0)
    write_png(path, 80, 72, 4, 8, pixel)


def check_colored(picture, color):
    p, want = Picture(picture), [int(v) for v in color.split(",")]
    for row in p.rows:
        for pixel in row:
            need(pixel[3] == 0 or all(abs(a - b) <= 9 for a, b in zip(pixel, want)), picture, "has", pixel)


def check_covered(picture, level, most):
    a, b = ([2 * pixel[3] >= p.most for row in p.rows for pixel in row]
            for p in (Picture(picture), Picture(level)))
    need(abs(sum(a) / len(a) - sum(b) / len(b)) <= float(most), level, "covers", sum(b) / len(b),
         "of", sum(a) / len(a))


def check_darker(picture, mask, by):
    p, m = Picture(picture), Picture(mask)
    need(p.size() == m.size(), mask, "is of another size")
    sums = {True: [0, 0], False: [0, 0]}
    for y in range(p.height):
        for x in range(p.width):
            side = sums[m.rows[y][x][0] > 0]
            side[0] += p.gray(x, y)
            side[1] += 1
    inside, outside = (sums[k][0] / sums[k][1] for k in (True, False))
    need(inside + float(by) <= outside, "inside", inside, "outside", outside)


def check_lines(lines, layers):
    with open(lines) as file:
        document = json.load(file)
    p, levels = Picture(layers), document["levels"]
    need((document["width"], document["height"]) == p.size(), "another size")
    thresholds = document["thresholds"]
    need(len(thresholds) == levels - 1 and thresholds == sorted(thresholds), thresholds)
    crossings = [[[] for _ in range(p.height)] for _ in range(levels)]
    for line in document["lines"]:
        points, area = line["points"], 0
        need(len(points) >= 4, "a line of", len(points), "points")
        for (x, y), (u, v) in zip(points, points[1:] + points[:1]):
            need((x == u) != (y == v), "a step from", (x, y), "to", (u, v))
            area += x * v - u * y
            for row in range(min(y, v), max(y, v)):
                crossings[line["layer"]][row].append(x)
        need((area < 0) == line["hole"], "a line of area", area / 2, "hole:", line["hole"])
    for y in range(p.height):
        for k in range(levels):
            gray, edges, inside = (255 * k + (levels - 1) // 2) // (levels - 1), crossings[k][y], False
            for x in range(p.width):
                inside ^= edges.count(x) % 2 == 1
                need(inside == (p.rows[y][x][0] == gray), "pixel", x, y, "layer", k)


def check_shapes(svg, lines):
    with open(lines) as file:
        document = json.load(file)
    paths = xml.etree.ElementTree.parse(svg).getroot().findall("{http://www.w3.org/2000/svg}path")
    need(len(paths) == document["levels"], len(paths), "paths")
    for k, path in enumerate(paths):
        need(path.get("id") == "layer-%d" % k, path.get("id"))
        shapes = [[[int(n) for n in point.split()] for point in shape.strip()[1:].split("L")]
                  for shape in path.get("d").split("Z") if shape.strip()]
        need(shapes == [line["points"] for line in document["lines"] if line["layer"] == k],
             "layer", k, "has other lines")


def main():
    try:
        if sys.argv[1] == "draw":
            draw(sys.argv[2])
        else:
            globals()["check_" + sys.argv[1]](*sys.argv[2:])
    except Wrong as wrong:
        print(wrong)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
