// Serves fixtures, pages and npm packages to the browser under test, on this machine only.

import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

import { readStoredZip } from "../../src/export/shader/carpaint.js";

export const here = dirname(fileURLToPath(import.meta.url));
export const fixtures = process.env.CARPAINT_FIXTURES ?? join(here, "fixtures");

const kinds = { ".html": "text/html", ".js": "text/javascript", ".json": "application/json" };

// /fixtures/F, /page/F, /three/F (of the npm package), and /bundle/NAME/F: a file as it stands inside NAME.zip.
async function find(path) {
  const [, place, ...rest] = normalize(path).split("/");
  if (place === "fixtures") return readFile(join(fixtures, ...rest));
  if (place === "page") return readFile(join(here, "page", ...rest));
  if (place === "three") return readFile(join(here, "node_modules", "three", ...rest));
  if (place !== "bundle") throw new Error(`nothing at ${path}`);
  const [name, file] = rest;
  if (/^three\..*\.js$/.test(file)) return readFile(join(here, "node_modules", "three", "build", file));
  const zip = await readFile(join(fixtures, `${name}.zip`));
  if (file === "paint.zip") return zip;
  return readStoredZip(new Uint8Array(zip)).get(file) ?? Promise.reject(new Error(`${file} is not in the bundle`));
}

export function serve() {
  const server = createServer(async (request, response) => {
    const path = new URL(request.url, "http://localhost").pathname;
    try {
      const body = await find(decodeURIComponent(path));
      response.writeHead(200, { "content-type": kinds[extname(path)] ?? "application/octet-stream" }).end(body);
    } catch (error) {
      response.writeHead(404).end(String(error));
    }
  });
  return new Promise((done) => {
    server.listen(0, "127.0.0.1", () => done({ server, address: `http://127.0.0.1:${server.address().port}` }));
  });
}
