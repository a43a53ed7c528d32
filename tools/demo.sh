#!/bin/sh
# demo.sh - what texkit does with the samples of build/samples/: textures, tiles, meshes, completion,
# trees; the results and a page that shows them, index.html, are written to out/
set -eu

build=${BUILD:-build}
out=out
tab=$(printf '\t')
mkdir -p "$out"

# figure NAME FILE: a number, or a list of numbers, from a --stats file
figure() { sed -n "s/^ *\"$1\": \[*\([-0-9., ]*[0-9]\).*/\1/p" "$2"; }
seconds() { printf %.1f "$(figure "$1" "$2")"; }

# pair SAMPLE TITLE SOURCE LICENCE NOTE: learn, synthesise, append both pictures to the page
pair() {
    name=${1##*/}
    exemplar=$out/$name.png model=$out/$name.txs result=$out/$name-512.png
    cp "$build/samples/$1.png" "$exemplar"
    "$build/texkit" learn "$exemplar" -o "$model" --stats "$out/$name.learn.json" --quiet
    "$build/texkit" synth "$model" -o "$result" --size 512x512 \
        --stats "$out/$name.synth.json" --quiet
    bytes=$(figure model_bytes "$out/$name.learn.json")
    types=$(figure clique_types "$out/$name.learn.json")
    per_level=$(figure clique_types_per_level "$out/$name.learn.json" | sed 's/, / + /g')
    learn=$(seconds learn "$out/$name.learn.json")
    synth=$(seconds synthesise "$out/$name.synth.json")
    threads=$(figure threads "$out/$name.synth.json")
    printf 'demo: %-8s learned in %4s s, %4s bytes; synthesised in %4s s\n' \
        "$name" "$learn" "$bytes" "$synth"
    cat >>"$out/index.part" <<PAIR
<section class="pair">
<div>
<img src="$name.png" alt="exemplar: $2">
<h3>$2</h3>
<dl>
<dt>model</dt><dd><a href="$name.txs">$bytes bytes</a></dd>
<dt>clique types</dt><dd>$types <small>= $per_level</small></dd>
<dt>learned in</dt><dd>$learn s</dd>
<dt>synthesised in</dt><dd>$synth s</dd>
</dl>
<p>${5:-}</p>
<p class="source">Exemplar: $3; licence $4.</p>
</div>
<img src="$name-512.png" width="512" height="512" alt="synthesis: $2">
</section>
PAIR
}

# laid SAMPLE TITLE SOURCE LICENCE NOTE: texture from pieces of a sample, appended to the page
laid() {
    name=${1##*/} stats=$out/${1##*/}.patch.json
    cp "$build/samples/$1.png" "$out/$name.png"
    "$build/texkit" patch "$out/$name.png" -o "$out/$name-laid.png" --size 512x512 \
        --stats "$stats" --quiet
    total=$(seconds total "$stats")
    whole=$(figure continuous "$stats" | awk '{ printf "%.0f", 100 * $1 }')
    lattice=none
    [ "$(figure lattice "$stats")" = 0 ] ||
        lattice=$(for k in ax ay bx by; do figure lattice_$k "$stats"; done | awk '
            { v[NR] = sprintf("%.0f", $1); if (v[NR] == "-0") v[NR] = 0 }
            END { print "(" v[1] ", " v[2] ") and (" v[3] ", " v[4] ") pixels" }')
    printf 'demo: %-8s patched in %4s s, lattice %s\n' "$name" "$total" "$lattice"
    cat >>"$out/index.part" <<LAID
<section class="pair">
<div>
<img src="$name.png" alt="exemplar: $2">
<h3>$2</h3>
<dl>
<dt>lattice</dt><dd>$lattice</dd>
<dt>unbroken</dt><dd>$whole % <small>of neighbouring pixels are neighbours in the exemplar</small></dd>
<dt>made in</dt><dd>$total s</dd>
</dl>
<p>${5:-}</p>
<p class="source">Exemplar: $3; licence $4.</p>
</div>
<img src="$name-laid.png" width="512" height="512" alt="texture from pieces of: $2">
</section>
LAID
}

# tile_set NAME KIND COLORS NOTE: a set of tiles cut from a sample, appended to the page
tile_set() {
    folder=$1-tiles-$2 stats=$out/$1-tiles-$2.json
    "$build/texkit" tiles "$out/$1.png" -o "$out/$folder" --kind "$2" --colors "$3" --size 64 \
        --stats "$stats" --quiet
    tiles=$(figure tiles "$stats")
    width=$(figure atlas_width "$stats") height=$(figure atlas_height "$stats")
    joint=$(printf %.2f "$(figure joint_mean "$stats")")
    worst=$(printf %.2f "$(figure joint_worst "$stats")")
    total=$(seconds total "$stats")
    printf 'demo: %-8s %s tiles of kind %s in %4s s, steps across joints %s times those inside\n' \
        "$1" "$tiles" "$2" "$total" "$joint"
    cat >>"$out/index.part" <<SET
<section class="pair">
<div>
<h3>$1, $2</h3>
<dl>
<dt>tiles</dt><dd><a href="$folder/tiles.json">$tiles</a> <small>of 64 pixels a side, $3 colours</small></dd>
<dt>made in</dt><dd>$total s</dd>
<dt>joints</dt><dd>$joint <small>(worst pair $worst)</small></dd>
</dl>
<p>$4</p>
</div>
<img src="$folder/preview.png" width="512" height="512" alt="a plane of $2 tiles of $1">
</section>
<img class="atlas" src="$folder/atlas.png" width="$width" height="$height" alt="all $2 tiles of $1">
SET
}

# retiled SHAPE VERTICES: a mesh before and after retiling, appended to the page
retiled() {
    "$build/shape" "$1" "$out/$1.obj"
    "$build/texkit" retile "$out/$1.obj" -o "$out/$1-retiled.obj" --vertices "$2" \
        --stats "$out/$1-retiled.json" --quiet
    "$build/view" "$out/$1.obj" -o "$out/$1-before.png" --size 512x512 --wire
    "$build/view" "$out/$1-retiled.obj" -o "$out/$1-after.png" --size 512x512 --wire --valence
    quality=$(printf %.3f "$(figure quality "$out/$1-retiled.json")")
    least=$(printf %.0f "$(figure least_angle "$out/$1-retiled.json")")
    six=$(figure valence_6 "$out/$1-retiled.json" | awk '{ printf "%.1f", 100 * $1 }')
    edges=$(figure edge_variation "$out/$1-retiled.json" | awk '{ printf "%.1f", 100 * $1 }')
    total=$(seconds total "$out/$1-retiled.json")
    printf 'demo: %-8s retiled with %s vertices in %4s s, quality %s\n' "$1" "$2" "$total" "$quality"
    cat >>"$out/index.part" <<RETILED
<h3>A $1, $2 vertices</h3>
<dl>
<dt>made in</dt><dd>$total s</dd>
<dt>quality</dt><dd>$quality <small>mean of twice the inscribed over the circumscribed radius; 1 is
equilateral</small></dd>
<dt>vertices with six triangles</dt><dd>$six %</dd>
<dt>edge lengths</dt><dd>vary by $edges % <small>(standard deviation)</small></dd>
<dt>smallest angle</dt><dd>$least degrees</dd>
</dl>
<div class="couple">
<img src="$1-before.png" width="512" height="512" alt="the $1 as it was made, uneven triangles">
<img src="$1-after.png" width="512" height="512" alt="the $1 in near-equilateral triangles">
</div>
RETILED
}

# covered SHAPE TILES VERTICES SIZE OPTIONS...: a shape covered with a set of tiles, appended
covered() {
    shape=$1 tiles=$2 vertices=$3 size=$4
    shift 4
    "$build/shape" "$shape" "$out/$shape.obj"
    for kind in obj glb; do
        "$build/texkit" retile "$out/$shape.obj" -o "$out/$shape-covered.$kind" \
            --vertices "$vertices" --tiles "$out/$tiles" --quiet
    done
    "$build/view" "$out/$shape-covered.obj" --texture "$out/$shape-covered-atlas.png" \
        -o "$out/$shape-covered.png" --size "$size" --crease 180 "$@"
    cat >>"$out/index.part" <<COVERED
<img class="wide" src="$shape-covered.png" alt="a $shape covered with tiles">
<p class="source">$vertices vertices; as <a href="$shape-covered.glb">GLB</a>, for glTF viewers, and
as <a href="$shape-covered.obj">OBJ</a>.</p>
COVERED
}

# repaired KIND SIDE TEXT [PHOTO]: a model with holes in its texture, completed, appended to the page
repaired() {
    kind=$1 side=$2 text=$3
    shift 3
    rm -rf "$out/$kind-steps"
    "$build/scan" "$kind" "$out/$kind" "$side" "$@"
    "$build/texkit" inpaint --mesh "$out/$kind.obj" --texture "$out/$kind.png" --mask "$out/$kind-mask.png" \
        -o "$out/$kind-completed.png" --debug "$out/$kind-steps" --stats "$out/$kind.json" --quiet
    total=$(seconds total "$out/$kind.json")
    # where copies alone fit best, no line is drawn in advance
    joins=$(figure joins "$out/$kind.json") how="as texture"
    [ "$joins" = 0 ] || how="$joins of $(figure line_ends "$out/$kind.json") line ends joined"
    printf 'demo: %-8s %s texels completed in %4s s, %s\n' "$kind" \
        "$(figure written "$out/$kind.json")" "$total" "$how"
    cat >>"$out/index.part" <<REPAIRED
<h3>A $kind</h3>
<p>$text</p>
<dl>
<dt>missing</dt><dd>$(figure missing "$out/$kind.json") texels <small>of a texture of $side x $side</small></dd>
<dt>completed in</dt><dd>$total s</dd>
</dl>
<div class="couple">
<img src="$kind.png" width="512" height="512" alt="the texture with its holes">
<img src="$kind-completed.png" width="512" height="512" alt="the texture completed">
</div>
REPAIRED
    [ -x "$build/examples/repair" ] || return 0
    "$build/examples/repair" "$out/$kind.obj" "$out/$kind.png" "$out/$kind-mask.png" \
        "$out/$kind-repaired" >/dev/null
    cat >>"$out/index.part" <<REPAIRED
<p>From two sides: before, the preview, which is there at once, and after (<code>examples/repair.c</code>).</p>
<img class="wide" src="$kind-repaired-0.png" width="1440" height="480" alt="the $kind: before, preview, after">
<img class="wide" src="$kind-repaired-1.png" width="1440" height="480" alt="the same from another side">
REPAIRED
}

# removed NAME TITLE BOXES...: an object taken out of a sample photograph, appended to the page
removed() {
    name=$1 title=$2
    shift 2
    [ -e "$build/samples/scene/$name.png" ] && [ -x "$build/examples/remove" ] || return 0
    cp "$build/samples/scene/$name.png" "$out/$name.png"
    "$build/examples/remove" "$out/$name.png" "$out/$name-removed.png" "$@"
    credit=$(awk -F "$tab" -v name="scene/$name" '$2 == name { print $4 "; licence " $5 }' \
        "$build/samples/list.txt")
    printf 'demo: %-8s %s removed\n' "$name" "$title"
    cat >>"$out/index.part" <<REMOVED
<div class="couple">
<img src="$name.png" width="512" height="512" alt="$name, a photograph">
<img src="$name-removed.png" width="512" height="512" alt="the same without $title">
</div>
<p class="source">Left: $credit. Right: without $title,
<code>remove $name.png $name-removed.png $*</code>.</p>
REMOVED
}

# bilayer SHAPE: a membrane, by examples/membrane
bilayer() {
    "$build/examples/membrane" "$1" "$out/membrane-$1.glb" | sed 's/^/demo: /'
    "$build/examples/membrane" "$1" "$out/membrane-$1.png" cut >/dev/null
    cat >>"$out/index.part" <<BILAYER
<img class="wide" src="membrane-$1.png" width="1200" height="900" alt="a bilayer of lipids on a $1, cut open">
<p class="source">The whole membrane as <a href="membrane-$1.glb">GLB</a> with EXT_mesh_gpu_instancing.</p>
BILAYER
}

# drawn OUT OPTIONS...: a picture by examples/forest_gl, without a window
drawn() {
    picture=$1
    shift
    "$build/examples/forest_gl" --shaders shaders --headless "$out/$picture" "$@" >"$out/$picture.txt"
}

# species NAME: a tree bare and in leaf
species() {
    drawn "tree-$1-bare.png" --species "$1" --count 1 --pieces 2500 --size 300x360 --bare
    drawn "tree-$1.png" --species "$1" --count 1 --pieces 2500 --size 300x360
    cat >>"$out/index.part" <<SPECIES
<figure>
<img src="tree-$1-bare.png" width="300" height="360" alt="$1, bare">
<img src="tree-$1.png" width="300" height="360" alt="$1, in leaf">
<figcaption>$1</figcaption>
</figure>
SPECIES
}

# moving NAME OPTIONS...: three seconds of wind as an animation without end, appended to the page; needs
# img2webp
moving() {
    name=$1
    shift
    command -v img2webp >/dev/null || { echo "demo: no animation of $name: img2webp is not installed"; return 0; }
    mkdir -p "$out/frames"
    drawn "frames/$name-%02d.png" --count 1 --frames 24 --loop 3 --size 300x360 "$@"
    img2webp -loop 0 -lossy -q 75 -d 125 "$out/frames/$name"-*.png -o "$out/$name.webp" >/dev/null
    rm -rf "$out/frames"
    printf '<img src="%s.webp" width="300" height="360" alt="%s, moving">\n' "$name" "$name" >>"$out/index.part"
}

# samples NAME...: samples for single sections, copied to the page; fails if one of them is not there
samples() {
    for sample; do
        [ -e "$build/samples/more/$sample.png" ] || return 1
        cp "$build/samples/more/$sample.png" "$out/$sample.png"
    done
}
# credits NAME...: where they come from
credits() {
    for sample; do
        awk -F "$tab" -v name="more/$sample" '$2 == name { printf "%s: %s; licence %s. ", $3, $4, $5 }' \
            "$build/samples/list.txt"
    done
}
# row TITLE TEXT PICTURE CAPTION [PICTURE CAPTION]...: pictures side by side, appended to the page
row() {
    printf '<h3>%s</h3>\n<p>%s</p>\n<div class="row">\n' "$1" "$2"
    shift 2
    while [ $# -ge 2 ]; do
        printf '<div><img src="%s" alt="%s"><small>%s</small></div>\n' "$1" "$2" "$2"
        shift 2
    done
    echo '</div>'
} >>"$out/index.part"

cat >"$out/index.part" <<'HEAD'
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>texkit: from a photograph to new texture</title>
<style>
body { margin: 0 auto; max-width: 50rem; padding: 3rem 1rem; color: #222; background: #fbfaf8;
       font: 16px/1.5 system-ui, sans-serif; }
h1 { margin: 0 0 0.5rem; font-size: 2rem; line-height: 1.2; font-weight: 600; }
h2 { margin: 4rem 0 0.5rem; font-size: 1.4rem; font-weight: 600; }
h3 { margin: 0.8rem 0 0.3rem; font-size: 1.1rem; font-weight: 600; }
img { display: block; max-width: 100%; height: auto; }
.pair { display: grid; grid-template-columns: 256px 512px; gap: 1.5rem; margin: 2rem 0; }
dl { display: grid; grid-template-columns: auto 1fr; gap: 0 0.8rem; margin: 0; font-size: 0.9rem; }
dt { color: #666; }
dd { margin: 0; }
small { color: #666; font-size: 0.8rem; }
p { margin: 0.5rem 0; }
.pair p { font-size: 0.9rem; }
.source, footer { color: #666; font-size: 0.8rem; overflow-wrap: anywhere; }
.repeated { width: 768px; height: 768px; max-width: 100%; margin: 1.5rem 0 0.5rem; }
.atlas { margin: -0.5rem 0 3rem; }
.couple { display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; margin: 1rem 0 3rem; }
.row { display: grid; grid-template-columns: repeat(auto-fill, 256px); gap: 1rem; margin: 1rem 0; }
.wide { margin: 1.5rem 0 0.5rem; }
.source { margin-bottom: 2.5rem; }
.trees { display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; margin: 1.5rem 0; }
figure { display: grid; grid-template-columns: 1fr 1fr; margin: 0; }
figcaption { grid-column: 1 / 3; font-size: 0.9rem; color: #666; }
.frames { display: grid; grid-template-columns: repeat(4, 1fr); gap: 0.5rem; margin: 1rem 0 2rem; }
footer { margin-top: 4rem; border-top: 1px solid #ddd; padding-top: 1rem; }
a { color: #15558a; }
@media (max-width: 50rem) { .pair, .couple { grid-template-columns: minmax(0, 1fr); } }
</style>
</head>
<body>
<h1>From a photograph to new texture</h1>
<p>Left: the exemplar, 256 &times; 256 pixels. Right: 512 &times; 512 pixels of new texture, made from
the model alone, which holds statistics of the exemplar and none of its pixels. All pictures are shown at
full size. The clique types are listed by pyramid level, the finest first.</p>
HEAD

count=0 limits=0 first=
while IFS=$tab read -r role sample title source licence; do
    [ "$role" = good ] || continue
    pair "$sample" "$title" "$source" "$licence"
    count=$((count + 1))
    [ -n "$first" ] || first=$name
    [ "$name" != pebbles ] || first=$name
done <"$build/samples/list.txt"

"$build/texkit" synth "$out/$first.txs" -o "$out/$first-tile.png" --size 384x384 --tileable --quiet
cat >>"$out/index.part" <<TILE
<h2>Seamless</h2>
<p>One tile of 384 &times; 384 pixels, synthesised with <code>--tileable</code> from the model of
$first and repeated 2 &times; 2.</p>
<div class="repeated" role="img" aria-label="a tile of $first, repeated"
  style="background: url($first-tile.png) repeat"></div>
TILE

while IFS=$tab read -r role sample title source licence; do
    [ "$role" = limit ] || continue
    if [ $limits = 0 ]; then
        cat >>"$out/index.part" <<'LIMITS'
<h2>What it cannot do</h2>
<p>Statistics of pixels and their neighbours do not capture long thin lines, closed contours or exact
layouts. The next section shows a method that keeps them.</p>
LIMITS
    fi
    limits=$((limits + 1))
    case $sample in
    */grass) note="Tones and grain are right, but the long blades are lost." ;;
    */brick) note="The courses of the wall are lost." ;;
    *) note= ;;
    esac
    pair "$sample" "$title" "$source" "$licence" "$note"
done <"$build/samples/list.txt"

# pick NAME NUMBER: the sample NAME if there is one, else the good sample of that number
good=$(awk -F "$tab" '$1 == "good" { print $2 }' "$build/samples/list.txt")
pick() {
    echo "$good" | grep -x "$1" || echo "$good" | sed -n "$2p"
}

stones=$(pick pebbles 2) marked=$(pick frost 1) wall=
cat >>"$out/index.part" <<'LAYOUT'
<h2>Layout preserved</h2>
<p>Here the texture is put together from pieces of the exemplar, which are shifted, cut and slightly warped
so that they continue each other. Away from the seams the pixels are those of the exemplar. Patterns on a
lattice stay on it, and long features stay whole.</p>
LAYOUT
for wanted in layout good limit; do
    while IFS=$tab read -r role sample title source licence; do
        case $wanted:$role:$sample in
        layout:layout:*) note= ;;
        good:good:pebbles) note="As sharp as the photograph. Striking features, such as the few dark stones,
recur." ;;
        good:good:$stones) note= ;;
        limit:limit:*/grass) note="The blades keep their length." ;;
        limit:limit:*/brick) note="The wall is seen at an angle, so no two bricks of the photograph are equally
wide. Where bricks of different width meet, mortar joints end. Below it is made straight first." ;;
        *) continue ;;
        esac
        laid "$sample" "$title" "$source" "$licence" "$note"
        [ "$role" != layout ] || wall=$name
    done <"$build/samples/list.txt"
done
[ -n "$wall" ] || wall=$stones

if [ -e "$out/brick-laid.png" ]; then
    "$build/texkit" straighten "$out/brick.png" -o "$out/brick-straight.png" --quiet
    "$build/texkit" patch "$out/brick.png" -o "$out/brick-straight-laid.png" --size 512x512 \
        --straighten --quiet
    echo 'demo: brick    straight, then patched'
    cat >>"$out/index.part" <<'STRAIGHT'
<h3>Straight first</h3>
<section class="pair">
<div>
<img src="brick.png" alt="bricks, as photographed">
<img src="brick-straight.png" alt="bricks, as from straight in front">
<p>The same bricks as photographed, and as from straight in front (<code>texkit straighten</code>); on the right
what <code>texkit patch --straighten</code> makes of them: courses stay whole.</p>
</div>
<img src="brick-straight-laid.png" width="512" height="512" alt="texture from straightened bricks">
</section>
STRAIGHT
fi

"$build/texkit" patch "$out/$wall.png" -o "$out/$wall-laid-tile.png" --size 384x384 --tileable --quiet
cat >"$out/strokes.json" <<'STROKES'
{"smooth": 1.5, "least": 40, "strokes": [
  {"layer": 0, "width": 26, "points": [[-10,430], [60,410], [120,360], [150,290], [165,210],
    [200,150], [260,130], [310,165], [325,230], [335,300], [370,350], [430,350], [480,300],
    [525,260]]},
  {"layer": 3, "closed": true, "points": [[180,330], [230,290], [280,330], [285,400], [230,440],
    [180,410]]}]}
STROKES
"$build/texkit" edges "$out/$marked.png" -o "$out/$marked-edges.png" --smooth 1.5 --least 40 --quiet
"$build/texkit" patch "$out/$marked.png" -o "$out/$marked-strokes.png" --size 512x512 \
    --control "$out/strokes.json" --quiet
echo "demo: $wall tileable, $marked along strokes"
cat >>"$out/index.part" <<LAYOUT
<h3>Seamless</h3>
<p>384 &times; 384 pixels of $wall, made with <code>--tileable</code> and repeated 2 &times; 2.</p>
<div class="repeated" role="img" aria-label="a tile of $wall, repeated"
  style="background: url($wall-laid-tile.png) repeat"></div>
<h3>Along strokes</h3>
<section class="pair">
<div>
<img src="$marked.png" alt="exemplar: $marked">
<img src="$marked-edges.png" alt="the edges of its gray layers">
<p>Left: the exemplar, and the edges of its gray layers as found by <code>texkit edges</code>. Right:
<a href="strokes.json">two strokes</a>, an open one of the darkest layer and a closed one of the
lightest, have become edges of the texture, as rough as those of the exemplar.</p>
</div>
<img src="$marked-strokes.png" width="512" height="512" alt="$marked, with edges along two strokes">
</section>
LAYOUT

cat >>"$out/index.part" <<'TILES'
<h2>Tiles that join</h2>
<p>Here the photograph is cut into sets of tiles that join wherever their edge colours match: an endless
plane from a small atlas. Each atlas is shown below a part of the plane. The number for the joints is the
mean difference of neighbouring pixels across joints, divided by that inside tiles; at 1 joints cannot be
told from other places.</p>
TILES
tile_set "$(pick pebbles 1)" wang 3 "Squares with colours on their edges. The gutters between the
tiles of the atlas are for texture filtering."
tile_set "$(pick lawn 2)" corner 2 "Squares with colours on their corners: neighbours also match
diagonally, and no pixel is common to all tiles."
tile_set "$(pick gravel 3)" triangle 2 "Equilateral triangles, stored as right triangles, two in each
cell of the atlas. They are rotated to fit, and cover meshes as well."

cat >>"$out/index.part" <<'RETILE'
<h2>Any surface as near-equilateral triangles</h2>
<p>Left: the input meshes, with small triangles in some places and long ones in others. Right: the same
surfaces retiled. Red vertices have seven triangles, blue ones five, all others six. On a surface of
genus 0 there are always twelve more fives than sevens.</p>
RETILE
retiled blob 3000
retiled knot 3000

stones=$(pick pebbles 1) leaves=$(pick lichen 3)
"$build/texkit" tiles "$out/$stones.png" -o "$out/$stones-tiles-mesh" --kind triangle --variants 2 \
    --size 96 --quiet
"$build/texkit" tiles "$out/$leaves.png" -o "$out/$leaves-tiles-mesh" --kind triangle --variants 2 \
    --size 64 --quiet
cat >>"$out/index.part" <<COVER
<h3>Tiles on meshes</h3>
<p>Each triangle of a retiled mesh shows a tile whose edges match those of its neighbours: no seams, no
stretching, and the input needs no texture coordinates. The tiles are cut from $stones and $leaves, as
above.</p>
COVER
covered sphere "$stones-tiles-mesh" 600 800x800
covered knot "$leaves-tiles-mesh" 1600 800x600 --elevation 40
printf 'demo: sphere and knot covered with tiles of %s and %s\n' "$stones" "$leaves"

# without examples/, as in a copy of the sources of the tool alone, there is no membrane
if [ -x "$build/examples/membrane" ]; then
    cat >>"$out/index.part" <<'MEMBRANE'
<h3>Instances on triangles</h3>
<p>A bilayer of lipids, of about a dozen beads each, on a sphere and on a capsule with a bump
(<code>examples/membrane</code>): a patch of points on every triangle for each leaflet, thinned to the same
density inside and outside. An eighth is cut away.</p>
MEMBRANE
    bilayer sphere
    bilayer capsule
fi

stone=$(pick lichen 3)
cat >>"$out/index.part" <<'INPAINT'
<h2>What is missing, completed</h2>
<p>Gray parts of these textures are missing, as in scans. They are completed on the surface, across the seams
of the texture: lines that end at a hole are continued through it, then the rest is filled with pieces of
the surroundings. Nothing else changes.</p>
INPAINT
repaired ball 1024 "Drawn stripes, in six charts."
cat >>"$out/index.part" <<'STEPS'
<p>What the library shows of its work on one of the holes, laid flat (<code>--debug DIR</code>):</p>
<div class="frames">
STEPS
for picture in "$out"/ball-steps/*.png; do
    step=${picture##*/}
    echo "<div><img src=\"ball-steps/$step\" alt=\"\"><small>${step%.png}</small></div>"
