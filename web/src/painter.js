// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws a picture and its surface from another viewpoint, with WebGL 2.

import { useProgram } from './program.js';
import { clipMatrix, kAround, kRing, kVertexFloats, makeMesh } from './surface.js';

const kBlur = 2;        // blur in the gaps that a movement opens: level of detail
const kNearest = 0.25;  // points nearer than this share of the nearest distance of the surface are not drawn

const kSoftware = /SwiftShader|llvmpipe|softpipe|Software|Basic Render/;

const kVertex = `#version 300 es
layout(location = 0) in vec3 place;  // pixel position in the picture, and inverse depth
layout(location = 1) in vec3 from;   // pixel position of the colour; side (makeMesh())
uniform mat4 clip_from_ray;
uniform vec4 lens;                   // fx, fy, cx, cy
uniform vec2 size;
out vec2 at;
flat out float side;
void main() {
  at = (from.xy + 0.5) / size;
  side = from.z;
  gl_Position = clip_from_ray * vec4((place.xy - lens.zw) / lens.xy, 1, place.z);
}`;

// The outermost pixels of the picture continue beyond its border and fade out. In a cell at an edge, the picture is finer
// than the surface. There, a pixel belongs to the side with neighbouring nodes of a similar colour.
const kFragment = `#version 300 es
precision highp float;
uniform sampler2D picture;
uniform sampler2D levels;
uniform vec2 size, part;  // pixels; width and left end of this eye's picture in the texture
uniform float step_size, blur, brightness;
in vec2 at;
flat in float side;
out vec4 colour;
vec3 colour_at(vec2 where, float detail) {
  vec2 margin = exp2(detail) * 0.5 / size;
  vec2 inside = clamp(where, margin, 1.0 - margin);
  return textureLod(picture, vec2(inside.x * part.x + part.y, inside.y), detail).rgb;
}
bool is_near(float limit) {
  vec3 own = colour_at(at, 0.0);
  vec2 node = at * size / step_size - 0.5, first = floor(node) - ${kRing}.0, last = vec2(textureSize(levels, 0)) - 1.0;
  vec2 sums = vec2(0);
  for (int j = 0; j < ${kAround}; j++)
    for (int i = 0; i < ${kAround}; i++) {
      vec2 other = clamp(first + vec2(i, j), vec2(0), last), away = other - node;
      vec2 place = min((other + 0.5) * step_size / size, 1.0);
      vec3 change = textureLod(picture, vec2(place.x * part.x + part.y, place.y), 1.0).rgb - own;
      float distance = 1.0 + dot(away, away) * 0.5 + dot(change, change) * 15.0, square = distance * distance;
      float weight = 1.0 / (square * square);
      sums[int(texelFetch(levels, ivec2(other), 0).r * 255.0 > limit)] += weight;
    }
  return sums.y > sums.x;
}
void main() {
  if (side != 0.0 && is_near(abs(side)) != (side > 0.0)) discard;
  vec2 beyond = abs(at - clamp(at, 0.0, 1.0));
  colour = vec4(colour_at(at, blur) * (1.0 - smoothstep(0.05, 0.3, max(beyond.x, beyond.y))) * brightness, 1);
}`;

const kUniforms = ['clip_from_ray', 'lens', 'size', 'picture', 'levels', 'part', 'step_size', 'blur', 'brightness'];

// Returns the name of the GPU or of the software that draws.
const rendererOf = gl =>
  gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info')?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);

// Returns a WebGL 2 context of a canvas. Throws an error if there is none, or only in software, which would slow down the
// video and the input, unless `inSoftware` is set.
export function contextOf(canvas, options = {}, inSoftware = false) {
  const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, failIfMajorPerformanceCaveat: !inSoftware, ...options });
  if (!gl || (!inSoftware && kSoftware.test(rendererOf(gl)))) throw new Error('no WebGL 2 on a GPU');
  return gl;
}

// Draws pictures of up to two eyes, which are side by side in the video.
export class Painter {
  constructor(gl) {
    this.gl = gl;
    const program = useProgram(gl, kVertex, kFragment);
    this.places = Object.fromEntries(kUniforms.map(name => [name, gl.getUniformLocation(program, name)]));
    this.picture = this.texture(gl.LINEAR_MIPMAP_NEAREST, gl.LINEAR);
    this.eyes = [];  // by index: { surface, mesh, array, buffers, levels }
    gl.uniform1i(this.places.levels, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }
  texture(less, more) {
    const { gl } = this, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, less);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, more);
    return texture;
  }

  // Reads a picture (a video, a canvas or an image), unless it has read the picture of this number.
  load(picture, number) {
    const { gl } = this;
    if (number === this.number) return;
    this.number = number;
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.picture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
  }
  begin() {
    const { gl } = this, array = gl.createVertexArray(), buffers = [gl.createBuffer(), gl.createBuffer()];
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]);
    for (const place of [0, 1]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 4 * kVertexFloats, 12 * place);
    }
    gl.activeTexture(gl.TEXTURE1);
    return { array, buffers, levels: this.texture(gl.NEAREST, gl.NEAREST) };
  }
  use(surface, index) {
    const { gl } = this, eye = this.eyes[index] ??= this.begin();
    gl.bindVertexArray(eye.array);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, eye.levels);
    if (surface === eye.surface) return eye;
    const mesh = makeMesh(surface);
    Object.assign(eye, { surface, mesh });
    gl.bindBuffer(gl.ARRAY_BUFFER, eye.buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, mesh.vertices, gl.STREAM_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STREAM_DRAW);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, surface.columns, surface.rows, 0, gl.RED, gl.UNSIGNED_BYTE, mesh.levels);
    return eye;
  }

  // Redraws the picture of the camera `from`, which shows this surface, for the camera `to`. `box` is the viewport. For a
  // pair, `index` is the eye, and `eyes` is 2.
  draw(surface, from, to, { box = [0, 0, to.width, to.height], index = 0, eyes = 1, brightness = 1 } = {}) {
    const { gl, places } = this, { mesh } = this.use(surface, index);
    gl.viewport(...box);
    gl.uniformMatrix4fv(places.clip_from_ray, false, clipMatrix(from, to, kNearest / Math.max(surface.nearest, 1e-9)));
    gl.uniform4f(places.lens, from.fx, from.fy, from.cx, from.cy);
    gl.uniform2f(places.size, from.width, from.height);
    gl.uniform2f(places.part, 1 / eyes, index / eyes);
    gl.uniform1f(places.step_size, surface.step);
    gl.uniform1f(places.brightness, brightness);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...box);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(places.blur, kBlur);
    gl.drawElements(gl.TRIANGLES, mesh.behind, gl.UNSIGNED_INT, 0);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(places.blur, 0);
    gl.drawElements(gl.TRIANGLES, mesh.front, gl.UNSIGNED_INT, 4 * mesh.behind);
    gl.disable(gl.SCISSOR_TEST);
  }
}
