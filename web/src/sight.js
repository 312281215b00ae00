// SPDX-License-Identifier: LGPL-2.1-or-later
// Whether anybody can see the element: it is on the screen, or nearly, in a tab that is not hidden.

const kNear = '200px';  // of the screen's border
const kLeave = 500;     // milliseconds out of sight until that is told; coming back is told at once

export class Sight {
  // `changed` is called with true or false.
  constructor(element, changed) {
    this.element = element;
    this.changed = changed;
    this.near = false;
    this.look = () => {
      clearTimeout(this.timer);
      if (this.near && !document.hidden) this.changed(true);
      else this.timer = setTimeout(() => this.changed(false), kLeave);
    };
  }
  watch() {
    this.observer = new IntersectionObserver(entries => {
      this.near = entries.at(-1).isIntersecting;
      this.look();
    }, { rootMargin: kNear });
    this.observer.observe(this.element);
    document.addEventListener('visibilitychange', this.look);
  }
  rest() {
    clearTimeout(this.timer);
    this.observer?.disconnect();
    document.removeEventListener('visibilitychange', this.look);
  }
}