done >>"$out/index.part"
echo '</div>' >>"$out/index.part"
repaired ring 1024 "Covered with $stone, mirrored from chart to chart." "$out/$stone.png"
if [ -e "$build/samples/scene/rocket.png" ]; then
    cat >>"$out/index.part" <<'REMOVE'
<h3>Objects removed from photographs</h3>
<p>The same for plain pictures (<code>examples/remove.c</code>): each hole is the ellipse in a box.</p>
REMOVE
fi
removed rocket "a tower" 322,110,42,236 318,260,60,110
removed camera "a tall building" 402,106,50,90


# what else texsyn.h does, with photographs for it
if samples autumn; then
    echo '<h2>Texture where it is wanted</h2>' >>"$out/index.part"
fi
if samples autumn; then
    holes="26,30,40,48 144,-4,50,58 154,56,34,48 108,132,36,48 132,80,112,72 -2,108,24,32 54,222,34,36
168,220,36,34"
    # shellcheck disable=SC2086 # boxes are words
    "$build/draw" discs "$out/autumn-hole.png" 256 $holes
    "$build/texkit" fill "$out/autumn.png" --mask "$out/autumn-hole.png" -o "$out/autumn-filled.png" \
        --stats "$out/autumn.json" --quiet
    printf 'demo: autumn   filled in %s s\n' "$(seconds total "$out/autumn.json")"
    row "Filled" "Leaves and a twig, white in the mask, have become lawn, learned around them, in
