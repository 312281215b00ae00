// SPDX-License-Identifier: LGPL-2.1-or-later
// Turning a phone orbits the point in focus, as if the phone were a window to the scene. The user switches this on.

import { kOrbitPerHeight, orbited } from './prediction.js';
import { axesOf, kFields } from './view.js';

const kMost = 12 * Math.PI / 180;  // maximum angle to the start, radians; a phone that turns farther turns the start

const isPossible = () =>
  isSecureContext && 'DeviceOrientationEvent' in globalThis && matchMedia('(pointer: coarse)').matches;

// Returns the orientation of the phone as a quaternion [w, x, y, z]: about z by alpha, then about x by beta, then about y
// by gamma. Its screen has x to the right, y up, and z towards the user.
function orientationOf({ alpha, beta, gamma }) {
  const [[cz, sz], [cx, sx], [cy, sy]] =
    [alpha, beta, gamma].map(degrees => [Math.cos(degrees * Math.PI / 360), Math.sin(degrees * Math.PI / 360)]);
  return [cx * cy * cz - sx * sy * sz, sx * cy * cz - cx * sy * sz, cx * sy * cz + sx * cy * sz, cx * cy * sz + sx * sy * cz];
}

// Returns the rotation from one orientation to another about the x and y axes of the phone, in radians.
function turnBetween([aw, ax, ay, az], [bw, bx, by, bz]) {
  const w = aw * bw + ax * bx + ay * by + az * bz;
  const v = [aw * bx - ax * bw - ay * bz + az * by, aw * by - ay * bw - az * bx + ax * bz,
    aw * bz - az * bw - ax * by + ay * bx].map(x => w < 0 ? -x : x);
  const sine = Math.hypot(...v), scale = sine > 1e-9 ? 2 * Math.atan2(sine, Math.abs(w)) / sine : 2;
  return [v[0] * scale, v[1] * scale];
}

export class Tilt {
  constructor(viewer, button) {
    this.viewer = viewer;
    this.button = button;
    this.turned = event => this.turn(event);
    button.hidden = !isPossible();
    button.addEventListener('click', () => this.on ? this.rest() : this.start());
  }

  get on() { return this.button.getAttribute('aria-pressed') === 'true'; }
  async start() {
    // Safari asks the user.
    const answer = await DeviceOrientationEvent.requestPermission?.().catch(error => error.message) ?? 'granted';
    if (answer !== 'granted') return this.viewer.say('This page may not read the motion sensors');
    this.before = this.total = null;
    this.button.setAttribute('aria-pressed', true);
    addEventListener('deviceorientation', this.turned);
  }
  rest() {
    this.button.setAttribute('aria-pressed', false);
    removeEventListener('deviceorientation', this.turned);
  }

  turn(event) {
    const { viewer } = this, view = viewer.redraw.prediction.now ?? viewer.flight.state;
    if (event.alpha === null || !view || !viewer.controls.flies) return;
    const orientation = orientationOf(event), before = this.before;
    this.before = orientation;
    if (!before) return void (this.total = [0, 0]);
    const [aboutX, aboutY] = turnBetween(before, orientation);
    const screenAngle = (screen.orientation?.angle ?? 0) * Math.PI / 180, [c, s] = [Math.cos(screenAngle), Math.sin(screenAngle)];
    // Angles to the right and upwards on the screen.
    const turns = [-(c * aboutY - s * aboutX), c * aboutX + s * aboutY];
    const total = this.total.map((angle, k) => Math.max(-kMost, Math.min(kMost, angle + turns[k])));
    const [right, up] = total.map((angle, k) => angle - this.total[k]);
    this.total = total;
    if (!right && !up) return;
    const vertical = axesOf(viewer.flight.home ?? view).down;
    const next = orbited(view, right / kOrbitPerHeight, -up / kOrbitPerHeight, vertical);
    viewer.flight.interrupt();
    viewer.flight.sendView(Object.fromEntries(kFields.slice(0, 6).map(name => [name, next[name]])), 'person');
  }
}
