// SPDX-License-Identifier: LGPL-2.1-or-later
// The control bar. It hides while idle and reappears on pointer, touch or keyboard input.

const kIdle = 3000;  // milliseconds
const kHint = 1500;  // milliseconds that a hint is visible

export class ControlBar {
  constructor(viewer, root) {
    this.viewer = viewer;
    this.bar = root.querySelector('.bar');
    this.help = root.querySelector('.guide');
    this.hintBox = root.querySelector('.hint');
    const { host } = viewer;
    for (const name of ['pointermove', 'pointerdown', 'keydown', 'focusin', 'wheel'])
      host.addEventListener(name, () => this.wake(), { passive: true });
    // The focus ring is only for keyboard users.
    host.addEventListener('keydown', () => viewer.stage.classList.add('keys'));
    host.addEventListener('pointerdown', () => viewer.stage.classList.remove('keys'));
    root.querySelector('button.help').addEventListener('click', () => this.toggleHelp());
    this.help.querySelector('button').addEventListener('click', () => this.toggleHelp());
    const full = root.querySelector('.full');
    full.addEventListener('click', () => this.toggleFull());
    host.addEventListener('keydown', event => event.key === 'Escape' && !this.help.hidden && this.toggleHelp());
  }

  wake() {
    const { stage } = this.viewer;
    stage.classList.remove('idle');
    clearTimeout(this.timer);
    this.timer = setTimeout(() => stage.classList.toggle('idle', this.help.hidden), kIdle);
  }
  rest() { clearTimeout(this.timer); }

  toggleHelp() {
    this.help.hidden = !this.help.hidden;
    (this.help.hidden ? this.viewer.video : this.help.querySelector('button')).focus();
    this.help.querySelector('a').href = new URL('cameras.html', this.viewer.stream.endpoint);
    return !this.help.hidden;
  }

  // Shown when the page has scrolled because of the wheel over the picture.
  hint() {
    this.hintBox.textContent = 'Click, or hold Ctrl, to zoom';
    this.hintBox.classList.add('on');
    clearTimeout(this.hinting);
    this.hinting = setTimeout(() => this.hintBox.classList.remove('on'), kHint);
  }

  toggleFull() {
    const ended = document.fullscreenElement ? document.exitFullscreen() : this.viewer.host.requestFullscreen();
    ended?.catch(error => this.viewer.say(`Full screen failed: ${error.message}`));
  }
}
