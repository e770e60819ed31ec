// Reads a carpaint bundle (.zip) or its single JSON in a browser or in Node; needs no library.
//
//   const paint = await readPaint(await (await fetch("paint.zip")).arrayBuffer());
//   paint.material   material.json
//   paint.shader     carpaint.glsl
//   paint.textures   name -> { width, height, components, type: "float" | "half" | "byte" | "short", data }
//
// The bundle of a whole blend is read likewise; at any weights it is a paint as above:
//
//   const mixed = blendAt(paint, { weights: [0.3, 0.7] });
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
  const paints = material.paints ? `#define CARPAINT_PAINTS ${material.paints.length}\n` : "";
  return { material, shader: paints + shader, textures };
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
    ...(material.weights && { carpaint_weights: material.weights }),
  };
}

// Samplers of the shader, in the order of their declaration.
export const SAMPLERS = [
  "angles", "color_table", "slice_means", "slices", "corners_lower", "corners_upper", "cumulative", "alias", "random",
];

// ---- blends ----

// A blend at some weights, one a paint and inside or beyond 0 to 1, as the paint it is there: what uniformValues and a
// shader need, with the texture slice_means made for these weights. `base`, `flakeLightness` and `flakeColor` are
// weights of their own for coat, diffuse, lobes and color table, for the flakes' lightness (with grain and lifetime)
// and for their color; flakeSaturation 0 whitens the flakes. Some milliseconds; nothing is asked of anybody.
export function blendAt(paint, { weights, base = weights, flakeLightness = weights, flakeColor = weights, flakeSaturation = 1 }) {
  const { material } = paint;
  const { paints } = material;
  for (const [name, list] of Object.entries({ base, flakeLightness, flakeColor })) {
    const fits = list?.length === paints.length && list.every((w) => Math.abs(w) <= 1e12);
    if (!fits) throw new Error(`${name}: ${paints.length} finite weights are needed, for ${paints.map((p) => p.name).join(", ")}`);
  }
  const color = flakeColor.map((w) => w * flakeSaturation);
  const blended = {
    ...material,
    weights: base.map((w, m) => [w, flakeLightness[m], color[m]]),
    coat: blendedCoat(paints, base),
    diffuse: [0, 1, 2].map((c) => hold(0, 1000, sum(paints, base, (p) => p.diffuse[c]))),
    lobes: paints[0].lobes.map((_, place) => blendedLobe(paints.map((p) => p.lobes[place]), base)),
  };
  if (!material.flakes) return { ...paint, material: blended };
  const mix = (low, high, get) => hold(low, high, geometricMean(paints.map((p) => get(p.flakes)), flakeLightness));
  const [texel_um, grain_um] = [mix(1e-3, 1e5, (f) => f.texel_um), mix(1e-3, 1e6, (f) => f.grain_um)];
  const { tile } = material.flakes;
  blended.flakes = {
    ...material.flakes,
    texel_um,
    grain_um,
    lifetime_deg: [0, 1].map((k) => mix(0.01, 1e4, (f) => f.lifetime_deg[k])),
    persistence_deg: [0, 1].map((k) => mix(0.01, 1e4, (f) => f.persistence_deg[k])),
    // Side of the random tile's texels at which it has the grain of these weights.
    tile_texel_um: Math.max(grain_um, texel_um / 2) / Math.max(tile.grain_um / tile.texel_um, 0.5),
  };
  const slice_means = sliceMeans(paint, flakeLightness, color);
  return { ...paint, material: blended, textures: { ...paint.textures, slice_means } };
}

const hold = (low, high, value) => Math.min(high, Math.max(low, value));
const sum = (list, weights, get) => list.reduce((all, entry, m) => all + weights[m] * get(entry), 0);

function blendedCoat(paints, weights) {
  if (!paints[0].coat) return null;
  const ior = hold(1, 4, sum(paints, weights, (p) => p.coat.ior));
  const roughness = hold(0, 1, sum(paints, weights, (p) => p.coat.roughness));
  return ior === 1 ? null : { ior, roughness, mirror: roughness < 1e-3 };
}

// How widths, sizes and lasting angles blend: by their ratios. Where the weights sum to less than a tenth the shares pass
// through the even mean, without a pole.
function geometricMean(values, weights) {
  const all = weights.reduce((a, w) => a + w, 0);
  const even = 1 / values.length;
  const share = weights.map((w) => (Math.abs(all) < 0.1 ? even + (w - all * even) * all / 0.01 : w / all));
  return Math.exp(sum(values, share, Math.log));
}

function blendedLobe(lobes, weights) {
  return {
    weight: [0, 1, 2].map((c) => hold(0, 1000, sum(lobes, weights, (lobe) => lobe.weight[c]))),
    alpha: hold(1e-4, 10, geometricMean(lobes.map((lobe) => lobe.alpha), weights)),
    f0: hold(0, 1, sum(lobes, weights, (lobe) => lobe.f0)),
  };
}

