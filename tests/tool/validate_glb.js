// validate_glb.js MODULES FILE.glb... - the Khronos validator's word on each file
// SPDX-License-Identifier: MIT OR Unlicense
//
// MODULES is the node_modules folder that holds gltf-validator. Prints "ok - FILE" for a file without
// errors and warnings, else "not ok - FILE" and what is wrong; the last line counts.
const fs = require("fs");
const path = require("path");

const [modules, ...files] = process.argv.slice(2);
const validator = require(path.resolve(modules, "gltf-validator"));

// extensions that the validator does not know are no fault of the file
const IGNORED = ["UNSUPPORTED_EXTENSION"];

async function main() {
  let passed = 0, failed = 0;
  for (const file of files) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
      uri: file, maxIssues: 20, ignoredIssues: IGNORED,
      externalResourceFunction: uri =>
        fs.promises.readFile(path.join(path.dirname(file), decodeURIComponent(uri)))
          .then(b => new Uint8Array(b)),
    });
    const bad = report.issues.messages.filter(m => m.severity <= 1);
    if (bad.length === 0) {
      passed++;
      console.log("ok - " + file);
    } else {
      failed++;
      console.log("not ok - " + file);
      for (const m of bad) console.log("    # " + m.code + " " + m.pointer + ": " + m.message);
    }
  }
  console.log(passed + " passed, " + failed + " failed");
  process.exit(failed > 0 || passed === 0 ? 1 : 0);
}

main().catch(e => { console.error(e); process.exit(2); });
