// SPDX-License-Identifier: LGPL-2.1-or-later
// What stands in the way of a picture, in words a person understands, and what can be done about it: wait, try again, or
// give the token. While there is no stream the last picture stays behind it.

const kStopped = 1000;    // milliseconds without a frame until that is told
const kGivenUp = 4000;    // without a word of the server, either, until another connection is tried
const kLookEvery = 250;

export class Notice {
  constructor(viewer, root) {
    this.viewer = viewer;
    this.box = root.querySelector('.status');
    this.why = root.querySelector('.why');
    this.again = root.querySelector('.again');
    this.form = root.querySelector('form');
    this.field = this.form.querySelector('input');
    this.last = root.querySelector('canvas.last');
    this.again.addEventListener('click', () => this.viewer.reconnect());
    this.form.addEventListener('submit', event => {
      event.preventDefault();
      this.viewer.setAttribute('token', this.field.value.trim());
      this.viewer.reconnect();
    });
  }

  // While the element is on a page, and a connection is there or under way.
  watch() {
    clearInterval(this.timer);
    this.frame = this.heard = performance.now();
    this.timer = setInterval(() => this.look(), kLookEvery);
  }
  rest() { clearInterval(this.timer); }

  connecting() {
    this.viewer.toggleAttribute('waiting', true);
    this.show('Connecting');
  }
  // A frame is there.
  shown() {
    this.frame = performance.now();
    if (this.box.hidden) return;
    this.box.hidden = this.last.hidden = true;
    this.viewer.toggleAttribute('waiting', false);
    clearInterval(this.countdown);
  }

  // A message of the server is there.
  answered() { this.heard = performance.now(); }

  // `error`: of Connection. `seconds` until another try; Infinity: none.
  lost(error, seconds) {
    const needsToken = error.status === 401;
    this.keep();
    this.viewer.toggleAttribute('waiting', true);
    this.show(this.words(error));
    this.form.hidden = !needsToken;
    this.again.hidden = needsToken;
    if (needsToken) return;
    const until = performance.now() + 1000 * seconds, name = 'Try again';
    const tell = () => {
      const left = Math.max(0, Math.ceil((until - performance.now()) / 1000));
      this.again.textContent = seconds === Infinity ? name : `${name} (in ${left} s)`;
    };
    tell();
    if (seconds !== Infinity) this.countdown = setInterval(tell, 200);
  }

  words({ status, message }) {
    if (status === 401)
      return this.viewer.token ? 'The token is wrong, or not valid any more.' : 'This light field needs a token.';
    if (status === 503) return 'There are too many viewers. You come in as soon as somebody leaves.';
    if (status === 429) return 'Too many connections came from here. It goes on in a moment.';
    if (status === undefined) return 'The server can\'t be reached.';
    return `The server refuses: ${message}.`;
  }

  show(words) {
    clearInterval(this.countdown);
    this.why.textContent = words;
    this.again.hidden = this.form.hidden = true;
    this.box.hidden = false;
  }

  // The picture as it is now, for as long as there is none.
  keep() {
    const { video } = this.viewer;
    if (!video.videoWidth || !video.srcObject || !this.last.hidden) return;
    Object.assign(this.last, { width: video.videoWidth, height: video.videoHeight });
    this.last.getContext('2d').drawImage(video, 0, 0);
    this.last.hidden = false;
  }

  // Frames come all the time, also of a scene that does not move: where they stop the server or the way to it is gone.
  look() {
    const { connection } = this.viewer, now = performance.now(), still = now - this.frame;
    if (document.hidden || !connection?.isOpen || this.viewer.video.paused) return void (this.frame = this.heard = now);
    if (still > kGivenUp && now - this.heard > kGivenUp) return connection.lose();
    if (still > kStopped && this.box.hidden) this.show('The picture has stopped. Waiting for the server');
  }
}
