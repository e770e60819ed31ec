// The bundle of a whole blend in a browser: at any weights its shader must find what carpaint's realisation is there.

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { test } from "node:test";

import { blendAt, readPaint } from "../../src/export/shader/carpaint.js";
import { fixtures } from "./server.js";
import { address, browser, distance, expected, openShaderPage, shade } from "./shader_page.js";

openShaderPage();

const bundle = async (name) => readPaint(await readFile(join(fixtures, `${name}.zip`)));
const told = ({ weights, base, flakeLightness, flakeColor, flakeSaturation }) =>
  [weights, base, flakeLightness, flakeColor, flakeSaturation].map((w) => `[${w}]`).join(" ");
const worst = (list, get) => Math.max(...list.map(get));

for (const name of ["duo", "trio"]) {
  // Halves of corners round at 0.03 Lab; floats only as a GPU does.
  for (const [precision, tolerance] of [["f32", 1e-4], ["f16", 0.01]]) {
    test(`${name} in ${precision}: 50 direction pairs at every weights shade to what evaluate finds, within ${100 * tolerance} %`, async () => {
      for (const { weights, pairs, slices } of await expected(name)) {
        assert.equal(pairs.length, 50);
        const directions = pairs.map(({ wi, wo }) => [wi, wo]);
        const whole = await shade(`${name}_${precision}`, directions,
          "answer = vec4(carpaint_evaluate(given(0).xyz, given(1).xyz), carpaint_mirror(given(1).xyz));", { weights });
        const base = await shade(`${name}_${precision}`, directions,
          "answer.rgb = carpaint_terms(given(0).xyz, given(1).xyz).base;", { weights });
        const means = await shade(`${name}_${precision}`, slices.map(({ angles }) => [angles]),
          "answer.rgb = carpaint_flakes_mean(given(0).x, given(0).y);", { weights });
        const off = [
          worst(pairs, ({ f }, k) => distance(whole[k], f, 1e-4)),
          worst(pairs, (pair, k) => distance(base[k], pair.base, 1e-4)),
          worst(slices, ({ mean }, k) => distance(means[k], mean, 1e-3)),
        ];
        console.log(`  ${told(weights)}: whole, base, slice means off by ${off.map((d) => d.toExponential(1)).join(", ")}`);
        assert.ok(Math.max(...off) < tolerance, `${off}`);
        pairs.forEach(({ mirror }, k) => assert.ok(Math.abs(whole[k][3] - mirror) < 1e-4));
      }
    });
  }

  for (const [precision, tolerance] of [["f32", 1e-4], ["f16", 0.01]]) {
    test(`${name} in ${precision}: 400 texels at every weights show the flakes that carpaint draws`, async () => {
      for (const { weights, texels } of await expected(name)) {
        const got = await shade(`${name}_${precision}`, texels.map(({ texel, angles }) => [texel, angles]), `
          uint cell = carpaint_cell(ivec2(given(0).xy));
          answer = vec4(carpaint_flakes(cell, given(1).x, given(1).y), float(cell >> 8u));`, { weights });
        texels.forEach(({ cell }, k) => assert.equal(got[k][3], cell >>> 8, `cell of texel ${k}`));
        const off = worst(texels, ({ color }, k) => distance(got[k], color, 0.02));
        console.log(`  ${told(weights)}: worst relative difference ${off.toExponential(2)}`);
        assert.ok(off < tolerance, `${off}`);
      }
    });
  }

  test(`${name}: coat, diffuse, lobes and grain at every weights are those of the realisation`, async () => {
    const paint = await bundle(`${name}_f32`);
    const near = (got, want, what) => assert.ok(Math.abs(got - want) <= 1e-12 * Math.max(1, Math.abs(want)), `${what}: ${got}, not ${want}`);
    for (const { weights, paint: want } of await expected(name)) {
      const { material } = blendAt(paint, weights);
      assert.equal(material.coat === null, want.coat === null);
      for (const key of ["ior", "roughness"]) if (want.coat) near(material.coat[key], want.coat[key], key);
      want.diffuse.forEach((v, c) => near(material.diffuse[c], v, "diffuse"));
      assert.equal(material.lobes.length, want.lobes.length);
      want.lobes.forEach((lobe, k) => {
        lobe.weight.forEach((v, c) => near(material.lobes[k].weight[c], v, "weight"));
        near(material.lobes[k].alpha, lobe.alpha, "alpha");
        near(material.lobes[k].f0, lobe.f0, "f0");
      });
      for (const [key, value] of Object.entries(want.texture)) {
        [value].flat().forEach((v, k) => near([material.flakes[key]].flat()[k], v, key));
      }
    }
  });
}

