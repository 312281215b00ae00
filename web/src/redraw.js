// SPDX-License-Identifier: LGPL-2.1-or-later
// Redraws the latest picture for the view that the user has already requested, until the picture of this view arrives.
// A movement is therefore visible without waiting for the server. The server sends the surface that each picture shows
// (surface.js), and prediction.js knows the requested view. Without a server, the user can look around in the last
// picture.
//
// While the picture shows the requested view, the <video> itself is visible and nothing is drawn.

import { kRest, Margin } from './margin.js';
import { contextOf, Painter } from './painter.js';
import { Prediction } from './prediction.js';
import { decodeSurface, displacement } from './surface.js';
import { cameraOf, kFields } from './view.js';

const kKept = 64;       // maximum number of pictures with surfaces that are not displayed yet
const kSame = 0.05;     // pixels; the picture counts as the picture of the requested view
// Maximum movement of points of the picture, in picture widths: for a jump to another view, and for a continued movement.
// Beyond, the video is shown. Without a server, the picture fades out between the two distances.
const kReach = 0.4, kContinuedReach = 1;
const kStalled = 750;   // milliseconds without a picture until the stream counts as stalled
const kBlend = 100;     // milliseconds until a wrong prediction is corrected
const kFade = 80;       // milliseconds until the redrawn picture has given way to the video
const kLatency = 100;   // milliseconds; assumed before a movement has been measured

const turn = degrees => degrees - 360 * Math.round(degrees / 360);
const difference = (a, b) => Object.fromEntries(
    kFields.map(name => [name, ['yaw', 'roll'].includes(name) ? turn(a[name] - b[name]) : a[name] - b[name]]));

// A surface at infinite distance, for pictures without a surface.
const flatSurface = ({ width, height }) =>
  ({ step: Math.max(width, height), columns: 1, rows: 1, farthest: 0, nearest: 0, levels: new Uint8Array(1) });

export class Redraw {
  constructor(viewer, canvas) {
    this.viewer = viewer;
    this.canvas = canvas;
    this.prediction = new Prediction();
    this.margin = new Margin();
    this.drawn = 0;   // pictures that were redrawn, for statistics
    this.frames = 0;  // pictures that were displayed
    canvas.addEventListener('webglcontextlost', event => {
      event.preventDefault();
      this.isLost = true;
      this.painter = null;
      this.hide();
    });
    canvas.addEventListener('webglcontextrestored', () => this.isLost = false);
    this.begin();
  }
  // Forgets the previous connection. The redrawn picture stays until the first picture of the new connection.
  begin() {
    this.prediction.forget();
    this.margin.forget();
    this.requestedMargin = 0;
    this.surfaces = new Map();  // by RTP timestamp: a surface for each eye
    this.latest = [];
    this.pictures = null;       // for each eye, the picture on the screen: { surface, camera }
    this.corrections = [];
    this.fadeBegan = null;
    if (!this.painted) this.hide();
  }

  // Takes a message of the data channel "surface".
  take(message) {
    if (this.isImpossible && !this.viewer.headset) return;
    let surface;
    try {
      surface = decodeSurface(message);
    } catch (error) {
      return console.warn(`lightfield-viewer: ${error.message}`);
    }
    const { surfaces } = this, { timestamp, eye } = surface, all = surfaces.get(timestamp) ?? [];
    all[eye] = this.latest[eye] = surface;
    surfaces.set(timestamp, all);
    if (surfaces.size > kKept) surfaces.delete(surfaces.keys().next().value);
    if (this.pictures && this.timestamp === timestamp) this.pictures[eye] = { surface, camera: surface.camera };
    this.wake();
  }

  get size() { return { width: this.viewer.picture.eyeWidth || 1, height: this.viewer.video.videoHeight || 1 }; }
  sent({ id, request }) {
    const { now } = this.prediction;
    this.prediction.sent(id, request, this.size, this.viewer.flight.home);
    this.moved(now, request);
  }
  // Moves the view on the page, because there is no server.
  look(request) {
    const { prediction, viewer: { flight } } = this;
    if (!prediction.now || !this.viewer.isInteractive) return;
    prediction.look(request, this.size, flight.home);
    flight.state = { ...flight.state, ...prediction.now };
    this.wake();
  }
  moved(before, request) {
    const { now } = this.prediction, { width, height } = this.size, nearest = this.latest[0]?.nearest;
    if (before && now && nearest && !('margin' in (request.structure ?? {}))) {
      const pixels = displacement(cameraOf(before, width, height), cameraOf(now, width, height), nearest);
      this.margin.moved(performance.now(), pixels / width);
    }
    this.wake();
    this.requestMargin();
  }
  // Requests the margin for the speed of the view, and checks it again later.
  requestMargin() {
    const { viewer: { flight, headset, panel, stream } } = this, crops = headset ? headset.painter : this.isPossible && this.painter;
    const margin = crops && flight.hasMargins ? this.margin.at(performance.now(), panel.latency ?? kLatency) : 0;
    clearTimeout(this.timer);
    if (margin) this.timer = setTimeout(() => this.requestMargin(), kRest / 2);
    if (margin === this.requestedMargin || !stream.isOpen) return;
    this.requestedMargin = margin;
    flight.sendView({ margin }, stream.connection.by);
  }

