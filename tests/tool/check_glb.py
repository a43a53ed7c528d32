#!/usr/bin/env python3
# check_glb.py FILE.glb [NAME=VALUE...] - is this GLB whole, and does it hold what it should?
# SPDX-License-Identifier: MIT OR Unlicense
#
# Checks the container, that every accessor lies in its buffer and keeps its promises (bounds, unit
# normals, indices in range), and instancing. NAME=VALUE asks for more: places (different positions
# of the surface), vertices, triangles, instances, prototypes, images (embedded), uris (referred to),
# uvs, colors (1 or 0). It prints them all.
import json
import math
import struct
import sys

FORMATS = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def need(condition, what):
    if not condition:
        sys.exit("check_glb: " + what)


def read_chunks(data):
    need(len(data) >= 20, "too short")
    magic, version, length = struct.unpack_from("<4sII", data)
    need(magic == b"glTF" and version == 2, "no GLB of version 2")
    need(length == len(data), "the header says %d bytes, there are %d" % (length, len(data)))
    chunks, at = [], 12
    while at < length:
        size, kind = struct.unpack_from("<I4s", data, at)
        need(size % 4 == 0 and at + 8 + size <= length, "a chunk is not aligned or too long")
        chunks.append((kind, data[at + 8:at + 8 + size]))
        at += 8 + size
    need([k for k, _ in chunks] in ([b"JSON"], [b"JSON", b"BIN\0"]), "not one JSON and one BIN chunk")
    return json.loads(chunks[0][1].decode("utf-8")), chunks[1][1] if len(chunks) > 1 else b""


class Glb:
    def __init__(self, path):
        with open(path, "rb") as f:
            self.json, self.bin = read_chunks(f.read())
        need(self.json["asset"]["version"] == "2.0", "asset.version")
        buffers = self.json.get("buffers", [])
        need(len(buffers) == 1 and "uri" not in buffers[0], "not one buffer, the BIN chunk")
        size = buffers[0]["byteLength"]
        need(len(self.bin) - 3 <= size <= len(self.bin), "the buffer is not the BIN chunk")
        for view in self.json["bufferViews"]:
            need(view.get("byteOffset", 0) + view["byteLength"] <= size, "a view beyond the buffer")

    def values(self, index):
        """An accessor as a list of tuples, checked against its own bounds."""
        a = self.json["accessors"][index]
        view = self.json["bufferViews"][a["bufferView"]]
        code, width = FORMATS[a["componentType"]], WIDTHS[a["type"]]
        item = struct.calcsize("<%d%s" % (width, code))
        stride = view.get("byteStride", item)
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        need(start % struct.calcsize("<" + code) == 0, "accessor %d is not aligned" % index)
        need(a["count"] >= 1, "accessor %d is empty" % index)
        last = a.get("byteOffset", 0) + (a["count"] - 1) * stride + item
        need(last <= view["byteLength"], "accessor %d does not fit into its view" % index)
        out = [struct.unpack_from("<%d%s" % (width, code), self.bin, start + i * stride)
               for i in range(a["count"])]
        for t in out:
            need(all(math.isfinite(x) for x in t), "accessor %d: not finite" % index)
        for name, best in (("min", min), ("max", max)):
            if name in a:
                bound = struct.unpack("<%d%s" % (width, code), struct.pack(
                    "<%d%s" % (width, code), *a[name])) # decimals stand for the nearest float
                need(tuple(best(column) for column in zip(*out)) == bound,
                     "accessor %d: %s is not true" % (index, name))
        return out

    def primitive(self, p):
        """Its positions and indices."""
        at = p["attributes"]
        positions = self.values(at["POSITION"])
        need("min" in self.json["accessors"][at["POSITION"]], "POSITION without min and max")
        for name, index in at.items():
            need(self.json["accessors"][index]["count"] == len(positions), name + ": another count")
            values = self.values(index)
            if name == "NORMAL":
                need(all(abs(math.hypot(*n) - 1) < 1e-3 for n in values), "normals are not unit")
        need(p.get("mode", 4) == 4, "not triangles")
        indices = [i[0] for i in self.values(p["indices"])]
        need(len(indices) % 3 == 0, "a triangle has not three corners")
        need(max(indices) < len(positions), "an index is too large")
        material = self.json.get("materials", [{}])[p.get("material", 0)]
        need("normalTexture" not in material or "TANGENT" in at, "a normal map without tangents")
        if "TANGENT" in at:
            self.tangents(at, positions, indices)
        return positions, indices

    def tangents(self, at, positions, indices):
        """Unit, at right angles to the normals, in the direction in which u grows; w: unmirrored."""
        tangents, normals, uvs = (self.values(at[n]) for n in ("TANGENT", "NORMAL", "TEXCOORD_0"))
        for t, n in zip(tangents, normals):
            need(abs(math.hypot(*t[:3]) - 1) < 1e-3 and abs(t[3]) == 1, "a tangent")
            need(abs(sum(x * y for x, y in zip(t, n))) < 1e-3, "a tangent that is not on the surface")
        right = count = 0
        for i in range(0, len(indices), 3):
            a, b, c = indices[i:i + 3]
            e, f = ([q - p for p, q in zip(positions[a], positions[x])] for x in (b, c))
            (s, u), (v, w) = ([q - p for p, q in zip(uvs[a], uvs[x])] for x in (b, c))
            area = s * w - v * u
            if abs(area) < 1e-12:
                continue
            along = [(x * w - y * u) / area for x, y in zip(e, f)]
            count += 1
            right += all(sum(x * y for x, y in zip(along, tangents[k])) > 0 and tangents[k][3] * area < 0
                         for k in (a, b, c))
        need(right > 0.85 * count, "%d of %d triangles have tangents along u" % (right, count))