$(seconds total "$out/autumn.json") s (<code>texkit fill</code>)." \
        autumn.png before autumn-hole.png "the mask" autumn-filled.png after
fi
if [ -e "$out/lawn.png" ] && [ -e "$out/mud-512.png" ]; then
    "$build/draw" discs "$out/path.png" 512 -60,300,200,130 60,230,180,150 170,120,170,190 290,60,150,150 \
        380,90,220,110
    "$build/texkit" knit "$out/lawn-512.png" "$out/mud-512.png" --layout "$out/path.png" \
        -o "$out/path-knit.png" --stats "$out/path.json" --quiet
    printf 'demo: lawn and mud knit in %s s\n' "$(seconds total "$out/path.json")"
    cat >>"$out/index.part" <<KNIT
<section class="pair">
<div>
<img src="path.png" width="256" height="256" alt="the layout: a path">
<h3>Knit together</h3>
<p>Mud where the layout is white and lawn where it is black, with a border as rough as their grain, in
$(seconds total "$out/path.json") s (<code>texkit knit</code>).</p>
</div>
<img src="path-knit.png" width="512" height="512" alt="a path of mud across a lawn">
</section>
KNIT
fi
if samples autumn && [ -e "$out/lawn.png" ]; then
    "$build/texkit" relight "$out/lawn.png" --like "$out/autumn.png" -o "$out/lawn-relit.png" --quiet
    echo 'demo: lawn     in the light of autumn'
    row "Relit" "The lawn of summer in the light and colours of autumn (<code>texkit relight</code>)." \
        lawn.png before autumn.png "the light that is wanted" lawn-relit.png after
