// A page that shades with a bundle's own shader, open while the tests of a file run.

import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { after, before } from "node:test";

import { launch } from "./browser.js";
import { fixtures, serve } from "./server.js";

export let browser;
export let address;
let [page, server] = [];

export function openShaderPage() {
  before(async () => {
    ({ server, address } = await serve());
    browser = await launch();
    page = await browser.newPage();
    await page.goto(`${address}/page/shade.html`);
    await page.waitForSelector("body[data-ready]", { state: "attached" });
  });

  after(async () => {
    await browser?.close();
    server?.close();
  });
}

// What carpaint itself computes for a fixture.
export const expected = async (name) => JSON.parse(await readFile(join(fixtures, `${name}_expected.json`), "utf8"));

// Runs a shader body for each of the inputs.
export const shade = (name, inputs, body, { defines = "", weights } = {}) =>
  page.evaluate(([n, i, b, d, w]) => window.shade(n, i, b, d, w), [name, inputs, body, defines, weights]);

// Largest difference relative to the color's largest channel, with a floor of `black`.
export const distance = (got, want, black) =>
  Math.max(...want.map((w, k) => Math.abs(got[k] - w))) / Math.max(black, ...want.map(Math.abs));
