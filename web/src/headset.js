// SPDX-License-Identifier: LGPL-2.1-or-later
// A WebXR headset: the head moves the view, and each eye gets its half of the picture. The picture is drawn in the
// direction of the view that it was rendered for, which hides latency. If the browser supports media layers, its
// compositor shows the video at the display's own rate; otherwise a shader does.

import {useProgram} from './program.js';
import { anglesOf, axesOf, axesOfQuaternion, dot } from './view.js';

const kFar = 100;     // distance of the layer in metres; there, the eye distance is less than a quarter of a pixel
const kHeight = 960;  // maximum height of the picture of an eye, pixels

const kVertex = `#version 300 es
in vec2 corner;
out vec2 display_position;
void main() {
  display_position = corner;
  gl_Position = vec4(corner, 0, 1);
}`;

// Maps a position on the display to the position in the eye's picture on the same line of sight.
const kFragment = `#version 300 es
precision highp float;
uniform sampler2D stereo_picture;
uniform mat3 picture_from_display;
uniform vec2 half_size;  // of the picture, at distance 1
uniform float side;
in vec2 display_position;
out vec4 colour;
void main() {
  vec3 line = picture_from_display * vec3(display_position, 1);
  vec2 at = 0.5 + 0.5 * line.xy / line.z / half_size;
  bool inside = line.z > 0.0 && all(equal(at, clamp(at, 0.0, 1.0)));
  colour = inside ? vec4(texture(stereo_picture, vec2((at.x + side) / 2.0, at.y)).rgb, 1) : vec4(0, 0, 0, 1);
}`;

export const headsets = async () => await navigator.xr?.isSessionSupported?.('immersive-vr').catch(() => false) ?? false;

const axesOfXr = ({ x, y, z, w }) => axesOfQuaternion(w, x, -y, -z);
const combine = ({ right, down, forward }, [x, y, z]) =>
  right.map((_, k) => x * right[k] + y * down[k] + z * forward[k]);
const turned = (base, axes) =>
    ({ right: combine(base, axes.right), down: combine(base, axes.down), forward: combine(base, axes.forward) });
// Converts a rotation, given by the columns of its matrix, to a quaternion. Uses the numerically best of four formulas.
function quaternionOf([m00, m10, m20], [m01, m11, m21], [m02, m12, m22]) {
  const [x, y, z, w] = [1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22, 1 + m00 + m11 + m22];
  const most = Math.max(x, y, z, w);
  const q = most === w ? [m21 - m12, m02 - m20, m10 - m01, w] : most === x ? [x, m01 + m10, m02 + m20, m21 - m12]
    : most === y ? [m01 + m10, y, m12 + m21, m02 - m20] : [m02 + m20, m12 + m21, z, m10 - m01];
  const length = Math.hypot(...q);
  return { x: q[0] / length, y: q[1] / length, z: q[2] / length, w: q[3] / length };
}

function tangents([sx, , , , , sy, , , px, py]) {
  return { x: Math.max((1 + px) / sx, (1 - px) / sx), y: Math.max((1 + py) / sy, (1 - py) / sy) };
}

export class Headset {
  constructor(viewer, ended) {
    this.viewer = viewer;
    this.ended = ended;
  }

