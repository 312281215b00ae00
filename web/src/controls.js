// SPDX-License-Identifier: LGPL-2.1-or-later
// Converts mouse, pen, touch, wheel, keyboard and gamepad input to the navigation events of GStreamer's windows. The
// page scrolls normally until the user clicks the picture; then the viewer receives the wheel and all touches.

const kKeys = { ArrowLeft: 'Left', ArrowRight: 'Right', ArrowUp: 'Up', ArrowDown: 'Down', '+': 'plus', '=': 'plus',
  '-': 'minus', '[': 'bracketleft', ']': 'bracketright' };
const kLetters = 'wsadqe';
const kWheelStep = 100;     // pixels of wheel movement per step
const kShift = 50;          // pixels per step with the shift key, which changes the focus
const kPinchStep = 1.1;
const kStickDead = 0.15;
const kStickHeights = 0.5;  // picture heights per second at full deflection
const kStickSteps = 5;  // wheel steps per second
const kGlideTime = 70;          // time constant of the glide after a drag, milliseconds
// maximum speed at the start and minimum speed at the end of a glide, CSS pixels per millisecond
const kFast = 0.8, kSlow = 0.02;
const kSpeedWindow = 100;         // the speed is measured over this time at the end of a drag, milliseconds

export class Controls {
  constructor(viewer) {
    this.viewer = viewer;
    this.pointers = new Map();
    this.left = 0;
    const { video, host } = viewer;
    video.addEventListener('pointerdown', event => this.flies && this.down(event));
    video.addEventListener('pointermove', event => this.move(event));
    video.addEventListener('pointerup', event => this.up(event));
    video.addEventListener('pointercancel', event => this.cancel(event));
    video.addEventListener('wheel', event => this.flies && this.turn(event), { passive: false });
    video.addEventListener('dblclick', () => this.flies && this.viewer.flight.goHome('person'));
    video.addEventListener('contextmenu', event => this.flies && event.preventDefault());
    host.addEventListener('keydown', event => this.flies && this.press(event));
    this.pads = () => requestAnimationFrame(now => this.gamepad(now));
  }
  watch() { addEventListener('gamepadconnected', this.pads); }
  rest() {
    removeEventListener('gamepadconnected', this.pads);
    this.settle();
  }

  get flies() { return this.viewer.host.hasAttribute('controls') && this.viewer.isInteractive; }
  get isHeld() { return this.viewer.host.matches(':focus-within') || this.viewer.host.matches(':fullscreen'); }
  navigate(event) {
    this.viewer.flight.interrupt();
    return this.viewer.send({ type: 'navigationEvent', event }, 'person');
  }

  modifiers(event) {
    return [event.shiftKey && 'shift-mask', event.ctrlKey && 'control-mask'].filter(Boolean).join('+');
  }
  send(name, event, more = {}) {
    const modifier_state = this.modifiers(event);
    if (modifier_state) more = { ...more, modifier_state };
    const { x, y } = this.viewer.picture.pixelAt(event);
    const id = this.navigate({ event: name, x: x - this.left, y, ...more });
    if (name === 'MouseMove' && this.pointers.size < 2) this.viewer.elastic.pulled(id, event);
    return id;
  }

