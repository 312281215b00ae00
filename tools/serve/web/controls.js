// SPDX-License-Identifier: LGPL-2.1-or-later
// Mouse, pen, touch, wheel, keys and gamepad, made into the navigation events that GStreamer's windows send.

const kKeys = { ArrowLeft: 'Left', ArrowRight: 'Right', ArrowUp: 'Up', ArrowDown: 'Down', '+': 'plus', '=': 'plus',
  '-': 'minus', '[': 'bracketleft', ']': 'bracketright' };
const kLetters = 'wsadqer';
const kWheelStep = 100;     // pixels of a wheel that are one step
const kPinchStep = 1.1;     // ratio of finger distances that is one step
const kStickDead = 0.15;
const kStickHeights = 0.5;  // heights of the picture a second, of a stick pushed all the way
const kStickSteps = 5;      // of the wheel, a second

export class Controls {
  constructor(viewer) {
    this.viewer = viewer;
    this.pointers = new Map();
    this.left = 0;  // pixels to the left of the picture under the pointer
    const video = viewer.video;
    video.addEventListener('pointerdown', event => this.down(event));
    video.addEventListener('pointermove', event => this.move(event));
    for (const name of ['pointerup', 'pointercancel']) video.addEventListener(name, event => this.up(event));
    video.addEventListener('wheel', event => this.turn(event), { passive: false });
    video.addEventListener('dblclick', () => this.viewer.path === null && this.viewer.goHome());
    video.addEventListener('contextmenu', event => event.preventDefault());
    viewer.addEventListener('keydown', event => this.press(event));
    addEventListener('gamepadconnected', () => requestAnimationFrame(now => this.gamepad(now)));
  }

  modifiers(event) {
    return [event.shiftKey && 'shift-mask', event.ctrlKey && 'control-mask'].filter(Boolean).join('+');
  }
  send(name, event, more = {}) {
    const modifier_state = this.modifiers(event);
    if (modifier_state) more = { ...more, modifier_state };
    const { x, y } = this.viewer.pixelAt(event);
    return this.viewer.navigate({ event: name, x: x - this.left, y, ...more });
  }

  down(event) {
    this.viewer.video.focus();
    this.viewer.video.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event);
    // Of two pictures side by side, that in which it begins.
    const { eyeWidth } = this.viewer;
    if (this.pointers.size === 1) this.left = this.viewer.pixelAt(event).x < eyeWidth ? 0 : eyeWidth;
    if (this.pointers.size === 2) this.pinch = this.spread();
    // Two fingers pan and pinch; the first is not let go, which would be a click.
    this.send('MouseButtonPress', event, { button: this.pointers.size === 2 ? 2 : event.button + 1 });
    event.preventDefault();
  }

  move(event) {
    if (!this.pointers.has(event.pointerId)) return;
    this.pointers.set(event.pointerId, event);
    if (this.pointers.size < 2) {
      this.send('MouseMove', event);
    } else if (event.pointerId === [...this.pointers.keys()].at(-1)) {
      this.send('MouseMove', event);
      const now = this.spread(), steps = Math.log(now / this.pinch) / Math.log(kPinchStep);
      if (Math.abs(steps) < 0.2) return;
      this.pinch = now;
      this.send('MouseScroll', event, { delta_x: 0, delta_y: steps });
    }
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    this.send('MouseButtonRelease', event, { button: this.pointers.size === 1 ? 2 : event.button + 1 });
  }

  spread() {
    const [a, b] = [...this.pointers.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) || 1;
  }

  turn(event) {
    event.preventDefault();
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * 33;
    this.send('MouseScroll', event, { delta_x: 0, delta_y: -pixels / kWheelStep });
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || this.viewer.path !== null) return;
    // A slider, a list and a field have keys of their own.
    const [at] = event.composedPath();
    if (at.matches('select, input:not([type=range])') || (at.matches('input') && /^(Arrow|Home|End|Page)/.test(event.key))) return;
    if (event.key === '?') return this.viewer.bar.toggleHelp();
    if (event.key === 'Home') return this.viewer.goHome();
    if (event.key === 'i') return this.viewer.toggle('figures', this.viewer.panel);
    if (event.key === 'f') return this.viewer.follow(!this.viewer.follows);
    if (event.key === 'm' && this.viewer.figures.monitored !== false) return this.viewer.toggle('quality', this.viewer.monitor);
    if (event.key === 'c') return this.viewer.toggle('cameras', this.viewer.cameras);
    const key = kKeys[event.key] ?? (kLetters.includes(event.key.toLowerCase()) ? event.key.toLowerCase() : null);
    if (!key) return;
    this.key(key, event);
    event.preventDefault();
  }
  key(key, event = {}) {
    const modifier_state = this.modifiers(event);
    return this.viewer.navigate({ event: 'KeyPress', key, ...modifier_state && { modifier_state } });
  }

  // Left stick orbits, with a shoulder button pans; right stick zooms and focuses; the first button goes home. All in
  // proportion.
  gamepad(now, before = now) {
    const pad = navigator.getGamepads().find(Boolean);
    if (!pad) return;
    const along = axis => {
      const value = pad.axes[axis] ?? 0, beyond = Math.abs(value) - kStickDead;
      return beyond > 0 ? Math.sign(value) * beyond / (1 - kStickDead) : 0;
    };
    const seconds = Math.min(now - before, 100) / 1000;
    this.drag(along(0), along(1), seconds * kStickHeights, [4, 5].some(button => pad.buttons[button]?.pressed));
    const steps = seconds * kStickSteps, scroll = { event: 'MouseScroll', x: 0, y: 0, delta_x: 0 };
    if (along(3)) this.viewer.navigate({ ...scroll, delta_y: -along(3) * steps });
    if (along(2)) this.viewer.navigate({ ...scroll, delta_y: along(2) * steps, modifier_state: 'control-mask' });
    if (pad.buttons[0]?.pressed) this.key('r');
    requestAnimationFrame(next => this.gamepad(next, now));
  }

  // As a mouse would that is held as long as the stick is.
  drag(x, y, heights, pans) {
    if (!x && !y) {
      if (this.held) this.viewer.navigate({ event: 'MouseButtonRelease', ...this.held, button: 1 });
      this.held = null;
      return;
    }
    if (!this.held) {
      this.held = { x: 0, y: 0 };
      this.viewer.navigate({ event: 'MouseButtonPress', ...this.held, button: 1 });
    }
    const { videoHeight } = this.viewer.video;
    this.held = { x: this.held.x + x * heights * videoHeight, y: this.held.y + y * heights * videoHeight };
    this.viewer.navigate({ event: 'MouseMove', ...this.held, ...pans && { modifier_state: 'shift-mask' } });
  }
}
