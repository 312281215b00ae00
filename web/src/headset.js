// SPDX-License-Identifier: LGPL-2.1-or-later
// A WebXR headset: the head moves the view. Each eye's picture is redrawn for the pose of the eye at the time of the
// frame, with the surface of the picture, so the frame rate of the headset does not depend on the server. Without WebGL on
// a GPU, the compositor of the headset shows the video as a layer in the direction that it was rendered for.

import { contextOf, Painter } from './painter.js';
import { anglesOf, axesOf, axesOfQuaternion, dot } from './view.js';

const kFar = 100;     // distance of the layer in metres; there, the eye distance is less than a quarter of a pixel
const kHeight = 960;  // maximum height of the picture of an eye, pixels

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
    const canLayer = globalThis.XRMediaBinding && session.enabledFeatures?.includes('layers');
    const gl = this.contextFor(!canLayer);
    if (gl) {
      session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl) });
      this.painter = new Painter(gl);
    } else {
      this.layer = new XRMediaBinding(session).createQuadLayer(this.viewer.video,
        { space: this.space, layout: 'stereo-left-right', width: 1, height: 1 });
      session.updateRenderState({ layers: [this.layer] });
    }
    session.requestAnimationFrame((time, frame) => this.frame(frame));
  }
  stop() { return this.session?.end(); }

  // Returns a WebGL context for the headset, or null if there is no GPU and `isNeeded` is false.
  contextFor(isNeeded) {
    try {
      return this.gl = contextOf(document.createElement('canvas'), { xrCompatible: true }, isNeeded);
    } catch (error) {
      if (isNeeded) throw error;
      return null;
    }
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
    const { gl, painter } = this, { video, redraw: { frames, pictures } } = this.viewer, layer = this.session.renderState.baseLayer;
    gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
    if (pictures?.length !== 2 || video.readyState < video.HAVE_CURRENT_DATA) return gl.clear(gl.COLOR_BUFFER_BIT);
    painter.load(video, frames);
    for (const [index, view] of pose.views.slice(0, 2).entries()) {
      const { x, y, width, height } = layer.getViewport(view), { surface, camera } = pictures[index];
      painter.draw(surface, camera, this.cameraOf(view, width, height),
          { target: layer.framebuffer, box: [x, y, width, height], index, eyes: 2 });
    }
  }
  // Returns the camera of an eye: its pose, and the lens of its projection matrix.
  cameraOf({ transform: { position, orientation }, projectionMatrix: p }, width, height) {
    const base = axesOf(this.base), way = combine(base, [position.x, -position.y, -position.z]);
    return {
      position: ['x', 'y', 'z'].map((name, k) => this.base[name] + way[k]),
      axes: turned(base, axesOfXr(orientation)),
      width,
      height,
      fx: p[0] * width / 2,
      fy: p[5] * height / 2,
      cx: ((1 - p[8]) * width - 1) / 2,
      cy: ((1 + p[9]) * height - 1) / 2
    };
  }
}
