// SPDX-License-Identifier: LGPL-2.1-or-later
// Redraws the latest picture for the view that the user has already requested, until the picture of this view arrives.
// A movement is therefore visible without waiting for the server. The server sends the surface that each picture shows
// (surface.js), and prediction.js knows the requested view.
//
// While the picture shows the requested view, the <video> itself is visible and nothing is drawn.

import { Prediction } from './prediction.js';
import {useProgram} from './program.js';
import { clipMatrix, decodeSurface, displacement, kVertexFloats, makeMesh } from './surface.js';
import { axesOf, kFields } from './view.js';

const kKept = 64;       // surfaces that wait for their picture
const kSame = 0.05;     // pixels; the picture counts as the picture of the requested view
// Maximum movement of points of the picture, in picture widths: for a jump to another view, and for a continued movement.
// Beyond, the video is shown.
const kReach = 0.4, kContinuedReach = 1;
const kBlend = 100;     // milliseconds until a wrong prediction is corrected
const kFade = 80;       // milliseconds until the redrawn picture has given way to the video
const kBlur = 3;        // blur in the gaps that a movement opens: level of detail
const kNearest = 0.25;  // points nearer than this share of the nearest distance of the surface are not drawn

const kSoftware = /SwiftShader|llvmpipe|softpipe|Software|Basic Render/;

const kVertex = `#version 300 es
layout(location = 0) in vec3 place;  // pixel position in the picture, and inverse depth
layout(location = 1) in vec2 from;   // pixel position of the colour
uniform mat4 clip_from_ray;
uniform vec4 lens;                   // fx, fy, cx, cy
uniform vec2 size;
out vec2 at;
void main() {
  at = (from + 0.5) / size;
  gl_Position = clip_from_ray * vec4((place.xy - lens.zw) / lens.xy, 1, place.z);
}`;

// Beyond the border of the picture, its outermost pixels fade out.
const kFragment = `#version 300 es
precision highp float;
uniform sampler2D picture;
uniform float blur;  // level of detail
in vec2 at;
out vec4 colour;
void main() {
  vec2 beyond = abs(at - clamp(at, 0.0, 1.0));
  colour = vec4(textureLod(picture, at, blur).rgb * (1.0 - smoothstep(0.05, 0.3, max(beyond.x, beyond.y))), 1);
}`;

// Returns the name of the GPU or of the software that draws.
const rendererOf = gl =>
  gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info')?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER);

// Draws the meshes of a surface with WebGL 2. Throws an error if there is no WebGL 2, or only in software, which would slow
// down the video and the input.
class Painter {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = this.gl = canvas.getContext('webgl2', { alpha: false, antialias: false, failIfMajorPerformanceCaveat: true });
    if (!gl || kSoftware.test(rendererOf(gl))) throw new Error('no WebGL 2 on a GPU');
    const program = useProgram(gl, kVertex, kFragment);
    this.places = Object.fromEntries(
        ['clip_from_ray', 'lens', 'size', 'blur'].map(name => [name, gl.getUniformLocation(program, name)]));
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    for (const [place, count, offset] of [[0, 3, 0], [1, 2, 12]]) {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 4 * kVertexFloats, offset);
    }
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  load(video) {
    const { gl } = this;
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, video);
    gl.generateMipmap(gl.TEXTURE_2D);
  }
  use(surface) {
    if (surface === this.surface) return;
    const { gl } = this, mesh = this.mesh = makeMesh(surface);
    this.surface = surface;
    gl.bufferData(gl.ARRAY_BUFFER, mesh.vertices, gl.STREAM_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.triangles, gl.STREAM_DRAW);
  }
  // Draws the picture of the camera `from`, as the camera `to` sees it.
  draw(from, to) {
    const { gl, canvas, mesh, places, surface } = this;
    if (canvas.width !== to.width || canvas.height !== to.height) [canvas.width, canvas.height] = [to.width, to.height];
    gl.viewport(0, 0, to.width, to.height);
    gl.uniformMatrix4fv(places.clip_from_ray, false, clipMatrix(from, to, kNearest / Math.max(surface.nearest, 1e-9)));
    gl.uniform4f(places.lens, from.fx, from.fy, from.cx, from.cy);
    gl.uniform2f(places.size, from.width, from.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(places.blur, kBlur);
    gl.drawElements(gl.TRIANGLES, mesh.behind, gl.UNSIGNED_INT, 0);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(places.blur, 0);
    gl.drawElements(gl.TRIANGLES, mesh.front, gl.UNSIGNED_INT, 4 * mesh.behind);
  }
}

// Returns the camera of a view with the size of the picture.
function cameraOf(view, width, height) {
  const focal = height / 2 / Math.tan(view.fov * Math.PI / 360);
  return {
    position: [view.x, view.y, view.z],
    axes: axesOf(view),
    width,
    height,
    fx: focal,
    fy: focal,
    cx: (width - 1) / 2,
    cy: (height - 1) / 2
  };
}

const turn = degrees => degrees - 360 * Math.round(degrees / 360);
const difference = (a, b) => Object.fromEntries(
    kFields.map(name => [name, ['yaw', 'roll'].includes(name) ? turn(a[name] - b[name]) : a[name] - b[name]]));