fi
if samples cracked rock; then
    for level in 0.2 0.5 1; do
        "$build/texkit" erode "$out/rock.png" --weathered "$out/cracked.png" --level $level \
            -o "$out/rock-eroded-$level.png" --quiet
    done
    echo 'demo: rock     eroded to three levels'
    row "Eroded" "Cracks like those of another rock at three levels, each of which contains the one before
(<code>texkit erode</code>)." rock-eroded-0.2.png "level 0.2" rock-eroded-0.5.png "level 0.5" \
        rock-eroded-1.png "level 1"
    if [ -x "$build/examples/pillar" ]; then
        "$build/examples/pillar" "$out/cracked.png" "$out/pillar.png" >/dev/null
        echo 'demo: a pillar'
        cat >>"$out/index.part" <<'PILLAR'
<p>A pillar of that other rock: the stone is learned where it has no cracks, and more of these are laid over
the pillar the nearer it is to the ground (<code>examples/pillar.c</code>).</p>
<img class="wide" src="pillar.png" width="520" height="1040" alt="a pillar, cracked at its foot">
PILLAR
    fi
fi
if samples thaw; then
    echo '<h2>Several textures in one picture</h2>' >>"$out/index.part"
    "$build/texkit" segment "$out/thaw.png" -o "$out/thaw-labels.png" --stats "$out/thaw.json" --quiet
    printf 'demo: thaw     segmented in %s s\n' "$(seconds total "$out/thaw.json")"
    row "Told apart" "The textures of a photograph, and how many there are, found in $(seconds total "$out/thaw.json") s; each label
