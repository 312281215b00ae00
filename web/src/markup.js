// SPDX-License-Identifier: LGPL-2.1-or-later
// The element's shadow tree and its style sheet. The README lists slots and parts.

import { kModes } from './picture.js';

// Creates elements without innerHTML, which pages with `require-trusted-types-for 'script'` forbid.

const kSvg = new Set(['svg', 'path', 'circle']);

// The value true adds an attribute without a value, and false omits the attribute. `children` are elements and texts.
function make(name, attributes = {}, ...children) {
  const element = kSvg.has(name) ? document.createElementNS('http://www.w3.org/2000/svg', name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes))
    if (value !== false) element.setAttribute(key, value === true ? '' : value);
  element.append(...children);
  return element;
}

const kUnseen = { 'aria-hidden': 'true' };
const path = d => make('path', { d });
const circle = (cx, cy, r) => make('circle', { cx, cy, r });
const icon = (...shapes) => make('svg', { viewBox: '0 0 24 24', ...kUnseen }, ...shapes);
const button = (name, label, title, ...shapes) => make('button', { class: name, title }, icon(...shapes), label);
const toggle = (...words) => {
  const made = button(...words);
  made.setAttribute('aria-pressed', 'false');
  return made;
};

const kDescription = 'Click to focus, double-click to return to the start, press f to keep the clicked point in focus. ' +
  'Arrow keys orbit the scene, w s a d q e fly, plus and minus zoom, square brackets move the focus, r returns to the ' +
  'start, c shows the cameras, m their quality, i shows statistics, a question mark shows all gestures.';

function makePicture() {
  const video = make('video', { part: 'video', autoplay: true, playsinline: true, muted: true });
  video.muted = true;  // the attribute alone mutes only parsed elements
  return make(
      'div', {class: 'picture'}, video,
      ...['anaglyph', 'cameras', 'last', 'redrawn'].map(
          name => make('canvas', {class: name, hidden: true, ...kUnseen})),
      make(
          'div', {class: 'poster'},
          make('slot', {name: 'poster'}, make('img', {part: 'poster', alt: '', hidden: true}))),
      make('div', {class: 'frame'}));
}

const makeStatus = () => make('div', { class: 'status', role: 'status', hidden: true },
  make('slot', { name: 'error' }, make('div', { part: 'notice' },
    make('p', { class: 'why' }),
    make('progress', { max: 1, 'aria-label': 'Done', hidden: true }),
    make('form', { hidden: true },
      make('input', { type: 'password', name: 'token', 'aria-label': 'Token', placeholder: 'token',
        autocomplete: 'current-password', required: true }),
      make('button', {}, 'Watch')),
    make('button', { class: 'again', hidden: true }, 'Try again'))));

function makeBar() {
  const quality = toggle('quality', 'Quality', 'Quality of each camera (key m)', path('M4 13l5 5L20 6'));
  quality.hidden = true;
  return make('div', { class: 'bar', part: 'controls' },
    make('label', {}, 'Focus ',
      make('input', { type: 'range', min: 0, max: 1, step: 0.01, value: 0.5, 'aria-label': 'Distance in focus' }),
      make('span', { class: 'distance', ...kUnseen })),
    toggle('sweep', 'Sweep', 'Moves the focus through the scene and back', path('M4 12h16M8 8l-4 4 4 4M16 8l4 4-4 4')),
    toggle('follow', 'Follow', 'Keeps the last clicked point in focus (key f)', circle(12, 12, 6), path('M12 2v5M12 17v5M2 12h5M17 12h5')),
    toggle('tilt', 'Tilt', 'Turning the phone moves the view', path('M8 3h8v18H8zM4 8l-2 4 2 4M20 8l2 4-2 4')),
    button('home', 'Home', 'Back to the start view (key r, double click)', path('M4 11l8-7 8 7M6 10v10h12V10')),
    make('select', { 'aria-label': 'Eyes', title: 'Picture for one eye or for two' },
      ...Object.entries(kModes).map(([value, name]) => make('option', { value }, name))),
    toggle('cameras', 'Cameras', 'Cameras that contribute to the picture (key c)', path('M3 8h4l2-3h6l2 3h4v11H3z'), circle(12, 13, 3.5)),
    toggle('figures', 'Figures', 'Frames per second, latency, bytes (key i)', path('M5 20V11M12 20V4M19 20v-6')),
    quality,
    button('share', 'Share', 'Copies a link to exactly this view', path('M12 15V3M8 7l4-4 4 4M5 12v8h14v-8')),
    button('full', 'Full screen', 'Show only the picture', path('M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5')),
    button('help', 'Help', 'Gestures and keys (key ?)', circle(12, 12, 9),
      path('M9.5 9.5a2.5 2.5 0 1 1 3.5 2.3c-.7.4-1 .8-1 1.7M12 16.5v.2')));
}

