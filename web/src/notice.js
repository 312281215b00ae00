// SPDX-License-Identifier: LGPL-2.1-or-later
// Messages that explain why there is no picture and offer an action: wait, try again, or enter the token. Without a
// stream, the last picture or the poster stays visible behind the message.

const kFreezeTimeout = 750;     // milliseconds without a frame until a message is shown and the server is checked
const kReconnectTimeout = 4000;    // milliseconds without any message from the server until a reconnect
const kCheckInterval = 150;
const kConnectingDelay = 600;       // milliseconds of connecting before a message is shown

const kWords = {
  attribute: ({ message }) => `This page has an invalid attribute: ${message}.`,
  origin: () => 'This page may not show this light field (lf-serve --origin).',
  host: () => 'The server does not accept this host name (lf-serve --host).',
  path: () => 'There is no such path on this server.',
  address: () => 'Too many views are open at this address. This view starts when another view ends.',
  filming: ({ progress }) => `The scene is being filmed for the first time${
    progress >= 0 ? `: ${Math.floor(100 * progress)} %` : '.'}`,
  starting: () => 'The cameras are being opened.',
  full: ({ place, waiting }) => place > 0 ?
    `There are too many viewers. You are number ${place} of ${Math.max(place, waiting || 0)} in the queue.` :
    'There are too many viewers. You will be connected when a viewer leaves.',
};

function silence({ count, silent } = {}) {
  if (!silent?.length) return '';
  const names = silent.map(node => node + 1), last = names.pop();
  return `Camera host${names.length ? `s ${names.join(', ')} and` : ''} ${last} of ${count} ${names.length ? 'do' : 'does'} not answer.`;
}

const kNoCamera = 'No camera works. Trying again';

function losses({ count, working } = {}) {
  const lost = count - working;
  return lost > 0 ? `${lost} of ${count} cameras ${lost > 1 ? 'do' : 'does'} not work.` : '';
}

// Returns a text about failed cameras or silent hosts. `all` is true if no camera is left and the picture is frozen.
function trouble({ cameras, nodes }) {
  if (cameras?.count > 0 && cameras.working === 0) return { words: kNoCamera, all: true };
  const words = silence(nodes);
  return { words: words || losses(cameras), all: words && nodes.silent.length === nodes.count };
}

export class StatusMessage {
  constructor(viewer, root) {
    this.viewer = viewer;
    this.box = root.querySelector('.status');
    this.why = root.querySelector('.why');
    this.again = root.querySelector('.again');
    this.progress = root.querySelector('progress');
    this.form = root.querySelector('form');
    this.field = this.form.querySelector('input');
    this.part = root.querySelector('.trouble');
    this.trouble = this.waiting = '';
    this.last = root.querySelector('canvas.last');
    this.poster = root.querySelector('.poster');
    this.again.addEventListener('click', () => this.viewer.stream.again());
    this.form.addEventListener('submit', event => {
      event.preventDefault();
      this.viewer.token.keep(this.field.value.trim());
      this.viewer.stream.again();
    });
  }

  watch() {
    clearInterval(this.timer);
    this.frame = this.heard = performance.now();
    this.timer = setInterval(() => this.look(), kCheckInterval);
  }
  rest() {
    this.dark = false;
    clearInterval(this.timer);
    clearInterval(this.countdown);
    clearTimeout(this.soon);
  }

  connecting() {
    this.viewer.stage.classList.add('waiting');
    this.watch();
    if (this.box.hidden) this.soon = setTimeout(() => this.show('Connecting'), kConnectingDelay);
    clearInterval(this.countdown);
    this.again.textContent = 'Connecting';
  }
  shown() {
    this.frame = performance.now();
    clearTimeout(this.soon);
    if (this.dark) return;
    if (!this.viewer.stage.classList.contains('waiting') && this.box.hidden) return;
    this.hide();
    this.last.hidden = this.poster.hidden = true;
    this.viewer.stage.classList.remove('waiting');
  }
  hide() {
    this.rest();
    // After the token has been entered, the keys control the view again.
    if (this.box.contains(this.viewer.root.activeElement)) this.viewer.video.focus({ preventScroll: true });
    this.box.hidden = true;
    this.viewer.stage.classList.remove('told');
    if (this.viewer.stream.displayed) this.watch();
  }

