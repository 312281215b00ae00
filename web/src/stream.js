// SPDX-License-Identifier: LGPL-2.1-or-later
// The viewer's stream: connects, reconnects, waits in the queue, and disconnects while invisible.

import { Connection, Refusal, serversIn } from './connection.js';

const kMaxRetryDelay = 10;  // seconds
const kVisibleMargin = '200px';  // an element closer than this to the screen counts as visible
const kHiddenDelay = 500;     // milliseconds out of sight until the stream ends; it starts again without delay

export class Stream {
  constructor(viewer) {
    this.viewer = viewer;
    this.connection = null;
    this.wanted = false;
    this.seen = true;
    this.online = () => this.timer && this.again();
  }
  watch() { addEventListener('online', this.online); }
  rest() { removeEventListener('online', this.online); }

  get endpoint() { return new URL(this.viewer.given('src') ?? new URL('../whep', import.meta.url), document.baseURI); }
  get isOpen() { return this.connection?.isOpen ?? false; }

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
    const { viewer } = this, connection = this.connection = new Connection(viewer.video);
    connection.addEventListener('message', event => viewer.take(event.detail));
    connection.addEventListener('surface', event => viewer.redraw.take(event.detail));
    connection.addEventListener('sent', event => viewer.redraw.sent(event.detail));
    connection.addEventListener('lost', event => this.lost(connection, event.detail));
    connection.addEventListener('open', () => {
      this.retry = 0;
      this.ticket = null;
      viewer.opened();
      viewer.tell('connected');
    });
    viewer.notice.connecting();
    this.asked = viewer.size;
    try {
      const own = viewer.iceServers ?? serversIn(viewer.given('ice-servers'));
      const ticket = this.ticket && { ticket: this.ticket };
      await connection.open(this.endpoint, viewer.token.value, { ...viewer.viewParams, ...ticket }, own.length ? own : this.iceServers ?? []);
    } catch (error) {
      this.lost(connection, error instanceof Refusal ? error : this.unreachable(error));
    }
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
    if (!connection) return;
    connection.close();
    this.viewer.notice.rest();
    if (reason && connection.isOpen) this.viewer.tell('disconnected', { reason });
  }

  // Reconnects with increasing delays, unless the error is permanent. In the queue for a free seat, the server
  // determines the delay.
  lost(connection, error) {
    if (this.connection !== connection) return;
    // ICE servers from the answer are used only if a direct connection fails.
    const servers = !connection.isOpen && connection.iceServers?.length && !this.iceServers;
    if (servers) this.iceServers = connection.iceServers;
    this.ticket = error.ticket ?? (error.reason === 'full' ? null : this.ticket);
    this.retry = error.status === 503 || servers ? 0 : Math.min((this.retry || 0.5) * 2, kMaxRetryDelay);
    const seconds = Math.max(this.retry, error.retryAfter);
    this.viewer.notice.lost(error, seconds);
    const was = connection.isOpen;
    this.disconnect();
    const { status, reason, message } = error, words = this.viewer.notice.why.textContent;
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
