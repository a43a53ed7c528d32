// load_three.js MODULES FILE.glb... - does three.js, in a browser, read these as we do?
// SPDX-License-Identifier: MIT OR Unlicense
//
// MODULES is the node_modules folder that holds three and puppeteer-core. Beside each FILE.glb lies
// FILE.json, which tests/tool/check_tree.py wrote: how many joints, vertices and copies there are, and where
// some of the vertices are at two times of the clip; of some trees also where the library has the bones at
// times of the clip; or boxes of plain nodes. Prints "ok - FILE" or "not ok - FILE" and what is
// wrong; the last line counts.
const fs = require("fs");
const http = require("http");
const path = require("path");

const [modules, ...files] = process.argv.slice(2);
const puppeteer = require(path.resolve(modules, "puppeteer-core"));
const TOLERANCE = 1e-4; // of the size of the tree
const BONE_TOLERANCE = 2e-3; // of the size of the tree; of a unit vector

const PAGE = `<!DOCTYPE html><script type="importmap">{"imports": {
  "three": "/modules/three/build/three.module.js", "three/addons/": "/modules/three/examples/jsm/"}}
</script><script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const rows = m => [0, 1, 2].flatMap(r => [0, 1, 2, 3].map(c => m.elements[4 * c + r]));

window.look = async (number, times, samples, boneTimes) => {
  const gltf = await new GLTFLoader().loadAsync("/file/" + number);
  const skinned = [], instanced = [];
  gltf.scene.traverse(o => {
    if (o.isSkinnedMesh) skinned.push(o);
    if (o.isInstancedMesh) instanced.push(o);
  });
  const found = { nodes: instanced.length, copies: 0, joints: 0, seconds: 0, primitives: [] };
  for (const m of instanced) found.copies += m.count;
  if (skinned.length) found.joints = skinned[0].skeleton.bones.length;
  for (const m of skinned)
    found.primitives.push({ vertices: m.geometry.attributes.position.count,
                            triangles: m.geometry.index.count / 3, at: [] });
  found.boxes = {};
  gltf.scene.updateMatrixWorld(true);
  if (!skinned.length && !instanced.length) for (const o of gltf.scene.children) {
    const box = new THREE.Box3().setFromObject(o, true); // of the vertices
    found.boxes[o.name] = [box.min.toArray(), box.max.toArray()];
  }
  found.bones = [];
  if (gltf.animations.length) {
    found.seconds = gltf.animations[0].duration;
    const mixer = new THREE.AnimationMixer(gltf.scene), v = new THREE.Vector3();
    mixer.clipAction(gltf.animations[0]).play();
    for (const time of boneTimes) {
      mixer.setTime(time);
      gltf.scene.updateMatrixWorld(true);
      const at = {}; // by number of the piece, with which the name ends
      for (const b of skinned[0].skeleton.bones) at[b.name.match(/[0-9]+$/)[0]] = rows(b.matrixWorld);
      found.bones.push(at);
    }
    for (const time of times) {
      mixer.setTime(time);
      gltf.scene.updateMatrixWorld(true);
      skinned.forEach((m, i) => found.primitives[i].at.push(
        samples[i].map(k => m.getVertexPosition(k, v).applyMatrix4(m.matrixWorld).toArray())));
    }
  }
  return found;
};
window.ready = true;
</script>`;

function serve(request, response) {
  const url = decodeURIComponent(request.url);
  const file = url.startsWith("/file/") ? files[Number(url.slice(6))]
    : url.startsWith("/modules/") ? path.join(modules, path.normalize(url.slice(9))) : null;
  if (url === "/" || !file || !fs.existsSync(file)) {
    response.writeHead(url === "/" ? 200 : 404, { "Content-Type": "text/html" });
    return response.end(url === "/" ? PAGE : "");
  }
  const type = file.endsWith(".js") ? "text/javascript" : "application/octet-stream";
  response.writeHead(200, { "Content-Type": type });
  response.end(fs.readFileSync(file));
}

function compare(want, found) {
  const wrong = [];
  const same = (what, a, b) => { if (Math.abs(a - b) > 1e-4) wrong.push(what + ": " + b + " instead of " + a); };
  for (const name of ["nodes", "copies", "joints", "seconds"])
    if (name in want) same(name, want[name], found[name]);
  let worst = 0, size = 1e-9;
  (want.primitives || []).forEach((p, i) => {
    const f = found.primitives[i];
    if (!f) return wrong.push("primitive " + i + " is missing");
    same("vertices", p.vertices, f.vertices);
    same("triangles", p.triangles, f.triangles);
    p.samples.forEach((s, k) => s.at.forEach((point, time) => {
      worst = Math.max(worst, Math.hypot(...point.map((x, a) => x - f.at[time][k][a])));
      size = Math.max(size, ...point.map(Math.abs));
    }));
  });
  for (const [piece, matrices] of Object.entries((want.bones || { pieces: {} }).pieces))
    matrices.forEach((m, time) => {
      const at = found.bones[time][piece] || [];
      m.forEach((x, k) => {
        const off = Math.abs(x - at[k]) / (k % 4 === 3 ? want.bones.size : 1);
        if (!(off < BONE_TOLERANCE)) wrong.push("bone " + piece + " is " + off + " away");
      });
    });
  for (const n of want.placed || []) {
    const corners = (found.boxes[n.name] || []).flat(), wanted = n.box.flat();
    if (!corners.length || !wanted.every((x, k) => Math.abs(x - corners[k]) < TOLERANCE * wanted[4]))
      wrong.push(n.name + " is missing or elsewhere");
  }
  if (want.placed) same("nodes", want.placed.length, Object.keys(found.boxes).length);
  if (!(worst <= TOLERANCE * size)) wrong.push("vertices up to " + worst + " from where they should be");
  return { wrong, worst };
}

async function main() {
  let passed = 0, failed = 0;
  const server = http.createServer(serve);
  await new Promise(done => server.listen(0, "127.0.0.1", done));
  const browser = await puppeteer.launch({ executablePath: "/usr/bin/chromium", headless: true,
                                           args: ["--no-sandbox", "--disable-gpu"] });
  const page = await browser.newPage();
  page.on("pageerror", e => console.log("    # " + e));
  await page.goto("http://127.0.0.1:" + server.address().port + "/");
  await page.waitForFunction("window.ready", { timeout: 20000 });
  for (let i = 0; i < files.length; i++) {
    const want = JSON.parse(fs.readFileSync(files[i].replace(/\.glb$/, ".json")));
    const samples = (want.primitives || []).map(p => p.samples.map(s => s.index));
    const found = await page.evaluate((n, t, s, b) => window.look(n, t, s, b), i, want.times || [], samples,
                                      want.bones ? want.bones.times : []);
    const { wrong, worst } = compare(want, found);
    if (wrong.length) failed++;
    else passed++;
    console.log((wrong.length ? "not ok - " : "ok - ") + files[i] +
                (want.times ? ": vertices at most " + worst.toExponential(1) + " m from ours" : ""));
    for (const w of wrong) console.log("    # " + w);
  }
  await browser.close();
  server.close();
  console.log(passed + " passed, " + failed + " failed");
  process.exit(failed > 0 || passed === 0 ? 1 : 0);
}

main().catch(e => { console.error(e); process.exit(2); });
