// SPDX-License-Identifier: LGPL-2.1-or-later
// Where the cameras see no farther the picture fades away, instead of ending at an edge. On which sides, and how far in, the
// picture itself says, while the server says that something is missing or the view moves.

const kEvery = 60;    // milliseconds
const kResting = 500; // milliseconds, of a view that does not move
const kWhole = 0.998; // of the picture: so much is covered where nothing is missing
const kMoving = 1200; // milliseconds after the view has moved until the server's word on it is sure to be there
const kSides = 128;   // pixels a side of what is looked at
const kDark = 10;     // of 255: nothing is there
const kMost = 0.3;    // of a row that may be dark where something is there
const kFade = 15;     // percent of the element, as in the style

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
      const at = counts.findIndex(count => count <= kMost * kSides);
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
