#!/bin/sh
# texkit inpaint: what it completes, what it leaves alone, and what it refuses.
. tests/kit/tap.sh
. tests/kit/texkit.sh

root=$(pwd)
released=$root/build/texkit
texkit=$root/$OUT/asan/texkit # with the sanitizers
look() { /usr/bin/python3 "$root/tests/tool/check_inpaint.py" "$@"; }
cd "$tmp" || exit 1

look picture bars 96 bars.png
look picture deep 96 deep.png
look picture alpha 96 alpha.png
look picture normal 96 bars-normal.png
look picture labels 96 bars_id.png
for kind in disc all none alpha edge; do look mask $kind 96 mask-$kind.png; done
look mask disc 64 small.png
"$root/build/scan" ball ball 160
"$root/build/scan" ring ring 160

# ---- pictures
check "a picture" run 0 inpaint bars.png --mask mask-disc.png -o a.png --stats stats.json
check "only the hole changes" look kept bars.png mask-disc.png a.png
check "tells what it did" grep -q 'a.png: 1 hole, .* texels' out.log
for key in holes windows structure line_ends joins missing written preview complete peak_bytes; do
    check "--stats has $key" grep -q "\"$key\": " stats.json
done
check "a mask in alpha" run 0 inpaint bars.png --mask mask-alpha.png -o b.png
check "the same picture" cmp a.png b.png
check "another seed" run 0 inpaint bars.png --mask mask-disc.png -o b.png --seed 9
for threads in 1 3; do
    check "--threads $threads" run 0 inpaint bars.png --mask mask-disc.png -o b.png --threads $threads
    check "the same picture" cmp a.png b.png
done
check "a hole at the border" run 0 inpaint bars.png --mask mask-edge.png -o edge.png
check "only the hole changes" look kept bars.png mask-edge.png edge.png 0
check "no hole" run 0 inpaint bars.png --mask mask-none.png -o none.png --quiet
check "nothing changes" look near bars.png mask-all.png none.png 0
check "16 bits" run 0 inpaint deep.png --mask mask-disc.png -o deep-out.png
check "only the hole changes, in 16 bits" look kept deep.png mask-disc.png deep-out.png
check "alpha" run 0 inpaint alpha.png --mask mask-disc.png -o alpha-out.png
check "only the hole changes, alpha too" look kept alpha.png mask-disc.png alpha-out.png
check "as JPEG" run 0 inpaint bars.png --mask mask-disc.png -o a.jpg
for how in auto texture picture pattern; do
    check "--structure $how" run 0 inpaint bars.png --mask mask-disc.png -o s.png --structure $how
    check "only the hole changes" look kept bars.png mask-disc.png s.png
done
check "--preview" run 0 inpaint bars.png --mask mask-disc.png -o p.png --preview
check "only the hole changes" look kept bars.png mask-disc.png p.png
check "--smooth" run 0 inpaint bars.png --mask mask-disc.png -o p.png --smooth
check "only the hole changes" look kept bars.png mask-disc.png p.png
check "values between those around it" look within mask-disc.png p.png 40 210
check "--source" run 0 inpaint bars.png --mask mask-disc.png -o p.png --source mask-all.png --quiet
check "all may be copied from: the same picture" cmp a.png p.png
refuses 1 "" inpaint bars.png --mask mask-disc.png -o n.png --source mask-none.png

# ---- maps in register
check "--maps" run 0 inpaint bars.png --mask mask-disc.png -o m.png --maps bars-normal.png,bars_id.png,deep.png \
    --normal 1 --label 2
check "the picture is the same as without" cmp a.png m.png
for map in normal deep; do
    from=bars-$map.png
    [ -e "$from" ] || from=$map.png
    check "only the hole changes in $map" look kept "$from" mask-disc.png m-$map.png 0.3
