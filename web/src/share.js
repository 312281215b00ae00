// SPDX-License-Identifier: LGPL-2.1-or-later
// The view in the page's address, for elements with the attribute `share` alone: #x=0.05&yaw=3&focus-distance=2, with
// eyes=, path= and token= where there are any.

import { viewOf } from './view.js';

const kShown = 2000;  // milliseconds

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

  // Another link in an open tab.
  take() {
    if (!this.on) return;
    this.viewer.settle();
    this.viewer.flight.setView(this.view).catch(() => {});
  }

  // The page's address with the view. An element with `share` keeps the other words of the address, such as the token.
  get link() {
    const { viewer } = this, words = this.words;
    for (const [name, value] of Object.entries(viewer.flight.state ?? viewer.flight.set)) words.set(name, +value.toPrecision(7));
    words.delete('eyes');
    if (viewer.mode !== 'one' && viewer.mode !== 'headset') words.set('eyes', viewer.mode);
    return new URL(`#${words}`, location.href).href;
  }

  // Copies the link, where the browser allows that, and returns it. The page's address changes only with `share`.
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