def instances_of(glb, node):
    ext = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
    if ext is None:
        return 0
    for name in ("extensionsUsed", "extensionsRequired"):
        need("EXT_mesh_gpu_instancing" in glb.json.get(name, []), name + " does not name it")
    values = {name: glb.values(index) for name, index in ext["attributes"].items()}
    counts = {len(v) for v in values.values()}
    need(len(counts) == 1, "instances: attributes of different counts")
    for q in values.get("ROTATION", []):
        need(abs(math.hypot(*q) - 1) < 1e-3, "instances: a rotation is not unit")
    for s in values.get("SCALE", []):
        need(min(s) > 0, "instances: a scale is not positive")
    return counts.pop()


def check_images(glb):
    embedded = uris = 0
    for image in glb.json.get("images", []):
        if "uri" in image:
            uris += 1
            continue
        view = glb.json["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        need(glb.bin[start:start + 8] == b"\x89PNG\r\n\x1a\n", "the image is no PNG")
        need(glb.bin[start:start + view["byteLength"]].endswith(b"IEND\xaeB`\x82"), "the PNG is cut")
        need(image["mimeType"] == "image/png", "mimeType")
        embedded += 1
    return embedded, uris


def main():
    glb = Glb(sys.argv[1])
    found = dict.fromkeys(("places", "vertices", "triangles", "instances", "prototypes", "uvs",
                           "colors"), 0)
    nodes = glb.json["nodes"]
    need(sorted(glb.json["scenes"][glb.json.get("scene", 0)]["nodes"]) == list(range(len(nodes))),
         "the scene does not show all nodes")
    for node in nodes:
        if "mesh" not in node:
            continue
        count = instances_of(glb, node)
        used = {} # by the primitives of several materials, which share their vertices
        for p in glb.json["meshes"][node["mesh"]]["primitives"]:
            positions, indices = glb.primitive(p)
            shared = used.setdefault(p["attributes"]["POSITION"], set())
            if not shared and not count:
                found["vertices"] += len(positions)
                found["places"] += len(set(positions))
            shared.update(indices)
            if count:
                continue
            found["triangles"] += len(indices) // 3
            found["uvs"] |= "TEXCOORD_0" in p["attributes"]
            found["colors"] |= "COLOR_0" in p["attributes"]
        for accessor, indices in used.items():
            need(indices == set(range(len(glb.values(accessor)))), "a vertex of no triangle")
        found["instances"] += count
        found["prototypes"] += count > 0
    found["images"], found["uris"] = check_images(glb)
    print(" ".join("%s=%d" % pair for pair in found.items()))
    for wish in sys.argv[2:]:
        name, value = wish.split("=")
        need(found[name] == int(value), "%s is %d, not %s" % (name, found[name], value))


if __name__ == "__main__":
    main()
