// Makes ../oracle/gltf_brdf.json: reflectances of glTF materials as the Khronos glTF Sample Renderer shades them.
//
//   npm install --no-save @khronosgroup/gltf-viewer@1.1.0 && node make_gltf_oracle.js
//
// Its fragment shader (npm package @khronosgroup/gltf-viewer, Apache-2.0) runs in Chromium's WebGL2 into 32-bit floats:
// one directional light of intensity 1, no image-based light, no tone mapping; the result over N.L is the BRDF.

import { readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";

import { launch } from "./browser.js";
import { here } from "./server.js";

const source = await readFile(join(here, "node_modules/@khronosgroup/gltf-viewer/dist/gltf-viewer.module.js"), "utf8");
const shader = (name) => JSON.parse(source.match(new RegExp(`var ${name} = ("(?:[^"\\\\]|\\\\.)*")`))[1]);
const parts = {
  "tonemapping.glsl": "tonemappingShader", "textures.glsl": "texturesShader", "functions.glsl": "shaderFunctions",
  "brdf.glsl": "brdfShader", "punctual.glsl": "punctualShader", "ibl.glsl": "iblShader",
  "material_info.glsl": "materialInfoShader", "iridescence.glsl": "iridescenceShader",
};
const fragment = shader("pbrShader").replace(/#include <([\w.]+)>/g, (_, file) => shader(parts[file]));

let state = 20261122;
const random = () => {
  state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
  return state / 4294967296;
};
const between = (low, high) => low + (high - low) * random();
const color = (high = 1) => [between(0, high), between(0, high), between(0, high)];
const direction = () => {
  const [z, turn] = [between(0.15, 1), between(0, 2 * Math.PI)];
  return [Math.sqrt(1 - z * z) * Math.cos(turn), Math.sqrt(1 - z * z) * Math.sin(turn), z];
};

// The renderer and the specification part ways where a colored Fresnel term meets a diffuse base (the one weighs the base
// by channel, the other by the largest channel), so such a case has one of the two only.
const cases = Array.from({ length: 160 }, (_, k) => {
  const kind = ["plain", "metal", "colored", "film", "metal film", "colored film", "coated", "all"][k % 8];
  const metal = kind.startsWith("metal") || kind === "all";
  const colored = kind.startsWith("colored");
  const film = kind.endsWith("film") || kind === "all";
  return {
    kind,
    base_color: colored ? [0, 0, 0] : color(),
    metallic: metal ? (kind === "all" ? between(0, 1) : 1) : 0,
    roughness: between(0.15, 1),
    // The renderer derives the coat's Fresnel term from the base's ior, the specification from 1.5.
    ior: kind === "coated" || kind === "all" ? 1.5 : between(1.1, 3),
    specular: film ? 1 : between(0, 1),
    specular_color: colored ? color(2) : [1, 1, 1],
    clearcoat: kind === "coated" || kind === "all" ? between(0, 1) : 0,
    clearcoat_roughness: between(0.15, 1),
    iridescence: film ? between(0, 1) : 0,
    iridescence_ior: between(1.1, 2.2),
    iridescence_thickness_nm: between(80, 1200),
    wi: direction(),
    wo: direction(),
  };
});

const browser = await launch();
const page = await browser.newPage();
const answers = await page.evaluate(async ([fragment, cases]) => {
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2");
  gl.getExtension("EXT_color_buffer_float");
  const defines = [
    "ALPHAMODE_OPAQUE 0", "ALPHAMODE_MASK 1", "ALPHAMODE_BLEND 2", "ALPHAMODE ALPHAMODE_OPAQUE", "LINEAR_OUTPUT 1",
    "MATERIAL_METALLICROUGHNESS 1", "MATERIAL_IOR 1", "MATERIAL_SPECULAR 1", "MATERIAL_CLEARCOAT 1",
    "MATERIAL_IRIDESCENCE 1", "USE_PUNCTUAL 1", "LIGHT_COUNT 1", "HAS_NORMAL_VEC3 1", "DEBUG_NONE 0", "DEBUG DEBUG_NONE",
    ...["DEBUG_METALLIC_ROUGHNESS", "DEBUG_NORMAL_SHADING", "DEBUG_NORMAL_GEOMETRY", "DEBUG_NORMAL_TEXTURE", "DEBUG_UV_0",
      "DEBUG_UV_1", "DEBUG_TANGENT", "DEBUG_BITANGENT", "DEBUG_ALPHA", "DEBUG_OCCLUSION", "DEBUG_EMISSIVE",
      "DEBUG_METALLIC", "DEBUG_ROUGHNESS", "DEBUG_BASE_COLOR", "DEBUG_CLEARCOAT_FACTOR", "DEBUG_CLEARCOAT_ROUGHNESS",
      "DEBUG_CLEARCOAT_NORMAL", "DEBUG_SHEEN_COLOR", "DEBUG_SHEEN_ROUGHNESS", "DEBUG_SPECULAR_FACTOR",
      "DEBUG_SPECULAR_COLOR", "DEBUG_TRANSMISSION_FACTOR", "DEBUG_VOLUME_THICKNESS", "DEBUG_IRIDESCENCE_FACTOR",
      "DEBUG_IRIDESCENCE_THICKNESS", "DEBUG_ANISOTROPIC_STRENGTH", "DEBUG_ANISOTROPIC_DIRECTION",
      "DEBUG_DIFFUSE_TRANSMISSION_FACTOR", "DEBUG_DIFFUSE_TRANSMISSION_COLOR_FACTOR"].map((name, k) => `${name} ${k + 1}`),
  ].map((define) => `#define ${define}\n`).join("");
  const vertex = `#version 300 es
    out vec3 v_Position; out vec3 v_Normal; out vec2 v_texcoord_0; out vec2 v_texcoord_1; out vec4 v_Color;
    void main() {
      v_Position = vec3(0.0); v_Normal = vec3(0.0, 0.0, 1.0); v_texcoord_0 = vec2(0.0); v_texcoord_1 = vec2(0.0);
      gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
    }`;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, `#version 300 es\n${defines}${fragment}`]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  const target = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, target);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, 1, 1);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  const missing = new Set();
  const set = (name, ...values) => {
    const at = gl.getUniformLocation(program, name);
    if (at === null) missing.add(name);
    gl[`uniform${values.length}f`](at, ...values);
  };
  const out = cases.map((c) => {
    set("u_BaseColorFactor", ...c.base_color, 1);
    set("u_MetallicFactor", c.metallic);
    set("u_RoughnessFactor", c.roughness);
    set("u_Ior", c.ior);
    set("u_KHR_materials_specular_specularFactor", c.specular);
    set("u_KHR_materials_specular_specularColorFactor", ...c.specular_color);
    set("u_ClearcoatFactor", c.clearcoat);
    set("u_ClearcoatRoughnessFactor", c.clearcoat_roughness);
    set("u_IridescenceFactor", c.iridescence);
    set("u_IridescenceIor", c.iridescence_ior);
    set("u_IridescenceThicknessMinimum", c.iridescence_thickness_nm);
    set("u_IridescenceThicknessMaximum", c.iridescence_thickness_nm);
    set("u_Camera", ...c.wo);
    set("u_Lights[0].direction", ...c.wi.map((v) => -v));
    set("u_Lights[0].color", 1, 1, 1);
    set("u_Lights[0].intensity", 1);
    gl.uniform1i(gl.getUniformLocation(program, "u_Lights[0].type"), 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const pixel = new Float32Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, pixel);
    return Array.from(pixel.subarray(0, 3), (v) => v / c.wi[2]);
  });
  return { out, missing: [...missing], error: gl.getError() };
}, [fragment, cases]);
await browser.close();
console.log("uniforms without a place:", answers.missing, "WebGL error:", answers.error);
const digits = (value) => (typeof value === "number" ? Number(value.toPrecision(9)) : value.map ? value.map(digits) : value);
const text = {
  made: "tests/browser/make_gltf_oracle.js: fragment shader of the Khronos glTF Sample Renderer (npm @khronosgroup/gltf-viewer 1.1.0) in Chromium WebGL2, 32-bit floats, one directional light, BRDF = color / N.L",
  cases: cases.map((c, k) => Object.fromEntries([...Object.entries(c), ["f", answers.out[k]]].map(([key, v]) => [key, digits(v)]))),
};
await writeFile(join(here, "../oracle/gltf_brdf.json"), `${JSON.stringify(text).replaceAll('{"kind"', '\n{"kind"')}\n`);
