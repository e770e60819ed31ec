// A carpaint bundle as a three.js material.
//
//   import * as THREE from "three";
//   import { readPaint } from "./carpaint.js";
//   import { carpaintMaterial } from "./three_example.js";
//   const paint = await readPaint(await (await fetch("paint.zip")).arrayBuffer());
//   mesh.material = carpaintMaterial(THREE, paint);
//
// Of the bundle of a whole blend it is the paint at equal weights; others are set at any time:
//
//   mesh.material.userData.setWeights({ weights: [0.3, 0.7] });
//
// Shades the studio of carpaint's own previews, fixed in world space with its key beside +z: soft boxes whose mirror images
// coat and lobes show and whose light the flakes sparkle in, dim walls, and one small lamp (`lightDirection`, null for none).
// Flakes are placed by uv: `uvMeters` says how many meters of paint one unit of uv spans. For lights of a scene of your own
// call carpaint_shade_area once for each.

import { SAMPLERS, blendAt, uniformValues } from "./carpaint.js";

export function carpaintMaterial(THREE, paint, { uvMeters = [0.06, 0.03], lightDirection = [-0.42, 0.5, 1] } = {}) {
  const { paints } = paint.material;
  const first = paints ? blendAt(paint, { weights: paints.map(() => 1 / paints.length) }) : paint;
  const vector = (values) => new THREE.Vector3(...values);
  const boxes = STUDIO.map((box) => placed(box));
  const lamps = boxes.flatMap((box) => lampsOf(box));
  const uniforms = {
    box_center: { value: boxes.map((box) => vector(box.center)) },
    box_across: { value: boxes.map((box) => vector(box.across)) },
    box_upwards: { value: boxes.map((box) => vector(box.upwards)) },
    box_shape: { value: boxes.map(({ half, border, radiance }) => new THREE.Vector4(...half, border, radiance)) },
    box_falloff: { value: boxes.map((box) => box.falloff) },
    lamp_direction: { value: lamps.map((lamp) => vector(lamp.direction)) },
    lamp_irradiance: { value: lamps.map((lamp) => lamp.irradiance) },
    sun_direction: { value: vector(lightDirection ?? [0, 1, 0]).normalize() },
    sun_irradiance: { value: lightDirection ? 0.22 : 0 },
    texels_per_uv: { value: new THREE.Vector2() },
  };
  const vectors = { 2: THREE.Vector2, 3: THREE.Vector3, 4: THREE.Vector4 };
  const wrap = (value) => {
    if (!Array.isArray(value)) return value;
    return Array.isArray(value[0]) ? value.map(wrap) : new vectors[value.length](...value);
  };
  const set = ({ material }) => {
    for (const [name, value] of Object.entries(uniformValues(material))) {
      uniforms[name] ??= {};
      uniforms[name].value = wrap(value);
    }
    const texel_um = material.flakes?.tile_texel_um ?? material.flakes?.texel_um ?? 1e6;
    uniforms.texels_per_uv.value.set(...uvMeters.map((m) => (m * 1e6) / texel_um));
  };
  set(first);
  const nothing = { width: 1, height: 1, components: 4, type: "float", data: new Float32Array(4) };
  for (const name of SAMPLERS) uniforms[`carpaint_${name}`] = { value: dataTexture(THREE, first.textures[name] ?? nothing) };
  const material = new THREE.ShaderMaterial({
    uniforms,
    vertexShader: VERTEX,
    fragmentShader: paint.shader + fragment(boxes.length, lamps.length),
  });
  if (paints) {
    material.userData.setWeights = (weights) => {
      const mixed = blendAt(paint, weights);
      set(mixed);
      if (!mixed.textures.slice_means) return;
      uniforms.carpaint_slice_means.value.dispose();
      uniforms.carpaint_slice_means.value = dataTexture(THREE, mixed.textures.slice_means);
    };
  }
  return material;
}

// Three components are padded to four: WebGL has no such texture any more in three.js.
function dataTexture(THREE, { width, height, components, type, data }) {
  const format = { 1: THREE.RedFormat, 2: THREE.RGFormat, 4: THREE.RGBAFormat };
  const kind = { float: THREE.FloatType, half: THREE.HalfFloatType, byte: THREE.UnsignedByteType };
  let texels = data;
  if (components === 3) {
    texels = new data.constructor(width * height * 4);
    for (let k = 0; k < width * height; k += 1) texels.set(data.subarray(3 * k, 3 * k + 3), 4 * k);
  }
  const texture = new THREE.DataTexture(texels, width, height, format[components] ?? THREE.RGBAFormat, kind[type]);
  texture.minFilter = texture.magFilter = THREE.NearestFilter;
  texture.generateMipmaps = false;
  texture.unpackAlignment = 1;
  texture.needsUpdate = true;
  return texture;
}

