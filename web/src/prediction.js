// SPDX-License-Identifier: LGPL-2.1-or-later
// Predicts the view of the server's virtual camera after messages that the server has not confirmed yet. The movements
// are those of lib/view/navigator.h. The limits of the view, which depend on the cameras, are not predicted.

import { anglesOf, axesOf, dot, kMaxFov } from './view.js';

export const kOrbitPerHeight = 0.25;  // radians
const kFocusStep = 1.1, kZoomStep = 1.05, kFlyStep = 0.01, kKeyOrbit = 1 / 20;
const kMinFov = 1;                 // degrees
const kLevel = 0.01;               // sine of the smallest angle to the vertical with a horizon
const kMaxPending = 2048;          // 17 s of messages at 120 Hz
const kFlyKeys = {
  w: [0, 0, 1],
  s: [0, 0, -1],
  a: [-1, 0, 0],
  d: [1, 0, 0],
  q: [0, 1, 0],
  e: [0, -1, 0]
};
const kOrbitKeys = {
  Left: [-kKeyOrbit, 0],
  Right: [kKeyOrbit, 0],
  Up: [0, -kKeyOrbit],
  Down: [0, kKeyOrbit]
};
const kStepKeys = {
  plus: ['zoom', 1],
  minus: ['zoom', -1],
  bracketleft: ['focus', -1],
  bracketright: ['focus', 1]
};

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = v => v.map(x => x / Math.hypot(...v));
const add = (a, b, share = 1) => a.map((x, k) => x + share * b[k]);

// Rotates a vector about a unit axis, by an angle in radians.
function rotated(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)], across = cross(axis, v), along = dot(axis, v) * (1 - c);
  return v.map((x, k) => x * c + across[k] * s + axis[k] * along);
}
const turnedAbout = ({ right, down, forward }, axis, angle) =>
    ({ right: rotated(right, axis, angle), down: rotated(down, axis, angle), forward: rotated(forward, axis, angle) });

const positionOf = view => [view.x, view.y, view.z];
const moved = (view, [x, y, z]) => ({ ...view, x, y, z });

// Returns the axes turned to look along `forward`, with the same horizon.
function turnedTo(axes, forward, vertical) {
  if (Math.hypot(...cross(axes.forward, vertical)) < kLevel || Math.hypot(...cross(forward, vertical)) < kLevel)
    return axes;
  const level = ahead => {
    const right = unit(cross(vertical, ahead));
    return { right, down: cross(ahead, right), forward: ahead };
  };
  const before = level(axes.forward), after = level(forward);
  const turn = v =>
      add(add(after.right.map(x => x * dot(before.right, v)), after.down, dot(before.down, v)), after.forward,
          dot(before.forward, v));
  return { right: turn(axes.right), down: turn(axes.down), forward: turn(axes.forward) };
}

export function orbited(view, dx, dy, vertical) {
  const axes = axesOf(view), distance = view['focus-distance'];
  const pivot = add(positionOf(view), axes.forward, distance);
  const turned = turnedAbout(turnedAbout(axes, axes.right, -dy * kOrbitPerHeight), vertical, dx * kOrbitPerHeight);
  return moved({ ...view, ...anglesOf(turned) }, add(pivot, turned.forward, -distance));
}
export function panned(view, dx, dy) {
  const { right, down } = axesOf(view), scale = 2 * view['focus-distance'] * Math.tan(view.fov * Math.PI / 360);
  return moved(view, add(add(positionOf(view), right, -scale * dx), down, -scale * dy));
}
export function zoomed(view, steps, [x, y], vertical) {
  const fov = Math.min(kMaxFov, Math.max(kMinFov, view.fov * kZoomStep ** -steps)), axes = axesOf(view);
  const towards = angle => {
    const half = 2 * Math.tan(angle * Math.PI / 360);
    return unit([half * x, half * y, 1]);
  };
  const before = towards(view.fov), after = towards(fov), axis = cross(after, before), sine = Math.hypot(...axis);
  const ahead = sine < 1e-12 ? [0, 0, 1] : rotated([0, 0, 1], unit(axis), Math.atan2(sine, dot(after, before)));
  const forward = add(add(axes.right.map(v => v * ahead[0]), axes.down, ahead[1]), axes.forward, ahead[2]);
  return { ...view, fov, ...anglesOf(turnedTo(axes, unit(forward), vertical)) };
}
export function flown(view, [x, y, z]) {
  const { right, down, forward } = axesOf(view), step = kFlyStep * view['focus-distance'];
  return moved(view, add(add(add(positionOf(view), right, step * x), down, step * y), forward, step * z));
}
const focused = (view, steps) => ({ ...view, 'focus-distance': view['focus-distance'] * kFocusStep ** steps });

