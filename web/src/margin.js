// SPDX-License-Identifier: LGPL-2.1-or-later
// The margin around the requested view. While the view moves, the page requests wider pictures and crops them, so that
// redrawn pictures have no border. At rest there is no margin.

const kWindow = 150;           // milliseconds over which the speed is measured
const kSteps = 3;              // changes of the view within this time that are a movement, not single steps
const kLeastTime = 50;         // milliseconds
export const kRest = 300;      // milliseconds until the margin shrinks
const kStep = 0.1, kMost = 0.5;
const kIgnored = 0.02;         // margins that are smaller than this are not requested

export class Margin {
  constructor() { this.forget(); }
  forget() {
    this.trail = [];  // { time, share } of the latest changes of the view
    this.value = this.until = 0;
  }
  // The view has moved by a share of the picture's width.
  moved(time, share) { this.trail.push({ time, share }); }
  // Returns the margin that hides the border while the picture of a movement is on its way, for `latency` milliseconds:
  // the requested picture is 1 + margin times as wide and as high as the view.
  at(time, latency) {
    const trail = this.trail = this.trail.filter(entry => entry.time > time - kWindow);
    const way = trail.length < kSteps ? 0 : trail.reduce((sum, { share }) => sum + share, 0);
    const needed = 2 * way / Math.max(kLeastTime, time - (trail[0]?.time ?? 0)) * latency;
    const margin = needed < kIgnored ? 0 : Math.min(kMost, kStep * Math.ceil(needed / kStep));
    if (margin >= this.value) this.until = time + kRest;
    if (margin > this.value || time >= this.until) this.value = margin;
    return this.value;
  }
}