const hand = (x, y) => ['circle', { class: 'hand', cx: x, cy: y, r: 4 }];
const ring = (x, y, r) => ['circle', { cx: x, cy: y, r }];
const arrow = (x1, y1, x2, y2) => {
  const angle = Math.atan2(y2 - y1, x2 - x1), tip = turn => `${x2 - 5 * Math.cos(angle + turn)} ${y2 - 5 * Math.sin(angle + turn)}`;
  return ['path', { d: `M${x1} ${y1}L${x2} ${y2}M${tip(0.5)}L${x2} ${y2}L${tip(-0.5)}` }];
};

const kGestures = [
  [[hand(14, 16), arrow(22, 16, 42, 16)], 'Drag', 'orbit the point in focus'],
  [[hand(10, 10), hand(10, 22), arrow(20, 16, 42, 16)], 'Two fingers, or shift and drag', 'move sideways'],
  [[hand(12, 26), hand(36, 6), arrow(20, 20, 14, 25), arrow(28, 12, 34, 7)], 'Pinch, or wheel', 'zoom at the pointer'],
  [[hand(24, 16), ring(24, 16, 9)], 'Tap, or click', 'focus at the pointer'],
  [[hand(24, 16), ring(24, 16, 8), ring(24, 16, 12)], 'Double tap, or double click', 'back to the start'],
];
const kKeys = [['← ↑ ↓ →', 'orbit'], ['w a s d q e', 'fly'], ['+ −', 'zoom'], ['[ ]', 'focus nearer, farther'],
  ['f', 'keep the clicked point in focus'], ['r', 'back to the start'], ['c', 'cameras'], ['i', 'figures'],
  ['m', 'quality'], ['?', 'this page']];

const gesture = ([shapes, name, does]) => make('li', {},
  make('svg', { viewBox: '0 0 48 32', 'aria-hidden': 'true' }, ...shapes.map(([shape, attributes]) => make(shape, attributes))),
  make('span', {}, make('b', {}, name), ` ${does}`));
const keys = ([names, does]) => make('div', {},
  make('dt', {}, ...names.split(' ').flatMap((name, i) => [i ? ' ' : '', make('kbd', {}, name)])), make('dd', {}, does));

const makeHelp = () => [
  make('header', {}, make('h2', {}, 'How to fly'), make('button', {}, 'Close')),
  make('ul', {}, ...kGestures.map(gesture)),
  make('dl', {}, ...kKeys.map(keys)),
  make('a', { target: '_blank', rel: 'noopener' }, 'All cameras, live'),
];

export const makeStage = () => make('div', { class: 'stage' },
  makePicture(),
  make('div', { class: 'vignette', part: 'vignette', ...kUnseen }),
  make('button', { class: 'start', part: 'start', 'aria-label': 'Watch', hidden: true }, icon(path('M8 5l12 7-12 7z'))),
  make('div', { class: 'hint', part: 'hint', ...kUnseen }),
  make('p', { class: 'trouble', part: 'trouble', hidden: true, ...kUnseen }),
  make('pre', { class: 'makers', hidden: true, role: 'group', 'aria-label': 'Cameras that make the pixel at the pointer' }),
  make('pre', { class: 'figures', part: 'figures', hidden: true, role: 'group', 'aria-label': 'Figures' }),
  make('div', { class: 'monitor', part: 'quality', hidden: true, role: 'group', 'aria-label': 'Quality of the cameras' },
    make('canvas', kUnseen), make('pre')),
  make('div', { class: 'said', role: 'log', 'aria-label': 'What happened' }),
  makeStatus(),
  make('slot', { name: 'controls' }, makeBar()),
  make('div', { class: 'guide', hidden: true, role: 'dialog', 'aria-label': 'How to fly' }, make('div', { part: 'help' }, ...makeHelp())),
  make('span', { id: 'description', hidden: true }, kDescription));

// The style sheet, light and dark. Pages change it with the properties --lightfield-... and with parts.