export class Prediction {
  constructor() { this.forget(); }
  forget() {
    this.base = null;      // the view that the server has confirmed
    this.dragBase = null;  // the drag at that time: { x, y, pans }
    this.pending = [];     // { id, request, size, home } that are not confirmed yet
    this.now = null;
    this.drag = null;
    this.answered = 0;
  }

  // Notes a message to the server. `size` is the size of the picture; `home` is the home view.
  sent(id, request, size, home) {
    if (!id || !this.base) return;
    this.pending.push({ id, request, size, home });
    if (this.pending.length > kMaxPending) return this.forget();
    this.apply(this.pending.at(-1));
  }
  // The view moves without a server.
  look(request, size, home) {
    if (!this.now) return;
    this.apply({ request, size, home });
    [this.base, this.dragBase, this.pending] = [this.now, this.drag, []];
  }
  // The server has answered a message, so later views contain its effect.
  answer(id, error) {
    if (error)
      this.drop(entry => entry.id === id);
    else
      this.answered = Math.max(this.answered, id);
  }
  // The server reports its view. `id` is the last message in the view, or undefined for the report of each second.
  confirm(view, id) {
    const last = id ?? this.answered;
    for (const entry of this.pending)
      if (entry.id <= last) this.dragBase = dragAfter(this.dragBase, entry.request.event);
    this.pending = this.pending.filter(entry => entry.id > last);
    this.base = view;
    this.predict();
  }
  drop(which) {
    this.pending = this.pending.filter(entry => !which(entry));
    this.predict();
  }
  get isConfirmed() { return this.pending.length === 0; }

  predict() {
    this.now = this.base;
    this.drag = this.dragBase;
    for (const entry of this.pending) this.apply(entry);
  }
  apply({ request: { type, event, structureName, structure }, size, home }) {
    if (type === 'navigationEvent') {
      this.now = this.after(event, size, home ?? this.now);
      this.drag = dragAfter(this.drag, event);
    } else if (structureName === 'lightfield-view-request') {
      const { 'focus-continuous': follows, margin, ...fields } = structure;
      this.now = { ...this.now, ...fields };
    }
  }
  after(event, { width, height }, home) {
    const { now, drag } = this, vertical = axesOf(home).down, modifiers = event.modifier_state ?? '';
    if (event.event === 'MouseMove' && drag) {
      const dx = (event.x - drag.x) / height, dy = (event.y - drag.y) / height;
      return drag.pans || modifiers.includes('shift') ? panned(now, dx, dy) : orbited(now, dx, dy, vertical);
    }
    if (event.event === 'MouseScroll') {
      const place = [(event.x + 0.5 - width / 2) / height, (event.y + 0.5 - height / 2) / height];
      const inside = Math.abs(place[0]) <= width / height / 2 && Math.abs(place[1]) <= 0.5;
      return modifiers.includes('control') ? focused(now, event.delta_y) :
                                             zoomed(now, event.delta_y, inside ? place : [0, 0], vertical);
    }
    if (event.event !== 'KeyPress') return now;
    const { key } = event;
    if (kOrbitKeys[key]) return orbited(now, ...kOrbitKeys[key], vertical);
    if (kFlyKeys[key]) return flown(now, kFlyKeys[key]);
    if (kStepKeys[key]?.[0] === 'zoom') return zoomed(now, kStepKeys[key][1], [0, 0], vertical);
    if (kStepKeys[key]) return focused(now, kStepKeys[key][1]);
    return key === 'r' ? home : now;
  }
}

function dragAfter(drag, event) {
  if (event?.event === 'MouseButtonPress' && event.button <= 3)
    return { x: event.x, y: event.y, pans: event.button !== 1 };
  if (event?.event === 'MouseButtonRelease') return null;
  return event?.event === 'MouseMove' && drag ? { ...drag, x: event.x, y: event.y } : drag;
}
