// SPDX-License-Identifier: LGPL-2.1-or-later
// The virtual camera: requested view, view on the server, and view on the screen.

import { isShown } from './figures.js';
import { kFields, toScript } from './view.js';

const kHomeDuration = 300;  // milliseconds
const kMinFocusChange = 0.005;    // minimum relative change of the focus distance that causes an event

const kConfirmTimeout = 500;      // milliseconds for the server to confirm a view
const kNothing = -1;     // id of views that were not sent; any picture completes these requests

const isSame = (a, b) => kFields.every(name => a?.[name] === b?.[name]);

export class ViewNavigation {
  constructor(viewer) {
    this.viewer = viewer;
    this.forget();
  }
  // Discards the state of the old light field when the element shows another light field. Calls of setView() that no
  // picture shows yet are rejected.
  forget(error = new DOMException('the element shows another light field', 'AbortError')) {
    const given = this.asked ?? [];
    this.interrupt();
    this.set = {};
    this.state = null;
    this.seen = null;
    this.home = null;
    this.isHomeSure = false;
    this.homeId = null;
    this.by = 'script';
    this.scene = null;   // metres
    this.margin = 0;     // margin of the displayed picture (margin.js)
    this.hasMargins = false;
    this.changes = [];   // [RTP timestamp, state, margin] of pictures that are not displayed yet
    this.asked = [];     // [id, done, failed, fields] of setView() calls that no picture shows yet
    for (const [, , failed] of given) failed(error);
  }

  resume(first) {
    this.changes = [];
    this.answerTime = null;
    this.margin = 0;
    const pending = Object.assign({}, ...this.asked.map(([, , , fields]) => fields));
    const fields = { ...this.state ?? { ...first, ...this.set }, ...pending };
    this.homeId = null;
    // The server starts at its home view, except for these fields.
    if (!this.home) this.isHomeSure = Object.keys(fields).every(name => name in this.viewer.start);
    this.asked.push([0, () => {}, () => {}, fields]);
    const id = this.setId = this.sendView(fields);
    for (const entry of this.asked) entry[0] = id || kNothing;
    // The server confirms each message with the view, so at least one message must be sent.
    if ((this.follows || !id) && this.viewer.path === null) this.follow(this.follows);
  }

  setView(fields) {
    if (this.viewer.isFixed)
      return Promise.reject(new DOMException('this stream has no view to set', 'InvalidStateError'));
    this.interrupt();
    if ('focus-distance' in fields) this.endSweep();
    Object.assign(this.set, fields);
    this.viewer.controls.settle();
    const id = this.setId = this.sendView(fields);
    this.answerTime = null;
    if (!Object.keys(fields).length && this.seen) return Promise.resolve(toScript(this.seen));
    return new Promise((done, failed) => this.asked.push([id, done, failed, fields]));
  }
  // The server has received a message.
  answered(id) {
    if (id === this.setId) this.answerTime = performance.now();
  }
  refused(id, why) {
    for (const entry of this.asked) if (entry[0] === id) entry[2](new RangeError(why));
    this.asked = this.asked.filter(entry => entry[0] !== id);
  }
  // Returns the id of the message, or 0 if there is no connection or nothing to set.
  sendView(view, by) {
    if (!Object.keys(view).length) return 0;
    return this.viewer.send({ type: 'customUpstreamEvent', structureName: 'lightfield-view-request', structure: view }, by);
  }

  take({ margin, ...view }, applied) {
    this.hasMargins = margin !== undefined;
    this.state = view;
    this.home ??= view;
    if (applied && applied.id === this.homeId) [this.home, this.isHomeSure] = [view, true];
    // The server discards requests that it answers before its virtual camera exists, so they are sent again. An id stays
    // the same, because a picture can show the first request while the second one is on its way.
    if (!applied && this.answerTime && this.asked.some(([id]) => id > 0) &&
        performance.now() > this.answerTime + kConfirmTimeout) {
      this.answerTime = null;
      this.setId = this.sendView(Object.assign({}, ...this.asked.map(([, , , fields]) => fields)));
    }
    this.changes.push([applied, view, margin ?? 0]);
    const { viewer } = this, focus = view['focus-distance'], { near, far } = this.range;
    if (viewer.root.activeElement !== viewer.slider) viewer.slider.value = Math.log(focus / near) / Math.log(far / near);
    const isMetric = viewer.statistics.unit === 'm', digits = focus.toPrecision(3);
    viewer.distance.textContent = focus < 1000 ? digits + (isMetric ? ' m' : '') : 'far';
    viewer.slider.setAttribute('aria-valuetext', digits + (isMetric ? ' metres' : ''));
  }