const VERTEX = `
out vec3 world_position;
out vec3 world_normal;
out vec2 paint_uv;
void main() {
  vec4 p = modelMatrix * vec4(position, 1.0);
  world_position = p.xyz;
  world_normal = mat3(modelMatrix) * normal;
  paint_uv = uv;
  gl_Position = projectionMatrix * viewMatrix * p;
}`;

// Soft boxes at infinity: where they are, turned by how much, half their width and height in a plane one away, the width of
// their border, their radiance, the share of it lost towards the border, and how many lamps stand for one.
const STUDIO = [
  { towards: [-0.44, 0.36, 1], roll: 0, half: [0.74, 0.38], border: 0.05, radiance: 1.65, falloff: 0.3, lamps: [3, 2] },
  { towards: [0.16, 1, 0.3], roll: 0, half: [0.8, 0.055], border: 0.012, radiance: 8, falloff: 0.2, lamps: [2, 1] },
  { towards: [1, 0.1, 0.22], roll: 90, half: [0.46, 0.05], border: 0.012, radiance: 7, falloff: 0.2, lamps: [2, 1] },
  { towards: [-0.85, 0.25, -1], roll: 90, half: [0.6, 0.04], border: 0.02, radiance: 6, falloff: 0.2, lamps: [1, 1] },
  { towards: [0.95, 0.4, -1], roll: 90, half: [0.6, 0.04], border: 0.02, radiance: 6, falloff: 0.2, lamps: [1, 1] },
];

const unit = (v) => v.map((x) => x / Math.hypot(...v));
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];

function placed({ towards, roll, ...box }) {
  const center = unit(towards);
  const level = unit(cross([0, 1, 0.001], center));
  const steep = cross(center, level);
  const [c, s] = [Math.cos((roll * Math.PI) / 180), Math.sin((roll * Math.PI) / 180)];
  const across = level.map((x, k) => x * c + steep[k] * s);
  return { ...box, center, across, upwards: cross(center, across) };
}

// A box as lamps of one direction each, with the irradiance of their parts of it.
function lampsOf({ center, across, upwards, half, radiance, falloff, lamps: [columns, rows] }) {
  const lamps = [];
  for (let k = 0; k < columns * rows; k += 1) {
    const [u, v] = [((k % columns) + 0.5) * (2 / columns) - 1, (Math.floor(k / columns) + 0.5) * (2 / rows) - 1];
    const [x, y] = [u * half[0], v * half[1]];
    const area = (4 * half[0] * half[1]) / (columns * rows);
    // What is lost towards the border is a third of it in the mean over a box, and about that over its parts.
    const irradiance = (radiance * (1 - falloff / 2) * area) / (1 + x * x + y * y) ** 1.5;
    lamps.push({ direction: unit(center.map((n, axis) => n + x * across[axis] + y * upwards[axis])), irradiance });
  }
  return lamps;
}

