// SPDX-License-Identifier: LGPL-2.1-or-later
// The border of what the cameras see: how it looks, and how it feels.

import { axesOf, dot } from './view.js';

// Where the cameras see no farther the picture fades away, instead of ending at an edge. On which sides, and how far in, the
// picture itself says, while the server says that something is missing or the view moves.

const kEvery = 60;       // milliseconds
const kResting = 500;    // milliseconds, of a view that does not move
const kWhole = 0.998;    // of the picture: so much is covered where nothing is missing
const kMoving = 1200;    // milliseconds after the view has moved until the server's word on it is sure to be there
const kSides = 128;      // pixels a side of what is looked at
const kDark = 10;        // of 255: nothing is there
const kDarkShare = 0.3;  // of a row that may be dark where something is there
const kFade = 15;        // percent of the element, as in the style

export class Vignette {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;
    this.forget();
  }
  forget() {
    this.missing = false;
    this.next = this.moved = 0;
  }

  know(coverage) {
    if (coverage !== undefined) this.missing = coverage < kWhole;
  }

  // With every frame.
  draw(now) {
    const { seen } = this.viewer.flight;
    if (seen !== this.seen) this.moved = now;
    this.seen = seen;
    const moves = now < this.moved + kMoving, looks = this.missing || moves;
    if (now < this.next || (!looks && !this.shown)) return;
    this.next = now + (moves ? kEvery : kResting);
    this.show(looks && this.viewer.mode !== 'side' ? this.look() : [0, 0, 0, 0]);
  }

  // How far in each side is dark: left, right, top, bottom, as shares of the picture.
  look() {
    this.canvas ??= Object.assign(document.createElement('canvas'), { width: kSides, height: kSides });
    const context = this.canvas.getContext('2d', { willReadFrequently: true }), { video, picture } = this.viewer;
    context.imageSmoothingEnabled = false;  // what is dark stays dark
    context.drawImage(video, 0, 0, picture.eyeWidth, video.videoHeight, 0, 0, kSides, kSides);
    const { data } = context.getImageData(0, 0, kSides, kSides), columns = Array(kSides).fill(0), rows = Array(kSides).fill(0);
    for (let i = 0; i < kSides * kSides; i++) {
      if (Math.max(data[4 * i], data[4 * i + 1], data[4 * i + 2]) >= kDark) continue;
      columns[i % kSides]++;
      rows[Math.floor(i / kSides)]++;
    }
    const depth = counts => {
      const at = counts.findIndex(count => count <= kDarkShare * kSides);
      return at < 0 ? 0 : (at + (at > 0)) / kSides;  // all dark: a dark scene
    };
    return [depth(columns), depth(columns.toReversed()), depth(rows), depth(rows.toReversed())];
  }
  show(depths) {
    this.shown = depths.some(depth => depth > 0);
    const { box, eyeWidth } = this.viewer.picture, { clientWidth, clientHeight } = this.viewer.video;
    if (!eyeWidth) return;
    ['left', 'right', 'top', 'bottom'].forEach((side, i) => {
      const [from, along, whole] = i < 2 ? [box.x, box.width, clientWidth] : [box.y, box.height, clientHeight];
      const inside = depths[i] > 0 ? 100 * (from + depths[i] * along) / whole : -kFade;
      this.box.style.setProperty(`--${side}`, `${inside.toFixed(1)}%`);
    });
  }
}

// Where the view can't go on, because the cameras see no farther, the picture gives way a little under the pointer and
// springs back when it is let go: so one feels the border instead of wondering about a view that stands still.
//
// How far the eye should have gone is known from the drag, how far it went from the server's word on each movement.

const kOrbitPerHeight = 0.25;  // radians, as lib/view/navigator.h has it
const kGives = 0.04;           // of the picture's height, that it gives way
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
      return Math.sign(value) * kGives * pull / (pull + kFirm);
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
