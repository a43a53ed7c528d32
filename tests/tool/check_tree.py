#!/usr/bin/env python3
# check_tree.py KIND FILE [NAME=VALUE...] - does a file of 'texkit tree' or 'forest' hold what it should?
# SPDX-License-Identifier: MIT OR Unlicense
#
# KIND is
#   skin     a GLB with a skeleton; bones=FILE is what tests/tool/sway_bones.c printed of the same tree. Reads it by itself, does the skinning itself: weights, hierarchy,
#            inverse bind matrices, the welded bark (see obj), the clip: keys without jumps, the last
#            like the first, vertices finite and within reach at several times
#   forest   a GLB of copies: instanced nodes, their attributes
#   variants a GLB of plain nodes: no extension, every mesh in use, each bark one surface, the nodes
#            upright; expect=FILE: names, boxes and triangles of the nodes, for other programs to compare
#   attributes  a GLB of --wind-attributes; skin=FILE is the same tree with its skeleton. The numbers
#            for shaders fit the joints, and the shader of docs/trees.md tears nothing
#   relief   a GLB whose bark has a normal map: does it fit the bark?
#   placed   FILE is what 'assimp export x.glb y.assjson' made of such nodes; expect=JSON as above
#   obj      an OBJ: the bark is one surface, manifold, oriented, open at the root rim or nowhere
#   assimp   FILE is what 'assimp export x.glb y.assjson' made; expect=JSON names what 'skin' wrote
# NAME=VALUE asks for more: joints, keys, seconds, components, rims (border loops of the bark), trees,
# pieces, materials, images, nodes. posed=1: the joints do not stand as the mesh was bound. expect=FILE
# (of skin): write vertices and where they are at two times of the clip, for other programs to compare.
import json
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../kit"))
from check_glb import Glb, need  # noqa: E402
from png import Png  # noqa: E402

SAMPLES = 60  # vertices of a primitive that other programs compare


# ---- rotations and matrices (rows of a 3 x 4 matrix)

def matrix(t, q, s=(1, 1, 1)):
    x, y, z, w = q
    r = ((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
         (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
         (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)))
    return tuple(tuple(r[i][k] * s[k] for k in range(3)) + (t[i],) for i in range(3))


def product(a, b):
    return tuple(tuple(sum(a[i][m] * b[m][k] for m in range(3)) + (a[i][3] if k == 3 else 0)
                       for k in range(4)) for i in range(3))


def apply(m, p):
    return tuple(m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3] for i in range(3))


def slerp(a, b, t):
    dot = sum(x * y for x, y in zip(a, b))
    if dot < 0:
        b, dot = tuple(-x for x in b), -dot
    if dot > 0.9999999:
        q = tuple(x + t * (y - x) for x, y in zip(a, b))
    else:
        angle = math.acos(min(dot, 1))
        u, v = math.sin((1 - t) * angle), math.sin(t * angle)
        q = tuple((u * x + v * y) / math.sin(angle) for x, y in zip(a, b))
    n = math.sqrt(sum(x * x for x in q))
    return tuple(x / n for x in q)


def distance(a, b):
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b)))


# ---- surfaces