has its mean colour (<code>texkit segment</code>)." thaw.png "the photograph" thaw-labels.png "its labels"
    "$build/texkit" learn "$out/thaw.png" -o "$out/thaw.txs" --quiet
    "$build/texkit" synth "$out/thaw.txs" -o "$out/thaw-single.png" --size 384x384 --quiet
    "$build/texkit" composite "$out/thaw.png" --labels "$out/thaw-labels.png" -o "$out/thaw-composite.png" \
        --size 384x384 --save "$out/thaw.txc" --map "$out/thaw-map.png" --stats "$out/thaw.json" --quiet
    printf 'demo: thaw     as a composite in %s s\n' "$(seconds total "$out/thaw.json")"
    cat >>"$out/index.part" <<COMPOSITE
<h3>Synthesised apart</h3>
<p>Left: one model of the whole photograph. Right: a model for each label and for where they meet, and a label
map that is synthesised as well, in $(seconds total "$out/thaw.json") s (<code>texkit composite</code>).</p>
<div class="couple">
<img src="thaw-single.png" width="384" height="384" alt="from one model">
<img src="thaw-composite.png" width="384" height="384" alt="from a model for each label">
</div>
COMPOSITE
fi
if samples rock snow && [ -e "$out/lawn.png" ] && [ -x "$build/examples/terrain" ]; then
    "$build/examples/terrain" "$out/lawn.png" "$out/rock.png" "$out/snow.png" "$out/terrain"
    echo 'demo: a terrain'
    cat >>"$out/index.part" <<'TERRAIN'