export class Redraw {
  constructor(viewer, canvas) {
    this.viewer = viewer;
    this.canvas = canvas;
    this.prediction = new Prediction();
    this.drawn = 0;  // pictures that were redrawn, for statistics
    canvas.addEventListener('webglcontextlost', event => {
      event.preventDefault();
      this.isLost = true;
      this.painter = null;
      this.hide();
    });
    canvas.addEventListener('webglcontextrestored', () => this.isLost = false);
    this.begin();
  }
  // Forgets the previous connection.
  begin() {
    this.prediction.forget();
    this.surfaces = new Map();
    this.latest = this.picture = this.correction = null;
    this.hide();
  }

  // Takes a message of the data channel "surface".
  take(message) {
    const { surfaces } = this;
    if (this.isImpossible) return;
    decodeSurface(message).then(surface => {
      if (surfaces !== this.surfaces) return;
      surfaces.set(surface.timestamp, surface);
      if (surfaces.size > kKept) surfaces.delete(surfaces.keys().next().value);
      this.latest = surface;
      if (this.picture?.timestamp === surface.timestamp)
        this.picture = { timestamp: surface.timestamp, surface, camera: surface.camera };
      this.wake();
    }, error => console.warn(`lightfield-viewer: ${error.message}`));
  }

  sent({ id, request }) {
    const { video, flight } = this.viewer;
    this.prediction.sent(id, request, { width: video.videoWidth || 1, height: video.videoHeight || 1 }, flight.home);
    this.wake();
  }
  answered(id, error) { this.prediction.answer(id, error); }
  // A view of the server. If the prediction was wrong, the redrawn picture does not jump, but approaches the view.
  confirm(view, id) {
    const before = this.painted && this.target();
    this.prediction.confirm(view, id);
    this.correction = null;
    if (before) this.correction = { fields: difference(before, this.prediction.now), began: performance.now() };
    this.wake();
  }
  // Returns the view to draw, or null.
  target() {
    const { prediction: { now }, correction } = this;
    const left = correction ? 1 - (performance.now() - correction.began) / kBlend : 0;
    if (left <= 0) this.correction = null;
    if (!now || left <= 0) return now;
    return { ...now, ...Object.fromEntries(kFields.map(name => [name, now[name] + left * correction.fields[name]])) };
  }

  // A new picture is on the screen.
  show({ rtpTimestamp }) {
    const { seen } = this.viewer.flight, { videoWidth, videoHeight } = this.viewer.video;
    const surface = this.surfaces.get(rtpTimestamp), last = surface ?? this.latest;
    this.picture = last && (surface || seen) ?
        { timestamp: rtpTimestamp, surface: last, camera: surface?.camera ?? cameraOf(seen, videoWidth, videoHeight) } :
        null;
    this.isLoaded = false;
    if (this.painted) this.load();
    this.wake();
  }

  get isPossible() {
    const { viewer } = this;
    return viewer.mode === 'one' && viewer.path === null && viewer.cameras.canvas.hidden &&
      !this.isLost && !this.isImpossible;
  }
  // Reads the picture on the screen once.
  load() {
    if (this.isLoaded || !this.painter) return;
    this.painter.load(this.viewer.video);
    this.isLoaded = true;
  }
  // Returns the camera to draw. Returns null if the video shows the requested view, or if the view is too far away.
  wanted() {
    const view = this.picture && this.isPossible && this.target(), { video } = this.viewer;
    if (!view || !video.videoWidth) return null;
    const camera = cameraOf(view, video.videoWidth, video.videoHeight), { surface, camera: from } = this.picture;
    const pixels = displacement(from, camera, surface.nearest);
    return pixels < kSame || pixels > (this.painted ? kContinuedReach : kReach) * from.width ? null : camera;
  }

  wake() {
    if (this.frame || (!this.painted && !this.wanted())) return;
    this.frame = requestAnimationFrame(now => {
      this.frame = null;
      this.paint(now);
      // Otherwise, nothing changes until the next message, input or picture.
      if (this.fadeBegan || (this.painted && this.correction)) this.wake();
    });
  }
  paint(now) {
    const camera = this.wanted();
    if (!camera) return this.fade(now);
    try {
      this.painter ??= new Painter(this.canvas);
      this.load();
      this.painter.use(this.picture.surface);
      this.painter.draw(this.picture.camera, camera);
    } catch (error) {
      console.info(`lightfield-viewer: pictures are not redrawn: ${error.message}`);
      this.isImpossible = true;
      return this.hide();
    }
    this.drawn++;
    this.fadeBegan = null;
    this.canvas.style.opacity = 1;
    this.canvas.hidden = false;
    this.painted = true;
  }
  // The video shows the requested view: fades the redrawn picture out.
  fade(now) {
    this.fadeBegan ??= now;
    const left = 1 - (now - this.fadeBegan) / kFade;
    if (left <= 0 || !this.isPossible) return this.hide();
    this.canvas.style.opacity = left;
  }
  hide() {
    this.canvas.hidden = true;
    this.painted = false;
    this.fadeBegan = this.correction = null;
  }
}
