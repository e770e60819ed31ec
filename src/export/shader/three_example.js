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
// Shades one directional light and a made-up sky. Flakes are placed by uv: `uvMeters` says how many meters of paint one
// unit of uv spans. For more lights call carpaint_shade_area once for each.

import { SAMPLERS, blendAt, uniformValues } from "./carpaint.js";

export function carpaintMaterial(THREE, paint, { uvMeters = [0.06, 0.03], lightDirection = [0.4, 0.6, 0.7] } = {}) {
  const { paints } = paint.material;
  const first = paints ? blendAt(paint, { weights: paints.map(() => 1 / paints.length) }) : paint;
  const uniforms = {
    light_direction: { value: new THREE.Vector3(...lightDirection).normalize() },
    light_irradiance: { value: Math.PI },
    sky: { value: 0.35 },
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
    fragmentShader: paint.shader + FRAGMENT,
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

const FRAGMENT = `
uniform vec3 light_direction;
uniform float light_irradiance;
uniform float sky;
uniform vec2 texels_per_uv;
in vec3 world_position;
in vec3 world_normal;
in vec2 paint_uv;

vec3 sky_radiance(vec3 w) {
  float ribbon = smoothstep(0.55, 0.6, w.y) * smoothstep(0.9, 0.85, w.y);
  return sky * (vec3(0.25) + 0.75 * smoothstep(-0.2, 1.0, w.y) + 3.0 * ribbon);
}

// Light of the sky: diffuse and mean flakes gather it from all sides, lobes and coat mirror it.
vec3 sky_light(mat3 to_paint, vec3 wo, vec3 mirrored) {
  const int SIDES = 12;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < SIDES; ++k) {
    float across2 = (float(k) + 0.5) / float(SIDES);
    float turn = 2.3999632 * float(k);
    vec3 w = vec3(sqrt(across2) * cos(turn), sqrt(across2) * sin(turn), sqrt(1.0 - across2));
    CarpaintHalf h = carpaint_half(carpaint_refract(w, carpaint_coat.x), carpaint_refract(wo, carpaint_coat.x));
    vec3 f = carpaint_chi(h) * carpaint_diffuse / 3.14159265 + carpaint_flakes_mean(h.theta_h_deg, h.theta_d_deg);
    sum += f * (1.0 - carpaint_fresnel(w.z, carpaint_coat.x)) * sky_radiance(transpose(to_paint) * w);
  }
  sum *= 3.14159265 / float(SIDES);
  float x = 1.0 - carpaint_refract(wo, carpaint_coat.x).z;
  vec3 lobes = vec3(0.0);
  for (int k = 0; k < carpaint_lobes; ++k) {
    float f0 = carpaint_lobe_shape[k].y;
    lobes += 4.0 * carpaint_lobe_weight[k] * (f0 + (1.0 - f0) * x * x * x * x * x);
  }
  sum += min(lobes, 1.0) * sky_radiance(mirrored);
  float coat = carpaint_fresnel(wo.z, carpaint_coat.x);
  return (1.0 - coat) * sum + coat * sky_radiance(mirrored);
}

void main() {
  vec3 n = normalize(world_normal);
  vec3 across = abs(n.y) < 0.999 ? normalize(cross(vec3(0.0, 1.0, 0.0), n)) : vec3(1.0, 0.0, 0.0);
  mat3 to_paint = transpose(mat3(across, cross(n, across), n));
  vec3 eye = normalize(cameraPosition - world_position);
  vec3 wo = to_paint * eye;
  vec2 p = paint_uv * texels_per_uv;
  vec2 dx = dFdx(p);
  vec2 dy = dFdy(p);
  vec3 wi = to_paint * light_direction;
  vec3 sum = carpaint_shade_area(wi, wo, p, dx, dy) * max(wi.z, 0.0) * light_irradiance;
  sum += sky_light(to_paint, wo, reflect(-eye, n));
  gl_FragColor = vec4(sum, 1.0);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`;
