// A texture bundle in a browser: its shader, fed with its textures, must find what carpaint itself computes.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { test } from "node:test";

import { fixtures } from "./server.js";
import { address, browser, distance, expected, openShaderPage, shade } from "./shader_page.js";

openShaderPage();

for (const name of ["silver", "solid"]) {
  for (const precision of ["f32", "f16"]) {
    test(`${name} in ${precision}: 50 direction pairs shade to what evaluate finds, within 1 %`, async () => {
      const { pairs } = await expected(name);
      assert.equal(pairs.length, 50);
      const inputs = pairs.map(({ wi, wo }) => [wi, wo]);
      const got = await shade(`${name}_${precision}`, inputs,
        "answer = vec4(carpaint_evaluate(given(0).xyz, given(1).xyz), carpaint_mirror(given(1).xyz));");
      const worst = Math.max(...pairs.map(({ f }, k) => distance(got[k], f, 1e-4)));
      console.log(`  worst relative difference ${worst.toExponential(2)}`);
      assert.ok(worst < 0.01, `${worst}`);
      pairs.forEach(({ mirror }, k) => assert.ok(Math.abs(got[k][3] - mirror) < 1e-4));
    });
  }
}

for (const precision of ["f32", "f16", "8bit"]) {
  test(`silver in ${precision}: slice means are those of evaluate, within 1 %`, async () => {
    const { slices, pairs } = await expected("silver");
    const got = await shade(`silver_${precision}`, slices.map(({ angles }) => [angles]),
      "answer.rgb = carpaint_flakes_mean(given(0).x, given(0).y);");
    const worst = Math.max(...slices.map(({ mean }, k) => distance(got[k], mean, 1e-4)));
    const between = await shade(`silver_${precision}`, pairs.map(({ wi, wo }) => [wi, wo]),
      `CarpaintTerms t = carpaint_terms(given(0).xyz, given(1).xyz);
       answer.rgb = carpaint_flakes_mean(t.angles.theta_h_deg, t.angles.theta_d_deg);`);
    const worstBetween = Math.max(...pairs.map(({ flakes }, k) => distance(between[k], flakes, 1e-4)));
    console.log(`  worst relative difference ${worst.toExponential(2)} at slices, ${worstBetween.toExponential(2)} between`);
    assert.ok(worst < 0.01 && worstBetween < 0.01);
  });
}

for (const [precision, tolerance] of [["f32", 1e-4], ["f16", 0.01]]) {
  test(`silver in ${precision}: 400 texels show the flakes that carpaint draws`, async () => {
    const { texels } = await expected("silver");
    const inputs = texels.map(({ texel, angles }) => [texel, angles]);
    const got = await shade(`silver_${precision}`, inputs, `
      uint cell = carpaint_cell(ivec2(given(0).xy));
      answer = vec4(carpaint_flakes(cell, given(1).x, given(1).y), float(cell >> 8u));`);
    texels.forEach(({ cell }, k) => assert.equal(got[k][3], cell >>> 8, `cell of texel ${k}`));
    const worst = texels.map(({ color }, k) => distance(got[k], color, 0.02));
    console.log(`  worst relative difference ${Math.max(...worst).toExponential(2)}`);
    assert.equal(worst.filter((d) => d > tolerance).length, 0);
  });
}

test("the alias table and the cumulative draw have the same mean", async () => {
  const draws = 40000;
  const inputs = Array.from({ length: 1 }, () => [[0]]);
  const body = `
    vec3 sum = vec3(0.0);
    for (uint k = 0u; k < ${draws}u; ++k) {
      uint key = carpaint_mix(k);
      vec4 draw = vec4(carpaint_unit(carpaint_mix(key ^ 1u)), carpaint_unit(carpaint_mix(key ^ 2u)),
        carpaint_unit(carpaint_mix(key ^ 3u)), carpaint_unit(carpaint_mix(key ^ 4u)));
      sum += carpaint_slice(1, 2, draw);
    }
    answer.rgb = sum / ${draws}.0;`;
  const [[cumulative], [alias]] = [await shade("silver_f32", inputs, body), await shade("silver_f32", inputs, body, { defines: "#define CARPAINT_ALIAS\n" })];
  const { slices } = await expected("silver");
  const { mean } = slices[1 * 5 + 2];
  console.log(`  cumulative ${distance(cumulative, mean, 0).toExponential(2)}, alias ${distance(alias, mean, 0).toExponential(2)} off the closed form`);
  assert.ok(distance(cumulative, mean, 0) < 0.03 && distance(alias, mean, 0) < 0.03);
});

test("the single JSON holds the same textures as the bundle", async () => {
  const { readPaint } = await import("../../src/export/shader/carpaint.js");
  const bundle = await readPaint(await readFile(join(fixtures, "silver_f16.zip")));
  const single = await readPaint(await readFile(join(fixtures, "silver.json")));
  assert.deepEqual(single.textures, bundle.textures);
  assert.equal(single.shader, bundle.shader);
});

test("the three.js example draws a sphere that sparkles", async () => {
  const three = await browser.newPage({ viewport: { width: 512, height: 512 } });
  const errors = [];
  three.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  three.on("pageerror", (error) => errors.push(String(error)));
  await three.goto(`${address}/bundle/silver_f16/index.html`);
  await three.waitForSelector("body[data-drawn]", { state: "attached" });
  const picture = await three.screenshot(process.env.CARPAINT_PICTURES ? { path: join(process.env.CARPAINT_PICTURES, "three.png") } : {});
  assert.deepEqual(errors.filter((text) => !text.includes("favicon")), []);
  // Neighbouring pixels of a sphere without flakes hardly differ; flakes make many that do.
  const rough = await three.evaluate(async (base64) => {
    const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
    const context = new OffscreenCanvas(512, 512).getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(200, 120, 120, 120);
    let count = 0;
    for (let k = 0; k + 4 < data.length; k += 4) count += Math.abs(data[k] - data[k + 4]) > 12 ? 1 : 0;
    return count / (data.length / 4);
  }, picture.toString("base64"));
  console.log(`  ${(100 * rough).toFixed(1)} % of neighbouring pixels differ visibly`);
  assert.ok(rough > 0.02, `${rough}`);
  await three.close();
});
