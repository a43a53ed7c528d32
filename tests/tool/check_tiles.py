#!/usr/bin/python3
"""check_tiles.py FOLDER [--reduced | --classes LIST] - is this a set that texkit tiles may write?

The schema of docs/, and what a schema cannot say: all combinations of colours are there, tiles and
their gutters lie apart and inside the atlas, uv agrees with x and y, equal colours mean equal pixels
along the joint, and the preview lays tiles of the atlas side by side that may lie so. tiles.tsx and tiles.tres
say the same as tiles.json; if Tiled is installed it draws a map with the set, which must be the tiles.

    check_tiles.py FOLDER --different   nothing but that no two square tiles are the same picture
    check_tiles.py FOLDER --damaged     damage the document in many ways; each must be noticed
"""
import copy
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree

import jsonschema

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
from png import Png, Wrong, need  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
with open(os.path.join(HERE, "..", "..", "docs", "tiles.schema.json")) as schema_file:
    SCHEMA = json.load(schema_file)
jsonschema.Draft7Validator.check_schema(SCHEMA)
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
LOCKED = 2  # pixels on either side of a joint that all tiles of its colour share


# ---- pictures

class Picture(Png):
    """An 8-bit PNG."""

    def __init__(self, path):
        super().__init__(path)
        need(self.bits == 8, path, "is another PNG")

    def block(self, x, y, width, height):
        c = self.channels
        return b"".join(self.lines[j][x * c:(x + width) * c] for j in range(y, y + height))

    def pixel(self, x, y):
        return self.lines[y][x * self.channels:(x + 1) * self.channels]


# ---- what the colours say

def colours(tile):
    return tuple(tile.get("corners") or tile["edges"])


def symbols(tile):
    """of a triangle: colour and direction of each side"""
    return tuple(zip(tile["edges"], tile["directions"]))


def rotations(sides):
    return [sides[r:] + sides[:r] for r in range(3)]


def joins(kind, a, b, down):
    """May b lie to the east of a, or to the south of it?"""
    if kind == "corner":
        return (a[3], a[2]) == (b[0], b[1]) if down else (a[1], a[2]) == (b[0], b[3])
    return a[2] == b[0] if down else a[1] == b[3]


def digits(base):
    return [(a, b, c, d) for a in range(base) for b in range(base) for c in range(base)
            for d in range(base)]


