// SPDX-License-Identifier: LGPL-2.1-or-later
// <lightfield-viewer src="https://HOST:PORT/whep" token="..." width="640" height="480"></lightfield-viewer>
//
// One virtual camera of an lf-serve: its picture, and mouse, touch, keys and a slider that fly it. Without `src` the
// server that this file came from. Without `width` and `height` the view follows the
// element's size.
// Properties: view (what has been set, as sent to the server), figures (the latest statistics), video.
// Methods: setView({x, y, z, yaw, pitch, roll, fov, "focus-distance"}), connect(), disconnect().
// Events: "connected", "disconnected" (detail: why), "statistics" (detail: figures), "applied" (detail: {id,
// rtpTimestamp}).

import { Connection } from './connection.js';
import { Controls } from './controls.js';
import { Overlay } from './overlay.js';

const kRest = 400;  // milliseconds without another size until the view takes it

const style = `
  :host { display: block; position: relative; background: #000; color: #fff; font: 14px/1.4 system-ui, sans-serif;
    min-width: 64px; min-height: 64px; overflow: hidden; }
  video { width: 100%; height: 100%; object-fit: contain; display: block; touch-action: none; cursor: grab;
    outline: none; }
  video:active { cursor: grabbing; }
  :host(:focus-within) .frame { box-shadow: inset 0 0 0 2px #6cf; }
  .frame { position: absolute; inset: 0; pointer-events: none; }
  .bar { position: absolute; left: 0; right: 0; bottom: 0; display: flex; gap: 12px; align-items: center;
    flex-wrap: wrap; padding: 8px 12px calc(8px + env(safe-area-inset-bottom));
    background: linear-gradient(transparent, rgb(0 0 0 / .7)); }
  label { display: flex; gap: 8px; align-items: center; flex: 1 1 160px; }
  input[type=range] { flex: 1; min-width: 80px; height: 28px; }
  button { font: inherit; color: inherit; background: rgb(40 40 40 / .8); border: 1px solid #888; border-radius: 6px;
    padding: 6px 10px; min-height: 36px; }
  button[aria-pressed=true] { background: #246; }
  :focus-visible { outline: 2px solid #6cf; outline-offset: 1px; }
  pre { position: absolute; left: 8px; top: 8px; margin: 0; padding: 6px 8px; background: rgb(0 0 0 / .6);
    font: 12px/1.35 ui-monospace, monospace; pointer-events: none; }
  .status { position: absolute; inset: 0; display: grid; place-items: center; text-align: center; padding: 16px;
    pointer-events: none; }
  [hidden] { display: none !important; }`;

const markup = `
  <style>${style}</style>
  <video autoplay playsinline muted tabindex="0" role="img" aria-describedby="help"
    aria-label="Live picture of the light field, flown by a virtual camera"></video>
  <div class="frame"></div>
  <pre hidden aria-label="Figures"></pre>
  <div class="status" role="status">connecting</div>
  <div class="bar">
    <label>Focus
      <input type="range" min="-1" max="1" step="0.01" value="0" aria-label="Distance of what is sharp"></label>
    <button class="sweep" aria-pressed="false" title="Moves the focus through the scene and back">Sweep</button>
    <button class="home" title="Back to where the flight began (key r)">Home</button>
    <button class="figures" aria-pressed="false" title="Frames per second, latency, bytes (key i)">Figures</button>
    <button class="share" title="Copies a link to exactly this view">Share</button>
  </div>
  <span id="help" hidden>Arrow keys turn around the scene, w s a d q e fly, plus and minus zoom, square brackets move
    the focus, r goes back to the start, i shows figures.</span>`;

export const kFields = ['x', 'y', 'z', 'yaw', 'pitch', 'roll', 'fov', 'focus-distance'];

// "x=0.1&yaw=5" to {x: 0.1, yaw: 5}; what is no number of a view is left out.
export function viewOf(text) {
  const view = {};
  for (const [name, value] of new URLSearchParams(text))
    if (kFields.includes(name) && value !== '' && Number.isFinite(Number(value))) view[name] = Number(value);
  return view;
}

export class LightfieldViewer extends HTMLElement {
  constructor() {
    super();
    this.attachShadow({ mode: 'open' }).innerHTML = markup;
    const find = selector => this.shadowRoot.querySelector(selector);
    this.video = find('video');
    this.status = find('.status');
    this.slider = find('input');
    this.view = {};
    this.state = null;  // of the view, as the server tells it
    this.figures = {};
    this.overlay = new Overlay(this, find('pre'));
    this.controls = new Controls(this);
    this.slider.addEventListener('input', () => this.focusAt(Number(this.slider.value)));
    find('.sweep').addEventListener('click', event => this.sweep(event.target));
    find('.home').addEventListener('click', () => this.controls.key('r'));
    find('.figures').addEventListener('click', () => this.toggleFigures());
    find('.share').addEventListener('click', event => this.share(event.target));
  }

