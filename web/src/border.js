// SPDX-License-Identifier: LGPL-2.1-or-later
// Feedback at the border of the cameras' coverage: a vignette, and overscroll.

import { axesOf, dot } from './view.js';

// Fades the picture out where the cameras see nothing more, instead of ending it at a sharp edge. The width of the dark
// margins is measured in the picture itself. This happens only while the server reports missing coverage or the view
// moves.

const kDrawInterval = 60;  // milliseconds
const kStillInterval = 500;    // milliseconds, while the view does not move
const kWhole = 0.998;    // minimum coverage of a complete picture
const kMoving = 1200;    // milliseconds after a movement until the coverage from the server is current
const kSides = 128;      // size of the analysed image, pixels
const kDark = 10;        // darker pixels, of 255, count as empty
const kDarkShare = 0.3;  // maximum fraction of empty pixels in a row or column of the picture
const kFade = 15;

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

  draw(now) {
    const { seen } = this.viewer.flight;
    if (seen !== this.seen) this.moved = now;
    this.seen = seen;
    const moves = now < this.moved + kMoving, looks = this.missing || moves;
    if (now < this.next || (!looks && !this.shown)) return;
    this.next = now + (moves ? kDrawInterval : kStillInterval);
    this.show(looks && this.viewer.mode !== 'side' ? this.look() : [0, 0, 0, 0]);
  }

  // Returns the widths of the dark margins (left, right, top, bottom) as fractions of the picture.
  look() {
    this.canvas ??= Object.assign(document.createElement('canvas'), { width: kSides, height: kSides });
    const context = this.canvas.getContext('2d', { willReadFrequently: true }), { video, picture } = this.viewer;
    context.imageSmoothingEnabled = false;
    context.drawImage(video, ...picture.shown(picture.eyeWidth, video.videoHeight), 0, 0, kSides, kSides);
    const { data } = context.getImageData(0, 0, kSides, kSides), columns = Array(kSides).fill(0), rows = Array(kSides).fill(0);
    for (let i = 0; i < kSides * kSides; i++) {
      if (Math.max(data[4 * i], data[4 * i + 1], data[4 * i + 2]) >= kDark) continue;
      columns[i % kSides]++;
      rows[Math.floor(i / kSides)]++;
    }
    const depth = counts => {
      const at = counts.findIndex(count => count <= kDarkShare * kSides);
      return at < 0 ? 0 : (at + (at > 0)) / kSides;
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

// Overscroll: if the view cannot move further because the coverage ends, the picture yields a little to the pointer and
// springs back on release. The element compares the movement that the drag requests with the movement of the views that
// the server reports.

const kOrbitPerHeight = 0.25;  // radians, as in lib/view/navigator.h
const kMaxOverscroll = 0.04;           // maximum displacement, as a fraction of the picture's height
const kOverscrollStiffness = 0.3;             // pull that gives half of the maximum displacement, picture heights
const kIdle = 0.02;

export class Overscroll {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;
    this.still = matchMedia('(prefers-reduced-motion: reduce)');
    this.end();
  }

  begin(event) {
    this.last = event;
    this.pulls = new Map();  // by message id: movement of the pointer since the previous message, picture heights
    this.missing = [0, 0];  // movement that the view did not follow, picture heights
    this.before = this.viewer.flight.state;
  }
  pulled(id, event) {
    if (!this.last || !id) return;
    const height = this.viewer.picture.box.height || 1;
    this.pulls.set(id, [(event.clientX - this.last.clientX) / height, (event.clientY - this.last.clientY) / height, event.shiftKey]);
    this.last = event;
  }

  // `view` is the view after all messages up to `id`.
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
    // The scene follows the pointer, so the eye moves in the opposite direction.
    [axes.right, axes.down].forEach((axis, k) => {
      const left = this.missing[k] + pull[k] + dot(axis, gone) / perHeight;
      // A movement back from the border ends the pull.
      this.missing[k] = left * pull[k] < 0 && Math.abs(pull[k]) > kIdle ? 0 : left;
    });
    this.show();
  }

  show() {
    const [x, y] = this.missing.map(value => {
      const pull = Math.max(0, Math.abs(value) - kIdle);
      return Math.sign(value) * kMaxOverscroll * pull / (pull + kOverscrollStiffness);
    });
    if (this.still.matches) return;
    const { width, height } = this.viewer.picture.box, { style } = this.box;
    // The picture is enlarged by the displacement, so that no background shows.
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
