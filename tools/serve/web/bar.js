// SPDX-License-Identifier: LGPL-2.1-or-later
// The control bar: it goes away while nobody does anything, and comes back with the pointer, a finger or the keyboard.

const kIdle = 3000;  // milliseconds

export class Bar {
  constructor(viewer, root) {
    this.viewer = viewer;
    this.bar = root.querySelector('.bar');
    this.help = root.querySelector('.guide');
    for (const name of ['pointermove', 'pointerdown', 'keydown', 'focusin', 'wheel'])
      viewer.addEventListener(name, () => this.wake(), { passive: true });
    root.querySelector('button.help').addEventListener('click', () => this.toggleHelp());
    this.help.querySelector('button').addEventListener('click', () => this.toggleHelp());
    const full = root.querySelector('.full');
    full.hidden = !document.fullscreenEnabled;
    full.addEventListener('click', () => this.toggleFull());
    viewer.addEventListener('keydown', event => event.key === 'Escape' && !this.help.hidden && this.toggleHelp());
  }

  wake() {
    this.viewer.toggleAttribute('idle', false);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.viewer.toggleAttribute('idle', this.help.hidden), kIdle);
  }

  toggleHelp() {
    this.help.hidden = !this.help.hidden;
    (this.help.hidden ? this.viewer.video : this.help.querySelector('button')).focus();
    return !this.help.hidden;
  }

  toggleFull() {
    const ended = document.fullscreenElement ? document.exitFullscreen() : this.viewer.requestFullscreen();
    ended.catch(error => this.viewer.say(`No full screen: ${error.message}`));
  }
}
