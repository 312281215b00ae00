// SPDX-License-Identifier: LGPL-2.1-or-later
// The implementation of the element, made of several parts.

import { ControlBar } from './bar.js';
import { Overscroll, Vignette } from './border.js';
import { Cameras } from './cameras.js';
import { Token } from './connection.js';
import { Controls } from './controls.js';
import { Figures } from './figures.js';
import { ViewNavigation } from './flight.js';
import { Headset, headsets } from './headset.js';
import { makeStage, style } from './markup.js';
import { MonitorPanel } from './monitor.js';
import { StatusMessage } from './notice.js';
import { Anaglyph, kModes, Picture, watchFrames } from './picture.js';
import { Redraw } from './redraw.js';
import { Stream, VisibilityWatcher } from './stream.js';
import { Tilt } from './tilt.js';
import { numberIn, Share, viewOf } from './view.js';

const kEyeDistance = 0.063;  // metres
const kOneEye = 1e-6;        // minimum eye distance to request, metres; the server interprets 0 as a single eye
const kMinSide = 64;       // minimum width and height of a picture from the server, pixels
const kRest = 400;           // milliseconds after the last change of the element's size until the view is resized
const kAlt = 'Live picture of the light field from a virtual camera';

let styleSheet = null;  // shared by all elements; strict pages forbid <style>

export class Viewer {
  constructor(host, root) {
    this.host = host;
    this.root = root;
    root.append(makeStage());
    if (!styleSheet) (styleSheet = new CSSStyleSheet()).replaceSync(style);
    root.adoptedStyleSheets = [styleSheet];
    const find = selector => root.querySelector(selector), click = (name, does) => find(name).addEventListener('click', does);
    this.stage = find('.stage');
    this.video = find('video');
    this.status = find('.status');
    this.slider = find('input[type=range]');
    this.distance = find('.distance');
    this.vignette = new Vignette(this, find('.vignette'));
    this.follower = find('.follow');
    this.choice = find('select');
    this.startButton = find('.start');
    this.statistics = {};
    this.mode = 'one';
    this.asked = null;
    this.declared = null;  // value of the property `view`; null: the attribute counts
    this.picture = new Picture(this);
    this.stream = new Stream(this);
    this.flight = new ViewNavigation(this);
    this.elastic = new Overscroll(this, find('.picture'));
    this.notice = new StatusMessage(this, root);
    this.bar = new ControlBar(this, root);
    this.panel = new Figures(this, find('pre.figures'));
    this.cameras = new Cameras(this, find('canvas.cameras'), find('pre.makers'));
    this.monitor = new MonitorPanel(this, find('.monitor'));
    this.controls = new Controls(this);
    this.tilt = new Tilt(this, find('.tilt'));
    this.share = new Share(this, find('.share'));
    this.token = new Token(this);
    this.redraw = new Redraw(this, find('canvas.redrawn'));
    this.anaglyph = new Anaglyph(find('canvas.anaglyph'), this.video);
    this.sight = new VisibilityWatcher(host, seen => this.stream.see(seen || this.mode === 'headset'));
    this.stream.seen = false;
    this.resizes = new ResizeObserver(() => this.resized());
    this.video.addEventListener('resize', () => this.picture.fit());
    this.slider.addEventListener('input', () => this.flight.focusShare(Number(this.slider.value), 'person'));
    this.choice.addEventListener('change', () => this.show(this.choice.value));
    click('.sweep', event => this.flight.sweep(event.currentTarget));
    click('.follow', () => this.flight.follow(!this.flight.follows, 'person'));
    click('.home', () => this.flight.goHome('person'));
    click('button.figures', () => this.toggle('figures', this.panel));
    click('button.cameras', () => this.toggle('cameras', this.cameras));
    click('button.quality', () => this.toggle('quality', this.monitor));
    click('.start', () => this.play());
    headsets().then(there => this.choice.querySelector('[value=headset]').hidden = !there);
    watchFrames(this.video, (now, rtpTimestamp) => this.shown(now, rtpTimestamp));
  }

  // Call when the element enters or leaves a page. Moving the element within the page keeps the stream.
  attach() {
    this.render();
    this.bar.wake();
    this.sight.watch();
    this.share.watch();
    this.controls.watch();
    this.stream.watch();
    this.resizes.observe(this.host);
    if (this.stream.connection) return void this.video.play()?.catch(() => {});
    this.settle();
    if (this.host.hasAttribute('autoplay')) this.play();
    if (this.host.autofocus && (document.activeElement ?? document.body) === document.body) this.video.focus();
  }
  detach() {
    this.sight.rest();
    this.share.rest();
    this.controls.rest();
    this.tilt.rest();
    this.stream.rest();
    this.bar.rest();
    this.resizes.disconnect();
    queueMicrotask(() => {
      if (this.host.isConnected) return;
      this.stream.end();
      this.notice.rest();
      this.stream.seen = false;
    });
  }