def find(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


def audit(faces, want):
    """Is this welded surface whole? Its components and border loops must be as many as wanted."""
    sides, parent = {}, {}
    for f in faces:
        need(len(set(f)) == 3, "a face with two corners in one place")
        for k in range(3):
            a, b = f[k], f[(k + 1) % 3]
            need((a, b) not in sides, "a side of two faces that are not oriented alike")
            sides[a, b] = True
            parent.setdefault(a, a)
            parent.setdefault(b, b)
            parent[find(parent, a)] = find(parent, b)
    components = len(set(find(parent, i) for i in parent))
    border = {}
    for a, b in sides:
        if (b, a) in sides:
            continue
        need(a not in border, "a border that crosses itself")
        border[a] = b
    loops = 0
    left = set(border)
    while left:
        start = at = left.pop()
        loops += 1
        while border.get(at) != start:
            at = border.get(at)
            need(at in left, "a border that does not close")
            left.discard(at)
    need(components == int(want.pop("components", 1)), "%d components" % components)
    need(loops == int(want.pop("rims", 1)), "%d border loops" % loops)
    return len(parent), len(border)


# ---- a skinned tree

class Tree(Glb):
    def __init__(self, path):
        super().__init__(path)
        g = self.json
        need(len(g.get("skins", [])) == 1, "not one skin")
        skin = g["skins"][0]
        self.joints = skin["joints"]
        self.nodes = g["nodes"]
        self.parent = {}
        for i, n in enumerate(self.nodes):
            for c in n.get("children", []):
                need(c not in self.parent, "node %d has two parents" % c)
                self.parent[c] = i
        roots = [i for i in self.joints if i not in self.parent]
        need(len(roots) == 1, "%d joints without a parent" % len(roots))
        need(set(self.parent) == set(self.joints) - set(roots), "a node below a joint is none")
        for i in self.joints:
            n = self.nodes[i]
            need("scale" not in n and "matrix" not in n, "joint %d has a scale" % i)
            need(abs(sum(x * x for x in n["rotation"]) - 1) < 1e-5, "rotation of joint %d" % i)
        self.bind = [tuple(tuple(m[4 * c + r] for c in range(4)) for r in range(3))
                     for m in self.matrices(skin["inverseBindMatrices"])]
        need(len(self.bind) == len(self.joints), "inverse bind matrices")
        meshes = [n for n in self.nodes if "mesh" in n]
        need(len(meshes) == 1 and meshes[0].get("skin") == 0, "not one skinned node")
        self.primitives = g["meshes"][meshes[0]["mesh"]]["primitives"]
        self.read_clip()

    def matrices(self, index):
        a = self.json["accessors"][index]
        a["type"], count = "SCALAR", a["count"]
        need("byteStride" not in self.json["bufferViews"][a["bufferView"]], "stride of matrices")
        a["count"] = 16 * count
        flat = [v for v, in self.values(index)]
        a["type"], a["count"] = "MAT4", count
        for i in range(count):
            need(flat[16 * i + 3:16 * i + 16:4] == [0, 0, 0, 1], "last row of a bind matrix")
        return [flat[16 * i:16 * i + 16] for i in range(count)]

    def read_clip(self):
        clips = self.json.get("animations", [])
        self.times, self.turns = [], {}
        need(len(clips) <= 1, "more than one clip")
        for clip in clips:
            for ch in clip["channels"]:
                s = clip["samplers"][ch["sampler"]]
                need(ch["target"]["path"] == "rotation", "a channel that is no rotation")
                need(s.get("interpolation", "LINEAR") == "LINEAR", "interpolation")
                times = self.times or [t for t, in self.values(s["input"])]
                node = ch["target"]["node"]
                need(node not in self.turns, "two channels of one joint")
                self.turns[node] = self.values(s["output"])
                need(len(self.turns[node]) == len(times), "keys of joint %d" % node)
                self.times = times
            need(set(self.turns) <= set(self.joints), "a channel of what is no joint")
            need(self.times[0] == 0 and all(a < b for a, b in zip(self.times, self.times[1:])),
                 "times of keys")

    def check_keys(self):
        for node, turns in self.turns.items():
            for q in turns:
                need(abs(sum(x * x for x in q) - 1) < 1e-5, "a key of %d is no unit quaternion" % node)
            steps = [distance(a, b) for a, b in zip(turns, turns[1:])]
            need(turns[0] == turns[-1], "the last key of %d is not the first" % node)
            need(max(steps) < 0.45, "the keys of %d jump" % node)
            bends = [max(abs(a[k] - 2 * b[k] + c[k]) for k in range(4))
                     for a, b, c in zip(turns, turns[1:], turns[2:])]
            seam = max(abs(turns[-2][k] - 2 * turns[0][k] + turns[1][k]) for k in range(4))
            need(seam <= 2 * max(bends) + 1e-5, "the clip of %d goes on with a jerk" % node)

    def pose(self, time=None):
        """Skin matrices, of the joints as they stand or at a time of the clip."""
        world = self.place(time)
        return [product(world[j], b) for j, b in zip(self.joints, self.bind)]

    def place(self, time=None):
        """Where the joints are, each a matrix."""
        world = {}

        def place(i):
            if i not in world:
                n = self.nodes[i]
                q = n["rotation"]
                if time is not None and i in self.turns:
                    k = max(j for j in range(len(self.times) - 1) if self.times[j] <= time)
                    t = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
                    q = slerp(self.turns[i][k], self.turns[i][k + 1], t)
                own = matrix(n["translation"], q)
                p = self.parent.get(i)
                world[i] = product(place(p), own) if p is not None else own
            return world[i]
        order = []  # parents first, lest the recursion run deep
        stack = [i for i in self.joints if i not in self.parent]
        while stack:
            i = stack.pop()
            order.append(i)
            stack += self.nodes[i].get("children", [])
        for i in order:
            place(i)
        return world


def skinned(positions, joints, weights, pose):
    out = []
    for p, j, w in zip(positions, joints, weights):
        q = [0, 0, 0]
        for k in range(4):
            if w[k] > 0:
                r = apply(pose[j[k]], p)
                for a in range(3):
                    q[a] += w[k] * r[a]
        out.append(tuple(q))
    return out


def check_bones(tree, path):
    """Are the joints at the times of some keys where the library alone says that the bones are? A sample
    for other programs to compare."""
    with open(path) as f:
        told = json.load(f)
    size = max(abs(m[0][k]) for m in told["pieces"] for k in (3, 7, 11))
    names = {j: int(tree.nodes[j]["name"].split()[-1]) for j in tree.joints}
    moved = 0
    for which, time in enumerate(told["times"]):
        world = tree.place(time)
        for j, number in names.items():
            want = told["pieces"][number][which]
            for r in range(3):
                for c in range(4):
                    need(abs(world[j][r][c] - want[4 * r + c]) < 2e-3 * (size if c == 3 else 1),
                         "joint %d is not where the library has it" % number)
            moved = max(moved, abs(want[3] - told["pieces"][number][0][3]))
    need(moved > 0.01 * size, "nothing moves")
    step = max(1, len(names) // SAMPLES)
    return {"times": told["times"], "size": size,
            "pieces": {n: told["pieces"][n] for n in sorted(names.values())[::step]}}


def check_skin(path, want):
    tree = Tree(path)
    g = tree.json
    rest = tree.pose()
    posed = int(want.pop("posed", 0))
    size = 0
    expect = {"joints": len(tree.joints), "seconds": tree.times[-1] if tree.times else 0,
              "primitives": []}
    if tree.times:
        expect["times"] = [0.37 * tree.times[-1], 0.71 * tree.times[-1]]
        tree.check_keys()
    poses = [tree.pose(t) for t in expect.get("times", [])]
    if "bones" in want:
        expect["bones"] = check_bones(tree, want.pop("bones"))
    for number, p in enumerate(tree.primitives):
        at = p["attributes"]
        for name in ("POSITION", "NORMAL", "TEXCOORD_0", "JOINTS_0", "WEIGHTS_0"):
            need(name in at, "no " + name)
        a = g["accessors"]
        need(a[at["JOINTS_0"]]["componentType"] == 5123 and a[at["WEIGHTS_0"]]["componentType"] == 5126,
             "kind of joints or weights")
        tree.primitive(p)
        positions, joints, weights = (tree.values(at[n]) for n in ("POSITION", "JOINTS_0", "WEIGHTS_0"))
        bound = {}
        for x, j, w in zip(positions, joints, weights):
            need(min(w) >= 0 and abs(sum(w) - 1) < 1e-6, "weights")
            for k in range(4):
                need(j[k] < len(tree.joints) and (w[k] > 0 or j[k] == 0), "joints")
            one = bound.setdefault(x, (j, w))
            need(number > 0 or one == (j, w), "vertices in one place that move apart")
        size = max([size] + [max(abs(c) for c in x) for x in positions])
        if not posed:
            for x, y in zip(positions, skinned(positions, joints, weights, rest)):
                need(distance(x, y) < 1e-4 * (1 + size), "the bind matrices do not fit the joints")
        indices = [i for i, in tree.values(p["indices"])]
        if number == 0:
            ids = {}
            places = [ids.setdefault(x, len(ids)) for x in positions]
            vertices, border = audit([tuple(places[i] for i in indices[t:t + 3])
                                      for t in range(0, len(indices), 3)], want)
            print("%d vertices of the bark, %d border edges" % (vertices, border))
        moved = [skinned(positions, joints, weights, m) for m in poses]
        for m in moved:
            far = [distance(x, y) for x, y in zip(positions, m)]
            need(all(math.isfinite(d) for d in far), "a vertex is not finite")
            need(max(far) < 0.5 * size or posed, "a vertex goes far astray")
            need(max(far) > 1e-4 * size, "nothing moves")
        step = max(1, len(positions) // SAMPLES)
        expect["primitives"].append({
            "vertices": len(positions), "triangles": len(indices) // 3,
            "samples": [{"index": i, "at": [m[i] for m in moved]}
                        for i in range(0, len(positions), step)]})
    materials = g["materials"]
    need("baseColorTexture" in materials[0]["pbrMetallicRoughness"], "bark without a picture")
    for m in materials[1:]:
        need(m.get("alphaMode") == "MASK" and m.get("doubleSided"), "material of leaves")
    extras = g["scenes"][0].get("extras", {})
    need({"species", "seed", "pieces"} <= set(extras), "extras")
    if "expect" in want:
        with open(want.pop("expect"), "w") as f:
            json.dump(expect, f)
    return {"joints": len(tree.joints), "keys": len(tree.times), "seconds": expect["seconds"],
            "pieces": extras["pieces"], "materials": len(materials),
            "images": len(g.get("images", []))}


# ---- the normal map of the bark

def picture(glb, texture):
    g = glb.json
    view = g["bufferViews"][g["images"][g["textures"][texture["index"]]["source"]]["bufferView"]]
    start = view.get("byteOffset", 0)
    return Png("a picture", glb.bin[start:start + view["byteLength"]])


def check_relief(path, _):
    """Half the size of the bark, of unit vectors, leaning to where the bark gets darker."""
    glb = Glb(path)
    material = glb.json["materials"][0]
    bark, relief = picture(glb, material["pbrMetallicRoughness"]["baseColorTexture"]), \
        picture(glb, material["normalTexture"])
    need((2 * relief.width, 2 * relief.height) == (bark.width, bark.height), "size of the normal map")
    need(glb.json["textures"][material["normalTexture"]["index"]]["sampler"] == 0, "its sampler")

    def light(x, y):
        return sum(sum(bark.lines[2 * y + v][bark.channels * (2 * x + u):][:3])
                   for u in (0, 1) for v in (0, 1))
    agree = lean = 0
    for y in range(1, relief.width - 1): # of the first layer
        for x in range(1, relief.width - 1):
            n = [c / 127.5 - 1 for c in relief.lines[y][3 * x:3 * x + 3]]
            need(abs(math.hypot(*n) - 1) < 0.02 and n[2] > 0.2, "a normal of the bark")
            for k, step in ((0, light(x - 1, y) - light(x + 1, y)), (1, light(x, y + 1) - light(x, y - 1))):
                if abs(step) < 60: # of 12 times 255
                    continue
                lean += 1
                agree += step * n[k] > 0
    need(lean > 500 and agree == lean, "%d of %d normals lean as the bark does" % (agree, lean))
    return {"reliefs": lean}


# ---- a forest of copies

def check_forest(path, want):
    glb = Glb(path)
    g = glb.json
    copies = leaves = 0
    for n in g["nodes"]:
        at = n["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]
        lists = {name: glb.values(i) for name, i in at.items()}
        need(len(set(len(v) for v in lists.values())) == 1, "attributes of different length")
        for q in lists["ROTATION"]:
            need(abs(sum(x * x for x in q) - 1) < 1e-5, "a rotation")
        need(all(min(s) > 0 for s in lists["SCALE"]), "a scale")
        mesh = g["meshes"][n["mesh"]]
        need(len(mesh["primitives"]) == 1, "primitives")
        glb.primitive(mesh["primitives"][0])
        if g["materials"][mesh["primitives"][0]["material"]].get("alphaMode") == "MASK":
            leaves += len(lists["SCALE"])
        else:
            copies += len(lists["SCALE"])
            need(all(s[0] == s[2] for s in lists["SCALE"]), "a piece that is not round")
    extras = g["scenes"][0]["extras"]
    need(copies == extras["pieces"], "%d copies of %d pieces" % (copies, extras["pieces"]))
    need(len(set(n["mesh"] for n in g["nodes"])) == len(g["nodes"]), "two nodes of one mesh")
    if "expect" in want:
        with open(want.pop("expect"), "w") as f:
            json.dump({"nodes": len(g["nodes"]), "copies": copies + leaves}, f)
    return {"nodes": len(g["nodes"]), "trees": extras["trees"], "pieces": copies, "clouds": leaves,
            "materials": len(g["materials"]), "images": len(g.get("images", []))}


# ---- a forest of plain nodes

def box_of(points):
    return [[min(p[k] for p in points) for k in range(3)], [max(p[k] for p in points) for k in range(3)]]


def check_variants(path, want):
    glb = Glb(path)
    g = glb.json
    need(not {"extensionsUsed", "extensionsRequired", "skins", "animations"} & set(g), "more than nodes")
    need(g["scenes"][0]["nodes"] == list(range(len(g["nodes"]))), "nodes that the scene does not show")
    points, triangles, own_rims = [], [], want.pop("rims", 1)
    for m in g["meshes"]:
        points.append([])
        triangles.append(0)
        for number, p in enumerate(m["primitives"]):
            glb.primitive(p)
            positions = glb.values(p["attributes"]["POSITION"])
            indices = [i for i, in glb.values(p["indices"])]
            points[-1] += positions
            triangles[-1] += len(indices) // 3
            leaves = g["materials"][p["material"]].get("alphaMode") == "MASK"
            need(leaves == (number == 1), "which primitive is leaves")
            if number == 0:
                ids = {}
                places = [ids.setdefault(x, len(ids)) for x in positions]
                audit([tuple(places[i] for i in indices[t:t + 3]) for t in range(0, len(indices), 3)],
                      {"rims": own_rims})
        low, high = box_of(points[-1])
        need(abs(low[1]) < 0.1 * high[1] and low[0] < 0 < high[0], "a variant that is not at the origin")
    nodes, used = [], [0] * len(g["meshes"])
    for n in g["nodes"]:
        need(set(n) == {"name", "mesh", "translation", "rotation", "scale"}, "fields of a node")
        q, s = n["rotation"], n["scale"]
        need(abs(sum(x * x for x in q) - 1) < 1e-5 and q[0] == q[2] == 0, "a tree that leans")
        need(s[0] == s[1] == s[2] and 0.7 < s[0] < 1.3 and n["translation"][1] == 0, "a scale or height")
        used[n["mesh"]] += 1
        m = matrix(n["translation"], q, s)
        nodes.append({"name": n["name"], "triangles": triangles[n["mesh"]],
                      "box": box_of([apply(m, p) for p in points[n["mesh"]]])})
        need(n["name"].startswith(g["meshes"][n["mesh"]]["name"] + "-"), "name of a node")
    need(min(used) > 0 and max(used) <= 1.5 * min(used) + 1, "variants are in use %s times" % used)
    need(len(set(n["name"] for n in nodes)) == len(nodes), "two nodes of one name")
    need(len(set(tuple(n["translation"]) for n in g["nodes"])) == len(nodes), "two trees in one place")
    turns = [n["mesh"] for n in sorted(g["nodes"], key=lambda n: n["translation"])]
    need(len(set(turns)) == 1 or turns != sorted(turns), "variants in rows")
    extras = g["scenes"][0]["extras"]
    need(extras["trees"] == len(nodes), "trees in the extras")
    if "expect" in want:
        with open(want.pop("expect"), "w") as f:
            json.dump({"placed": nodes}, f)
    return {"nodes": len(nodes), "variants": len(g["meshes"]), "materials": len(g["materials"]),
            "images": len(g.get("images", [])), "pieces": extras["pieces"],
            "triangles": sum(n["triangles"] for n in nodes)}


def check_placed(path, want):
    with open(path) as f:
        scene = json.load(f)
    with open(want.pop("expect")) as f:
        expect = {n["name"]: n for n in json.load(f)["placed"]}
    stack, found = [(scene["rootnode"], ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0)))], 0
    while stack:
        node, above = stack.pop()
        m = node["transformation"]
        world = product(above, tuple(tuple(m[4 * r:4 * r + 4]) for r in range(3)))
        stack += [(c, world) for c in node.get("children", [])]
        if node["name"] not in expect:
            continue
        found += 1
        wanted = expect[node["name"]]
        meshes = [scene["meshes"][i] for i in node["meshes"]]
        need(sum(len(m["faces"]) for m in meshes) == wanted["triangles"], "triangles of " + node["name"])
        box = box_of([apply(world, m["vertices"][i:i + 3]) for m in meshes
                      for i in range(0, len(m["vertices"]), 3)])
        far = max(distance(a, b) for a, b in zip(box, wanted["box"]))
        need(far < 1e-4 * max(wanted["box"][1]), "%s is %g away" % (node["name"], far))
    need(found == len(expect), "%d nodes of %d" % (found, len(expect)))
    return {}


# ---- a tree for shaders

def in_wind(p, weights, pivot, phase, wind, bend, flutter, time):
    """The shader of docs/trees.md."""
    angle = flutter * weights[1] * math.sin(2 * math.pi * (1.3 * time + phase))
    arm = [a - b for a, b in zip(p, pivot)]
    axis = (wind[2], 0, -wind[0])  # cross((0, 1, 0), wind)
    across = (axis[1] * arm[2] - axis[2] * arm[1], axis[2] * arm[0] - axis[0] * arm[2],
              axis[0] * arm[1] - axis[1] * arm[0])
    along = sum(a * b for a, b in zip(axis, arm)) * (1 - math.cos(angle))
    gust = bend * weights[0] * weights[0] * (1 + 0.4 * math.sin(2 * math.pi * 0.3 * time))
    return tuple(pivot[k] + arm[k] * math.cos(angle) + across[k] * math.sin(angle) + axis[k] * along +
                 gust * wind[k] for k in range(3))


def check_attributes(path, want):
    glb, tree = Glb(path), Tree(want.pop("skin"))
    g = glb.json
    need(not {"extensionsUsed", "skins", "animations"} & set(g) and len(g["nodes"]) == 1, "more than a mesh")
    rest = {}  # of the joints: where they are, which is the first of their branch
    for j in tree.joints:  # parents first
        n, p = tree.nodes[j], tree.parent.get(j)
        m = matrix(n["translation"], n["rotation"])
        rest[j] = product(rest[p][0], m) if p is not None else m, j
        if n["name"].startswith("trunk"):
            rest[j] = rest[j][0], tree.joints[0]
        elif not tree.nodes[p]["name"].startswith("trunk"):
            rest[j] = rest[j][0], rest[p][1]
    place = {j: tuple(row[3] for row in rest[j][0]) for j in rest}
    size = max(max(p) for p in place.values())
    weights, phases, triangles, highest, feet = {}, {}, 0, [0, 0], 0
    for p, q in zip(g["meshes"][0]["primitives"], tree.primitives):
        a, b = p["attributes"], q["attributes"]
        need({"TEXCOORD_1", "TEXCOORD_2", "TEXCOORD_3"} <= set(a) and "JOINTS_0" not in a, "attributes")
        glb.primitive(p)
        positions, joints, shares = (tree.values(b[n]) for n in ("POSITION", "JOINTS_0", "WEIGHTS_0"))
        need(glb.values(a["POSITION"]) == positions, "another tree than with a skeleton")
        numbers = list(zip(*(glb.values(a["TEXCOORD_%d" % k]) for k in (1, 2, 3))))
        moved = [[], []]
        for x, j, w, ((sway, flutter), (px, py), (pz, phase)) in zip(positions, joints, shares, numbers):
            need(0 <= sway <= 1 and 0 <= flutter <= 1 and 0 <= phase < 1, "a number beyond 0..1")
            if x[1] < 1e-6 and p is g["meshes"][0]["primitives"][0] and j[w.index(max(w))] == 0:
                need(sway == 0 and flutter == 0, "the foot moves")
                feet += 1
            highest = [max(highest[0], sway), max(highest[1], flutter)]
            joint = tree.joints[j[w.index(max(w))]]
            if max(w) == 1:  # all that one joint moves alone moves alike
                base = rest[joint][1]
                need(distance((px, py, pz), place[base]) < 1e-5 * size, "a pivot that is not the branch's joint")
                known = weights.setdefault(joint, (sway, flutter))
                need(distance(known, (sway, flutter)) < 1e-6, "weights of a joint differ")
                need(phases.setdefault(base, phase) == phase, "two phases of a branch")
            for k in range(2):
                moved[k].append(in_wind(x, (sway, flutter), (px, py, pz), phase, (0.8, 0, 0.6),
                                        0.07 * size, 0.12, 0.2 + k))
        indices = [i for i, in glb.values(p["indices"])]
        for t in range(0, len(indices), 3):
            for k in range(3):
                c, d = indices[t + k], indices[t + (k + 1) % 3]
                was = distance(positions[c], positions[d])
                for m in moved:
                    need(abs(distance(m[c], m[d]) - was) < 0.3 * was + 1e-3 * size, "the shader tears the tree")
        triangles += len(indices) // 3
        need(max(distance(x, y) for x, y in zip(positions, moved[0])) > 0.03 * size, "the shader moves nothing")
    for j, (sway, flutter) in weights.items():
        p = tree.parent.get(j)
        trunk = tree.nodes[j]["name"].startswith("trunk")
        need(not trunk or flutter == 0, "the trunk flutters")
        if p in weights:
            need(sway > weights[p][0], "sway does not grow along an axis")
            need(trunk or rest[j][1] == j or flutter > weights[p][1], "flutter does not grow along a branch")
            need(trunk or rest[j][1] != j or flutter == 0, "a branch does not begin with 0")
    need(len(weights) > 0.9 * len(tree.joints), "joints that move no vertex alone")
    need(min(highest) > 0.999 and feet >= 6, "no weight is 1, or none at the foot")
    return {"triangles": triangles, "phases": len(phases), "materials": len(g["materials"])}


# ---- OBJ

def check_obj(path, want):
    faces, vertices, material, counts = {}, [], None, {"vt": 0, "vn": 0}
    with open(path) as f:
        for line in f:
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                vertices.append(tuple(float(x) for x in words[1:4]))
            elif words[0] in counts:
                counts[words[0]] += 1
            elif words[0] == "usemtl":
                material = words[1]
            elif words[0] == "f":
                corner = [tuple(int(x) for x in w.split("/")) for w in words[1:]]
                for v, vt, vn in corner:
                    need(v <= len(vertices) and vt <= counts["vt"] and vn <= counts["vn"], "a face")
                faces.setdefault(material, []).append(tuple(c[0] for c in corner))
    bark = [f for name, list in faces.items() if name.startswith("bark") for f in list]
    used = [vertices[i - 1] for i in set(i for f in bark for i in f)]
    need(len(set(used)) == len(used), "vertices of the bark in one place")
    audit(bark, want)
    return {"materials": len(faces), "triangles": sum(len(f) for f in faces.values()),
            "bark": len(bark)}


# ---- what assimp has read

def check_assimp(path, want):
    with open(path) as f:
        scene = json.load(f)
    with open(want.pop("expect")) as f:
        expect = json.load(f)
    need(len(scene["meshes"]) == len(expect["primitives"]), "%d meshes" % len(scene["meshes"]))
    clip = scene["animations"][0]
    rate = clip.get("tickspersecond") or 1000
    channels = {c["name"]: c["rotationkeys"] for c in clip["channels"]}
    worst = 0
    size = max(abs(x) for m in scene["meshes"] for x in m["vertices"])
    for which, time in enumerate(expect["times"]):
        world = {}
        stack = [(scene["rootnode"], ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0)))]
        while stack:
            node, above = stack.pop()
            m = node["transformation"]
            own = tuple(tuple(m[4 * r:4 * r + 4]) for r in range(3))
            keys = channels.get(node["name"])
            if keys:
                ticks = time * rate
                k = max(i for i in range(len(keys) - 1) if keys[i][0] <= ticks)
                t = (ticks - keys[k][0]) / (keys[k + 1][0] - keys[k][0])
                a, b = (tuple(q[1:] + q[:1]) for q in (keys[k][1], keys[k + 1][1]))  # w x y z
                own = matrix([row[3] for row in own], slerp(a, b, t))
            world[node["name"]] = product(above, own)
            stack += [(c, world[node["name"]]) for c in node.get("children", [])]
        for mesh, primitive in zip(scene["meshes"], expect["primitives"]):
            count = len(mesh["vertices"]) // 3
            need(count == primitive["vertices"], "%d vertices" % count)
            need(len(mesh["faces"]) == primitive["triangles"], "%d faces" % len(mesh["faces"]))
            wanted = {s["index"]: s["at"][which] for s in primitive["samples"]}
            got = {i: [0, 0, 0] for i in wanted}
            names = set()
            for bone in mesh["bones"]:
                names.add(bone["name"])
                m = bone["offsetmatrix"]
                skin = product(world[bone["name"]], tuple(tuple(m[4 * r:4 * r + 4]) for r in range(3)))
                for i, w in bone["weights"]:
                    if i in got:
                        p = apply(skin, mesh["vertices"][3 * i:3 * i + 3])
                        got[i] = [x + w * y for x, y in zip(got[i], p)]
            need(names <= set(world), "a bone that is no node")
            need(len(names) <= expect["joints"], "%d bones" % len(names))
            worst = max([worst] + [distance(got[i], wanted[i]) for i in got])
    need(worst < 1e-4 * size, "vertices %g from where they should be" % worst)
    print("vertices at most %.2g from ours" % worst)
    return {"joints": len(channels)}


def main():
    need(len(sys.argv) > 2, "KIND FILE [NAME=VALUE...]")
    want = dict(a.split("=", 1) for a in sys.argv[3:])
    kinds = {"skin": check_skin, "forest": check_forest, "obj": check_obj, "assimp": check_assimp,
             "variants": check_variants, "placed": check_placed, "attributes": check_attributes,
             "relief": check_relief}
    figures = kinds[sys.argv[1]](sys.argv[2], want)
    for name, value in figures.items():
        print("%s=%s" % (name, value))
    for name, value in want.items():
        most = name.startswith("most_")
        have = figures[name[5:] if most else name]
        need(have <= float(value) if most else have == float(value),
             "%s is %s, not %s" % (name, have, value))


if __name__ == "__main__":
    main()
