// SPDX-License-Identifier: LGPL-2.1-or-later
// WHEP and the data channel "control" of one viewer. Events: "open", "message" (detail: object), "lost" (detail: error; of the server it has `status` and `retryAfter`, seconds).

const kConnectTimeout = 15000;  // milliseconds
const kRemembered = 256;        // requests

export class Connection extends EventTarget {
  constructor(video) {
    super();
    this.video = video;
    this.nextId = 1;
    this.times = new Map();  // when the latest requests were sent, by id
  }

  // `wish`: what the endpoint's query asks for, as {width, height, ...}.
  async open(endpoint, token, wish) {
    this.token = token;
    const peer = this.peer = new RTCPeerConnection();
    peer.addTransceiver('video', { direction: 'recvonly' });
    this.channel = peer.createDataChannel('control');
    this.channel.onopen = () => {
      this.isOpen = true;
      this.dispatchEvent(new CustomEvent('open'));
    };
    this.channel.onclose = () => this.lose();
    this.channel.onmessage = event => this.take(event.data);
    peer.ontrack = event => {
      // Live is live: nothing is kept back for smoothness.
      if ('jitterBufferTarget' in event.receiver) event.receiver.jitterBufferTarget = 0;
      if ('playoutDelayHint' in event.receiver) event.receiver.playoutDelayHint = 0;
      this.video.srcObject = new MediaStream([event.track]);
    };
    peer.onconnectionstatechange = () => {
      if (['failed', 'closed', 'disconnected'].includes(peer.connectionState)) this.lose();
    };
    await peer.setLocalDescription();

    const url = new URL(endpoint);
    for (const [name, value] of Object.entries(wish)) url.searchParams.set(name, value);
    const headers = { 'Content-Type': 'application/sdp', ...this.authorization };
    const response = await fetch(url, { method: 'POST', headers, body: peer.localDescription.sdp });
    const text = await response.text();
    if (response.status !== 201) {
      const error = new Error(text.trim() || `the server answers ${response.status}`);
      error.status = response.status;
      const later = [429, 500, 502, 503].includes(response.status);
      error.retryAfter = later ? Number(response.headers.get('Retry-After')) || 5 : Infinity;
      throw error;
    }
    this.session = new URL(response.headers.get('Location'), endpoint);
    if (this.closed) return this.leave();
    await peer.setRemoteDescription({ type: 'answer', sdp: text });
    this.timer = setTimeout(() => this.channel.readyState !== 'open' && this.lose(), kConnectTimeout);
    this.goodbye = () => this.leave();
    addEventListener('pagehide', this.goodbye);
  }

  get authorization() { return this.token ? { Authorization: `Bearer ${this.token}` } : {}; }

  take(text) {
    const message = JSON.parse(text);
    this.dispatchEvent(new CustomEvent('message', { detail: message }));
  }

  request(request) {
    if (this.channel?.readyState !== 'open') return 0;
    const id = this.nextId++;
    this.times.set(id, performance.now());
    this.times.delete(id - kRemembered);
    this.channel.send(JSON.stringify({ id, mid: null, request }));
    return id;
  }

  lose() {
    if (!this.closed) this.dispatchEvent(new CustomEvent('lost', { detail: new Error('the connection is lost') }));
  }

  leave() {
    if (!this.session) return;
    fetch(this.session, { method: 'DELETE', headers: this.authorization, keepalive: true }).catch(() => {});
    this.session = null;
  }

  close() {
    if (this.closed) return;
    this.closed = true;
    clearTimeout(this.timer);
    if (this.goodbye) removeEventListener('pagehide', this.goodbye);
    this.leave();
    this.peer?.close();
  }
}