  show(rtpTimestamp) {
    const before = this.seen;
    let shown = 0;
    while (this.changes.length) {
      const [applied, state, margin] = this.changes[0];
      if (applied && rtpTimestamp !== undefined && !isShown(applied.rtpTimestamp, rtpTimestamp)) break;
      if (!isSame(state, this.seen)) this.seen = state;
      this.margin = margin;
      // Continuous focus moves without a request, so the author of the last movement stays the same.
      this.by = this.viewer.stream.connection?.sent.get(applied?.id)?.by ?? this.by;
      shown = Math.max(shown, applied?.id ?? 0);
      this.changes.shift();
    }
    if (this.seen && !isSame(this.seen, before)) this.tell(before);
    const isDone = ([id]) => this.seen && id && id <= shown;
    for (const entry of this.asked) if (isDone(entry)) entry[1](toScript(this.seen));
    this.asked = this.asked.filter(entry => !isDone(entry));
  }
  tell(before) {
    const view = toScript(this.seen);
    this.viewer.tell('view-change', { view, by: this.by });
    const [now, then] = [this.seen['focus-distance'], this.told ?? before?.['focus-distance']];
    if (Math.abs(now / then - 1) < kMinFocusChange) return;
    this.told = now;
    this.viewer.tell('focus-change', { focusDistance: now });
  }

  // The range of the slider in metres: the depth range of the scene, extended by half. If the depths are unknown, a
  // decade to each side of the home distance.
  get range() {
    const home = this.home?.['focus-distance'] ?? 1;
    if (!this.scene) return { near: home / 10, far: home * 10 };
    return { near: Math.min(this.scene.near, home) / 1.5, far: Math.max(this.scene.far, home) * 1.5 };
  }
  // Sets the focus distance. `share` is the position in the range, on a logarithmic scale.
  focusShare(share, by) {
    this.interrupt();
    const { near, far } = this.range;
    if (this.home) this.sendView({ 'focus-distance': near * (far / near) ** share }, by);
  }

  // Flies to the start view of the page, with missing fields from the server's home view. The flight is short but
  // visible, so that people see where home is. If the system requests reduced motion, the view jumps.
  goHome(by = 'script') {
    const { viewer } = this, from = this.state, start = viewer.start, to = { ...this.home, ...start };
    if (viewer.isFixed) return;
    viewer.say('Back at the start');
    viewer.controls.settle();
    this.interrupt();
    this.endSweep();
    if (!viewer.stream.isOpen) {
      for (const entry of this.asked) entry[3] = {};
      if (this.home) this.sendView(to, by);
      return void ([this.state, this.set] = [null, to]);
    }
    const arrive = () => {
      this.interrupt();
      this.homeId = viewer.stream.connection.request({ type: 'navigationEvent', event: { event: 'KeyPress', key: 'r' } }, by);
      this.sendView(start, by);
    };
    if (!from || !this.isHomeSure || matchMedia('(prefers-reduced-motion: reduce)').matches) return arrive();
    const began = performance.now(), way = this.way = {};
    const step = now => {
      if (this.way !== way || !viewer.stream.isOpen) return;
      const t = (now - began) / kHomeDuration;
      if (t >= 1) return arrive();
      const share = Math.max(0, t) ** 2 * (3 - 2 * t);
      const between = (name, by = to[name] - from[name]) =>
        from[name] + share * (['yaw', 'pitch', 'roll'].includes(name) ? by - 360 * Math.round(by / 360) : by);
      this.sendView(Object.fromEntries(kFields.map(name => [name, between(name)])), by);
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
  interrupt() { this.way = null; }

  get follows() { return this.viewer.follower.getAttribute('aria-pressed') === 'true'; }
  follow(on, by) {
    this.viewer.follower.setAttribute('aria-pressed', on);
    return this.sendView({ 'focus-continuous': on ? 1 : 0 }, by);
  }

  endSweep() { this.viewer.root.querySelector('.sweep').setAttribute('aria-pressed', 'false'); }
  sweep(button) {
    const on = button.getAttribute('aria-pressed') !== 'true', began = performance.now(), { viewer } = this;
    button.setAttribute('aria-pressed', on);
    const step = now => {
      if (button.getAttribute('aria-pressed') !== 'true' || !viewer.host.isConnected) return;
      viewer.slider.value = 0.5 + 0.5 * Math.sin((now - began) / 1000);
      this.focusShare(Number(viewer.slider.value), 'person');
      requestAnimationFrame(step);
    };
    if (on) requestAnimationFrame(step);
  }
}
