// SPDX-License-Identifier: LGPL-2.1-or-later
// The viewer's stream: connects, reconnects, waits in the queue, and disconnects while invisible. While it waits in the
// queue, it shows a camera path of the server, which needs no seat.

import { Connection, Refusal, serversIn } from './connection.js';

const kFirstRetryDelay = 0.25, kMaxRetryDelay = 10;  // seconds
const kVisibleMargin = '200px';  // an element closer than this to the screen counts as visible
const kHiddenDelay = 500;     // milliseconds out of sight until the stream ends; it starts again without delay
const kInvalidOffer = [400, 406, 415, 422];  // HTTP status of servers that refuse offers with data channels

// lf-serve gives a reason for each refusal.
const refusesChannels = ({ status, reason }) => reason === 'answer' || (kInvalidOffer.includes(status) && !reason);

export class Stream {
  constructor(viewer) {
    this.viewer = viewer;
    this.connection = null;
    this.shared = null;      // the connection of a shared flight, while all seats are taken
    this.sharedPath = null;  // name of the shared flight that is displayed
    this.sharedAfter = 0;    // earliest time of the next shared flight, milliseconds
    this.isPlain = false;    // the server only sends video
    this.wanted = false;
    this.seen = true;
    this.online = () => this.timer && this.again();
  }
  watch() { addEventListener('online', this.online); }
  rest() { removeEventListener('online', this.online); }

  get endpoint() { return new URL(this.viewer.given('src') ?? new URL('../whep', import.meta.url), document.baseURI); }
  get isOpen() { return this.connection?.isOpen ?? false; }
  get displayed() { return this.shared ?? this.connection; }

  begin() {
    this.wanted = true;
    if (this.seen && !this.connection && !this.timer) this.connect();
  }
  end() {
    this.wanted = false;
    this.disconnect('ended');
  }
  again() {
    if (!this.wanted) return;
    this.disconnect('again');
    if (this.seen) this.connect();
  }
  // Frees the seat while the element is invisible. The last picture stays.
  see(seen) {
    if (seen === this.seen) return;
    this.seen = seen;
    if (!seen) this.viewer.notice.keep();
    if (!seen) this.disconnect('out of sight');
    else if (this.wanted) this.connect();
  }

  async connect() {
    clearTimeout(this.timer);
    this.timer = null;
    const { viewer } = this, connection = this.connection = new Connection(this.isPlain);
    connection.addEventListener('surface', event => viewer.redraw.take(event.detail));
    connection.addEventListener('sent', event => viewer.redraw.sent(event.detail));
    connection.addEventListener('track', () => this.shared || this.show(connection));
    connection.addEventListener('plain', () => this.knowPlain(true));
    connection.addEventListener('open', () => {
      this.retry = 0;
      this.ticket = null;
      this.leaveShared(connection);
      viewer.opened();
      this.knowPlain(connection.isPlain);
      viewer.tell('connected');
    });
    if (!this.shared) viewer.notice.connecting();
    this.asked = viewer.size;
    const ticket = this.ticket && { ticket: this.ticket };
    await this.open(connection, { ...viewer.viewParams, ...ticket });
  }
  async open(connection, viewParams) {
    const { viewer } = this;
    connection.addEventListener('message', event => viewer.take(event.detail));
    connection.addEventListener('lost', event => this.lost(connection, event.detail));
    try {
      const own = viewer.iceServers ?? serversIn(viewer.given('ice-servers'));
      await connection.open(this.endpoint, viewer.token.value, viewParams, own.length ? own : this.iceServers ?? []);
    } catch (error) {
      this.lost(connection, error instanceof Refusal ? error : this.unreachable(error));
    }
  }
  show(connection) { this.viewer.video.srcObject = connection.media; }
  knowPlain(isPlain) {
    this.isPlain = isPlain;
    if (isPlain) this.viewer.flight.forget(new DOMException('this stream has no view to set', 'InvalidStateError'));
    this.viewer.render();
  }