const fragment = (boxes, lamps) => `
uniform vec3 box_center[${boxes}];
uniform vec3 box_across[${boxes}];
uniform vec3 box_upwards[${boxes}];
uniform vec4 box_shape[${boxes}];
uniform float box_falloff[${boxes}];
uniform vec3 lamp_direction[${lamps}];
uniform float lamp_irradiance[${lamps}];
uniform vec3 sun_direction;
uniform float sun_irradiance;
uniform vec2 texels_per_uv;
in vec3 world_position;
in vec3 world_normal;
in vec2 paint_uv;

// Walls and floor: the wall behind the camera is lit, the one behind the object is not.
float surround(vec3 w) {
  float front = 0.5 + 0.5 * w.z;
  float wall = 0.014 + (0.03 + 0.27 * front) * exp(-1.2 * max(w.y, 0.0)) + 0.03 * front;
  float ground = 0.25 * (0.4 + 0.6 * front) * (0.75 + 0.25 * (1.0 + min(w.y, 0.0)));
  return mix(ground, wall, smoothstep(-0.03, 0.03, w.y));
}

// The studio as a rough mirror sees it: borders widen by the blur, and what is narrower than they are dims.
float studio(vec3 w, float blur) {
  float light = surround(w);
  for (int k = 0; k < ${boxes}; ++k) {
    float towards = dot(w, box_center[k]);
    if (towards < 0.05) continue;
    vec2 place = abs(vec2(dot(w, box_across[k]), dot(w, box_upwards[k]))) / towards;
    vec2 size = box_shape[k].xy;
    float border = box_shape[k].z + blur;
    vec2 cover = smoothstep(-border, border, size - place) * min(vec2(1.0), size / border);
    vec2 out2 = min(place / size, 1.0);
    float radiance = box_shape[k].w * (1.0 - box_falloff[k] * max(out2.x * out2.x, out2.y * out2.y));
    light += (radiance - light) * cover.x * cover.y;
  }
  return light;
}

// Light of the walls, which diffuse and mean flakes gather from all sides.
vec3 from_all_sides(mat3 to_paint, vec3 inner_o) {
  const int SIDES = 12;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < SIDES; ++k) {
    float across2 = (float(k) + 0.5) / float(SIDES);
    float turn = 2.3999632 * float(k);
    vec3 w = vec3(sqrt(across2) * cos(turn), sqrt(across2) * sin(turn), sqrt(1.0 - across2));
    CarpaintHalf h = carpaint_half(carpaint_refract(w, carpaint_coat.x), inner_o);
    vec3 f = carpaint_chi(h) * carpaint_diffuse / CARPAINT_PI + carpaint_flakes_mean(h.theta_h_deg, h.theta_d_deg);
    sum += f * (1.0 - carpaint_fresnel(w.z, carpaint_coat.x)) * surround(transpose(to_paint) * w);
  }
  return sum * CARPAINT_PI / float(SIDES);
}

void main() {
  vec3 n = normalize(world_normal);
  vec3 across = abs(n.y) < 0.999 ? normalize(cross(vec3(0.0, 1.0, 0.0), n)) : vec3(1.0, 0.0, 0.0);
  mat3 to_paint = transpose(mat3(across, cross(n, across), n));
  vec3 eye = normalize(cameraPosition - world_position);
  vec3 wo = to_paint * eye;
  wo = normalize(vec3(wo.xy, max(wo.z, 1e-3)));
  vec2 p = paint_uv * texels_per_uv;
  vec2 dx = dFdx(p);
  vec2 dy = dFdy(p);
  vec3 inner_o = carpaint_refract(wo, carpaint_coat.x);
  vec3 mirrored = reflect(-eye, n);
  float coat = carpaint_fresnel(wo.z, carpaint_coat.x);

  // Diffuse and flakes under the boxes, lamp by lamp.
  vec3 inside = from_all_sides(to_paint, inner_o);
  for (int k = 0; k < ${lamps}; ++k) {
    vec3 wi = to_paint * lamp_direction[k];
    if (wi.z <= 0.0) continue;
    CarpaintHalf h = carpaint_half(carpaint_refract(wi, carpaint_coat.x), inner_o);
    vec3 f = carpaint_chi(h) * carpaint_diffuse / CARPAINT_PI + carpaint_flakes_area(p, dx, dy, h.theta_h_deg, h.theta_d_deg);
    inside += f * ((1.0 - carpaint_fresnel(wi.z, carpaint_coat.x)) * wi.z * lamp_irradiance[k]);
  }
  // Lobes mirror the studio, each as rough as it is, and colored as the table says along the mirror direction.
  float x = 1.0 - inner_o.z;
  vec3 lobes = vec3(0.0);
  for (int k = 0; k < carpaint_lobes; ++k) {
    float f0 = carpaint_lobe_shape[k].y;
    vec3 strength = 4.0 * carpaint_lobe_weight[k] * (f0 + (1.0 - f0) * x * x * x * x * x);
    lobes += min(strength, 1.0) * studio(mirrored, 1.5 * carpaint_lobe_shape[k].x);
  }
  CarpaintHalf facing = carpaint_half(vec3(-inner_o.xy, inner_o.z), inner_o);
  inside += (1.0 - coat) * carpaint_chi(facing) * lobes;

  vec3 sum = (1.0 - coat) * max(inside, 0.0) + coat * studio(mirrored, 1.5 * carpaint_coat.y);
  vec3 wi = to_paint * sun_direction;
  sum += carpaint_shade_area(wi, wo, p, dx, dy) * max(wi.z, 0.0) * sun_irradiance;
  gl_FragColor = vec4(sum, 1.0);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`;
