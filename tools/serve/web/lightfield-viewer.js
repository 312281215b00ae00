// SPDX-License-Identifier: LGPL-2.1-or-later
// <lightfield-viewer src="https://HOST:PORT/whep" token="..." width="640" height="480"></lightfield-viewer>
//
// One virtual camera of an lf-serve: its picture, and mouse, touch, keys and a slider that fly it. Without `src` the
// server that this file came from. Without `width` and `height` the view follows the element's size. `eyes` ("one",
// "side", "anaglyph") and `eye-distance` (metres) are for two eyes. With `path`, or #path= in the page's address, the
// server flies a path of its own of that name, and there is nothing to be done but to watch.
// Properties: view (what has been set, as sent to the server), figures (the latest statistics), video.
// Methods: setView({x, y, z, yaw, pitch, roll, fov, "focus-distance"}), connect(), disconnect().
// Events: "connected", "disconnected" (detail: why), "statistics" (detail: figures), "applied" (detail: {id,
// rtpTimestamp}).

import { Bar } from './bar.js';
import { Cameras } from './cameras.js';
import { Connection } from './connection.js';
import { Controls } from './controls.js';
import { Figures, isShown } from './figures.js';
import { Headset, headsets } from './headset.js';
import { markup, sheet } from './markup.js';
import { Monitor } from './monitor.js';
import { Notice } from './notice.js';
import { Anaglyph, kModes } from './stereo.js';
import { kFields, viewOf } from './view.js';

const kEyeDistance = 0.063;  // metres
const kHomeward = 300;  // milliseconds that the way home takes
const kRest = 400;  // milliseconds without another size until the view takes it

export class LightfieldViewer extends HTMLElement {
  constructor() {
    super();
    this.attachShadow({ mode: 'open' }).innerHTML = markup;
    this.shadowRoot.adoptedStyleSheets = [sheet];
    const find = selector => this.shadowRoot.querySelector(selector);
    this.video = find('video');
    this.status = find('.status');
    this.notice = new Notice(this, this.shadowRoot);
    this.bar = new Bar(this, this.shadowRoot);
    this.slider = find('input[type=range]');
    this.distance = find('.distance');
    this.vignette = find('.vignette');
    this.view = {};
    this.state = null;  // of the view, as the server tells it
    this.seen = null;   // that of the picture that is shown
    this.changes = [];  // [RTP timestamp, state] of pictures to come
    this.figures = {};
    this.panel = new Figures(this, find('pre.figures'));
    this.cameras = new Cameras(this, find('canvas.cameras'), find('pre.makers'));
    this.monitor = new Monitor(this, find('.monitor'));
    this.controls = new Controls(this);
    this.slider.addEventListener('input', () => this.focusAt(Number(this.slider.value)));
    find('.sweep').addEventListener('click', event => this.sweep(event.target));
    this.follower = find('.follow');
    this.follower.addEventListener('click', () => this.follow(!this.follows));
    find('.home').addEventListener('click', () => this.goHome());
    find('button.figures').addEventListener('click', () => this.toggle('figures', this.panel));
    find('button.cameras').addEventListener('click', () => this.toggle('cameras', this.cameras));
    find('button.quality').addEventListener('click', () => this.toggle('quality', this.monitor));
    find('.share').addEventListener('click', event => this.share(event.target));
    this.anaglyph = new Anaglyph(find('canvas.anaglyph'), this.video);
    this.choice = find('select');
    this.choice.addEventListener('change', () => this.show(this.choice.value));
    headsets().then(there => this.choice.querySelector('[value=headset]').hidden = !there);
    this.watch();
  }

  connectedCallback() {
    const eyes = this.given('eyes');
    this.mode = Object.hasOwn(kModes, eyes) && eyes !== 'headset' ? eyes : 'one';
    this.showMode();
    this.bar.bar.hidden = this.path !== null;
    this.bar.wake();
    this.resizes = new ResizeObserver(() => this.resized());
    this.resizes.observe(this);
    this.disconnect();
    this.connect();
  }
  disconnectedCallback() {
    this.resizes.disconnect();
    this.notice.rest();
    this.disconnect();
  }