  // Watches a camera path of the server until there is a seat. `error` is the refusal that names the path.
  watchShared(error) {
    const { viewer } = this, { path } = error, isLate = performance.now() >= this.sharedAfter;
    if (!path || this.shared || viewer.path !== null || viewer.mode !== 'one' || !isLate) return;
    const connection = this.shared = new Connection();
    connection.addEventListener('track', () => {
      viewer.showShared();
      this.show(connection);
    });
    connection.addEventListener('open', () => {
      this.sharedPath = path;
      viewer.notice.wait(error);
      viewer.tell('fallback', { path });
    });
    viewer.render();
    this.open(connection, { path });
  }
  // Ends the shared flight. `next` is the viewer's own connection, if it is open. The last picture stays on the screen
  // until the first picture of `next`.
  leaveShared(next) {
    const { viewer, shared, sharedPath } = this;
    if (!shared) return;
    viewer.notice.keep();
    this.shared = this.sharedPath = null;
    shared.close();
    viewer.notice.rest();
    viewer.notice.wait(null);
    if (next) viewer.notice.connecting();
    if (next && sharedPath !== null) viewer.say('This is your own view.');
    if (next?.media) this.show(next);
    viewer.render();
    if (sharedPath !== null) viewer.tell('fallback', { path: null });
  }
  unreachable(error) {
    return new Refusal(error.message, error.name === 'TypeError' && /ice-servers|Invalid URL/.test(error.message) ?
      { retryAfter: Infinity, reason: 'attribute' } : {});
  }

  disconnect(reason) {
    clearTimeout(this.timer);
    this.timer = null;
    const { connection } = this;
    this.connection = null;
    if (reason) this.leaveShared();
    if (!connection) return;
    connection.close();
    if (!this.shared) this.viewer.notice.rest();
    if (reason && connection.isOpen) this.viewer.tell('disconnected', { reason });
  }

  // Reconnects with increasing delays, unless the error is permanent. In the queue for a free seat, the server
  // determines the delay.
  lost(connection, error) {
    if (this.shared === connection) {
      this.sharedAfter = performance.now() + 1000 * Math.max(error.retryAfter, kMaxRetryDelay);
      this.leaveShared();
      // The next refusal explains why there is no picture.
      if (!this.timer && !this.connection) this.connect();
      return;
    }
    if (this.connection !== connection) return;
    const isPlain = !this.isPlain && !connection.isOpen && refusesChannels(error);
    if (!connection.isOpen) this.isPlain = isPlain;
    if (isPlain) {
      this.disconnect();
      return this.connect();
    }
    // ICE servers from the answer are used only if a direct connection fails.
    const servers = !connection.isOpen && connection.iceServers?.length && !this.iceServers;
    if (servers) this.iceServers = connection.iceServers;
    this.ticket = error.ticket ?? (error.reason === 'full' ? null : this.ticket);
    this.retry = error.status === 503 || servers ? 0 : Math.min(this.retry * 2 || kFirstRetryDelay, kMaxRetryDelay);
    const seconds = Math.max(this.retry, error.retryAfter);
    const { status, reason, message } = error, words = this.viewer.notice.words(error), was = connection.isOpen;
    this.watchShared(error);
    if (this.sharedPath === null) this.viewer.notice.lost(error, seconds);
    else this.viewer.notice.wait(error);
    this.disconnect();
    if (was) this.viewer.tell('disconnected', { reason: words });
    this.viewer.tell('error', { message: words, cause: message, status, reason, retryAfter: seconds });
    if (seconds !== Infinity) this.timer = setTimeout(() => this.connect(), 1000 * seconds);
  }
}

export class VisibilityWatcher {
  constructor(element, changed) {
    this.element = element;
    this.changed = changed;
    this.near = false;
    this.look = () => {
      clearTimeout(this.timer);
      if (this.near && !document.hidden) this.changed(true);
      else this.timer = setTimeout(() => this.changed(false), kHiddenDelay);
    };
  }
  watch() {
    this.observer = new IntersectionObserver(entries => {
      this.near = entries.at(-1).isIntersecting;
      this.look();
    }, { rootMargin: kVisibleMargin });
    this.observer.observe(this.element);
    document.addEventListener('visibilitychange', this.look);
  }
  rest() {
    clearTimeout(this.timer);
    this.observer?.disconnect();
    document.removeEventListener('visibilitychange', this.look);
  }
}
