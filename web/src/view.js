// SPDX-License-Identifier: LGPL-2.1-or-later
// Fields of a view as used in links, attributes, server messages and scripts, and the geometry of a view.

export const kFields = ['x', 'y', 'z', 'yaw', 'pitch', 'roll', 'fov', 'focus-distance'];
export const kMaxFov = 170;  // degrees
const kScriptNames = { 'focus-distance': 'focusDistance' };

// Converts "x=0.1&yaw=5" or "x=0.1 yaw=5" to {x: 0.1, yaw: 5}, and ignores everything else.
export function viewOf(text) {
  const view = {};
  for (const [, name, value] of (text ?? '').matchAll(/([a-z-]+)=([^\s&;,]+)/g))
    if (kFields.includes(name) && Number.isFinite(Number(value))) view[name] = Number(value);
  return view;
}

// Convert to and from the field names that scripts use. Throws TypeError for an unknown name or an invalid number.
export function toScript(view) {
  return Object.fromEntries(kFields.filter(name => name in view).map(name => [kScriptNames[name] ?? name, view[name]]));
}
export function fromScript(view) {
  const fields = {};
  for (const [name, value] of Object.entries(view ?? {})) {
    const field = kFields.find(known => name === known || name === kScriptNames[known]);
    if (!field || !Number.isFinite(value)) throw new TypeError(`${name}: ${value} is not a valid field of a view`);
    fields[field] = value;
  }
  return fields;
}

export function numberIn(text, least = -Infinity) {
  const value = text?.trim() ? Number(text) : NaN;
  return Number.isFinite(value) && value >= least ? value : null;
}

// Returns the axes of the view in the world: yaw about y (down), then pitch about x (right), then roll about z
// (forward).
export function axesOf({ yaw, pitch, roll }) {
  const turn = degrees => [Math.cos(degrees * Math.PI / 180), Math.sin(degrees * Math.PI / 180)];
  const [[cy, sy], [cp, sp], [cr, sr]] = [turn(yaw), turn(pitch), turn(roll)];
  return {
    right: [cy * cr + sy * sp * sr, cp * sr, -sy * cr + cy * sp * sr],
    down: [-cy * sr + sy * sp * cr, cp * cr, sy * sr + cy * sp * cr],
    forward: [sy * cp, -sp, cy * cp],
  };
}

// Returns the angles of these axes, in degrees: the inverse of axesOf().
export function anglesOf({ right, down, forward }) {
  const degrees = 180 / Math.PI;
  return {
    yaw: Math.atan2(forward[0], forward[2]) * degrees,
    pitch: Math.asin(Math.max(-1, Math.min(1, -forward[1]))) * degrees,
    roll: Math.atan2(right[1], down[1]) * degrees
  };
}

// Returns the axes of a camera that a unit quaternion rotates.
export function axesOfQuaternion(w, x, y, z) {
  return {
    right: [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    down: [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    forward: [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  };
}

// Returns the camera of a view with the size of a picture. A picture with a margin shows more than the view.
export function cameraOf(view, width, height, margin = 0) {
  const half = Math.min((1 + margin) * Math.tan(view.fov * Math.PI / 360), Math.tan(kMaxFov * Math.PI / 360));
  const fx = height / 2 / half;
  return { position: [view.x, view.y, view.z], axes: axesOf(view), width, height, fx, fy: fx, cx: (width - 1) / 2, cy: (height - 1) / 2 };
}

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// Converts a world point to the axes of the view. The eye is `eyeOffset` metres to the right of the view.
export function inView(view, axes, point, eyeOffset = 0) {
  const relative = [point[0] - view.x, point[1] - view.y, point[2] - view.z];
  return [dot(axes.right, relative) - eyeOffset, dot(axes.down, relative), dot(axes.forward, relative)];
}

const kShown = 2000;  // milliseconds

// The view in the address of the page, for elements with the attribute `share`: #x=0.05&yaw=3&focus-distance=2,
// optionally with eyes=, path= and token=.
export class Share {
  constructor(viewer, button) {
    this.viewer = viewer;
    this.button = button;
    button.addEventListener('click', () => this.share());
    this.changed = () => this.take();
  }

  get on() { return this.viewer.host.hasAttribute('share'); }
  get words() { return new URLSearchParams(this.on ? location.hash.slice(1) : ''); }
  get view() { return this.on ? viewOf(location.hash.slice(1)) : {}; }

  watch() {
    addEventListener('hashchange', this.changed);
    this.button.hidden = !this.on;
  }
  rest() { removeEventListener('hashchange', this.changed); }

  take() {
    if (!this.on) return;
    this.viewer.settle();
    this.viewer.flight.setView(this.view).catch(() => {});
  }

  // The address of the page with the view. Elements with `share` keep other parameters of the address, such as the
  // token.
  get link() {
    const { viewer } = this, words = this.words;
    for (const [name, value] of Object.entries(viewer.flight.state ?? viewer.flight.set)) words.set(name, +value.toPrecision(7));
    words.delete('eyes');
    if (viewer.mode !== 'one' && viewer.mode !== 'headset') words.set('eyes', viewer.mode);
    return new URL(`#${words}`, location.href).href;
  }

  // Returns the link, and copies it to the clipboard if the browser allows that. Changes the address of the page only
  // with `share`.
  async share() {
    const { link, button, on } = this;
    if (on) history.replaceState(history.state, '', link);
    const copied = await navigator.clipboard?.writeText(link).then(() => true, () => false);
    if (copied || on) {
      button.lastChild.data = copied ? 'Copied' : 'In the address bar';
      this.viewer.say(`The link to this view is ${copied ? 'copied' : 'in the address bar'}`);
      setTimeout(() => button.lastChild.data = 'Share', kShown);
    }
    return link;
  }
}