// The mean color of every slice, 1/sr: of each box its mean in linear light, in closed form.
function sliceMeans(paint, lightness, color) {
  const { probability, corners } = prepared(paint);
  const { slices } = paint.textures;
  const data = new Float32Array(3 * slices.width * slices.height);
  const weight = lightness.map((l, m) => [l, color[m], color[m]]);
  const [center, half] = [[0, 0, 0], [0, 0, 0]];
  for (let slice = 0; slice < slices.width * slices.height; slice += 1) {
    const [first, count] = [slices.data[2 * slice], slices.data[2 * slice + 1]];
    let [x, y, z] = [0, 0, 0];
    for (let cluster = first; cluster < first + count; cluster += 1) {
      for (let axis = 0; axis < 3; axis += 1) {
        let lower = 0;
        let upper = 0;
        for (let m = 0; m < corners.length; m += 1) {
          lower += weight[m][axis] * corners[m].lower[3 * cluster + axis];
          upper += weight[m][axis] * corners[m].upper[3 * cluster + axis];
        }
        lower = hold(-2000, 2000, lower);
        upper = hold(-2000, 2000, upper);
        center[axis] = (lower + upper) / 2;
        half[axis] = Math.abs(upper - lower) / 2;
      }
      const m = (center[0] + 16) / 116;
      const dm = half[0] / 116;
      const p = probability[cluster];
      x += p * meanOfSum(m + center[1] / 500, dm, half[1] / 500);
      y += p * meanOfSum(m, dm, 0);
      z += p * meanOfSum(m - center[2] / 200, dm, half[2] / 200);
    }
    [x, z] = [0.95047 * x, 1.08883 * z];
    data[3 * slice] = (3.240454836 * x - 1.53713885 * y - 0.4985315469 * z) / Math.PI;
    data[3 * slice + 1] = (-0.9692663899 * x + 1.876010929 * y + 0.04155608235 * z) / Math.PI;
    data[3 * slice + 2] = (0.0556434196 * x - 0.2040258543 * y + 1.057225162 * z) / Math.PI;
  }
  return { width: slices.width, height: slices.height, components: 3, type: "float", data };
}

// Mean of CIELAB's inverse compression over m + s + t, s and t uniform with half widths ds and dt.
function meanOfSum(m, ds, dt) {
  const knee = 6 / 29;
  if (m - ds - dt >= knee) return m * m * m + m * (ds * ds + dt * dt);
  const expand = (f) => (f > knee ? f * f * f : 3 * knee * knee * (f - 4 / 29));
  if (m + ds + dt <= knee) return expand(m);
  // Across the knee: the integral over one axis, four Gauss points along the other, each half of it.
  const wide = Math.max(ds, dt);
  const narrow = Math.min(ds, dt);
  const within = wide < 2e-3
    ? (f) => gauss(f, wide, expand)
    : (f) => (integral(f + wide) - integral(f - wide)) / (2 * wide);
  return (gauss(m - narrow / 2, narrow / 2, within) + gauss(m + narrow / 2, narrow / 2, within)) / 2;
}

function gauss(m, half, f) {
  const near = 0.3399810435848563 * half;
  const far = 0.8611363115940526 * half;
  return 0.3260725774312731 * (f(m - near) + f(m + near)) + 0.1739274225687269 * (f(m - far) + f(m + far));
}

// First integral of the inverse compression.
function integral(f) {
  const knee = 6 / 29;
  return f > knee ? f ** 4 / 4 - 0.75 * knee ** 4 : 1.5 * knee ** 2 * f * f - 2 * knee ** 3 * f;
}

// Probabilities and corners of a blend as plain numbers, found once.
const known = new WeakMap();

function prepared({ material, textures }) {
  if (!known.has(textures)) {
    const { slices, cumulative } = textures;
    const probability = new Float32Array(material.flakes.clusters);
    for (let slice = 0; slice < slices.width * slices.height; slice += 1) {
      const [first, count] = [slices.data[2 * slice], slices.data[2 * slice + 1]];
      for (let k = first; k < first + count; k += 1) {
        probability[k] = cumulative.data[k] - (k > first ? cumulative.data[k - 1] : 0);
      }
    }
    const stacks = ["corners_lower", "corners_upper"].map((name) => numbers(textures[name], material.textures[name]));
    const size = stacks[0].length / material.paints.length;
    const corners = material.paints.map((_, m) => {
      const [lower, upper] = stacks.map((stack) => stack.subarray(m * size, (m + 1) * size));
      return { lower, upper };
    });
    known.set(textures, { probability, corners });
  }
  return known.get(textures);
}

// Texels as the numbers they stand for.
function numbers({ components, type, data }, { scale, offset }) {
  if (type === "float") return data;
  const out = new Float32Array(data.length);
  if (type === "half") {
    const float = Float32Array.from({ length: 65536 }, (_, bits) => halfToFloat(bits));
    for (let k = 0; k < out.length; k += 1) out[k] = float[data[k]];
  } else {
    for (let k = 0; k < out.length; k += 1) out[k] = offset[k % components] + (scale[k % components] * data[k]) / 255;
  }
  return out;
}

function halfToFloat(bits) {
  const [sign, exponent, fraction] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return exponent === 0 ? sign * fraction * 2 ** -24 : sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}