  answered(id, error) { this.prediction.answer(id, error); }
  // A view of the server. If the prediction was wrong, the redrawn picture does not jump, but approaches the view.
  confirm({ margin, ...view }, id) {
    const before = this.painted && this.prediction.now;
    this.prediction.confirm(view, id);
    const fields = before && difference(before, this.prediction.now);
    if (fields && kFields.some(name => Math.abs(fields[name]) > 1e-9))
      this.corrections.push({ fields, began: performance.now() });
    this.wake();
  }
  // Returns the view to draw, or null.
  target() {
    const { prediction: { now } } = this, time = performance.now();
    this.corrections = this.corrections.filter(({ began }) => time < began + kBlend);
    if (!now || !this.corrections.length) return now;
    const view = { ...now };
    for (const { fields, began } of this.corrections)
      for (const name of kFields) view[name] += (1 - (time - began) / kBlend) * fields[name];
    return view;
  }

  // A new picture is on the screen.
  show(rtpTimestamp) {
    const { flight: { seen, margin }, twoEyes, eyeDistance, headset } = this.viewer, { width, height } = this.size;
    if (this.painted && !this.pictures) this.hide();
    const surfaces = this.surfaces.get(rtpTimestamp) ?? [], distance = headset?.viewParams?.['eye-distance'] ?? eyeDistance;
    const pictures = (twoEyes ? [-0.5, 0.5] : [0]).map((side, eye) => {
      if (surfaces[eye]) return { surface: surfaces[eye], camera: surfaces[eye].camera };
      if (!seen || !(this.latest[eye] || headset)) return null;
      const camera = cameraOf(seen, width, height, margin), { position, axes: { right } } = camera;
      camera.position = position.map((at, k) => at + side * distance * right[k]);
      return { surface: this.latest[eye] ?? flatSurface(camera), camera };
    });
    this.pictures = pictures.every(Boolean) ? pictures : null;
    this.timestamp = rtpTimestamp;
    this.shownTime = performance.now();
    this.frames++;
    this.viewer.picture.crop();
    if (this.painted) this.load();
    this.wake();
  }
  get picture() { return this.pictures?.[0] ?? null; }

  get isPossible() {
    const { viewer } = this;
    return viewer.mode === 'one' && viewer.isInteractive && viewer.cameras.canvas.hidden &&
      !this.isLost && !this.isImpossible;
  }
  get isStalled() { return !this.viewer.stream.isOpen || performance.now() > this.shownTime + kStalled; }
  // Reads the picture on the screen. Returns false if that is impossible.
  load() {
    if (!this.pictures || !this.isPossible) return false;
    try {
      this.painter ??= new Painter(contextOf(this.canvas));
    } catch (error) {
      console.info(`lightfield-viewer: pictures are not redrawn: ${error.message}`);
      this.isImpossible = true;
      this.hide();
      return false;
    }
    this.painter.load(this.viewer.video, this.frames);
    return true;
  }
  // Returns the camera to draw. Returns null if the video shows the requested view, or if the view is too far away.
  wanted() {
    const view = this.picture && this.isPossible && this.target();
    if (!view) return null;
    const { surface, camera: from } = this.picture, camera = cameraOf(view, from.width, from.height);
    const pixels = displacement(from, camera, surface.nearest);
    this.away = pixels / from.width;
    if (pixels < kSame) return null;
    return this.away < (this.painted ? kContinuedReach : kReach) || this.isStalled ? camera : null;
  }

  wake() {
    if (this.frame || (!this.painted && !this.wanted())) return;
    this.frame = requestAnimationFrame(now => {
      this.frame = null;
      this.paint(now);
      // Otherwise, nothing changes until the next message, input or picture.
      if (this.fadeBegan || (this.painted && this.corrections.length)) this.wake();
    });
  }
  paint(now) {
    const camera = this.wanted();
    if (!camera) return this.picture ? this.fade(now) : null;
    if (!this.load()) return;
    const { surface, camera: from } = this.picture, { width, height } = camera;
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    const beyond = this.isStalled ? (this.away - kReach) / (kContinuedReach - kReach) : 0;
    this.painter.draw(surface, from, camera, { brightness: Math.min(1, Math.max(0, 1 - beyond)) });
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
    this.fadeBegan = null;
    this.corrections = [];
  }
}