export const style = `
  :host { display: block; position: relative; width: 640px; height: 480px; max-width: 100%; box-sizing: border-box;
    min-width: 64px; min-height: 64px; overflow: hidden; container-type: inline-size; color-scheme: light dark;
    background: var(--lightfield-background, #000); font: 14px/1.4 system-ui, sans-serif; text-align: start;
    --text: var(--lightfield-text, #fff); --panel: var(--lightfield-panel, rgb(20 22 26 / .84));
    --button: var(--lightfield-button, rgb(58 62 70 / .9)); --line: var(--lightfield-line, #8a8f98);
    --on: var(--lightfield-pressed, #14518f); --mark: var(--lightfield-accent, #6cf); color: var(--text); }
  @media (prefers-color-scheme: light) {
    :host { --text: var(--lightfield-text, #111); --panel: var(--lightfield-panel, rgb(250 250 250 / .88));
      --button: var(--lightfield-button, rgb(255 255 255 / .95)); --line: var(--lightfield-line, #6a6f78);
      --on: var(--lightfield-pressed, #bfe0ff); --mark: var(--lightfield-accent, #0a5cc2); }
  }
  :host([hidden]) { display: none; }
  .stage, .picture { position: absolute; inset: 0; overflow: hidden; }
  .picture { transition: transform .3s cubic-bezier(.2, .8, .3, 1); }
  video { width: 100%; height: 100%; object-fit: contain; display: block; outline: none; }
  :host([controls]) video { touch-action: pan-y; cursor: grab; }
  :host([controls]:focus-within) video, :host([controls]:fullscreen) video { touch-action: none; }
  :host([controls]) video:active { cursor: grabbing; }
  :host([controls]) .idle video { cursor: none; }
  canvas { position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none; z-index: 1; }
  canvas.redrawn, canvas.anaglyph, canvas.last { object-fit: contain; z-index: 0; }
  .fills video, .fills canvas:is(.redrawn, .anaglyph, .last) { object-fit: cover; }
  .poster, ::slotted([slot=poster]) { position: absolute; inset: 0; width: 100%; height: 100%; }
  .poster { z-index: 0; }
  .poster img { width: 100%; height: 100%; object-fit: contain; display: block; }
  .watches :is(canvas.cameras, .makers) { display: none; }
  .told canvas:is(.last, .redrawn), .told .poster { filter: brightness(.5); }
  .start { position: absolute; inset: 0; margin: auto; width: 84px; height: 84px; border-radius: 50%; z-index: 2; padding: 0; }
  .start svg { width: 40px; height: 40px; fill: currentcolor; }
  .vignette { position: absolute; inset: 0; pointer-events: none;
    background: linear-gradient(to right, #000 var(--left, -15%), transparent calc(var(--left, -15%) + 15%)),
      linear-gradient(to left, #000 var(--right, -15%), transparent calc(var(--right, -15%) + 15%)),
      linear-gradient(to bottom, #000 var(--top, -15%), transparent calc(var(--top, -15%) + 15%)),
      linear-gradient(to top, #000 var(--bottom, -15%), transparent calc(var(--bottom, -15%) + 15%)); }
  .frame { position: absolute; inset: 0; pointer-events: none; z-index: 1; }
  .keys video:focus-visible ~ .frame { box-shadow: inset 0 0 0 2px var(--mark); }
  .bar { position: absolute; left: 0; right: 0; bottom: 0; z-index: 2; display: flex; gap: 6px 8px; align-items: center;
    flex-wrap: wrap; padding: 8px 12px calc(8px + env(safe-area-inset-bottom)); background: var(--panel);
    transition: opacity .25s, translate .25s; }
  .idle .bar:not(:focus-within) { opacity: 0; translate: 0 30%; pointer-events: none; }
  .waiting .bar, .waiting ::slotted([slot=controls]), .begins .bar { display: none; }
  .stage:has(.guide:not([hidden])) .bar { visibility: hidden; }
  .hint { position: absolute; left: 50%; top: 50%; translate: -50% -50%; padding: 8px 14px; border-radius: 8px; z-index: 2;
    background: var(--panel); opacity: 0; transition: opacity .25s; pointer-events: none; white-space: nowrap; }
  .hint.on { opacity: 1; }
  .trouble { position: absolute; left: 50%; top: 8px; translate: -50% 0; margin: 0; padding: 4px 10px; border-radius: 8px; z-index: 1;
    background: var(--panel); font-size: 12px; pointer-events: none; width: max-content; max-width: calc(100% - 32px);
    box-sizing: border-box; }
  progress { width: 100%; accent-color: var(--mark); }
  @media (prefers-reduced-motion: reduce) { .bar, .hint, .picture { transition: none; } }
  label { display: flex; gap: 8px; align-items: center; flex: 1 1 200px; white-space: nowrap; }
  .distance { min-width: 6ch; text-align: right; font-variant-numeric: tabular-nums; }
  input[type=range] { flex: 1; width: 0; min-width: 70px; height: 28px; accent-color: var(--mark); }
  button, select, input[type=password] { font: inherit; color: inherit; background: var(--button);
    border: 1px solid var(--line); border-radius: 6px; padding: 6px 10px; min-height: 36px; }
  button { display: inline-flex; gap: 6px; align-items: center; justify-content: center; cursor: pointer; }
  button svg { width: 18px; height: 18px; flex: none; }
  svg { fill: none; stroke: currentcolor; stroke-width: 1.8; stroke-linecap: round; stroke-linejoin: round; }
  button[aria-pressed=true] { background: var(--on); }
  :focus-visible { outline: 2px solid var(--mark); outline-offset: 1px; }
  pre { position: absolute; left: 8px; top: 8px; margin: 0; padding: 6px 8px; background: var(--panel);
    font: 12px/1.35 ui-monospace, monospace; pointer-events: none; max-width: calc(100% - 32px); overflow: hidden;
    white-space: pre-wrap; }
  .monitor { position: absolute; right: 8px; top: 8px; padding: 8px; background: var(--panel); pointer-events: none;
    max-width: min(380px, calc(100% - 32px)); z-index: 1; }
  .monitor canvas { position: static; display: block; width: auto; height: auto; margin-bottom: 6px; }
  .monitor pre { position: static; padding: 0; background: none; max-width: none; }
  pre.makers { left: 0; top: 0; z-index: 1; }
  .status, .guide { position: absolute; inset: 0; z-index: 3; display: grid; place-content: safe center; pointer-events: none; }
  .status [part=notice], .status ::slotted([slot=error]) { pointer-events: auto; }
  .status [part=notice] { display: grid; gap: 10px; justify-items: center; text-align: center;
    padding: 14px 20px; margin: 12px; border-radius: 10px; background: var(--panel); max-width: 36ch; }
  .status p { margin: 0; }
  form { display: flex; gap: 6px; flex-wrap: wrap; justify-content: center; }
  .guide { pointer-events: auto; background: rgb(0 0 0 / .4); overflow: auto; }
  .guide > div { padding: 12px 20px 16px; margin: 12px; border-radius: 10px; background: var(--panel);
    width: min(700px, 100cqw - 24px); box-sizing: border-box; display: grid; gap: 10px; justify-items: start; }
  .guide header { display: flex; justify-content: space-between; align-items: center; width: 100%; }
  .guide a { color: inherit; }
  .guide h2 { margin: 0; font-size: 18px; }
  .guide ul, .guide dl { margin: 0; padding: 0; list-style: none; display: grid; gap: 6px 18px;
    grid-template-columns: repeat(auto-fit, minmax(min(100%, 260px), 1fr)); width: 100%; }
  .guide li { display: flex; gap: 8px; align-items: center; }
  .guide li b { font-weight: 600; }
  .guide li svg { width: 48px; height: 32px; flex: none; }
  .guide .hand { fill: currentcolor; stroke: none; }
  .guide dl div { display: flex; gap: 10px; }
  .guide dt { min-width: 16ch; }
  .guide dd { margin: 0; }
  kbd { font: 12px ui-monospace, monospace; border: 1px solid var(--line); border-radius: 4px; padding: 1px 5px; }
  @container (max-width: 1100px) {
    .bar { gap: 5px; padding: 6px 8px calc(6px + env(safe-area-inset-bottom)); }
    .bar button, .bar select { padding: 4px 3px; min-height: 44px; font-size: 12px; }
    .bar button { flex-direction: column; gap: 0; }
    .bar select { width: 86px; }
    label { flex-basis: 120px; gap: 5px; }
    input[type=range] { min-width: 54px; }
  }
  @container (max-width: 720px) {
    .bar { display: grid; grid-template-columns: repeat(5, 1fr); }
    .bar label { grid-column: 1 / -1; }
    .bar button, .bar select { min-width: 0; width: auto; padding: 2px; font-size: 11px; line-height: 1.15; }
    pre { font-size: 10px; }
  }
  .said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  [hidden] { display: none !important; }`;