  async start() {
    this.base = this.viewer.flight.state;
    if (!this.base) throw new Error('there is no picture yet');
    const session = this.session = await navigator.xr.requestSession('immersive-vr', { optionalFeatures: ['layers'] });
    session.addEventListener('end', () => {
      this.session = null;
      this.ended();
    });
    this.space = await session.requestReferenceSpace('local');
    if (globalThis.XRMediaBinding && session.enabledFeatures?.includes('layers')) {
      this.layer = new XRMediaBinding(session).createQuadLayer(this.viewer.video,
        { space: this.space, layout: 'stereo-left-right', width: 1, height: 1 });
      session.updateRenderState({ layers: [this.layer] });
    } else {
      const gl = this.gl = document.createElement('canvas').getContext('webgl2', { xrCompatible: true });
      session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl) });
      this.prepare();
    }
    session.requestAnimationFrame((time, frame) => this.frame(frame));
  }
  stop() { return this.session?.end(); }

  prepare() {
    const {gl} = this, program = this.program = useProgram(gl, kVertex, kFragment);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
    const corner = gl.getAttribLocation(program, 'corner');
    gl.enableVertexAttribArray(corner);
    gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
  }

  frame(frame) {
    if (!this.session) return;
    this.session.requestAnimationFrame((time, next) => this.frame(next));
    const pose = frame.getViewerPose(this.space);
    if (!pose || pose.views.length < 2) return;
    this.fly(pose);
    if (this.layer) this.place();
    else this.draw(pose);
  }

  fly(pose) {
    const base = axesOf(this.base), { position, orientation } = pose.transform;
    const [dx, dy, dz] = combine(base, [position.x, -position.y, -position.z]);
    const [left, right] = pose.views.map(view => view.transform.position);
    const sides = pose.views.map(view => tangents(view.projectionMatrix));
    const most = { x: Math.max(...sides.map(s => s.x)), y: Math.max(...sides.map(s => s.y)) };
    if (!this.viewParams) {
      const distance = Math.hypot(left.x - right.x, left.y - right.y, left.z - right.z);
      this.viewParams = { height: kHeight, width: Math.round(kHeight * most.x / most.y / 16) * 16, 'eye-distance': distance };
      this.viewer.stream.again();
    }
    this.viewer.flight.sendView({ x: this.base.x + dx, y: this.base.y + dy, z: this.base.z + dz,
      ...anglesOf(turned(base, axesOfXr(orientation))), fov: 2 * Math.atan(most.y) * 180 / Math.PI }, 'person');
  }

  // Places the layer, which is the flat picture in the headset, in the direction of the rendered view. The layer gets
  // the angular size of the picture.
  place() {
    const { layer, viewer: { video, flight: { seen } } } = this;
    if (!seen || !video.videoWidth) return;
    const base = axesOf(this.base), { right, down, forward } = axesOf(seen);
    // Converts a world vector to the coordinates of the headset, with y up and z back.
    const inSpace = line => [dot(base.right, line), -dot(base.down, line), -dot(base.forward, line)];
    const back = inSpace(forward).map(v => -v);
    const eye = inSpace([seen.x - this.base.x, seen.y - this.base.y, seen.z - this.base.z]);
    const [x, y, z] = eye.map((at, i) => at - kFar * back[i]);
    layer.transform = new XRRigidTransform({ x, y, z }, quaternionOf(inSpace(right), inSpace(down).map(v => -v), back));
    layer.height = 2 * kFar * Math.tan(seen.fov * Math.PI / 360);
    layer.width = layer.height * video.videoWidth / 2 / video.videoHeight;
  }

  draw(pose) {
    const { gl, program } = this, { video } = this.viewer, layer = this.session.renderState.baseLayer;
    gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const seen = this.viewer.flight.seen;
    if (!seen || video.readyState < video.HAVE_CURRENT_DATA) return;
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, video);
    const uniform = name => gl.getUniformLocation(program, name);
    const height = Math.tan(seen.fov * Math.PI / 360), width = height * video.videoWidth / 2 / video.videoHeight;
    const then = axesOf(seen), base = axesOf(this.base);
    for (const [side, view] of pose.views.slice(0, 2).entries()) {
      const { x, y, width: w, height: h } = layer.getViewport(view);
      gl.viewport(x, y, w, h);
      const now = turned(base, axesOfXr(view.transform.orientation)), p = view.projectionMatrix;
      // The line of sight at (u, v) is ((u + p[8]) / p[0], -(v + p[9]) / p[5], 1).
      const rows = [then.right, then.down, then.forward].map(axis => {
        const [a, b, c] = [dot(axis, now.right), dot(axis, now.down), dot(axis, now.forward)];
        return [a / p[0], -b / p[5], c + a * p[8] / p[0] - b * p[9] / p[5]];
      });
      gl.uniformMatrix3fv(uniform('picture_from_display'), true, rows.flat());
      gl.uniform2f(uniform('half_size'), width, height);
      gl.uniform1f(uniform('side'), side);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
  }
}
