// Runs a bundle's shader over a list of inputs and reads the answers back as 32-bit floats.

// `inputs`: lists of up to four numbers, several a fragment; `body`: GLSL that reads `given(k)` and sets `answer`;
// `weights`: of a blend.
export async function shade(name, inputs, body, defines = "", weights = null) {
  const { blendAt, readPaint, uniformValues, SAMPLERS } = await import(`/bundle/${name}/carpaint.js`);
  const read = await readPaint(await (await fetch(`/bundle/${name}/paint.zip`)).arrayBuffer());
  const paint = weights ? blendAt(read, weights) : read;
  const gl = new OffscreenCanvas(1, 1).getContext("webgl2");
  if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("no float render targets");
  const program = link(gl, defines + paint.shader, body);
  gl.useProgram(program);

  const rows = inputs[0].length;
  const given = new Float32Array(inputs.length * rows * 4);
  inputs.forEach((lists, x) => lists.forEach((list, y) => given.set(list, (y * inputs.length + x) * 4)));
  const textures = { inputs: { width: inputs.length, height: rows, components: 4, type: "float", data: given } };
  for (const sampler of SAMPLERS) if (paint.textures[sampler]) textures[`carpaint_${sampler}`] = paint.textures[sampler];
  Object.entries(textures).forEach(([name, texture], unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    upload(gl, texture);
    gl.uniform1i(gl.getUniformLocation(program, name), unit);
  });
  for (const [name, value] of Object.entries(uniformValues(paint.material))) set(gl, program, name, value);

  const target = gl.createTexture();
  gl.activeTexture(gl.TEXTURE15);
  gl.bindTexture(gl.TEXTURE_2D, target);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, inputs.length, 1);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
  gl.viewport(0, 0, inputs.length, 1);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const out = new Float32Array(inputs.length * 4);
  gl.readPixels(0, 0, inputs.length, 1, gl.RGBA, gl.FLOAT, out);
  const error = gl.getError();
  if (error !== gl.NO_ERROR) throw new Error(`WebGL error ${error}`);
  return inputs.map((_, k) => Array.from(out.subarray(4 * k, 4 * k + 4)));
}

function link(gl, library, body) {
  const fragment = `#version 300 es
${library}
uniform sampler2D inputs;
#define given(k) texelFetch(inputs, ivec2(int(gl_FragCoord.x), k), 0)
out vec4 answer;
void main() {
${body}
}`;
  const vertex = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  return program;
}

function upload(gl, { width, height, components, type, data }) {
  const base = [, gl.RED, gl.RG, gl.RGB, gl.RGBA][components];
  const [internal, kind] = {
    float: [[, gl.R32F, gl.RG32F, gl.RGB32F, gl.RGBA32F], gl.FLOAT],
    half: [[, gl.R16F, gl.RG16F, gl.RGB16F, gl.RGBA16F], gl.HALF_FLOAT],
    byte: [[, gl.R8, gl.RG8, gl.RGB8, gl.RGBA8], gl.UNSIGNED_BYTE],
  }[type];
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage2D(gl.TEXTURE_2D, 0, internal[components], width, height, 0, base, kind, data);
  for (const [name, value] of [["MIN_FILTER", "NEAREST"], ["MAG_FILTER", "NEAREST"], ["WRAP_S", "CLAMP_TO_EDGE"], ["WRAP_T", "CLAMP_TO_EDGE"]]) {
    gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl[value]);
  }
}

function set(gl, program, name, value) {
  const flat = [value].flat(2);
  const info = Array.from({ length: gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) }, (_, k) => gl.getActiveUniform(program, k));
  const active = info.find((uniform) => uniform && uniform.name.replace("[0]", "") === name);
  if (!active) return;
  const setter = {
    [gl.FLOAT]: "uniform1fv", [gl.FLOAT_VEC2]: "uniform2fv", [gl.FLOAT_VEC3]: "uniform3fv",
    [gl.INT]: "uniform1iv", [gl.INT_VEC4]: "uniform4iv",
  }[active.type];
  gl[setter](gl.getUniformLocation(program, name), flat.slice(0, flat.length));
}
