// SPDX-License-Identifier: LGPL-2.1-or-later
// Draws a picture and its surface from another viewpoint, with WebGL 2.

import { useProgram } from './program.js';
import { clipMatrix, kAround, kRing, kVertexFloats, makeMesh } from './surface.js';

const kBlur = 2;        // blur in the gaps that a movement opens: level of detail
const kNearest = 0.25;  // points nearer than this share of the nearest distance of the surface are not drawn

// Pixels to each side of a pixel where its surroundings end. A pixel is a speck if at most `kSpeck` pixels there, including
// itself, have a similar inverse depth: the difference is less than this share of the nearest one. A pixel of a gap is a
// crack if at most `kCrack` pixels there are in a gap.
const kReach = 2, kSpeck = 8, kCrack = 13, kSameDepth = 0.04;
const kLeast = 0.2;     // alpha of points at infinity

const kSoftware = /SwiftShader|llvmpipe|softpipe|Software|Basic Render/;

const kVertex = `#version 300 es
layout(location = 0) in vec3 place;  // pixel position in the picture, and inverse depth
layout(location = 1) in vec3 from;   // pixel position of the colour; side (makeMesh())
uniform mat4 clip_from_ray;
uniform vec4 lens;                   // fx, fy, cx, cy
uniform vec2 size;
uniform float nearest;
out vec2 at;
out float height;                    // inverse depth, 0 to 1
flat out float side;
void main() {
  at = (from.xy + 0.5) / size;
  height = place.z / nearest;
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
in float height;
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
  colour.rgb = colour_at(at, blur) * (1.0 - smoothstep(0.05, 0.3, max(beyond.x, beyond.y))) * brightness;
  colour.a = blur > 0.0 ? 0.0 : mix(${kLeast}, 1.0, height);
}`;

// Removes specks and cracks of one or two pixels at silhouettes. Alpha is the inverse depth. A pixel whose depth is not the
// usual one around it gets the mean colour of the pixels with the usual depth.
const kCleanVertex = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1); }`;
const kCleanFragment = `#version 300 es
precision highp float;
uniform sampler2D drawn;
uniform ivec2 corner;  // of the viewport
out vec4 colour;
const int reach = ${kReach};
ivec2 place;
vec4 around(int x, int y) { return texelFetch(drawn, clamp(place + ivec2(x, y), ivec2(0), textureSize(drawn, 0) - 1), 0); }
bool is_similar(int x, int y, float alpha) { return abs(around(x, y).a - alpha) < ${kSameDepth}; }
int similar(float alpha) {
  int count = 0;
  for (int y = -reach; y <= reach; y++)
    for (int x = -reach; x <= reach; x++) count += int(is_similar(x, y, alpha));
  return count;
}
void main() {
  place = ivec2(gl_FragCoord.xy) - corner;
  vec4 own = around(0, 0);
  colour = own;
  // Most pixels are in the middle of a surface.
  if (is_similar(reach, 0, own.a) && is_similar(-reach, 0, own.a) && is_similar(0, reach, own.a) && is_similar(0, -reach, own.a))
    return;
  int most = similar(own.a);
  if (most > (own.a > 0.0 ? ${kSpeck} : ${kCrack})) return;
  float usual = own.a;
  for (int y = -reach; y <= reach; y++)
    for (int x = -reach; x <= reach; x++) {
      float alpha = around(x, y).a;
      int count = similar(alpha);
      if (count <= most) continue;
      most = count;
      usual = alpha;
    }
  vec4 sum = vec4(0);
  for (int y = -reach; y <= reach; y++)
    for (int x = -reach; x <= reach; x++)
      if (is_similar(x, y, usual)) sum += vec4(around(x, y).rgb, 1) / (0.1 + float(x * x + y * y));
  colour = sum / sum.a;
}`;

const kUniforms = ['clip_from_ray', 'lens', 'size', 'picture', 'levels', 'part', 'step_size', 'blur', 'brightness', 'nearest'];

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
    this.cleaner = useProgram(gl, kCleanVertex, kCleanFragment);
    gl.uniform1i(gl.getUniformLocation(this.cleaner, 'drawn'), 2);
    this.corner = gl.getUniformLocation(this.cleaner, 'corner');
    this.program = useProgram(gl, kVertex, kFragment);
    this.places = Object.fromEntries(kUniforms.map(name => [name, gl.getUniformLocation(this.program, name)]));
    this.picture = this.texture(gl.LINEAR_MIPMAP_NEAREST, gl.LINEAR);
    this.eyes = [];  // by index: { surface, mesh, array, buffers, levels }
    gl.uniform1i(this.places.levels, 1);
    gl.depthFunc(gl.LEQUAL);
    this.drawn = { frame: gl.createFramebuffer(), depths: gl.createRenderbuffer(), width: 0, height: 0 };
    gl.activeTexture(gl.TEXTURE2);
    this.drawn.texture = this.texture(gl.NEAREST, gl.NEAREST);
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
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, surface.columns, surface.rows, 0, gl.RED, gl.UNSIGNED_BYTE, surface.levels);
    return eye;
  }

  // Binds a framebuffer of this size, with a texture and depths.
  prepare(width, height) {
    const { gl, drawn } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, drawn.frame);
    if (drawn.width === width && drawn.height === height) return;
    Object.assign(drawn, { width, height });
    gl.activeTexture(gl.TEXTURE2);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, drawn.texture, 0);
    gl.bindRenderbuffer(gl.RENDERBUFFER, drawn.depths);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, drawn.depths);
  }

  // Redraws the picture of the camera `from`, which shows this surface, for the camera `to`. `box` is the viewport in the
  // framebuffer `target`. For a pair, `index` is the eye, and `eyes` is 2.
  draw(surface, from, to,
      { target = null, box = [0, 0, to.width, to.height], index = 0, eyes = 1, brightness = 1 } = {}) {
    const { gl, places } = this, [left, bottom, width, height] = box, { mesh } = this.use(surface, index);
    this.prepare(width, height);
    gl.useProgram(this.program);
    gl.enable(gl.DEPTH_TEST);
    gl.viewport(0, 0, width, height);
    const nearest = Math.max(surface.nearest, 1e-9);
    gl.uniformMatrix4fv(places.clip_from_ray, false, clipMatrix(from, to, kNearest / nearest));
    gl.uniform4f(places.lens, from.fx, from.fy, from.cx, from.cy);
    gl.uniform2f(places.size, from.width, from.height);
    gl.uniform2f(places.part, 1 / eyes, index / eyes);
    gl.uniform1f(places.step_size, surface.step);
    gl.uniform1f(places.brightness, brightness);
    gl.uniform1f(places.nearest, nearest);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(places.blur, kBlur);
    gl.drawElements(gl.TRIANGLES, mesh.behind, gl.UNSIGNED_INT, 0);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(places.blur, 0);
    gl.drawElements(gl.TRIANGLES, mesh.front, gl.UNSIGNED_INT, 4 * mesh.behind);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.useProgram(this.cleaner);
    gl.disable(gl.DEPTH_TEST);
    gl.viewport(...box);
    gl.uniform2i(this.corner, left, bottom);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