<h3>Terrain</h3>
<p>Heights and slopes say where lawn, rock and snow lie; 2048 &times; 2048 pixels of composite texture, learned
from three photographs, <a href="terrain-map.png">cover it</a> without a repetition
(<code>examples/terrain</code>).</p>
<img class="wide" src="terrain.png" width="1200" height="600" alt="mountains with meadows, rock and snow">
TERRAIN
fi
if samples autumn; then
    printf '<p class="source">%s</p>\n' "$(credits autumn cracked rock snow thaw)" >>"$out/index.part"
fi

# trees: files written by the tool, and where there is OpenGL pictures drawn by examples/forest_gl
bark=$(pick lichen 3)
"$build/texkit" tiles "$out/$bark.png" -o "$out/$bark-tiles-bark" --kind frame --colors 1 --variants 8 \
    --size 64 --quiet
"$build/texkit" tree -o "$out/oak.glb" --species oak --wind 9 --seed 2 --quiet \
    --stats "$out/oak.json"
"$build/texkit" tree -o "$out/willow-barked.glb" --species willow --tiles "$out/$bark-tiles-bark" --quiet
"$build/texkit" forest --count 60 -o "$out/forest.glb" --species oak,birch,spruce --pieces 165 --quiet \
    --stats "$out/forest.json"
