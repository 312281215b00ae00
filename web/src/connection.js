// SPDX-License-Identifier: LGPL-2.1-or-later
// Connection to a server: ICE servers, bearer token, WHEP and the data channel "control".

const kConnectTimeout = 15000;  // milliseconds
// milliseconds to connect directly before the ICE servers that the server names are used
const kDirectTimeout = 3000;
const kGatherTimeout = 1000;           // milliseconds to gather candidates from ICE servers
const kSilence = 3000;  // milliseconds with pictures but without a message, after which a server counts as plain WHEP
const kMaxPending = 256;

// Parses a list of ICE servers, separated by white space, such as "stun:stun.example.org
// turn:USER:PASSWORD@turn.example.org:3478?transport=udp". User and password are percent-encoded.
export function serversIn(text) {
  return (text ?? '').split(/\s+/).filter(Boolean).map(word => {
    const [, scheme, user, password, host] = word.match(/^(stuns?|turns?):(?:([^:@]*):([^@]*)@)?(.+)$/) ?? [];
    if (!scheme) throw new TypeError(`ice-servers: ${word} is not stun:HOST or turn:USER:PASSWORD@HOST`);
    const secret = user && { username: decodeURIComponent(user), credential: decodeURIComponent(password) };
    return { urls: `${scheme}:${host}`, ...secret };
  });
}

