// SPDX-License-Identifier: LGPL-2.1-or-later
// The help page: gestures as pictures, and keys.

import { make } from './make.js';

const hand = (x, y) => ['circle', { class: 'hand', cx: x, cy: y, r: 4 }];
const ring = (x, y, r) => ['circle', { cx: x, cy: y, r }];
const arrow = (x1, y1, x2, y2) => {
  const angle = Math.atan2(y2 - y1, x2 - x1), tip = turn => `${x2 - 5 * Math.cos(angle + turn)} ${y2 - 5 * Math.sin(angle + turn)}`;
  return ['path', { d: `M${x1} ${y1}L${x2} ${y2}M${tip(0.5)}L${x2} ${y2}L${tip(-0.5)}` }];
};

const kGestures = [
  [[hand(14, 16), arrow(22, 16, 42, 16)], 'Drag', 'look around what is in focus'],
  [[hand(10, 10), hand(10, 22), arrow(20, 16, 42, 16)], 'Two fingers, or shift and drag', 'go sideways'],
  [[hand(12, 26), hand(36, 6), arrow(20, 20, 14, 25), arrow(28, 12, 34, 7)], 'Pinch, or wheel', 'zoom on what is there'],
  [[hand(24, 16), ring(24, 16, 9)], 'Tap, or click', 'focus on what is there'],
  [[hand(24, 16), ring(24, 16, 8), ring(24, 16, 12)], 'Double tap, or double click', 'back to the start'],
];
const kKeys = [['← ↑ ↓ →', 'look around'], ['w a s d q e', 'fly'], ['+ −', 'zoom'], ['[ ]', 'focus nearer, farther'],
  ['f', 'keep in focus what was clicked'], ['r', 'back to the start'], ['c', 'cameras'], ['i', 'figures'],
  ['m', 'quality'], ['?', 'this page']];

const gesture = ([shapes, name, does]) => make('li', {},
  make('svg', { viewBox: '0 0 48 32', 'aria-hidden': 'true' }, ...shapes.map(([shape, attributes]) => make(shape, attributes))),
  make('span', {}, make('b', {}, name), ` ${does}`));
const keys = ([names, does]) => make('div', {},
  make('dt', {}, ...names.split(' ').flatMap((name, i) => [i ? ' ' : '', make('kbd', {}, name)])), make('dd', {}, does));

export const makeHelp = () => [
  make('header', {}, make('h2', {}, 'How to fly'), make('button', {}, 'Close')),
  make('ul', {}, ...kGestures.map(gesture)),
  make('dl', {}, ...kKeys.map(keys)),
  make('a', { target: '_blank', rel: 'noopener' }, 'All cameras, live'),
];