printf 'demo: an oak of %s pieces in %s s, a forest of %s trees in %s s\n' \
    "$(figure pieces "$out/oak.json")" "$(seconds total "$out/oak.json")" \
    "$(figure trees "$out/forest.json")" "$(seconds total "$out/forest.json")"
cat >>"$out/index.part" <<TREES
<h2>Trees from pieces</h2>
<p>Seven kinds of pieces - tube, forks, side branches, tip, root flare - meet in hexagonal rims; a small
grammar puts them together on one skeleton. As files: <a href="oak.glb">an oak</a> of
$(figure pieces "$out/oak.json") pieces with an animation of wind, <a href="willow-barked.glb">a willow</a>
whose bark is cut from $bark, and <a href="forest.glb">a forest</a> of $(figure trees "$out/forest.json")
different trees, as instances of the pieces.</p>
TREES
if [ -x "$build/examples/forest_gl" ] &&
    drawn forest.png --count 1 --pieces 8 --size 64x64 2>"$out/forest.txt"; then
    cat >>"$out/index.part" <<'SPECIES'
<p>Each species bare and in leaf, as <code>examples/forest_gl</code> draws them: tessellated near the
camera, leaves as impostors with depth. The textures of bark and leaves are generated by the library.</p>
<div class="trees">
SPECIES
    for name in oak beech maple birch poplar willow almond pine spruce dead; do species $name; done
    drawn forest.png --species oak,beech,birch,spruce,maple,pine --count 160 --pieces 300 \
        --size 1200x600 --orbit 20,7,72
    drawn levels.png --species oak,beech --count 16 --pieces 300 --size 1200x500 --wire \
        --level 8 --half 9 --bare --orbit 20,8,24
    for frame in 0 1 2 3; do
        drawn wind-$frame.png --species birch --count 1 --pieces 1200 --size 300x360 --wind 14 \
            --time "$((frame * 6 / 10)).$((frame * 6 % 10))"
    done
    cat >>"$out/index.part" <<'FOREST'
