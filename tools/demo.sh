#!/bin/sh
# demo.sh - learn and synthesise every sample of build/samples/, show them in out/index.html
set -eu

build=${BUILD:-build}
out=out
tab=$(printf '\t')
mkdir -p "$out"

# figure NAME FILE: a number out of a --stats file
figure() { sed -n "s/^ *\"$1\": \([0-9.]*\),*\$/\1/p" "$2"; }

cat >"$out/index.part" <<'HEAD'
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>texkit: from a photograph to new texture</title>
<style>
body { margin: 2rem auto; max-width: 60rem; padding: 0 1rem; font: 16px/1.5 sans-serif; }
h2 { margin: 2.5rem 0 0.5rem; }
figure { display: inline-block; margin: 0 1rem 0.5rem 0; vertical-align: top; }
figcaption, .source { color: #555; font-size: 0.9rem; }
</style>
</head>
<body>
<h1>From a photograph to new texture</h1>
<p>On the left the exemplar, 256 pixels wide. On the right 512 x 512 pixels of new texture,
synthesised from statistics of the exemplar alone: the model file holds no pixel of it.
Each picture is shown at full size.</p>
HEAD

count=0
while IFS=$tab read -r name source licence; do
    exemplar=$out/$name.png model=$out/$name.txs result=$out/$name-512.png
    cp "$build/samples/$name.png" "$exemplar"
    "$build/texkit" learn "$exemplar" -o "$model" --stats "$out/$name.learn.json" --quiet
    "$build/texkit" synth "$model" -o "$result" --size 512x512 \
        --stats "$out/$name.synth.json" --quiet
    bytes=$(figure model_bytes "$out/$name.learn.json")
    types=$(figure clique_types "$out/$name.learn.json")
    learn=$(printf %.2f "$(figure learn "$out/$name.learn.json")")
    synth=$(printf %.2f "$(figure synthesise "$out/$name.synth.json")")
    threads=$(figure threads "$out/$name.synth.json")
    count=$((count + 1))
    printf 'demo: %-8s learned in %5s s, %4s bytes; synthesised in %5s s\n' \
        "$name" "$learn" "$bytes" "$synth"
    cat >>"$out/index.part" <<PAIR
<h2>$name</h2>
<figure><img src="$name.png" alt="exemplar: $name"><figcaption>exemplar</figcaption></figure>
<figure><img src="$name-512.png" width="512" height="512" alt="synthesis: $name"><figcaption>synthesis:
learned in $learn s, made in $synth s; <a href="$name.txs">model</a> of $bytes bytes,
$types clique types</figcaption></figure>
<p class="source">$source; licence of the picture: $licence</p>
PAIR
done <"$build/samples/list.txt"

cat >>"$out/index.part" <<TAIL
<p class="source">Made by <code>make demo</code> with $threads threads.
Each pair: <code>texkit learn NAME.png -o NAME.txs</code>,
<code>texkit synth NAME.txs -o NAME-512.png --size 512x512</code>.</p>
</body>
</html>
TAIL
mv "$out/index.part" "$out/index.html"
echo "demo: $count pairs; open $out/index.html"