done
check "normals have unit length" look unit m-normal.png
check "labels are not mixed" look labels bars_id.png m-id.png
refuses 2 "--normal" inpaint bars.png --mask mask-disc.png -o n.png --maps deep.png --normal 2
refuses 2 "choose one" inpaint bars.png --mask mask-disc.png -o n.png --maps deep.png --normal 1 --label 1
refuses 2 "go with --maps" inpaint bars.png --mask mask-disc.png -o n.png --label 1
refuses 2 "at most 15" inpaint bars.png --mask mask-disc.png -o n.png \
    --maps a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png,a.png
refuses 1 "64 x 64" inpaint bars.png --mask mask-disc.png -o n.png --maps small.png
refuses 2 "twice" inpaint bars.png --mask mask-disc.png -o n.png --maps deep.png,./deep.png
cp m-deep.png bars-out.png
refuses 2 "destroy" inpaint bars.png --mask mask-disc.png -o bars.png --maps bars-out.png

# ---- lines that were drawn
echo '{"strokes": [{"points": [[10,48], [86,48]]}, {"closed": true, "points": [[40,40], [60,40], [50,60]]}]}' >g.json
check "--guide" run 0 inpaint bars.png --mask mask-disc.png -o g.png --guide g.json
check "only the hole changes" look kept bars.png mask-disc.png g.png
check "lines of texkit edges" sh -c "'$texkit' edges bars.png -o e.json --quiet &&
    '$texkit' inpaint bars.png --mask mask-disc.png -o g.png --guide e.json --quiet"
for bad in '' '{' '[]' '{"strokes": []}' '{"strokes": [{"points": [[1,2]]}]}' '{"strokes": [{"points": [[1,2],[3]]}]}' \
    '{"strokes": [{"points": [[1,2],[3,"4"]]}]}' '{"strokes": [7]}' '{"strokes": [{"points": [[1,2],[3,1e30]]}]}'; do
    printf '%s' "$bad" >bad.json
    refuses 1 "bad.json" inpaint bars.png --mask mask-disc.png -o n.png --guide bad.json
done
printf 'v 0 1 0\nv 0.7 0.7 0\nv 0.8 0.5 0.4\nv 0.6 0.3 0.8\nl 1 2 3 4\nl -1/1 -2/2\n' >lines.obj
ball="--mesh ball.obj --texture ball.png --mask ball-mask.png"
check "--prior FILE.obj" run 0 inpaint $ball -o l.png --prior lines.obj
check "only the holes change" look kept ball.png ball-mask.png l.png
echo '{"strokes": [{"points": [[0,1,0], [0.7,0.7,0]]}]}' >lines.json
check "--prior FILE.json" run 0 inpaint $ball -o l.png --prior lines.json
# a mesh in map coordinates, and lines in the same
awk '/^v / { printf "v %.6f %.6f %s\n", $2 + 455000, $3 + 5400000, $4; next } { print }' ball.obj >far.obj
awk '/^v / { printf "v %.6f %.6f %s\n", $2 + 455000, $3 + 5400000, $4; next } { print }' lines.obj >far-lines.obj
echo '{"strokes": [{"points": [[455000,5400001,0], [455000.7,5400000.7,0]]}]}' >far-lines.json
far="--mesh far.obj --texture ball.png --mask ball-mask.png"
check "--mesh far away" run 0 inpaint $far -o f.png
check "its lines of an .obj" run 0 inpaint $far -o f.png --prior far-lines.obj
check "only the holes change" look kept ball.png ball-mask.png f.png
check "its lines of a .json" run 0 inpaint $far -o f.png --prior far-lines.json
check "--prior crest" run 0 inpaint $ball -o l.png --prior crest
check "--prior none" run 0 inpaint $ball -o l.png --prior none
for bad in '' 'v 0 0 0' 'l 1 2' 'v 0 0 0\nv 1 1 1\nl 1' 'v 0 0 0\nv 1 1 1\nl 1 0' 'v 0 0 0\nv 1 1 x\nl 1 2' 'v 0 0 0\nl 1 1x'; do
    printf "$bad" >bad.obj
    refuses 1 "bad.obj" inpaint $ball -o n.png --prior bad.obj