  get started() { return this.stream.wanted; }
  play() {
    this.stream.begin();
    this.render();
  }
  pause() {
    this.notice.keep();
    this.stream.end();
    this.notice.hide();
    this.render();
  }

  render() {
    const { host, video } = this, flies = this.controls.flies;
    video.ariaLabel = host.getAttribute('alt') ?? kAlt;
    for (const [name, value] of [['tabindex', '0'], ['role', 'application'], ['aria-describedby', 'description']])
      flies ? video.setAttribute(name, value) : video.removeAttribute(name);
    for (const part of [this.bar.bar, this.root.querySelector('slot[name=controls]')]) part.hidden = !flies;
    this.startButton.hidden = this.started;
    this.stage.classList.toggle('begins', !this.started);
    this.stage.classList.toggle('watches', !this.isInteractive);
    const poster = this.root.querySelector('.poster img'), url = host.getAttribute('poster');
    poster.hidden = !url;
    if (url && poster.getAttribute('src') !== url) poster.src = url;
    this.share.button.hidden = !this.share.on;
    this.root.querySelector('.full').hidden = !document.fullscreenEnabled && !video.webkitEnterFullscreen;
  }

  settle() {
    const before = this.asked ?? {};
    const names = ['src', 'token', 'path', 'eye-distance', 'max-width', 'ice-servers', 'eyes'];
    this.asked = Object.fromEntries(names.map(name => [name, this.given(name)]));
    const changed = name => this.asked[name] !== before[name];
    this.resetNavigation();
    this.flightOf = this.lightField;
    if (changed('eyes')) {
      const { eyes } = this.asked;
      this.mode = Object.hasOwn(kModes, eyes ?? '') && eyes !== 'headset' ? eyes : 'one';
      this.showMode();
    }
    if (before.src !== undefined && (changed('src') || changed('path'))) {
      this.loaded = false;
      this.vignette.forget();
      Object.assign(this.stream, { iceServers: null, ticket: null, retry: 0, isPlain: false, sharedAfter: 0 });
      this.cameras.array = this.cameras.known = this.monitor.array = null;
    }
    if (changed('token')) this.token.typed = null;
    this.render();
    if (names.some(changed)) this.stream.again();
  }
  // Called before settle(), so that a view set after `src` in the same script is for the new light field.
  resetNavigation() {
    if (this.flightOf === undefined || this.flightOf === this.lightField) return;
    this.flightOf = this.lightField;
    this.flight.forget();
  }
  scheduleSettle() {
    this.soon ??= Promise.resolve().then(() => {
      this.soon = null;
      if (this.host.isConnected) this.settle();
    });
  }

  // Returns the attribute, or with `share` the parameter in the address of the page. Returns null if both are missing
  // or empty.
  given(name) { return this.host.getAttribute(name) || this.share.words.get(name) || null; }
  get path() { return this.given('path'); }
  // There is no view to control: a path, or a server that only sends video.
  get isFixed() { return this.path !== null || this.stream.isPlain; }
  // The picture follows the view that the user and scripts control.
  get isInteractive() { return !this.isFixed && !this.stream.shared; }
  get lightField() { return JSON.stringify([this.given('src'), this.path]); }
  get start() {
    const focus = numberIn(this.host.getAttribute('focus'));
    return { ...this.declared ?? viewOf(this.host.getAttribute('view')), ...focus > 0 && { 'focus-distance': focus } };
  }
  // The size to request for each eye: the size of the element in pixels, rounded to even numbers.
  get size() {
    const { width, height } = this.host.getBoundingClientRect(), most = numberIn(this.given('max-width'), 1) ?? Infinity;
    const wide = (width || 640) / (this.mode === 'side' ? 2 : 1);
    const scale = Math.min(devicePixelRatio || 1, 2, most / wide);
    const side = length => 2 * Math.round(length * scale / 2);
    return { width: Math.max(kMinSide, Math.min(side(wide), 2 * Math.floor(most / 2))),
      height: Math.max(kMinSide, side(height || 480)) };
  }
  get eyeDistance() { return numberIn(this.given('eye-distance'), 0) ?? kEyeDistance; }
  get viewParams() {
    const path = this.path && { path: this.path };
    if (this.mode === 'one') return { ...this.size, ...path };
    return { ...this.headset?.viewParams ?? { ...this.size, 'eye-distance': Math.max(this.eyeDistance, kOneEye) }, ...path };
  }

