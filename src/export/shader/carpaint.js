// Reads a carpaint bundle (.zip) or its single JSON in a browser or in Node; needs no library.
//
//   const paint = await readPaint(await (await fetch("paint.zip")).arrayBuffer());
//   paint.material   material.json
//   paint.shader     carpaint.glsl
//   paint.textures   name -> { width, height, components, type: "float" | "half" | "byte" | "short", data }
//
// Every texel is an array element as it stands in the file: nothing is flipped, premultiplied or color managed.

export async function readPaint(buffer) {
  const bytes = new Uint8Array(buffer);
  const zipped = bytes[0] === 0x50 && bytes[1] === 0x4b;
  const files = zipped ? readStoredZip(bytes) : new Map();
  const material = JSON.parse(new TextDecoder().decode(zipped ? files.get("material.json") : bytes));
  const shader = zipped ? new TextDecoder().decode(files.get(material.shader)) : material.shader_source;
  const textures = {};
  for (const [name, entry] of Object.entries(material.textures)) {
    const file = entry.file ? files.get(entry.file) : base64(entry.data.slice(entry.data.indexOf(",") + 1));
    textures[name] = file[0] === 0x89 ? await readPng(file) : readExr(file);
  }
  return { material, shader, textures };
}

function base64(text) {
  return Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
}

// Entries of an archive that deflates nothing, as bundles are.
export function readStoredZip(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end -= 1;
  if (end < 0) throw new Error("not a zip archive");
  const files = new Map();
  let at = view.getUint32(end + 16, true);
  for (let k = view.getUint16(end + 10, true); k > 0; k -= 1) {
    const [method, size] = [view.getUint16(at + 10, true), view.getUint32(at + 20, true)];
    const [name, extra, comment] = [28, 30, 32].map((offset) => view.getUint16(at + offset, true));
    const local = view.getUint32(at + 42, true);
    const title = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + name));
    if (method !== 0) throw new Error(`${title} is compressed: not a bundle as carpaint writes it`);
    const start = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    files.set(title, bytes.subarray(start, start + size));
    at += 46 + name + extra + comment;
  }
  return files;
}

// An uncompressed scan-line OpenEXR file; channels R, G, B become components 0, 1, 2.
export function readExr(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 8;
  const text = () => {
    const start = at;
    while (bytes[at] !== 0) at += 1;
    at += 1;
    return String.fromCharCode(...bytes.subarray(start, at - 1));
  };
  const channels = [];
  let [width, height, compression] = [0, 0, -1];
  for (let name = text(); name !== ""; name = text()) {
    text();
    const size = view.getInt32(at, true);
    at += 4;
    const next = at + size;
    if (name === "channels") {
      while (bytes[at] !== 0) {
        channels.push({ component: "RGBA".indexOf(text()), half: view.getInt32(at, true) === 1 });
        at += 16;
      }
    } else if (name === "dataWindow") {
      width = view.getInt32(at + 8, true) - view.getInt32(at, true) + 1;
      height = view.getInt32(at + 12, true) - view.getInt32(at + 4, true) + 1;
    } else if (name === "compression") {
      compression = bytes[at];
    }
    at = next;
  }
  if (compression !== 0) throw new Error("a compressed EXR file: not one of carpaint's");
  const half = channels[0].half;
  const components = channels.length;
  const data = half ? new Uint16Array(width * height * components) : new Float32Array(width * height * components);
  at += 8 * height;
  for (let y = 0; y < height; y += 1) {
    at += 8;
    for (const { component } of channels) {
      for (let x = 0; x < width; x += 1) {
        data[(y * width + x) * components + component] = half ? view.getUint16(at, true) : view.getFloat32(at, true);
        at += half ? 2 : 4;
      }
    }
  }
  return { width, height, components, type: half ? "half" : "float", data };
}

// A PNG file without row filters and interlacing, 8 bits a component or 16 of a single one.
export async function readPng(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const parts = [];
  let [width, height, depth, components] = [0, 0, 0, 0];
  for (let at = 8; at < bytes.length; ) {
    const size = view.getUint32(at);
    const kind = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    if (kind === "IHDR") {
      [width, height, depth] = [view.getUint32(at + 8), view.getUint32(at + 12), bytes[at + 16]];
      components = { 0: 1, 2: 3, 6: 4 }[bytes[at + 17]];
    } else if (kind === "IDAT") {
      parts.push(bytes.subarray(at + 8, at + 8 + size));
    }
    at += 12 + size;
  }
  const inflated = new Blob(parts).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = new Uint8Array(await new Response(inflated).arrayBuffer());
  const line = (width * components * depth) / 8;
  const data = new Uint8Array(line * height);
  for (let y = 0; y < height; y += 1) {
    if (raw[y * (line + 1)] !== 0) throw new Error("a filtered PNG row: not one of carpaint's");
    data.set(raw.subarray(y * (line + 1) + 1, (y + 1) * (line + 1)), y * line);
  }
  if (depth === 8) return { width, height, components, type: "byte", data };
  const wide = Uint16Array.from({ length: width * height }, (_, k) => data[2 * k] * 256 + data[2 * k + 1]);
  return { width, height, components, type: "short", data: wide };
}

// Values of every uniform that is no texture, by name.
export function uniformValues(material) {
  const { coat, color_table: table, flakes, lobes } = material;
  const corner = material.textures.corners_lower ?? {};
  const pad = (list, filler) => Array.from({ length: 8 }, (_, k) => list[k] ?? filler);
  return {
    carpaint_diffuse: material.diffuse,
    carpaint_lobes: lobes.length,
    carpaint_lobe_weight: pad(lobes.map((lobe) => lobe.weight), [0, 0, 0]),
    carpaint_lobe_shape: pad(lobes.map((lobe) => [lobe.alpha, lobe.f0]), [1, 0]),
    carpaint_coat: coat ? [coat.ior, coat.roughness] : [1, 0],
    carpaint_grid: [
      table.theta_h_deg.length,
      table.theta_d_deg.length,
      flakes ? flakes.theta_h_deg.length : 0,
      flakes ? flakes.theta_d_deg.length : 0,
    ],
    carpaint_persistence_deg: flakes ? flakes.persistence_deg : [1, 1],
    carpaint_corner_scale: corner.scale ?? [1, 1, 1],
    carpaint_corner_offset: corner.offset ?? [0, 0, 0],
  };
}

// Samplers of the shader, in the order of their declaration.
export const SAMPLERS = [
  "angles", "color_table", "slice_means", "slices", "corners_lower", "corners_upper", "cumulative", "alias", "random",
];