// Parses the ICE servers in a Link header: <turn:turn.example.org>; rel="ice-server"; username="USER";
// credential="PASSWORD", ...
export function serversInLinks(header) {
  const servers = [];
  for (const [, urls, parameters] of (header ?? '').matchAll(/<([^>]*)>((?:\s*;\s*[\w-]+\s*=\s*(?:"(?:[^"\\]|\\.)*"|[^\s;,]+))*)/g)) {
    const value = name => {
      const [, quoted, bare] = parameters.match(new RegExp(`;\\s*${name}\\s*=\\s*(?:"((?:[^"\\\\]|\\\\.)*)"|([^\\s;,]+))`)) ?? [];
      return quoted?.replace(/\\(.)/g, '$1') ?? bare;
    };
    if (value('rel') !== 'ice-server' || !/^(stun|turn)s?:/.test(urls)) continue;
    const username = value('username'), credential = value('credential');
    servers.push({ urls, ...username !== undefined && { username, credential } });
  }
  return servers;
}

// The bearer token for the server. It comes from the user, from the attribute, or with `share` from the address of the
// page. It leaves the browser only as a header.
export class Token {
  constructor(viewer) {
    this.viewer = viewer;
    this.typed = null;
  }

  get value() { return this.typed ?? this.viewer.given('token') ?? this.remembered ?? ''; }
  get authorization() { return this.value ? { Authorization: `Bearer ${this.value}` } : {}; }

  // Stores a token that the user has entered. The server's own page (with `share`) keeps the token until its tab is
  // closed.
  keep(token) {
    this.typed = token;
    try {
      if (this.viewer.share.on) sessionStorage.setItem(this.key, token);
    } catch {  }
  }
  get remembered() {
    try {
      return this.viewer.share.on ? sessionStorage.getItem(this.key) : null;
    } catch {
      return null;
    }
  }
  get key() { return `lightfield-token ${this.viewer.stream.endpoint}`; }
}

// The certificate is generated only once, because this is the slowest step of a new connection.
let certificate = null;
const certificates = async () => [await (certificate ??= RTCPeerConnection.generateCertificate({ name: 'ECDSA', namedCurve: 'P-256' }))];

// An error response of the server, or a failure to reach the server (without `status`). Has the `reason` and all other
// members of the response (RFC 9457). `retryAfter` is in seconds; Infinity means never.
export class Refusal extends Error {
  constructor(message, fields = {}) {
    super(message);
    Object.assign(this, { retryAfter: 0 }, fields);
  }
  static async of(response) {
    const text = (await response.text()).trim();
    let problem = {};
    try {
      if (/\bjson\b/.test(response.headers.get('Content-Type'))) problem = JSON.parse(text);
    } catch {  }
    const { status } = response, later = [429, 500, 502, 503, 504].includes(status);
    const { reason, place, waiting, ticket, progress, path, title } = problem ?? {};
    return new Refusal(title ?? (text.length < 200 && !text.startsWith('<') && text || `HTTP status ${status}`),
      { status, reason, place, waiting, ticket, progress, path,
        retryAfter: later ? Number(response.headers.get('Retry-After')) || 5 : Infinity });
  }
}

// The WHEP session of a viewer, with its data channels "control" and "surface". Events are "track", "open", "message"
// (detail: object), "surface" (detail: ArrayBuffer), "sent" (detail: id and request), "plain", and "lost" (detail:
// error). A plain WHEP server has no data channels, or sends no messages. With `isPlain`, the offer has no data channels.
export class Connection extends EventTarget {
  constructor(isPlain = false) {
    super();
    this.isPlain = isPlain;
    this.nextId = 1;
    this.by = 'script';  // cause of the latest request
    this.sent = new Map();
  }

  // `viewParams` are query parameters of the endpoint, such as {width, height}. `iceServers` are used to gather
  // candidates.
  async open(endpoint, token, viewParams, iceServers = []) {
    this.token = token;
    const made = await certificates();
    if (this.closed) return;
    const peer = this.peer = new RTCPeerConnection({ iceServers, certificates: made });
    peer.addTransceiver('video', { direction: 'recvonly' });
    if (!this.isPlain) this.addChannels();
    peer.ontrack = event => {
      this.receiver = event.receiver;
      if ('jitterBufferTarget' in event.receiver) event.receiver.jitterBufferTarget = 0;
      if ('playoutDelayHint' in event.receiver) event.receiver.playoutDelayHint = 0;
      this.media = new MediaStream([event.track]);
      this.dispatchEvent(new CustomEvent('track'));
    };
    peer.onconnectionstatechange = () => {
      if (this.isPlain && peer.connectionState === 'connected') this.opened();
      if (['failed', 'closed', 'disconnected'].includes(peer.connectionState)) this.lose();
    };
    await peer.setLocalDescription();
    if (iceServers.length) await this.gathered();
    if (this.closed) return;

    const url = new URL(endpoint);
    for (const [name, value] of Object.entries(viewParams)) url.searchParams.set(name, value);
    const headers = { 'Content-Type': 'application/sdp', ...this.authorization };
    const response = await fetch(url, { method: 'POST', headers, body: peer.localDescription.sdp });
    if (response.status !== 201) throw await Refusal.of(response);
    const location = response.headers.get('Location');
    this.session = location && new URL(location, response.url || url);
    const text = await response.text();
    if (this.closed) return this.leave();
    this.isPlain ||= !/^m=application [1-9]/m.test(text);
    await peer.setRemoteDescription({ type: 'answer', sdp: text }).catch(({ message }) => {
      throw new Refusal(message, { reason: 'answer' });
    });
    // A connection usually works without ICE servers, so it does not wait for their candidates.
    this.iceServers = serversInLinks(response.headers.get('Link'));
    const patience = this.iceServers.length && !iceServers.length ? kDirectTimeout : kConnectTimeout;
    this.timer = setTimeout(() => this.isOpen || this.lose(), patience);
    this.goodbye = () => this.leave();
    addEventListener('pagehide', this.goodbye);
  }

  addChannels() {
    const { peer } = this;
    this.channel = peer.createDataChannel('control');
    this.channel.onopen = () => this.opened();
    this.channel.onclose = () => this.isPlain || this.lose();
    this.channel.onmessage = event => this.take(event.data);
    // A late surface is useless, so it is not sent again.
    const surfaces = peer.createDataChannel('surface', { ordered: false, maxRetransmits: 0 });
    surfaces.binaryType = 'arraybuffer';
    surfaces.onmessage = event => this.dispatchEvent(new CustomEvent('surface', { detail: event.data }));
  }
  opened() {
    if (this.isOpen || this.closed) return;
    this.isOpen = true;
    this.openTime = performance.now();
    this.dispatchEvent(new CustomEvent('open'));
  }
  // A picture is on the screen. lf-serve sends a message with each picture of a view.
  checkPlain() {
    if (!this.isOpen || this.heard || this.isPlain || performance.now() < this.openTime + kSilence) return;
    this.isPlain = true;
    this.dispatchEvent(new CustomEvent('plain'));
  }

  // The RTP timestamp of the picture that was decoded last, or undefined.
  get rtpTimestamp() { return this.receiver?.getSynchronizationSources?.()[0]?.rtpTimestamp; }

  gathered() {
    const { peer } = this;
    return new Promise(done => {
      setTimeout(done, kGatherTimeout);
      peer.addEventListener('icegatheringstatechange', () => peer.iceGatheringState === 'complete' && done());
    });
  }

  get authorization() { return this.token ? { Authorization: `Bearer ${this.token}` } : {}; }

  take(text) {
    this.heard = true;
    const message = JSON.parse(text);
    this.dispatchEvent(new CustomEvent('message', { detail: message }));
  }

  // Sends a request to the server and returns its id, or 0 if there is no connection. `by` is the cause of the request,
  // 'person' or 'script'.
  request(request, by = 'script') {
    if (this.channel?.readyState !== 'open') return 0;
    const id = this.nextId++;
    this.by = by;
    this.sent.set(id, { time: performance.now(), by });
    this.sent.delete(id - kMaxPending);
    this.channel.send(JSON.stringify({ id, mid: null, request }));
    this.dispatchEvent(new CustomEvent('sent', { detail: { id, request } }));
    return id;
  }

  lose() {
    if (!this.closed) this.dispatchEvent(new CustomEvent('lost', { detail: new Refusal('the connection is lost') }));
  }

  // Returns false if the server of the session does not answer. A proxy then answers itself, or asks another server,
  // which does not know the session.
  async hasSession() {
    if (!this.session) return true;
    const options = { method: 'HEAD', headers: this.authorization, cache: 'no-store' };
    const { status } = await fetch(this.session, options).catch(() => ({ status: 0 }));
    return ![0, 404, 502, 503, 504].includes(status);
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
