// SPDX-License-Identifier: LGPL-2.1-or-later
// What stands in the way of a picture, in words a person understands, and what can be done about it: wait, try again, or
// give the token. While there is no stream the last picture stays behind it, or the poster.

const kStopped = 750;     // milliseconds without a frame until that is told, and the server asked whether it lives
const kGivenUp = 4000;    // without a word of the server, either, until another connection is tried
const kLookEvery = 150;
const kQuiet = 600;       // milliseconds of connecting that need no words

const kWords = {
  attribute: ({ message }) => `This page asks for what can't be: ${message}.`,
  origin: () => 'This page may not show this light field (lf-serve --origin).',
  host: () => 'The server does not go by this name (lf-serve --host).',
  path: () => 'There is no such path on this server.',
  address: () => 'Too many views are open at this address. It goes on when one of them ends.',
  filming: ({ progress }) => `The scene is being filmed for the first time${
    progress >= 0 ? `: ${Math.floor(100 * progress)} %` : '.'}`,
  starting: () => 'The cameras are being opened.',
  full: ({ place, waiting }) => place > 0 ?
    `There are too many viewers. You are number ${place} of ${Math.max(place, waiting || 0)} who wait, and come in by yourself.` :
    'There are too many viewers. You come in as soon as somebody leaves.',
};

// "Camera hosts 1 and 3 of 4 do not answer."
function silence({ count, silent } = {}) {
  if (!silent?.length) return '';
  const names = silent.map(node => node + 1), last = names.pop();
  return `Camera host${names.length ? `s ${names.join(', ')} and` : ''} ${last} of ${count} ${names.length ? 'do' : 'does'} not answer.`;
}

const kNoCamera = 'No camera works. Trying again';

// "2 of 64 cameras do not work."
function losses({ count, working } = {}) {
  const lost = count - working;
  return lost > 0 ? `${lost} of ${count} cameras ${lost > 1 ? 'do' : 'does'} not work.` : '';
}

// What is wrong with the cameras: of the server, or of other hosts. The picture is without those that are silent; with
// nothing left (`all`) it stays as it was.
function trouble({ cameras, nodes }) {
  if (cameras?.count > 0 && cameras.working === 0) return { words: kNoCamera, all: true };
  const words = silence(nodes);
  return { words: words || losses(cameras), all: words && nodes.silent.length === nodes.count };
}

export class Notice {
  constructor(viewer, root) {
    this.viewer = viewer;
    this.box = root.querySelector('.status');
    this.why = root.querySelector('.why');
    this.again = root.querySelector('.again');
    this.progress = root.querySelector('progress');
    this.form = root.querySelector('form');
    this.field = this.form.querySelector('input');
    this.part = root.querySelector('.trouble');  // says what a part of the picture is without, for as long as it is
    this.trouble = '';  // what has been said of cameras that don't work, or hosts that are silent
    this.last = root.querySelector('canvas.last');
    this.poster = root.querySelector('.poster');
    this.again.addEventListener('click', () => this.viewer.stream.again());
    this.form.addEventListener('submit', event => {
      event.preventDefault();
      this.viewer.token.keep(this.field.value.trim());
      this.viewer.stream.again();
    });
  }

  // While a connection is there or under way.
  watch() {
    clearInterval(this.timer);
    this.frame = this.heard = performance.now();
    this.timer = setInterval(() => this.look(), kLookEvery);
  }
  rest() {
    this.dark = false;
    clearInterval(this.timer);
    clearInterval(this.countdown);
    clearTimeout(this.soon);
  }

  // Words that are there stay until there is something new to say.
  connecting() {
    this.viewer.stage.classList.add('waiting');
    this.watch();
    if (this.box.hidden) this.soon = setTimeout(() => this.show('Connecting'), kQuiet);
    clearInterval(this.countdown);
    this.again.textContent = 'Connecting';
  }
  // A frame is there.
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
    // Who has typed a token flies on with the same keys.
    if (this.box.contains(this.viewer.root.activeElement)) this.viewer.video.focus({ preventScroll: true });
    this.box.hidden = true;
    this.viewer.stage.classList.remove('told');
    if (this.viewer.stream.connection) this.watch();
  }

  // A message of the server is there.
  answered() { this.heard = performance.now(); }
  // Statistics of the server are there.
  know(statistics) {
    const { words, all } = trouble(statistics);
    if (words !== this.trouble)
      this.viewer.say(words || (/^Camera host/.test(this.trouble) ? 'All camera hosts answer.' : 'All cameras work again.'));
    this.part.textContent = all ? '' : words;
    this.part.hidden = all || !words;
    if (all) this.show(words);
    else if (this.dark) this.hide();
    this.trouble = words;
    this.dark = all;
  }

  // `error`: a Refusal. `seconds` until another try; Infinity: none.
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
      return this.viewer.token.value ? 'The token is wrong, or not valid any more.' : 'This light field needs a token.';
    if (Object.hasOwn(kWords, reason ?? '')) return kWords[reason](error);
    if (status === 503) return kWords.full(error);
    if (status === 429) return 'Too many connections came from here. It goes on in a moment.';
    if (status === undefined)
      return navigator.onLine ? 'The server can\'t be reached.' : 'This device has no network.';
    return `The server refuses: ${message}.`;
  }

  // Words that change are said once: numbers that count are not read out again and again.
  show(words) {
    clearInterval(this.countdown);
    clearTimeout(this.soon);
    if (this.why.textContent !== words) this.why.textContent = words;
    this.again.hidden = this.form.hidden = this.progress.hidden = true;
    this.box.hidden = false;
    this.viewer.stage.classList.add('told');
  }

  // The picture as it is now, for as long as there is none.
  keep() {
    const { video, mode, anaglyph } = this.viewer;
    if (!video.videoWidth || !video.srcObject || !this.last.hidden) return;
    const picture = mode === 'anaglyph' ? anaglyph.canvas : video;
    const { width, height } = mode === 'anaglyph' ? picture : { width: video.videoWidth, height: video.videoHeight };
    Object.assign(this.last, { width, height });
    this.last.getContext('2d').drawImage(picture, 0, 0);
    this.last.hidden = false;
  }

  // Frames come all the time, also of a scene that does not move: where they stop the server or the way to it is gone.
  look() {
    const { connection } = this.viewer.stream, now = performance.now(), still = now - this.frame;
    if (document.hidden || !connection?.isOpen || this.viewer.video.paused) return void (this.frame = this.heard = now);
    if (still > kGivenUp && now - this.heard > kGivenUp) return connection.lose();
    if (still < kStopped || !this.box.hidden) return;
    this.show('The picture has stopped. Waiting for the server');
    // No word of what it says: that it says something is enough.
    // Pages of other sites may not load healthz (Cross-Origin-Resource-Policy), but the element's own files.
    const ask = (name, mode) => fetch(new URL(name, this.viewer.stream.endpoint), { mode, cache: 'no-store' });
    ask('healthz', 'no-cors').catch(() => ask('lightfield-viewer.js', 'cors'))
      .catch(() => performance.now() - this.frame > kStopped && connection.lose());
  }
}