  connectedCallback() {
    this.resizes = new ResizeObserver(() => this.resized());
    this.resizes.observe(this);
    this.disconnect();
    this.connect();
  }
  disconnectedCallback() {
    this.resizes.disconnect();
    this.disconnect();
  }

  // A stream keeps its size: one of another size is another stream. Waits until the window rests.
  resized() {
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      const { width, height } = this.size;
      if (!this.asked || !this.connection || (width === this.asked.width && height === this.asked.height)) return;
      this.disconnect();
      this.connect();
    }, kRest);
  }

  // Where to: the attribute, or the server of this file.
  get endpoint() { return new URL(this.getAttribute('src') ?? new URL('whep', import.meta.url), document.baseURI); }
  // The link's: #token=...&x=... ; it never leaves the browser but as a header.
  get token() { return this.getAttribute('token') ?? new URLSearchParams(location.hash.slice(1)).get('token') ?? ''; }

  // Pixels to ask for: what the element has, in whole multiples of 16.
  get size() {
    const box = this.getBoundingClientRect(), scale = Math.min(devicePixelRatio || 1, 2);
    const side = (name, length) =>
      Number(this.getAttribute(name)) || Math.max(64, Math.round(length * scale / 16) * 16);
    return { width: side('width', box.width || 640), height: side('height', box.height || 480) };
  }

  async connect() {
    const connection = this.connection = new Connection(this.video);
    connection.addEventListener('message', event => this.take(event.detail));
    connection.addEventListener('lost', event => this.lost(connection, event.detail));
    connection.addEventListener('open', () => {
      this.status.hidden = true;
      this.retry = 0;
      this.asked = this.size;
      // Another connection goes on where the one before was.
      this.sendView(this.state ?? { ...viewOf(location.hash.slice(1)), ...this.view });
      this.dispatchEvent(new CustomEvent('connected'));
    });
    try {
      await connection.open(this.endpoint, this.token, this.size);
    } catch (error) {
      this.lost(connection, error.message, error.retryAfter);
    }
  }

  disconnect() {
    clearTimeout(this.timer);
    this.connection?.close();
    this.connection = null;
  }

  // Tries again after a while that grows, unless it is no use.
  lost(connection, why, retryAfter) {
    if (this.connection !== connection) return;
    this.disconnect();
    this.status.hidden = false;
    this.status.textContent = why;
    this.dispatchEvent(new CustomEvent('disconnected', { detail: why }));
    if (retryAfter === Infinity) return;
    this.retry = Math.min((this.retry || 0.5) * 2, 30);
    this.timer = setTimeout(() => this.connect(), 1000 * Math.max(this.retry, retryAfter || 0));
  }

  take(message) {
    if (message.type !== 'InfoMessage') return;
    const { statistics, applied, view } = message.info;
    if (statistics) {
      this.figures = statistics;
      this.overlay.update();
      this.dispatchEvent(new CustomEvent('statistics', { detail: statistics }));
    }
    if (view) this.showView(view);
    if (applied) {
      this.overlay.applied(applied);
      this.dispatchEvent(new CustomEvent('applied', { detail: applied }));
    }
  }

  // What the server says the view is; the slider follows.
  showView(view) {
    this.state = view;
    this.home ??= view;
    const focus = view['focus-distance'];
    if (this.shadowRoot.activeElement !== this.slider)
      this.slider.value = Math.log10(focus / this.home['focus-distance']);
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
  navigate(event) { return this.connection?.request({ type: 'navigationEvent', event }) ?? 0; }

  // `decades` from the distance that the flight began with.
  focusAt(decades) {
    if (this.home) this.sendView({ 'focus-distance': this.home['focus-distance'] * 10 ** decades });
  }

  sweep(button) {
    const on = button.getAttribute('aria-pressed') !== 'true', began = performance.now();
    button.setAttribute('aria-pressed', on);
    const step = now => {
      if (button.getAttribute('aria-pressed') !== 'true' || !this.isConnected) return;
      this.slider.value = 0.5 * Math.sin((now - began) / 1000);
      this.focusAt(Number(this.slider.value));
      requestAnimationFrame(step);
    };
    if (on) requestAnimationFrame(step);
  }

  toggleFigures() {
    const button = this.shadowRoot.querySelector('button.figures');
    button.setAttribute('aria-pressed', this.overlay.toggle());
  }

  get link() {
    const hash = new URLSearchParams(Object.entries(this.state ?? this.view).map(([k, v]) => [k, +v.toPrecision(7)]));
    return new URL(`#${hash}`, location.href).href;
  }
  async share(button) {
    history.replaceState(null, '', this.link);
    try {
      await navigator.clipboard.writeText(this.link);
      button.textContent = 'Copied';
    } catch {
      button.textContent = 'In the address bar';
    }
    setTimeout(() => button.textContent = 'Share', 2000);
  }
}

customElements.define('lightfield-viewer', LightfieldViewer);
