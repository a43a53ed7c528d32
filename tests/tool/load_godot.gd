# load_godot.gd - does Godot 3 read these trees and forests as we do?
# SPDX-License-Identifier: MIT OR Unlicense
#
#   godot3-server --path PROJECT -s load_godot.gd
#
# PROJECT is a folder with project.godot and files FILE.glb, which the editor has imported; beside each
# lies FILE.json, which check_tree.py wrote: names, boxes and triangles of plain nodes; or how many joints
# there are, and how long the clip is. Prints "ok - FILE" or "not ok - FILE" and what is wrong.
extends SceneTree

var wrong

func need(holds, what):
    if not holds and wrong == "":
        wrong = what

func _init():
    var folder = Directory.new()
    folder.open("res://")
    folder.list_dir_begin()
    var name = folder.get_next()
    while name != "":
        if name.ends_with(".glb"):
            look("res://" + name)
        name = folder.get_next()
    quit()

func look(path):
    var file = File.new()
    file.open(path.get_basename() + ".json", File.READ)
    var expect = JSON.parse(file.get_as_text()).result
    var scene = load(path)
    wrong = ""
    need(scene != null, "it is not imported")
    if scene:
        var root = scene.instance()
        get_root().add_child(root)
        if expect.has("placed"):
            check_placed(root, expect["placed"])
        else:
            check_skin(root, expect)
        root.free()
    print("ok - " if wrong == "" else "not ok - ", "Godot reads ", path, "" if wrong == "" else "\n    # " + wrong)

func check_placed(root, expect):
    for n in expect:
        var node = root.find_node(n["name"], true, false)
        need(node is MeshInstance, "no node " + n["name"])
        if wrong != "":
            return
        var corners = node.mesh.get_faces() # three corners a triangle
        need(corners.size() == 3 * n["triangles"], "triangles of " + n["name"])
        var box = AABB(node.global_transform.xform(corners[0]), Vector3())
        for c in corners:
            box = box.expand(node.global_transform.xform(c))
        var low = n["box"][0]
        var high = n["box"][1]
        var far = max((box.position - Vector3(low[0], low[1], low[2])).length(),
                      (box.end - Vector3(high[0], high[1], high[2])).length())
        need(far < 1e-4 * high[1], "%s is %f away" % [n["name"], far])

func check_skin(root, expect):
    var skeleton = root.find_node("Skeleton", true, false)
    var tree = root.find_node("tree", true, false)
    var player = root.find_node("AnimationPlayer", true, false)
    need(skeleton is Skeleton and tree is MeshInstance, "no skeleton or no mesh")
    need(player != null or expect["seconds"] == 0, "no animation")
    if wrong != "":
        return
    var triangles = 0
    for p in expect["primitives"]:
        triangles += p["triangles"]
    need(skeleton.get_bone_count() == expect["joints"], "%d bones" % skeleton.get_bone_count())
    need(tree.mesh.get_faces().size() == 3 * triangles, "triangles")
    if player:
        var clip = player.get_animation(player.get_animation_list()[0])
        need(clip.get_track_count() == expect["joints"], "%d tracks" % clip.get_track_count())
        need(abs(clip.length - expect["seconds"]) < 1e-4, "%f seconds" % clip.length)
