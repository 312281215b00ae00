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
    this.viewer.flight.setView(this.view);
  }

  // What the address has beside the view, as the token, stays in it.
  get link() {
    const { viewer } = this, words = this.words;
    for (const [name, value] of Object.entries(viewer.flight.state ?? viewer.flight.set)) words.set(name, +value.toPrecision(7));
    words.delete('eyes');
    if (viewer.mode !== 'one' && viewer.mode !== 'headset') words.set('eyes', viewer.mode);
    return new URL(`#${words}`, location.href).href;
  }

  async share() {
    const { link, button } = this;
    history.replaceState(history.state, '', link);
    let done = 'Copied';
    try {
      await navigator.clipboard.writeText(link);
    } catch {
      done = 'In the address bar';
    }
    button.lastChild.data = done;
    this.viewer.say(`The link to this view is ${done === 'Copied' ? 'copied' : 'in the address bar'}`);
    setTimeout(() => button.lastChild.data = 'Share', kShown);
  }
}