  // A stream keeps its size: one of another size is another stream. Waits until the window rests.
  resized() {
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      const { width, height } = this.size;
      if (!this.asked || !this.connection || (width === this.asked.width && height === this.asked.height)) return;
      if (this.mode !== 'headset' && this.path === null) this.reconnect();
    }, kRest);
  }

  // Where to: the attribute, or the server of this file.
  get endpoint() { return new URL(this.getAttribute('src') ?? new URL('whep', import.meta.url), document.baseURI); }
  // The link's: #token=...&x=... ; it never leaves the browser but as a header.
  get token() { return this.given('token') ?? ''; }
  get path() { return this.given('path'); }
  given(name) { return this.getAttribute(name) ?? new URLSearchParams(location.hash.slice(1)).get(name); }

  // Pixels to ask for: what the element has, in whole multiples of 16; of each eye.
  get size() {
    const box = this.getBoundingClientRect(), scale = Math.min(devicePixelRatio || 1, 2);
    const side = (name, length) =>
      Number(this.getAttribute(name)) || Math.max(64, Math.round(length * scale / 16) * 16);
    return { width: side('width', (box.width || 640) / (this.mode === 'side' ? 2 : 1)),
      height: side('height', box.height || 480) };
  }
  get eyeDistance() { return Number(this.getAttribute('eye-distance')) || kEyeDistance; }
  // What the server is asked for.
  get wish() {
    const path = this.path && { path: this.path };
    if (this.mode === 'one') return { ...this.size, ...path };
    return { ...this.headset?.wish ?? { ...this.size, 'eye-distance': this.eyeDistance }, ...path };
  }

  // One of kModes.
  async show(mode) {
    if (mode === this.mode) return;
    const before = this.mode, headset = this.headset;
    this.mode = mode;
    this.headset = null;
    headset?.stop();
    this.showMode();
    if (mode !== 'headset') return this.reconnect();
    const started = this.headset = new Headset(this, () => this.headset === started && this.show('one'));
    try {
      await started.start();
    } catch (error) {
      this.say(`no headset: ${error.message}`);
      this.headset = null;
      this.mode = before;
      this.showMode();
    }
  }
  showMode() {
    this.choice.value = this.mode;
    this.anaglyph.canvas.hidden = this.mode !== 'anaglyph';
  }
  reconnect() {
    this.disconnect();
    this.connect();
  }

  async connect() {
    const connection = this.connection = new Connection(this.video);
    connection.addEventListener('message', event => this.take(event.detail));
    connection.addEventListener('lost', event => this.lost(connection, event.detail));
    this.notice.connecting();
    this.notice.watch();
    connection.addEventListener('open', () => {
      this.retry = 0;
      // Another connection goes on where the one before was.
      this.sendView(this.state ?? { ...viewOf(location.hash.slice(1)), ...this.view });
      if (this.follows) this.follow(true);
      this.dispatchEvent(new CustomEvent('connected'));
    });
    try {
      this.asked = this.size;
      this.twoEyes = this.mode !== 'one';
      await connection.open(this.endpoint, this.token, this.wish);
    } catch (error) {
      this.lost(connection, error);
    }
  }

  disconnect() {
    clearTimeout(this.timer);
    this.connection?.close();
    this.connection = null;
  }

  // Tries again after a while that grows, unless it is no use.
  lost(connection, error) {
    if (this.connection !== connection) return;
    const useless = error.retryAfter === Infinity;
    this.retry = Math.min((this.retry || 0.5) * 2, 30);
    const seconds = useless ? Infinity : Math.max(this.retry, error.retryAfter || 0);
    this.notice.lost(error, seconds);
    this.disconnect();
    this.dispatchEvent(new CustomEvent('disconnected', { detail: this.notice.why.textContent }));
    if (!useless) this.timer = setTimeout(() => this.connect(), 1000 * seconds);
  }

  take(message) {
    this.notice.answered();
    if (message.type !== 'InfoMessage') return;
    const { statistics, applied, view, pixel } = message.info;
    if (pixel) this.cameras.take(pixel);
    if (statistics) {
      this.figures = statistics;
      this.know(statistics);
      this.panel.update();
      this.dispatchEvent(new CustomEvent('statistics', { detail: statistics }));
    }
    if (view) this.showView(view);
    if (view) this.changes.push([applied?.rtpTimestamp, view]);
    if (applied) {
      this.panel.applied(applied);
      this.dispatchEvent(new CustomEvent('applied', { detail: applied }));
    }
  }

  // What can be seen changes what is shown around the picture.
  know({ coverage, focus, monitored }) {
    this.shadowRoot.querySelector('button.quality').hidden = monitored === false;
    if (focus?.far > focus?.near) this.scene = focus;
    if (coverage === undefined) return;
    this.fullCoverage = Math.max(this.fullCoverage ?? 0, coverage);
    this.vignette.style.opacity = Math.min(1, Math.max(0, 12 * (this.fullCoverage - 0.01 - coverage)));
  }

  // Metres, over which the slider goes: where the scene is and half as far again, or a decade to each side of where the
  // flight began.
  get range() {
    const home = this.home?.['focus-distance'] ?? 1;
    if (!this.scene) return { near: home / 10, far: home * 10 };
    return { near: Math.min(this.scene.near, home) / 1.5, far: Math.max(this.scene.far, home) * 1.5 };
  }
  // What the server says the view is; the slider follows.
  showView(view) {
    this.state = view;
    this.home ??= view;
    const focus = view['focus-distance'], { near, far } = this.range;
    if (this.shadowRoot.activeElement !== this.slider) this.slider.value = Math.log(focus / near) / Math.log(far / near);
    this.distance.textContent = `${focus < 1000 ? focus.toPrecision(3) : 'far'}${focus < 1000 ? ' m' : ''}`;
    this.slider.setAttribute('aria-valuetext', `${focus.toPrecision(3)} metres`);
  }

  // Returns the message's id, which the event "applied" names; 0 if there is no connection or nothing to set.
  setView(view) {
    Object.assign(this.view, view);
    return this.sendView(view);
  }
  sendView(view) {
    if (!Object.keys(view).length) return 0;
    const request = { type: 'customUpstreamEvent', structureName: 'lf-view-request', structure: view };
    return this.connection?.request(request) ?? 0;
  }
  navigate(event) { return this.path !== null ? 0 : this.connection?.request({ type: 'navigationEvent', event }) ?? 0; }

  // `share` of the way from the nearest to the farthest, in equal ratios.
  focusAt(share) {
    const { near, far } = this.range;
    if (this.home) this.sendView({ 'focus-distance': near * (far / near) ** share });
  }

  // Flown in a moment, so that one sees where it is; who wants no motion is there at once.
  goHome() {
    const from = this.state, to = this.home, began = performance.now();
    this.say('Back at the start');
    if (!from || !to || matchMedia('(prefers-reduced-motion: reduce)').matches) return this.controls.key('r');
    const step = now => {
      const t = (now - began) / kHomeward;
      if (t >= 1 || !this.connection) return this.controls.key('r');
      const share = Math.max(0, t) ** 2 * (3 - 2 * t);
      const between = (name, by = to[name] - from[name]) =>
        from[name] + share * (['yaw', 'pitch', 'roll'].includes(name) ? by - 360 * Math.round(by / 360) : by);
      this.sendView(Object.fromEntries(kFields.map(name => [name, between(name)])));
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  // Keeps in focus what was clicked last, as it moves.
  get follows() { return this.follower.getAttribute('aria-pressed') === 'true'; }
  follow(on) {
    this.follower.setAttribute('aria-pressed', on);
    return this.sendView({ 'focus-continuous': on ? 1 : 0 });
  }

  sweep(button) {
    const on = button.getAttribute('aria-pressed') !== 'true', began = performance.now();
    button.setAttribute('aria-pressed', on);
    const step = now => {
      if (button.getAttribute('aria-pressed') !== 'true' || !this.isConnected) return;
      this.slider.value = 0.5 + 0.5 * Math.sin((now - began) / 1000);
      this.focusAt(Number(this.slider.value));
      requestAnimationFrame(step);
    };
    if (on) requestAnimationFrame(step);
  }

  // To who can't see it.
  say(text) { this.shadowRoot.querySelector('.said').textContent = text; }

  async toggle(name, layer) {
    const button = this.shadowRoot.querySelector(`button.${name}`);
    button.setAttribute('aria-pressed', await layer.toggle());
  }

  // Every frame that is shown.
  watch() {
    this.video.requestVideoFrameCallback?.((now, frame) => {
      while (this.changes.length) {
        const [stamp, state] = this.changes[0];
        if (stamp !== undefined && frame.rtpTimestamp !== undefined && !isShown(stamp, frame.rtpTimestamp)) break;
        this.seen = state;
        this.changes.shift();
      }
      this.notice.shown();
      this.panel.frame(now, frame);
      this.anaglyph.draw(this.seen, this.eyeDistance);
      this.cameras.draw(now, this.seen);
      this.watch();
    });
  }

  // Where the picture is in the element, in CSS pixels: it keeps its shape.
  get pictureBox() {
    const { clientWidth, clientHeight, videoWidth, videoHeight } = this.video;
    const shownWidth = this.mode === 'side' ? videoWidth : this.eyeWidth;
    const scale = Math.min(clientWidth / (shownWidth || 1), clientHeight / (videoHeight || 1)) || 1;
    const width = shownWidth * scale, height = videoHeight * scale;
    return { x: (clientWidth - width) / 2, y: (clientHeight - height) / 2, width, height, scale };
  }
  // What each eye sees where: `offset` metres to the right of the view.
  get eyes() {
    const box = this.pictureBox;
    if (this.mode !== 'side') return [{ box, offset: 0 }];
    const width = box.width / 2;
    return [-1, 1].map(side => ({ box: { ...box, width, x: box.x + (side > 0 ? width : 0) },
      offset: side * this.eyeDistance / 2 }));
  }
  get eyeWidth() { return this.video.videoWidth / (this.twoEyes ? 2 : 1); }
  // The pixel of the view under a pointer, and back.
  pixelAt(event) {
    const frame = this.video.getBoundingClientRect(), box = this.pictureBox;
    return { x: (event.clientX - frame.left - box.x) / box.scale, y: (event.clientY - frame.top - box.y) / box.scale };
  }
  placeOf({ x, y }) {
    const box = this.pictureBox;
    return { x: box.x + x * box.scale, y: box.y + y * box.scale };
  }
  // The answer goes to the cameras' overlay.
  askAbout({ x, y }) {
    return this.connection?.request(
      { type: 'customUpstreamEvent', structureName: 'lf-pixel', structure: { x: Math.round(x), y: Math.round(y) } });
  }

  get link() {
    const hash = new URLSearchParams(Object.entries(this.state ?? this.view).map(([k, v]) => [k, +v.toPrecision(7)]));
    if (this.mode !== 'one' && this.mode !== 'headset') hash.set('eyes', this.mode);
    return new URL(`#${hash}`, location.href).href;
  }
  async share(button) {
    history.replaceState(null, '', this.link);
    try {
      await navigator.clipboard.writeText(this.link);
      button.lastChild.data = 'Copied';
    } catch {
      button.lastChild.data = 'In the address bar';
    }
    this.say(`The link to this view is ${button.lastChild.data === 'Copied' ? 'copied' : 'in the address bar'}`);
    setTimeout(() => button.lastChild.data = 'Share', 2000);
  }
}

customElements.define('lightfield-viewer', LightfieldViewer);