done
refuses 1 "[x,y,z]" inpaint $ball -o n.png --prior g.json
refuses 1 "No such file" inpaint $ball -o n.png --prior missing.obj
refuses 2 "--guide is for pictures" inpaint $ball -o n.png --guide g.json
refuses 2 "--prior goes with --mesh" inpaint bars.png --mask mask-disc.png -o n.png --prior crest
refuses 2 "destroy" inpaint $ball -o n.png --stats lines.obj --prior lines.obj

# ---- meshes
for kind in ball ring; do
    check "a $kind" run 0 inpaint --mesh $kind.obj --texture $kind.png --mask $kind-mask.png -o $kind-out.png \
        --stats stats.json
    check "only the holes change" look kept $kind.png $kind-mask.png $kind-out.png
    check "two holes" grep -q '"holes": 2,' stats.json
    check "near to what was there" look near $kind-whole.png $kind-mask.png $kind-out.png 60
    check "--smooth" run 0 inpaint --mesh $kind.obj --texture $kind.png --mask $kind-mask.png -o s.png --smooth
    check "only the holes change" look kept $kind.png $kind-mask.png s.png
done
check "as PLY" sh -c "awk '\$1 == \"v\" { v[++n] = \$2 \" \" \$3 \" \" \$4 } \$1 == \"vt\" { t[++m] = \$2 \" \" \$3 }
    \$1 == \"f\" { split(\$2, a, \"/\"); split(\$3, b, \"/\"); split(\$4, c, \"/\"); f[++k] = a[1]-1 \" \" b[1]-1 \" \" c[1]-1 }
    END { print \"ply\nformat ascii 1.0\nelement vertex \" n \"\nproperty float x\nproperty float y\nproperty float z\"
    print \"property float s\nproperty float t\nelement face \" k \"\nproperty list uchar int vertex_indices\nend_header\"
    for (i = 1; i <= n; i++) print v[i], t[i]; for (i = 1; i <= k; i++) print 3, f[i] }' ball.obj >ball.ply &&
    '$texkit' inpaint --mesh ball.ply --texture ball.png --mask ball-mask.png -o ply.png --quiet"
check "the same picture" cmp ball-out.png ply.png
check "--dilate" run 0 inpaint --mesh ball.obj --texture ball.png -o d.png --dilate
check "--dilate with a mask and a width" run 0 inpaint $ball -o d.png --dilate --gutter 2
check "--gutter 0" run 0 inpaint $ball -o d.png --gutter 0

# ---- pictures of the steps
check "--debug" run 0 inpaint $ball -o d.png --debug steps
check "the picture is the same as without" cmp ball-out.png d.png
check "the pictures are numbered from 1" sh -c "ls steps/01-*.png steps/02-*.png"
check "again, into the same folder" run 0 inpaint $ball -o d.png --debug steps
cp ball-mask.png steps/01-mask.png
refuses 1 "" inpaint bars.png --mask mask-all.png -o n.png --debug none
check "no folder is left behind" test ! -e none
refuses 1 "cannot write" inpaint $ball -o n.png --debug nowhere/steps
refuses 1 "" inpaint $ball -o n.png --debug ball.obj

