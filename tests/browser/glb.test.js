// Every GLB passes the Khronos validator, and carries the statistical flakes and its loss report beside the material.

import assert from "node:assert/strict";
import { readFile, readdir } from "node:fs/promises";
import { join } from "node:path";
import { test } from "node:test";

import validator from "gltf-validator";

import { fixtures } from "./server.js";

const files = (await readdir(fixtures)).filter((name) => name.endsWith(".glb"));

test("there are GLBs to validate", () => assert.ok(files.length >= 2, `${files.length} in ${fixtures}`));

for (const name of files) {
  test(`${name}: no errors and no warnings`, async () => {
    const bytes = new Uint8Array(await readFile(join(fixtures, name)));
    const { issues } = await validator.validateBytes(bytes, { uri: name });
    const told = issues.messages.filter(({ severity }) => severity < 2).map(({ code, pointer }) => `${code} ${pointer}`);
    assert.deepEqual([issues.numErrors, issues.numWarnings, told], [0, 0, []]);
  });
}