def check_combinations(doc, reduced, classes):
    kind, n, variants = doc["kind"], doc["colors"], doc["variants"]
    tiles = doc["tiles"]
    need(len(tiles) % variants == 0, "tiles are no multiple of the variants")
    for i, tile in enumerate(tiles):
        need(tile["variant"] == i % variants, "tile", i, "is not variant", i % variants)
        need(max(colours(tile)) < n, "tile", i, "has a colour beyond", n - 1)
        first = tiles[i - i % variants]
        need(colours(tile) == colours(first) and tile.get("directions") == first.get("directions"),
             "tile", i, "differs from its variant 0")
    firsts = tiles[::variants]
    if kind == "triangle":
        have = [symbols(t) for t in firsts]
        all_ways = {((a, p), (b, q), (c, r)) for a in range(n) for b in range(n) for c in range(n)
                    for p in (1, -1) for q in (1, -1) for r in (1, -1)}
        if reduced:
            all_ways = {w for w in all_ways if len({s[1] for s in w}) == 2}
        covered = [set(rotations(s)) for s in have]
        need(set().union(*covered) == all_ways, "not all triangles are there, or too many")
        need(sum(map(len, covered)) == len(all_ways), "a triangle is there twice")
        need(len(have) == (2 * n ** 3 if reduced else ((2 * n) ** 3 + 4 * n) // 3), len(have), "?")
    elif kind == "frame":
        wanted = classes or [(0, k, 0, k) for k in range(n)]
        need([colours(t) for t in firsts] == wanted, "the classes are not those asked for")
    elif reduced:
        groups = {}
        for t in firsts:
            groups.setdefault((t["edges"][0], t["edges"][3]), []).append(t["edges"])
        need(len(groups) == n * n, "a pair of north and west is missing")
        for pair in groups.values():
            need(len(pair) == 2 and pair[0][1] != pair[1][1] and pair[0][2] != pair[1][2],
                 "not two tiles that differ in east and south:", pair)
    else:
        need([colours(t) for t in firsts] == digits(n), "not all colours in their order")


# ---- where the tiles lie

def check_places(doc):
    """Each tile with its gutter is inside the atlas and covers no other."""
    atlas, size, triangle = doc["atlas"], doc["size"], doc["kind"] == "triangle"
    width, height, g = atlas["width"], atlas["height"], atlas["gutter"]
    pitch, columns = atlas["pitch"], atlas["columns"]
    need(width == columns * pitch[0] and height % pitch[1] == 0, "columns times pitch is no width")
    taken = [bytearray(width) for _ in range(height)]
    for number, tile in enumerate(doc["tiles"]):
        step = tile.get("step", 1)
        ox, oy = (tile["x"], tile["y"]) if step > 0 else (tile["x"] + size, tile["y"] + size)
        for v in (ox, oy) if step > 0 else (ox + 1, oy + 1):
            need(g == 0 or v % g == 0, "tile", number, "is not at a multiple of the gutter")
        # rows of a square, or of a triangle, whose gutter goes round its corners only if there is room
        far = size + g if triangle else size - 1 + g
        last = size + 2 * g if triangle and atlas["packing"] == "packed" else far
        for j in range(-g, last + 1):
            a, b = sorted((ox - step * g, ox + step * min(last, far - j if triangle else far)))
            y = oy + step * j
            need(0 <= a and b < width and 0 <= y < height, "tile", number, "leaves the atlas")
            need(not any(taken[y][a:b + 1]), "tile", number, "overlaps another")
            taken[y][a:b + 1] = b"\1" * (b + 1 - a)

        slices = atlas["packing"] == "slices"
        y0, h = (oy % pitch[1], pitch[1]) if slices else (oy, height)
        if slices:
            need(oy // pitch[1] == number, "tile", number, "is not layer", number)
        centre = 0.5 if triangle else 0
        corners = ((0, 0), (0, 1), (1, 0)) if triangle else ((0, 0), (1, 0), (1, 1), (0, 1))
        for (u, v), (cx, cy) in zip(tile["uv"], corners):
            need(abs(u * width - (ox + centre + step * size * cx)) < 1e-3 and
                 abs(v * h - (y0 + centre + step * size * cy)) < 1e-3,
                 "tile", number, "has uv elsewhere")
    if atlas["packing"] == "torus":
        at = {(t["x"], t["y"]): colours(t) for t in doc["tiles"]}
        for (x, y), tile in at.items():
            need(joins(doc["kind"], tile, at[(x + size) % width, y], 0) and
                 joins(doc["kind"], tile, at[x, (y + size) % height], 1),
                 "the tile at", x, y, "does not match its neighbours")


# ---- what the pixels say

def side_of_triangle(picture, tile, size, k):
    corner = ((0, 0), (0, size), (size, 0))
    (ax, ay), (bx, by) = corner[k], corner[(k + 1) % 3]
    step = tile["step"]
    ox, oy = (tile["x"], tile["y"]) if step > 0 else (tile["x"] + size, tile["y"] + size)
    line = [(ax + (bx - ax) * t // size, ay + (by - ay) * t // size) for t in range(size + 1)]
    return [picture.pixel(ox + step * x, oy + step * y) for x, y in line]


def check_joints(doc, picture):
    """Equal colours mean equal pixels on this side of the joint."""
    size, seen = doc["size"], {}

    def same(key, pixels, number):
        need(seen.setdefault(key, pixels) == pixels, "tile", number, "has other pixels at", key)

    for number, tile in enumerate(doc["tiles"]):
        x, y, c = tile["x"], tile["y"], colours(tile)
        if doc["kind"] == "triangle":
            for k in range(3):
                line = side_of_triangle(picture, tile, size, k)
                same(c[k], line if tile["directions"][k] > 0 else line[::-1], number)
            continue
        strips = ((x, y, size, LOCKED), (x + size - LOCKED, y, LOCKED, size),
                  (x, y + size - LOCKED, size, LOCKED), (x, y, LOCKED, size))
        ends = ((0, 1), (1, 2), (3, 2), (0, 3))
        for k in range(4):
            colour = (c[ends[k][0]], c[ends[k][1]]) if doc["kind"] == "corner" else c[k]
            same((k, colour), picture.block(*strips[k]), number)
    need(len(set(map(str, seen.values()))) == len(seen), "two colours show the same pixels")


def check_preview(doc, picture, preview, matched):
    """The squares of the preview are tiles of the atlas, and those that touch may do so."""
    size = doc["size"]
    side = 8
    while side > 2 and side * size > 2048:
        side -= 1
    need(preview.width == preview.height == side * size, "the preview has another size")
    need(preview.channels == picture.channels, "the preview has other channels")
    if doc["kind"] == "triangle":
        return
    by_pixels = {picture.block(t["x"], t["y"], size, size): colours(t) for t in doc["tiles"]}
    laid = {}
    for row in range(side):
        for column in range(side):
            tile = by_pixels.get(preview.block(column * size, row * size, size, size))
            need(tile is not None, "the preview shows no tile at", column, row)
            laid[column, row] = tile
    need(doc["kind"] == "frame" or len(set(laid.values())) > 1, "the preview shows one tile only")
    for (column, row), tile in laid.items() if matched else ():
        for down in (0, 1):
            other = laid.get((column + 1 - down, row + down))
            need(other is None or joins(doc["kind"], tile, other, down),
                 "the preview's tile at", column, row, "does not match its neighbour")


def check_document(doc, folder, reduced, classes):
    errors = sorted(VALIDATOR.iter_errors(doc), key=str)
    need(not errors, "schema:", errors[0].message if errors else "")
    check_combinations(doc, reduced, classes)
    check_places(doc)
    for name in doc["atlas"]["files"]:
        picture = Picture(os.path.join(folder, name))
        need((picture.width, picture.height) == (doc["atlas"]["width"], doc["atlas"]["height"]),
             name, "is not as large as tiles.json says")


# ---- damages: schema tells whether the schema alone must notice

def damages(doc):
    triangle, corner = doc["kind"] == "triangle", doc["kind"] == "corner"
    colour_key = "corners" if corner else "edges"
    last = len(doc["tiles"]) - 1

    def put(*path, value=None):
        def change(d):
            for key in path[:-1]:
                d = d[key]
            d[path[-1]] = value
        return change

    def drop(*path):
        def change(d):
            for key in path[:-1]:
                d = d[key]
            del d[path[-1]]
        return change

    def move(*path, by=0):
        def change(d):
            for key in path[:-1]:
                d = d[key]
            d[path[-1]] += by
        return change

    for key in doc:
        yield True, "no " + key, drop(key)
    for key in doc["atlas"]:
        yield True, "no atlas." + key, drop("atlas", key)
    for key in doc["tiles"][last]:
        yield True, "no " + key + " in the last tile", drop("tiles", last, key)
    yield True, "a field more", put("extra", value=1)
    yield True, "a field more in the atlas", put("atlas", "extra", value=1)
    yield True, "a field more in a tile", put("tiles", 0, "extra", value=1)
    for kind in ("wang", "corner", "triangle", "frame", "hexagon"):
        squares_with_edges = {kind, doc["kind"]} == {"wang", "frame"}
        if kind != doc["kind"] and not squares_with_edges:
            yield True, "kind " + kind, put("kind", value=kind)
    yield True, "size 7", put("size", value=7)
    yield True, "size as text", put("size", value=str(doc["size"]))
    yield True, "size with a fraction", put("size", value=doc["size"] + 0.5)
    yield True, "colors 5", put("colors", value=5)
    yield True, "colors 0", put("colors", value=0)
    yield True, "variants 0", put("variants", value=0)
    yield True, "gutter 3", put("atlas", "gutter", value=3)
    yield True, "packing loose", put("atlas", "packing", value="loose")
    yield True, "pitch of one number", put("atlas", "pitch", value=[64])
    yield True, "no file", put("atlas", "files", value=[])
    yield True, "another file", put("atlas", "files", value=["atlas.jpg"])
    yield True, "a path as file", put("atlas", "files", value=["atlas.png", "../atlas-2.png"])
    yield True, "no tile", put("tiles", value=[])
    yield True, "the same tile twice", put("tiles", 0, value=doc["tiles"][last])
    yield True, "x below 0", put("tiles", 0, "x", value=-1)
    yield True, "a colour 4", put("tiles", 0, colour_key, 0, value=4)
    yield True, "a colour less", drop("tiles", 0, colour_key, 0)
    yield True, "a corner of uv less", drop("tiles", 0, "uv", 0)
    yield True, "uv beyond 1", put("tiles", 0, "uv", 1, value=[0.5, 1.01])
    yield True, "uv of three numbers", put("tiles", 0, "uv", 1, value=[0.5, 0.5, 0.5])
    yield True, "variant 16", put("tiles", 0, "variant", value=16)
    if triangle:
        yield True, "direction 0", put("tiles", 0, "directions", 0, value=0)
        yield True, "two directions", drop("tiles", 0, "directions", 0)
        yield True, "four colours", put("tiles", 0, "edges", value=[0, 0, 0, 0])
        yield True, "step 2", put("tiles", 0, "step", value=2)
        yield False, "a direction turned", put("tiles", 0, "directions", 0, value=-1)
        yield False, "a step turned", put("tiles", 0, "step", value=-1)
    else:
        yield True, "directions in a square", put("tiles", 0, "directions", value=[1, 1, 1])
        yield True, "three colours", put("tiles", 0, colour_key, value=[0, 0, 0])
        yield True, "a triangle's uv", put("tiles", 0, "uv", value=[[0, 0], [0, 1], [1, 0]])
    yield False, "a tile less", drop("tiles", last)
    yield False, "a colour changed", move("tiles", 0, colour_key, 1, by=1)
    yield False, "a colour out of range", put("tiles", last, colour_key, 1, value=doc["colors"])
    yield False, "a variant changed", put("tiles", 0, "variant", value=doc["variants"])
    yield False, "variants one more", move("variants", by=1)
    yield False, "a tile one pixel off", move("tiles", 0, "x", by=1)
    yield False, "a tile upon the other", lambda d: d["tiles"][0].update(
        x=d["tiles"][last]["x"], y=d["tiles"][last]["y"])
    yield False, "uv one pixel off", move("tiles", 0, "uv", 0, 0, by=1 / doc["atlas"]["width"])
    yield False, "a narrower atlas", move("atlas", "width", by=-1)
    yield False, "another pitch", move("atlas", "pitch", 1, by=1)
    yield False, "a file that is not there", put("atlas", "files",
                                                 value=["atlas.png", "atlas-8.png"])


def check_damages(doc, folder, reduced, classes):
    check_document(doc, folder, reduced, classes)
    missed = 0
    for by_schema, what, change in damages(doc):
        damaged = copy.deepcopy(doc)
        change(damaged)
        by_checks = False
        if by_schema:
            by_checks = not VALIDATOR.is_valid(damaged)
        else:
            try:
                check_document(damaged, folder, reduced, classes)
            except (Wrong, OSError, KeyError):
                by_checks = True
        missed += not by_checks
        print(("" if by_checks else "not ") + "ok - %s: noticed by the %s: %s" % (
            doc["kind"], "schema" if by_schema else "checks", what))
    return missed


# ---- sets for other programs

def cells(doc):
    """Column and row of each tile in the grid of the atlas."""
    atlas = doc["atlas"]
    return [((t["x"] - atlas["gutter"]) // atlas["pitch"][0], (t["y"] - atlas["gutter"]) // atlas["pitch"][1])
            for t in doc["tiles"]]


def colors_of(doc):
    key = "corners" if doc["kind"] == "corner" else "edges"
    return [t[key] for t in doc["tiles"]]


def check_tiled(doc, folder):
    path = os.path.join(folder, "tiles.tsx")
    tileset = xml.etree.ElementTree.parse(path).getroot()
    atlas, size = doc["atlas"], doc["size"]
    want = {"tilewidth": size, "tileheight": size, "spacing": atlas["pitch"][0] - size,
            "margin": atlas["gutter"], "columns": atlas["columns"],
            "tilecount": atlas["columns"] * (atlas["height"] // atlas["pitch"][1])}
    for name, value in want.items():
        need(tileset.get(name) == str(value), path, name, "is", tileset.get(name), "not", value)
    image = tileset.find("image").attrib
    need(image == {"source": "atlas.png", "width": str(atlas["width"]), "height": str(atlas["height"])}, path, image)
    wang = tileset.find("wangsets").find("wangset")
    is_corner = doc["kind"] == "corner"
    need(wang.get("type") == ("corner" if is_corner else "edge"), path, "is of another type")
    need(len(wang.findall("wangcolor")) == doc["colors"], path, "has other colors")
    ids = {int(t.get("tileid")): list(map(int, t.get("wangid").split(","))) for t in wang.findall("wangtile")}
    need(len(ids) == len(doc["tiles"]), path, "has", len(ids), "tiles")
    order = (7, 1, 3, 5) if is_corner else (0, 2, 4, 6)  # from the top edge on, clockwise
    numbers = [row * atlas["columns"] + column for column, row in cells(doc)]
    for number, colors in zip(numbers, colors_of(doc)):
        parts = ids[number]
        need([parts[k] - 1 for k in order] == colors and sum(parts[k] for k in order) == sum(parts),
             path, "tile", number, "has the colors", parts)
    if shutil.which("tmxrasterizer"):
        check_drawn(doc, folder, numbers)


def check_drawn(doc, folder, numbers):
    """Tiled's own program draws all tiles in a row."""
    size, count = doc["size"], len(numbers)
    with tempfile.TemporaryDirectory() as scratch:
        for name in "tiles.tsx", "atlas.png":
            shutil.copy(os.path.join(folder, name), scratch)
        with open(os.path.join(scratch, "map.tmx"), "w") as file:
            file.write('<map version="1.8" orientation="orthogonal" width="%d" height="1" tilewidth="%d" '
                       'tileheight="%d"><tileset firstgid="1" source="tiles.tsx"/><layer id="1" name="a" '
                       'width="%d" height="1"><data encoding="csv">%s</data></layer></map>' % (
                           count, size, size, count, ",".join(str(n + 1) for n in numbers)))
        result = subprocess.run(["tmxrasterizer", "map.tmx", "map.png"], cwd=scratch, capture_output=True,
                                env=dict(os.environ, QT_QPA_PLATFORM="offscreen"))
        need(result.returncode == 0, "Tiled:", result.stderr)
        drawn = Picture(os.path.join(scratch, "map.png"))
    atlas = Picture(os.path.join(folder, "atlas.png"))
    need((drawn.width, drawn.height) == (count * size, size), "Tiled draws", drawn.width, drawn.height)
    for i, tile in enumerate(doc["tiles"]):
        for y in range(0, size, 3):
            for x in range(0, size, 3):
                a, b = atlas.block(tile["x"] + x, tile["y"] + y, 1, 1), drawn.block(i * size + x, y, 1, 1)
                if atlas.channels == 1:
                    a = a * 3
                if atlas.channels in (1, 3):
                    need(a[:3] == b[:3], "Tiled draws another tile", i)


VALUES = (r'"[^"]*"', r"-?\d+", r"Vector2i\(\d+, \d+\)", r"Color\([\d.]+, [\d.]+, [\d.]+, 1\)",
          r'ExtResource\("1"\)', r'SubResource\("2"\)')


def check_godot(doc, folder):
    """By the published format of resources: tags, then names with values, of which none is repeated."""
    path, sections = os.path.join(folder, "tiles.tres"), []
    with open(path) as file:
        for line in filter(None, file.read().split("\n")):
            if line.startswith("["):
                sections.append((line, {}))
                continue
            name, value = line.split(" = ")
            need(any(re.fullmatch(v, value) for v in VALUES), path, "has a value", value)
            need(name not in sections[-1][1], path, "has", name, "twice")
            sections[-1][1][name] = value
    tags = ['[gd_resource type="TileSet" load_steps=3 format=3]',
            '[ext_resource type="Texture2D" path="atlas.png" id="1"]',
            '[sub_resource type="TileSetAtlasSource" id="2"]', "[resource]"]
    need([tag for tag, _ in sections] == tags, path, "has other sections")
    source, resource = sections[2][1], sections[3][1]
    atlas, size = doc["atlas"], doc["size"]

    def take(values, name, value):
        need(values.pop(name, None) == value, path, name, "is not", value)

    take(source, "texture", 'ExtResource("1")')
    for name, x, y in (("margins", atlas["gutter"], atlas["gutter"]), ("texture_region_size", size, size),
                       ("separation", atlas["pitch"][0] - size, atlas["pitch"][1] - size)):
        take(source, name, "Vector2i(%d, %d)" % (x, y))
    is_corner = doc["kind"] == "corner"
    names = (["top_left_corner", "top_right_corner", "bottom_right_corner", "bottom_left_corner"] if is_corner
             else ["top_side", "right_side", "bottom_side", "left_side"])
    for (column, row), colors in zip(cells(doc), colors_of(doc)):
        tile = "%d:%d/0" % (column, row)
        take(source, tile, "0")
        take(source, tile + "/terrain_set", "0")
        main = source.pop(tile + "/terrain")
        need(colors.count(int(main)) == max(map(colors.count, colors)), path, tile, "is of terrain", main)
        for name, color in zip(names, colors):
            take(source, "%s/terrains_peering_bit/%s" % (tile, name), str(color))
    need(not source, path, "has too much:", source)
    take(resource, "tile_size", "Vector2i(%d, %d)" % (size, size))
    take(resource, "terrain_set_0/mode", "1" if is_corner else "2")
    take(resource, "sources/0", 'SubResource("2")')
    for c in range(doc["colors"]):
        take(resource, "terrain_set_0/terrain_%d/name" % c, '"color %d"' % c)
        resource.pop("terrain_set_0/terrain_%d/color" % c)
    need(not resource, path, "has too much:", resource)


def main():
    options = sys.argv[2:]
    folder, reduced, classes = sys.argv[1], "--reduced" in options, None
    if "--classes" in options:
        classes = [tuple(map(int, c.split(",")))
                   for c in options[options.index("--classes") + 1].split(";")]
    with open(os.path.join(folder, "tiles.json")) as file:
        doc = json.load(file)
    if "--different" in options:
        atlas, size = Picture(os.path.join(folder, "atlas.png")), doc["size"]
        pictures = {atlas.block(t["x"], t["y"], size, size) for t in doc["tiles"]}
        print(len(doc["tiles"]), "tiles,", len(pictures), "different pictures")
        return 0 if len(pictures) == len(doc["tiles"]) else 1
    if "--damaged" in options:
        return 1 if check_damages(doc, folder, reduced, classes) else 0
    try:
        check_document(doc, folder, reduced, classes)
        atlas = Picture(os.path.join(folder, "atlas.png"))
        check_joints(doc, atlas)
        check_preview(doc, atlas, Picture(os.path.join(folder, "preview.png")), not classes)
        if doc["kind"] != "triangle":
            check_tiled(doc, folder)
            check_godot(doc, folder)
    except Wrong as wrong:
        print("%s: %s" % (folder, wrong))
        return 1
    return 0


sys.exit(main())