  down(event) {
    const { viewer } = this;
    this.settle();
    viewer.video.focus({ preventScroll: true });
    viewer.video.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event);
    // If two pictures are side by side, a gesture belongs to the picture under its start.
    const { eyeWidth } = viewer.picture;
    if (this.pointers.size === 1) this.left = viewer.picture.pixelAt(event).x < eyeWidth ? 0 : eyeWidth;
    if (this.pointers.size === 2) this.pinch = this.spread();
    // Two fingers pan and pinch. The first finger is then not reported as released, because that would be a click.
    this.send('MouseButtonPress', event, { button: this.pointers.size === 2 ? 2 : event.button + 1 });
    viewer.elastic.begin(event);
    event.preventDefault();
  }

  move(event) {
    if (!this.pointers.has(event.pointerId)) return;
    const before = this.pointers.get(event.pointerId);
    this.pointers.set(event.pointerId, event);
    if (this.pointers.size < 2) {
      this.trail = [...(this.trail ?? [before]).filter(({ timeStamp }) => timeStamp > event.timeStamp - kSpeedWindow), event];
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
    const speed = this.speedAt(event.timeStamp), button = this.pointers.size === 1 ? 2 : event.button + 1;
    this.trail = null;
    const release = at => this.send('MouseButtonRelease', at, { button });
    this.viewer.elastic.end();
    if (this.pointers.size || !speed ||
        matchMedia('(prefers-reduced-motion: reduce)').matches) return release(event);
    this.glide(event, speed, release);
  }
  // The browser scrolls the page instead, so this is not a click.
  cancel(event) {
    if (!this.pointers.has(event.pointerId)) return;
    this.send('MouseButtonPress', event, { button: 2 });
    this.trail = null;
    this.up(event);
  }
  speedAt(time) {
    const trail = this.trail?.filter(({ timeStamp }) => timeStamp > time - kSpeedWindow);
    if (!(trail?.length > 1)) return null;
    const [x, y] = ['clientX', 'clientY'].map(name => (trail.at(-1)[name] - trail[0][name]) / kSpeedWindow);
    const speed = Math.hypot(x, y), share = Math.min(1, kFast / speed);
    return speed > kSlow ? { x: x * share, y: y * share } : null;
  }

  glide(event, { x, y }, release) {
    const { shiftKey, ctrlKey } = event, at = { clientX: event.clientX, clientY: event.clientY, shiftKey, ctrlKey };
    this.release = () => release(at);
    let before = performance.now();
    const step = now => {
      const time = Math.max(0, now - before), left = Math.exp(-time / kGlideTime);
      before = now;
      [at.clientX, at.clientY] = [at.clientX + x * time, at.clientY + y * time];
      [x, y] = [x * left, y * left];
      this.send('MouseMove', at);
      if (Math.hypot(x, y) < kSlow) return this.settle();
      this.gliding = requestAnimationFrame(step);
    };
    this.gliding = requestAnimationFrame(step);
  }
  settle() {
    if (this.gliding === undefined) return;
    cancelAnimationFrame(this.gliding);
    this.gliding = undefined;
    this.release();
  }

  spread() {
    const [a, b] = [...this.pointers.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) || 1;
  }

  turn(event) {
    if (!event.ctrlKey && !this.isHeld) return this.viewer.bar.hint();
    event.preventDefault();
    const scale = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 33;
    const steps = -(event.deltaY || event.deltaX) * scale;
    const { x, y } = this.viewer.picture.pixelAt(event), scroll = { event: 'MouseScroll', x, y, delta_x: 0 };
    if (event.shiftKey) return this.navigate({ ...scroll, delta_y: steps / kShift, modifier_state: 'control-mask' });
    this.navigate({ ...scroll, delta_y: steps / kWheelStep });
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    // Sliders, lists and input fields handle these keys themselves.
    const [at] = event.composedPath();
    if (at.matches('select, input:not([type=range])') || (at.matches('input') && /^(Arrow|Home|End|Page)/.test(event.key))) return;
    const { viewer } = this, own = {
      '?': () => viewer.bar.toggleHelp(),
      Home: () => viewer.flight.goHome('person'),
      r: () => viewer.flight.goHome('person'),
      R: () => viewer.flight.goHome('person'),
      i: () => viewer.toggle('figures', viewer.panel),
      f: () => viewer.flight.follow(!viewer.flight.follows, 'person'),
      m: () => viewer.statistics.monitored && viewer.toggle('quality', viewer.monitor),
      c: () => viewer.toggle('cameras', viewer.cameras),
    };
    if (Object.hasOwn(own, event.key)) return own[event.key]();
    const key = kKeys[event.key] ?? (kLetters.includes(event.key.toLowerCase()) ? event.key.toLowerCase() : null);
    if (!key) return;
    this.settle();
    this.key(key, event);
    event.preventDefault();
  }
  key(key, event = {}) {
    const modifier_state = this.modifiers(event);
    return this.navigate({ event: 'KeyPress', key, ...modifier_state && { modifier_state } });
  }

  // The left stick orbits, or pans while a shoulder button is pressed. The right stick zooms and focuses, and the first
  // button returns home. Speeds are proportional to the deflection.
  gamepad(now, before = now) {
    const pad = navigator.getGamepads().find(Boolean);
    if (!pad || !this.viewer.host.isConnected) return;
    requestAnimationFrame(next => this.gamepad(next, now));
    if (!this.flies) return;
    const along = axis => {
      const value = pad.axes[axis] ?? 0, beyond = Math.abs(value) - kStickDead;
      return beyond > 0 ? Math.sign(value) * beyond / (1 - kStickDead) : 0;
    };
    const seconds = Math.min(now - before, 100) / 1000;
    this.drag(along(0), along(1), seconds * kStickHeights, [4, 5].some(button => pad.buttons[button]?.pressed));
    const steps = seconds * kStickSteps, scroll = { event: 'MouseScroll', x: 0, y: 0, delta_x: 0 };
    if (along(3)) this.navigate({ ...scroll, delta_y: -along(3) * steps });
    if (along(2)) this.navigate({ ...scroll, delta_y: along(2) * steps, modifier_state: 'control-mask' });
    const pressed = pad.buttons[0]?.pressed ?? false;
    if (pressed && !this.padPressed) this.viewer.flight.goHome('person');
    this.padPressed = pressed;
  }

  drag(x, y, heights, pans) {
    if (!x && !y) {
      if (this.held) this.navigate({ event: 'MouseButtonRelease', ...this.held, button: 1 });
      this.held = null;
      return;
    }
    if (!this.held) {
      this.held = { x: 0, y: 0 };
      this.navigate({ event: 'MouseButtonPress', ...this.held, button: 1 });
    }
    const { videoHeight } = this.viewer.video;
    this.held = { x: this.held.x + x * heights * videoHeight, y: this.held.y + y * heights * videoHeight };
    this.navigate({ event: 'MouseMove', ...this.held, ...pans && { modifier_state: 'shift-mask' } });
  }
}