test("eight bits a corner keep the slice means of a blend within 3 %", async () => {
  for (const { weights, slices } of (await expected("duo")).slice(0, 2)) {
    const got = await shade("duo_8bit", slices.map(({ angles }) => [angles]), "answer.rgb = carpaint_flakes_mean(given(0).x, given(0).y);", { weights });
    const off = worst(slices, ({ mean }, k) => distance(got[k], mean, 1e-3));
    console.log(`  ${told(weights)}: ${off.toExponential(2)}`);
    assert.ok(off < 0.03);
  }
});

test("weights that do not fit the blend are refused by name", async () => {
  const paint = await bundle("duo_f32");
  assert.throws(() => blendAt(paint, { weights: [1] }), /base: 2 finite weights are needed, for silver, copper/);
  assert.throws(() => blendAt(paint, { weights: [1, NaN] }), /finite/);
  assert.throws(() => blendAt(paint, { weights: [1, 0], flakeColor: [1, 0, 0] }), /flakeColor/);
});

test("a slider of the three.js page changes the picture without a request", async () => {
  const three = await browser.newPage({ viewport: { width: 360, height: 288 } });
  // The processor draws here, in its own time.
  three.setDefaultTimeout(120000);
  const [errors, requests] = [[], []];
  three.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  three.on("pageerror", (error) => errors.push(String(error)));
  await three.goto(`${address}/bundle/trio_f16/index.html`);
  await three.waitForSelector("body[data-drawn]", { state: "attached" });
  three.on("request", (request) => requests.push(request.url()));
  const seen = async (file) => {
    const path = process.env.CARPAINT_PICTURES && join(process.env.CARPAINT_PICTURES, file);
    return (await three.screenshot(path ? { path } : {})).toString("base64");
  };
  // Mean color of the ball's middle.
  const color = (base64) => three.evaluate(async (text) => {
    const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))]));
    const context = new OffscreenCanvas(360, 288).getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(155, 84, 56, 56);
    return [0, 1, 2].map((c) => data.filter((_, k) => k % 4 === c).reduce((a, v) => a + v, 0) / (data.length / 4));
  }, base64);
  const move = (slider, value) => three.evaluate(([k, v]) => {
    const input = document.querySelectorAll("input[type=range]")[k];
    input.value = v;
    input.dispatchEvent(new Event("input"));
    return Array.from(document.querySelectorAll("output"), (output) => Number(output.textContent));
  }, [slider, value]);
  assert.equal(await three.locator("input[type=range]").count(), 3);
  assert.deepEqual(await three.locator("label span").allTextContents(), ["copper", "solid", "silver"]);
  await seen("blend_equal.png");
  assert.deepEqual(await move(0, 1), [1, 0, 0]);
  const copper = await color(await seen("blend_copper.png"));
  assert.deepEqual(await move(2, 1), [0, 0, 1]);
  const silver = await color(await seen("blend_silver.png"));
  await move(1, 0.5);
  await seen("blend_between.png");
  const took = await three.evaluate(() => Number(document.body.dataset.blendMilliseconds));
  console.log(`  copper ${copper.map(Math.round)}, silver ${silver.map(Math.round)}; weights set in ${took.toFixed(1)} ms`);
  assert.ok(copper[0] - copper[2] > 20 && Math.abs(silver[0] - silver[2]) < 20, `${copper} ${silver}`);
  assert.deepEqual(requests, []);
  assert.deepEqual(errors.filter((text) => !text.includes("favicon")), []);
  await three.close();
});
