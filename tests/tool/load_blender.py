# load_blender.py - does Blender read these trees and forests as we do?
# SPDX-License-Identifier: MIT OR Unlicense
#
#   blender --background --python-exit-code 1 --python tests/tool/load_blender.py -- FILE.glb...
#
# Beside each FILE.glb lies FILE.json, which check_tree.py wrote: names, boxes and triangles of plain
# nodes; or how many joints there are, and where some vertices are at two times of the clip. Prints
# "ok - FILE" or "not ok - FILE" and what is wrong.
import json
import math
import sys

import bpy
import numpy

if not hasattr(numpy, "bool"):
    numpy.bool = bool  # the importer of Blender 3.4 is older than Debian's numpy


def need(holds, what):
    if not holds:
        raise ValueError(what)


def ours(v):
    """From Blender's coordinates, z up, to those of the file."""
    return (v[0], v[2], -v[1])


def distance(a, b):
    return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b)))


def check_placed(expect):
    for n in expect:
        o = bpy.data.objects[n["name"]]
        need(len(o.data.polygons) == n["triangles"], "triangles of " + n["name"])
        points = [ours(o.matrix_world @ v.co) for v in o.data.vertices]
        box = [[f(p[k] for p in points) for k in range(3)] for f in (min, max)]
        far = max(distance(a, b) for a, b in zip(box, n["box"]))
        need(far < 1e-4 * max(n["box"][1]), "%s is %g away" % (n["name"], far))
    return "%d nodes" % len(expect)


def check_skin(expect):
    rig, = [o for o in bpy.data.objects if o.type == "ARMATURE"]
    tree, = [o for o in bpy.data.objects if o.type == "MESH" and o.find_armature() == rig]
    need(len(rig.data.bones) == expect["joints"], "%d bones" % len(rig.data.bones))
    scene, worst, size = bpy.context.scene, 0, 0
    fps = scene.render.fps / scene.render.fps_base
    for which, time in enumerate(expect.get("times", [])):
        frame = time * fps
        scene.frame_set(int(frame), subframe=frame - int(frame))
        shape = tree.evaluated_get(bpy.context.evaluated_depsgraph_get())
        vertices, first = shape.data.vertices, 0
        for p in expect["primitives"]:
            for s in p["samples"]:
                at = ours(shape.matrix_world @ vertices[first + s["index"]].co)
                worst = max(worst, distance(at, s["at"][which]))
                size = max([size] + [abs(x) for x in at])
            first += p["vertices"]
        need(first == len(vertices), "%d vertices" % len(vertices))
    need(worst < 1e-3 * max(size, 1e-9) or not size, "vertices up to %g from where they should be" % worst)
    return "%d bones, vertices at most %.2g m from ours" % (expect["joints"], worst)


def main():
    failed = 0
    for path in sys.argv[sys.argv.index("--") + 1:]:
        try:
            with open(path[:-4] + ".json") as f:
                expect = json.load(f)
            bpy.ops.wm.read_factory_settings(use_empty=True)
            bpy.ops.import_scene.gltf(filepath=path)
            told = check_placed(expect["placed"]) if "placed" in expect else check_skin(expect)
            print("ok - Blender reads %s: %s" % (path, told))
        except Exception as e:  # whatever it is, this file is not read as it should be
            failed += 1
            print("not ok - Blender reads %s\n    # %s" % (path, e))
    sys.exit(failed)


main()
