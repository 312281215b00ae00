// SPDX-License-Identifier: LGPL-2.1-or-later
// <lightfield-viewer src="https://HOST:PORT/whep" controls autoplay></lightfield-viewer>
//
// A virtual camera of an lf-serve: its picture, and controls for mouse, touch, keyboard and a focus slider. README.md
// and lightfield-viewer.d.ts document attributes, properties, methods, events, slots and parts.

import { fromScript, numberIn, toScript, viewOf } from './src/view.js';
import { Viewer } from './src/viewer.js';

const kTexts = { src: 'src', token: 'token', poster: 'poster', alt: 'alt', eyes: 'eyes', path: 'path' };
const kSwitches = { controls: 'controls', autoplay: 'autoplay', shares: 'share' };
const kNumbers = { eyeDistance: 'eye-distance', maxWidth: 'max-width' };
const kOwn = ['view', 'focusDistance', 'iceServers'];

// A private field, so that other scripts and frameworks cannot access it by name.
const inside = Symbol('inside');
const isSame = (a, b) => JSON.stringify(a) === JSON.stringify(b);

// There is no HTMLElement in server-side rendering, where the class only provides its name.
export class LightfieldViewer extends (globalThis.HTMLElement ?? class {}) {
  static observedAttributes = [...Object.values(kTexts), ...Object.values(kSwitches), ...Object.values(kNumbers), 'view',
    'focus', 'ice-servers'];
  #declared = {};  // latest values of properties, because frameworks set the same value repeatedly

  constructor() {
    super();
    Object.defineProperty(this, inside, { value: new Viewer(this, this.attachShadow({ mode: 'open' })) });
  }

  connectedCallback() {
    // Applies properties that were set before the class was defined.
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
    if (name === 'view') viewer.declared = null;
    if (name === 'src' || name === 'path') viewer.resetNavigation();
    if (!this.isConnected) return;
    if (name === 'view') return void viewer.flight.setView(viewOf(now)).catch(() => {});
    if (name === 'focus') return void this.#focus(numberIn(now));
    if (name === 'autoplay' && now !== null && !viewer.started) viewer.play();
    if (name === 'controls' || name === 'share') viewer.controls.settle();
    viewer.scheduleSettle();
  }

  // The displayed view, or null before the first picture. Accepts the values of setView(), or a text such as "x=0.1
  // yaw=3". Setting the same value again changes nothing, so that re-rendering a page does not reset the user's view.
  get view() { return this[inside].flight.seen && toScript(this[inside].flight.seen); }
  set view(value) {
    const view = typeof value === 'string' ? viewOf(value) : fromScript(value);
    if (isSame(view, this.#declared.view)) return;
    this.#declared.view = view;
    this[inside].declared = Object.keys(view).length ? view : null;
    if (Object.keys(view).length) this[inside].flight.setView(view).catch(() => {});
  }
  // Focus distance in metres. Setting a number always focuses there, even if the number is unchanged.
  get focusDistance() { return this.view?.focusDistance ?? numberIn(this.getAttribute('focus')); }
  set focusDistance(value) {
    const isSame = value != null && this.getAttribute('focus') === String(value);
    setText(this, 'focus', value);
    if (isSame && this.isConnected) this.#focus(numberIn(String(value)));
  }
  #focus(metres) {
    if (metres > 0) this[inside].flight.setView({ 'focus-distance': metres }).catch(() => {});
  }
  get iceServers() { return this[inside].iceServers ?? null; }
  set iceServers(value) {
    if (isSame(value ?? null, this.iceServers)) return;
    this[inside].iceServers = value ?? null;
    if (this.isConnected) this[inside].stream.again();
  }

  get loaded() { return this[inside].loaded ?? false; }
  get connected() { return this[inside].stream.isOpen; }
  get fallback() { return this[inside].stream.sharedPath; }
  get interactive() { return this[inside].isInteractive; }
  get paused() { return !this[inside].started; }
  get statistics() { return this[inside].statistics; }
  // For inspection by tests and tools: the RTCPeerConnection `peer` and its data channel `channel`, each null without a
  // connection, and the element with the status message, which is hidden if there is none.
  get connection() { return this[inside].stream.connection ?? null; }
  get status() { return this[inside].notice.box; }

  async setView(view) { return this[inside].flight.setView(fromScript(view)); }
  goHome() { this[inside].flight.goHome(); }
  focusAt(clientX, clientY) { return this[inside].focusAt(clientX, clientY); }
  toBlob({ type = 'image/png', quality } = {}) { return this[inside].picture.toBlob(type, quality); }
  play() { this[inside].play(); }
  pause() { this[inside].pause(); }
  reconnect() { this[inside].stream.again(); }
  // Returns a link to the displayed view, and copies it to the clipboard if the browser allows that, like the share
  // button.
  share() { return this[inside].share.share(); }
  // Some phones support full screen for videos only.
  async requestFullscreen(options) {
    if (super.requestFullscreen && document.fullscreenEnabled) return super.requestFullscreen(options);
    const { video } = this[inside];
    if (!video.webkitEnterFullscreen) throw new TypeError('full screen is not available');
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
