// SPDX-License-Identifier: LGPL-2.1-or-later
// <lightfield-viewer src="https://HOST:PORT/whep" controls autoplay></lightfield-viewer>
//
// One virtual camera of an lf-serve: its picture, and mouse, touch, keys and a slider that fly it. Attributes, properties,
// methods, events, slots, parts: README.md and lightfield-viewer.d.ts.

import { fromScript, numberIn, toScript, viewOf } from './src/view.js';
import { Viewer } from './src/viewer.js';

// Attributes that properties of the same meaning reflect.
const kTexts = { src: 'src', token: 'token', poster: 'poster', alt: 'alt', eyes: 'eyes', path: 'path' };
const kSwitches = { controls: 'controls', autoplay: 'autoplay', shares: 'share' };
const kNumbers = { eyeDistance: 'eye-distance', maxWidth: 'max-width' };
const kOwn = ['view', 'focusDistance', 'iceServers'];

// Nobody else's: neither other scripts nor frameworks meet it by name.
const inside = Symbol('inside');
const isSame = (a, b) => JSON.stringify(a) === JSON.stringify(b);

// Servers that render pages have no elements: there the class is only a name.
export class LightfieldViewer extends (globalThis.HTMLElement ?? class {}) {
  static observedAttributes = [...Object.values(kTexts), ...Object.values(kSwitches), ...Object.values(kNumbers), 'view',
    'focus', 'ice-servers'];
  #declared = {};  // the values that properties were set to, which frameworks set again and again

  constructor() {
    super();
    Object.defineProperty(this, inside, { value: new Viewer(this, this.attachShadow({ mode: 'open' })) });
  }

  connectedCallback() {
    // What was set before there was this class.
    for (const name of [...Object.keys({ ...kTexts, ...kSwitches, ...kNumbers }), ...kOwn]) {
      if (!Object.hasOwn(this, name)) continue;
      const value = this[name];
      delete this[name];
      this[name] = value;
    }
    this[inside].attach();
  }
  disconnectedCallback() { this[inside].detach(); }
  attributeChangedCallback(name, before, now) {
    if (before === now) return;
    const viewer = this[inside];
    if (name === 'view') viewer.declared = null;  // what was declared last counts
    if (name === 'src' || name === 'path') viewer.forgetFlight();
    if (!this.isConnected) return;
    if (name === 'view') return void viewer.flight.setView(viewOf(now)).catch(() => {});
    if (name === 'focus') return void this.#focus(numberIn(now));
    if (name === 'autoplay' && now !== null && !viewer.started) viewer.play();
    if (name === 'controls' || name === 'share') viewer.controls.settle();
    viewer.settleSoon();
  }

  // The view that is seen; null before there is one. Set to what setView() takes or to "x=0.1 yaw=3": to the same again
  // changes nothing, so that a page that is rendered anew does not take away where somebody has flown.
  get view() { return this[inside].flight.seen && toScript(this[inside].flight.seen); }
  set view(value) {
    const view = typeof value === 'string' ? viewOf(value) : fromScript(value);
    if (isSame(view, this.#declared.view)) return;
    this.#declared.view = view;
    this[inside].declared = Object.keys(view).length ? view : null;
    if (Object.keys(view).length) this[inside].flight.setView(view).catch(() => {});
  }
  // Metres to what is sharp. Set to a number, it focuses there, also after somebody has focused elsewhere.
  get focusDistance() { return this.view?.focusDistance ?? numberIn(this.getAttribute('focus')); }
  set focusDistance(value) {
    const isSame = value != null && this.getAttribute('focus') === String(value);
    setText(this, 'focus', value);
    if (isSame && this.isConnected) this.#focus(numberIn(String(value)));
  }
  #focus(metres) {
    if (metres > 0) this[inside].flight.setView({ 'focus-distance': metres }).catch(() => {});
  }
  // As RTCPeerConnection has them.
  get iceServers() { return this[inside].iceServers ?? null; }
  set iceServers(value) {
    if (isSame(value ?? null, this.iceServers)) return;
    this[inside].iceServers = value ?? null;
    if (this.isConnected) this[inside].stream.again();
  }

  get loaded() { return this[inside].loaded ?? false; }
  get connected() { return this[inside].stream.isOpen; }
  get paused() { return !this[inside].started; }
  get statistics() { return this[inside].statistics; }
  // For who looks into it: the RTCPeerConnection `peer` and its data channel `channel`, null without; the element that
  // says what is in the way, hidden where nothing is.
  get connection() { return this[inside].stream.connection ?? null; }
  get status() { return this[inside].notice.box; }

  async setView(view) { return this[inside].flight.setView(fromScript(view)); }
  goHome() { this[inside].flight.goHome(); }
  focusAt(clientX, clientY) { return this[inside].focusAt(clientX, clientY); }
  toBlob({ type = 'image/png', quality } = {}) { return this[inside].picture.toBlob(type, quality); }
  play() { this[inside].play(); }
  pause() { this[inside].pause(); }
  // Lets go of the stream and asks for another one, where it was.
  reconnect() { this[inside].stream.again(); }
  // As the button does: copies a link to the view, where the browser allows that, and returns it.
  share() { return this[inside].share.share(); }
  // Telephones that have it for videos alone get that.
  async requestFullscreen(options) {
    if (super.requestFullscreen && document.fullscreenEnabled) return super.requestFullscreen(options);
    const { video } = this[inside];
    if (!video.webkitEnterFullscreen) throw new TypeError('there is no full screen here');
    video.webkitEnterFullscreen();
  }
}

const define = (names, get, set) => {
  for (const [property, attribute] of Object.entries(names))
    Object.defineProperty(LightfieldViewer.prototype, property, { configurable: true, enumerable: true,
      get() { return get(this, attribute); },
      set(value) { set(this, attribute, value); } });
};
const setText = (element, name, value) => value == null ? element.removeAttribute(name) : element.setAttribute(name, value);
define(kTexts, (element, name) => element.getAttribute(name), setText);
define(kNumbers, (element, name) => numberIn(element.getAttribute(name)), setText);
define(kSwitches, (element, name) => element.hasAttribute(name), (element, name, value) => element.toggleAttribute(name, Boolean(value)));

if (globalThis.customElements && !customElements.get('lightfield-viewer')) customElements.define('lightfield-viewer', LightfieldViewer);