# ---- bad input
refuses 2 "no picture given" inpaint --mask mask-disc.png -o n.png
refuses 2 "not both" inpaint bars.png $ball -o n.png
refuses 2 "needs its texture" inpaint --mesh ball.obj --mask ball-mask.png -o n.png
refuses 2 "--texture goes with --mesh" inpaint --texture bars.png --mask mask-disc.png -o n.png
refuses 2 "add --mask" inpaint --mesh ball.obj --texture ball.png -o n.png
refuses 2 "--dilate goes with --mesh" inpaint bars.png -o n.png --dilate
refuses 2 "does nothing" inpaint $ball -o n.png --dilate --gutter 0
refuses 2 "choose one" inpaint $ball -o n.png --dilate --smooth
refuses 2 "go only with" inpaint $ball -o n.png --smooth --prior crest
refuses 2 "--gutter goes with --mesh" inpaint bars.png --mask mask-disc.png -o n.png --gutter 3
refuses 2 "--structure" inpaint bars.png --mask mask-disc.png -o n.png --structure cubism
refuses 2 "--directx" inpaint bars.png --mask mask-disc.png -o n.png --directx
for bad in 0 -1 x 1e9; do refuses 2 "--alpha" inpaint bars.png --mask mask-disc.png -o n.png --alpha $bad; done
for bad in 0 4097 x; do refuses 2 "--beta" inpaint bars.png --mask mask-disc.png -o n.png --beta $bad; done
for bad in -1 32769 x; do refuses 2 "--gutter" inpaint $ball -o n.png --gutter $bad; done
refuses 2 "unexpected" inpaint bars.png bars.png --mask mask-disc.png -o n.png
check "16 bits into JPEG: a warning" warns "takes 8" inpaint deep.png --mask mask-disc.png -o deep.jpg
refuses 2 "end the name in" inpaint bars.png --mask mask-disc.png -o n.gif
refuses 1 "96 x 96" inpaint bars.png --mask small.png -o n.png
refuses 1 "96 x 96" inpaint bars.png --mask mask-disc.png --source small.png -o n.png
refuses 1 "" inpaint bars.png --mask mask-all.png -o n.png
refuses 1 "No such file" inpaint missing.png --mask mask-disc.png -o n.png
refuses 1 "No such file" inpaint bars.png --mask missing.png -o n.png
refuses 1 "No such file" inpaint --mesh missing.obj --texture ball.png --mask ball-mask.png -o n.png
refuses 1 "cannot read" inpaint --mesh bars.png --texture ball.png --mask ball-mask.png -o n.png
refuses 2 "destroy" inpaint bars.png --mask mask-disc.png -o bars.png
refuses 2 "destroy" inpaint bars.png --mask mask-disc.png -o mask-disc.png
refuses 2 "destroy" inpaint $ball -o ball.png

# ---- meshes that are not what they should be: a clear status, or a defined result
sed 's/^\(f .*\)/\1/; s|/[0-9]*||g' ball.obj | grep -v ^vt >plain.obj
refuses 1 "no texture coordinates" inpaint --mesh plain.obj --texture ball.png --mask ball-mask.png -o n.png
awk '$1 == "vt" { $2 += 3; $3 -= 2 } { print }' ball.obj >outside.obj
check "coordinates outside 0..1 repeat the texture" run 0 inpaint --mesh outside.obj --texture ball.png \
    --mask ball-mask.png -o out.png
check "only the holes change" look kept ball.png ball-mask.png out.png
awk '$1 == "vt" { $2 = 1e9 } { print }' ball.obj >far.obj
refuses 1 "" inpaint --mesh far.obj --texture ball.png --mask ball-mask.png -o n.png
awk '$1 == "vt" { $2 = 0.5; $3 = 0.5 } { print }' ball.obj >point.obj
awk '{ print } $1 == "f" && ++n % 50 == 0' ball.obj >doubled.obj
awk '$1 == "f" && ++n % 7 == 0 { print $1, $2, $4, $3; next } { print }' ball.obj >turned.obj
awk '$1 == "v" && ++n % 3 == 0 { print "v 0 0 0"; next } { print }' ball.obj >crushed.obj
awk '$1 == "f" && ++n % 2 { next } { print }' ball.obj >torn.obj
for kind in point doubled turned crushed torn; do
    check "a mesh that is $kind ends well or with a message" sh -c "
        '$texkit' inpaint --mesh $kind.obj --texture ball.png --mask ball-mask.png -o n.png --quiet 2>e.log
        s=\$?; [ \$s = 0 ] || { [ \$s = 1 ] && [ \$(wc -l <e.log) = 1 ]; }"
done

# ---- stopping, memory, progress
"$root/build/scan" ball large 1024
large="inpaint --mesh large.obj --texture large.png --mask large-mask.png"
check "a signal stops it" stops stopped.png $large
check "too little memory" starves 60000 starved.png $large
if has_terminal; then check "a progress bar" shows_bar $large -o bar.png; fi
