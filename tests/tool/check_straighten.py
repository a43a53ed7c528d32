#!/usr/bin/python3
"""check_straighten.py WHAT FILES... - do the courses of a wall lie straight?

    draw FOLDER             wall.png, bricks photographed from the side by a camera that is turned;
                            wall-height.png, its heights in 16 bits, and wall-normal.png, flat;
                            object.png, where half of it is noise, and mask.png, which leaves that out;
                            noise.png, without a pattern
    courses PICTURE L M     the rows of the picture differ by L to M of what its pixels do
    flat PICTURE            all its normals are (128, 128, 255)
    register PICTURE MAP    mortar is bright in the picture and deep in the map
"""
import math
import os
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_patch import Picture, need, write_png  # noqa: E402

WIDTH, HEIGHT = 192, 144


def draw(folder):
    def noise(x, y):
        return ((x * 73856093 ^ y * 19349663) * 2654435761 >> 13) % 256

    def on_wall(x, y):
        """Turned by 5 degrees, then seen from the side; a course is 1 high, a brick 3 long."""
        x, y = x - WIDTH / 2, y - HEIGHT / 2
        x, y = x * math.cos(0.09) + y * math.sin(0.09), y * math.cos(0.09) - x * math.sin(0.09)
        depth = 1 + x / (2.5 * WIDTH)
        return x / depth / 10 + 300, y / depth / 10 + 300

    def is_mortar(x, y):
        x, y = on_wall(x, y)
        return y % 1 < 0.18 or (x + 1.5 * (int(y) % 2)) % 3 < 0.18

    def part(x, y):
        return sum(is_mortar(x + i / 3, y + j / 3) for i in range(3) for j in range(3)) / 9

    mortar = [[part(x, y) for x in range(WIDTH)] for y in range(HEIGHT)]

    def color(x, y):
        a, b = on_wall(x, y)
        brick = 60 + noise(int((a + 1.5 * (int(b) % 2)) / 3), int(b)) // 5
        value = brick + (200 - brick) * mortar[y][x]
        return int(value), int(0.9 * value), int(0.8 * value)

    def grain(x, y):
        return (noise(x, y),) * 3

    def save(name, channels, bits, pixel):
        write_png(os.path.join(folder, name), WIDTH, HEIGHT, channels, bits, pixel)

    save("wall.png", 3, 8, color)
    save("wall-height.png", 1, 16, lambda x, y: int(50000 - 40000 * mortar[y][x]))
    save("wall-normal.png", 3, 8, lambda x, y: (128, 128, 255))
    save("object.png", 3, 8, lambda x, y: color(x, y) if x < WIDTH * 2 // 3 else grain(x, y))
    save("mask.png", 1, 8, lambda x, y: 255 if x < WIDTH * 2 // 3 else 0)
    save("noise.png", 3, 8, grain)


def spread(values):
    mean = sum(values) / len(values)
    return math.sqrt(sum((v - mean) ** 2 for v in values) / len(values))


def check_courses(path, least, most):
    picture = Picture(path)
    width, height = picture.size()
    rows = [[picture.gray(x, y) for x in range(width)] for y in range(height)]
    part = spread([sum(row) / width for row in rows]) / spread([v for row in rows for v in row])
    need(float(least) <= part <= float(most), path, "rows differ by %.2f of what pixels do" % part)


def check_flat(path):
    need(all(tuple(p) == (128, 128, 255) for row in Picture(path).rows for p in row), path,
         "has normals that are not flat")


def check_register(path, other):
    picture, heights = Picture(path), Picture(other)
    need(picture.size() == heights.size(), other, "has another size")
    width, height = picture.size()
    pairs = [(picture.gray(x, y), heights.gray(x, y)) for y in range(height) for x in range(width)]
    a, b = spread([p for p, _ in pairs]), spread([q for _, q in pairs])
    mean_p, mean_q = (sum(pair[i] for pair in pairs) / len(pairs) for i in (0, 1))
    both = sum((p - mean_p) * (q - mean_q) for p, q in pairs) / len(pairs)
    need(both < -0.8 * a * b, other, "is not in register: correlation %.2f" % (both / (a * b)))


if __name__ == "__main__":
    {"draw": draw, "courses": check_courses, "flat": check_flat,
     "register": check_register}[sys.argv[1]](*sys.argv[2:])
