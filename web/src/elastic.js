// SPDX-License-Identifier: LGPL-2.1-or-later
// Where the view can't go on, because the cameras see no farther, the picture gives way a little under the pointer and
// springs back when it is let go: so one feels the border instead of wondering about a view that stands still.
//
// How far the eye should have gone is known from the drag, how far it went from the server's word on each movement.

import { axesOf, dot } from './view.js';

const kOrbitPerHeight = 0.25;  // radians, as lib/view/navigator.h has it
const kMost = 0.04;            // of the picture's height, that it gives way
const kFirm = 0.3;             // heights of pulling that bring half of that
const kIdle = 0.02;            // heights that are no pulling yet

export class Elastic {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;  // what gives way
    this.still = matchMedia('(prefers-reduced-motion: reduce)');
    this.end();
  }

  begin(event) {
    this.last = event;
    this.pulls = new Map();  // by message: how far the pointer had come since the one before, heights
    this.missing = [0, 0];   // heights that the view has not gone
    this.before = this.viewer.flight.state;
  }
  pulled(id, event) {
    if (!this.last || !id) return;
    const height = this.viewer.picture.box.height || 1;
    this.pulls.set(id, [(event.clientX - this.last.clientX) / height, (event.clientY - this.last.clientY) / height, event.shiftKey]);
    this.last = event;
  }

  // The view as it is once the message `id` and those before are in it.
  applied(id, view) {
    const { before } = this;
    this.before = view;
    if (!this.pulls?.size || !before) return;
    const pull = [0, 0];
    let pans = false;
    for (const [sent, [x, y, shift]] of this.pulls) {
      if (sent > id) continue;
      [pull[0], pull[1], pans] = [pull[0] + x, pull[1] + y, shift];
      this.pulls.delete(sent);
    }
    const axes = axesOf(before), gone = ['x', 'y', 'z'].map(name => view[name] - before[name]);
    const perHeight = before['focus-distance'] * (pans ? 2 * Math.tan(before.fov * Math.PI / 360) : kOrbitPerHeight);
    // The scene follows the pointer, so that the eye goes against it.
    [axes.right, axes.down].forEach((axis, k) => {
      const left = this.missing[k] + pull[k] + dot(axis, gone) / perHeight;
      // Whoever turns back at a border is no longer pulling at it.
      this.missing[k] = left * pull[k] < 0 && Math.abs(pull[k]) > kIdle ? 0 : left;
    });
    this.show();
  }

  show() {
    const [x, y] = this.missing.map(value => {
      const pull = Math.max(0, Math.abs(value) - kIdle);
      return Math.sign(value) * kMost * pull / (pull + kFirm);
    });
    if (this.still.matches) return;
    const { width, height } = this.viewer.picture.box, { style } = this.box;
    // Larger by what it is moved, so that nothing behind it shows.
    const larger = 1 + 2 * Math.max(Math.abs(x) * height / width, Math.abs(y));
    style.transform = x || y ? `translate(${x * height}px, ${y * height}px) scale(${larger})` : '';
    style.transition = 'none';
  }
  end() {
    this.last = this.pulls = null;
    this.missing = [0, 0];
    Object.assign(this.box.style, { transform: '', transition: '' });
  }
}