</div>
<h3>A forest</h3>
<p>160 trees, no two alike, in $DRAWS draw calls; ten thousand trees take as many.</p>
<img class="wide" src="forest.png" width="1200" height="600" alt="a forest of six species">
<p>Levels of detail by distance, from green for the coarsest to red for the finest: quads near the camera
have more triangles, and quads that share an edge always agree on its level, so there are no cracks.</p>
<img class="wide" src="levels.png" width="1200" height="500" alt="trees coloured by level of tessellation">
<p>A birch in a fresh breeze, and the same in a near gale, at intervals of 0.6 seconds. The trunk sways with the
gusts, branches and twigs swing on their own, the faster the thinner they are.</p>
<div class="frames" style="grid-template-columns: repeat(5, 1fr)">
FOREST
    moving birch --species birch --pieces 1200 --wind 8
    cat >>"$out/index.part" <<'FOREST'
<img src="wind-0.png" width="300" height="360" alt="a birch in the wind">
<img src="wind-1.png" width="300" height="360" alt="0.6 seconds later">
<img src="wind-2.png" width="300" height="360" alt="1.2 seconds later">
<img src="wind-3.png" width="300" height="360" alt="1.8 seconds later">
</div>
FOREST
    draws=$(sed -n 's/^draws \([0-9]*\).*/\1/p' "$out/forest.png.txt" | tail -n 1)
    sed -i "s/\$DRAWS/${draws:-10}/" "$out/index.part"
    rm -f "$out"/*.png.txt "$out/forest.txt"
    printf 'demo: ten species, a forest, levels and wind drawn\n'
else
    echo "demo: trees are not drawn: no OpenGL$(sed 's/^/: /' "$out/forest.txt" 2>/dev/null)"
fi

cat >>"$out/index.part" <<TAIL
<footer>Made by <code>make demo</code> with $("$build/texkit" --version) on $threads threads. Each
pair: <code>texkit learn NAME.png -o NAME.txs</code>, then
<code>texkit synth NAME.txs -o NAME-512.png --size 512x512</code>. Textures with their layout:
<code>texkit patch NAME.png -o NAME-laid.png --size 512x512</code>; edges and strokes:
<code>texkit edges NAME.png -o NAME-edges.png --smooth 1.5 --least 40</code> and
<code>texkit patch NAME.png -o NAME-strokes.png --size 512x512 --control strokes.json</code>. Each set of tiles:
<code>texkit tiles NAME.png -o NAME-tiles-KIND --kind KIND --colors C --size 64</code>. Each retiled
mesh: <code>texkit retile NAME.obj -o NAME-retiled.obj --vertices N</code>; each completed texture:
<code>texkit inpaint --mesh NAME.obj --texture NAME.png --mask NAME-mask.png -o NAME-completed.png</code>; trees:
<code>texkit tree -o oak.glb --species oak --wind 9 --seed 2</code>. The times are those of this run.</footer>
</body>
</html>
TAIL
mv "$out/index.part" "$out/index.html"
echo "demo: $((count + limits)) pairs, 3 tile sets, 4 meshes, trees; open $out/index.html"