  answered() { this.heard = performance.now(); }
  know(statistics) {
    const { words, all } = trouble(statistics);
    if (words !== this.trouble)
      this.viewer.say(words || (/^Camera host/.test(this.trouble) ? 'All camera hosts answer.' : 'All cameras work again.'));
    if (all) this.show(words);
    else if (this.dark) this.hide();
    this.trouble = words;
    this.dark = all;
    this.showLine();
  }
  // Says over a shared flight why the viewer has no own view yet. `error` is the latest refusal; null ends the message.
  wait(error) {
    const words = error ? `Shared flight. ${this.words(error)}` : '';
    if (words && !this.waiting) this.viewer.say(words);
    this.waiting = words;
    this.showLine();
  }
  showLine() {
    this.part.textContent = [this.waiting, this.dark ? '' : this.trouble].filter(Boolean).join(' ');
    this.part.hidden = !this.part.textContent;
  }

  // `error` is a Refusal. `seconds` is the delay until the next try; Infinity means none.
  lost(error, seconds) {
    const needsToken = error.status === 401;
    this.keep();
    this.viewer.stage.classList.add('waiting');
    this.show(this.words(error));
    this.form.hidden = !needsToken;
    this.again.hidden = needsToken || ['filming', 'starting'].includes(error.reason);
    this.progress.hidden = !(error.reason === 'filming' && error.progress >= 0);
    if (!this.progress.hidden) this.progress.value = error.progress;
    if (this.again.hidden) return;
    const until = performance.now() + 1000 * seconds, name = 'Try again';
    const tell = () => {
      const left = Math.max(0, Math.ceil((until - performance.now()) / 1000));
      this.again.textContent = seconds === Infinity ? name : `${name} (in ${left} s)`;
    };
    tell();
    if (seconds !== Infinity) this.countdown = setInterval(tell, 200);
  }

  words(error) {
    const { status, reason, message } = error;
    if (status === 401)
      return this.viewer.token.value ? 'The token is wrong or has expired.' : 'This light field needs a token.';
    if (Object.hasOwn(kWords, reason ?? '')) return kWords[reason](error);
    if (status === 503) return kWords.full(error);
    if (status === 429) return 'Too many connections from this address. Trying again in a moment.';
    if (status === undefined)
      return navigator.onLine ? 'The server can\'t be reached.' : 'This device has no network.';
    return `The server refuses: ${message}.`;
  }

  // Replaces the text only if it differs, because screen readers read every replaced text aloud.
  show(words) {
    clearInterval(this.countdown);
    clearTimeout(this.soon);
    if (this.why.textContent !== words) this.why.textContent = words;
    this.again.hidden = this.form.hidden = this.progress.hidden = true;
    this.box.hidden = false;
    this.viewer.stage.classList.add('told');
  }

  // Keeps a copy of the current picture while there is no stream.
  keep() {
    const { video, mode, anaglyph } = this.viewer;
    if (!video.videoWidth || !video.srcObject || !this.last.hidden) return;
    this.viewer.redraw.load();
    const picture = mode === 'anaglyph' ? anaglyph.canvas : video;
    const { width, height } = mode === 'anaglyph' ? picture : { width: video.videoWidth, height: video.videoHeight };
    Object.assign(this.last, { width, height });
    this.last.getContext('2d').drawImage(picture, ...this.viewer.picture.shown(width, height), 0, 0, width, height);
    this.last.hidden = false;
  }

  // Frames of lf-serve arrive continuously, even if nothing moves in the scene. If they stop, the server or the network
  // has failed.
  look() {
    const { displayed: connection, isPlain } = this.viewer.stream, now = performance.now(), still = now - this.frame;
    if (document.hidden || !connection?.isOpen || isPlain || this.viewer.video.paused) return void (this.frame = this.heard = now);
    if (still > kReconnectTimeout && now - this.heard > kReconnectTimeout) return connection.lose();
    if (still < kFreezeTimeout || !this.box.hidden) return;
    this.show('The picture has stopped. Waiting for the server');
    connection.hasSession().then(has => has || performance.now() - this.frame <= kFreezeTimeout || connection.lose());
  }
}