  // A stream has a fixed size, so the stream restarts in the new size when resizing has stopped.
  resized() {
    this.picture.fit();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => {
      const { width, height } = this.size, { asked } = this.stream;
      if (!asked || !this.stream.connection || (width === asked.width && height === asked.height)) return;
      if (this.mode === 'headset' || !this.isInteractive) return;
      this.notice.keep();
      this.stream.again();
    }, kRest);
  }

  async show(mode) {
    if (mode === this.mode) return;
    const before = this.mode, headset = this.headset;
    this.notice.keep();
    this.mode = mode;
    this.headset = null;
    headset?.stop();
    this.showMode();
    if (mode !== 'headset') return this.stream.again();
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
    this.picture.fit();
  }

  opened() {
    this.redraw.begin();
    this.twoEyes = this.mode !== 'one';
    this.flight.resume({ ...this.start, ...this.share.view });
  }

  showShared() {
    this.redraw.begin();
    this.twoEyes = false;
    Object.assign(this.flight, { margin: 0, changes: [] });
  }

  take(message) {
    this.notice.answered();
    if (message.type === 'ControlResponseMessage') {
      if (message.error) this.flight.refused(message.id, message.error);
      else this.flight.answered(message.id);
      this.redraw.answered(message.id, message.error);
    }
    if (message.type !== 'InfoMessage') return;
    const { statistics, applied, view, pixel, rig } = message.info;
    if (rig) {
      this.cameras.forget();
      this.monitor.array = null;
      this.tell('rig', { hash: rig });
    }
    if (pixel) this.cameras.take(pixel);
    if (statistics) {
      this.statistics = statistics;
      this.know(statistics);
      this.panel.update();
      this.tell('statistics', statistics);
    }
    if (view) this.flight.take(view, applied);
    if (view) this.redraw.confirm(view, applied?.id);
    if (view && applied) this.elastic.applied(applied.id, view);
    if (applied) this.panel.applied(applied);
  }
  know(statistics) {
    const { coverage, focus, monitored } = statistics;
    this.notice.know(statistics);
    this.root.querySelector('button.quality').hidden = !monitored;
    if (focus?.far > focus?.near) this.flight.scene = focus;
    this.vignette.know(coverage);
  }

  // A new picture is on the screen.
  shown(now, reported) {
    const { displayed } = this.stream;
    if (!displayed?.media) return;
    const rtpTimestamp = reported ?? displayed.rtpTimestamp;
    displayed.checkPlain();
    this.flight.show(rtpTimestamp);
    this.redraw.show(rtpTimestamp);
    this.notice.shown();
    this.panel.frame(now, rtpTimestamp);
    this.vignette.draw(now);
    this.anaglyph.draw(this.flight.seen, this.eyeDistance);
    this.cameras.draw(now, this.isInteractive ? this.flight.seen : null);
    // In an interactive element, the event also requires a displayed view.
    if (!this.loaded && (this.flight.seen || !this.isInteractive)) {
      this.loaded = true;
      this.tell('first-frame', { width: this.picture.eyeWidth, height: this.video.videoHeight });
    }
  }

  // Sends a request to the server and returns its id. Without a connection, the view moves in the last picture, and the
  // id is 0.
  send(request, by) {
    const id = this.stream.connection?.request(request, by) ?? 0;
    if (!id) this.redraw.look(request);
    return id;
  }
  requestPixelInfo({ x, y }) {
    return this.stream.connection?.request(
      { type: 'customUpstreamEvent', structureName: 'lightfield-pixel', structure: { x: Math.round(x), y: Math.round(y) } });
  }
  focusAt(clientX, clientY) {
    if (!this.isInteractive) return false;
    const { x, y } = this.picture.pixelAt({ clientX, clientY }), at = { x: x % this.picture.eyeWidth, y, button: 1 };
    this.flight.interrupt();
    const send = event => this.stream.connection?.request({ type: 'navigationEvent', event: { event, ...at } });
    return Boolean(send('MouseButtonPress') && send('MouseButtonRelease'));
  }

  // Returns a JSON file of the server.
  async fetchJson(name) {
    const response = await fetch(new URL(name, this.stream.endpoint), { headers: this.token.authorization });
    if (!response.ok) throw new Error(response.statusText);
    return response.json();
  }

  tell(name, detail) { this.host.dispatchEvent(new CustomEvent(name, { detail })); }
  say(text) { this.root.querySelector('.said').textContent = text; }

  async toggle(name, layer) {
    this.root.querySelector(`button.${name}`).setAttribute('aria-pressed', await layer.toggle());
  }
}
