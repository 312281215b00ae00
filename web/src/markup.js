// SPDX-License-Identifier: LGPL-2.1-or-later
// The element's shadow tree. Its slots and parts are named in the README.

import { makeHelp } from './help.js';
import { make } from './make.js';
import { kModes } from './stereo.js';

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

const kDescription = 'A click focuses on what is there, a double click goes back to the start, f keeps in focus what was clicked. ' +
  'Arrow keys turn around the scene, w s a d q e fly, plus and minus zoom, square brackets move the focus, r goes back to the ' +
  'start, c shows the cameras, m how well they fit together, i shows figures, a question mark shows all gestures.';

function makePicture() {
  const video = make('video', { part: 'video', autoplay: true, playsinline: true, muted: true });
  video.muted = true;  // the attribute alone mutes only what a parser makes
  return make('div', { class: 'picture' },
    video,
    ...['anaglyph', 'cameras', 'last'].map(name => make('canvas', { class: name, hidden: true, ...kUnseen })),
    make('div', { class: 'poster' }, make('slot', { name: 'poster' }, make('img', { part: 'poster', alt: '', hidden: true }))),
    make('div', { class: 'frame' }));
}

// Says why there is no picture, and what can be done.
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
  const quality = toggle('quality', 'Quality', 'How well the cameras fit together (key m)', path('M4 13l5 5L20 6'));
  quality.hidden = true;
  return make('div', { class: 'bar', part: 'controls' },
    make('label', {}, 'Focus ',
      make('input', { type: 'range', min: 0, max: 1, step: 0.01, value: 0.5, 'aria-label': 'Distance of what is sharp' }),
      make('span', { class: 'distance', ...kUnseen })),
    toggle('sweep', 'Sweep', 'Moves the focus through the scene and back', path('M4 12h16M8 8l-4 4 4 4M16 8l4 4-4 4')),
    toggle('follow', 'Follow', 'Keeps what was clicked last in focus (key f)', circle(12, 12, 6), path('M12 2v5M12 17v5M2 12h5M17 12h5')),
    button('home', 'Home', 'Back to where the flight began (key r, double click)', path('M4 11l8-7 8 7M6 10v10h12V10')),
    make('select', { 'aria-label': 'Eyes', title: 'A picture for one eye, or for two' },
      ...Object.entries(kModes).map(([value, name]) => make('option', { value }, name))),
    toggle('cameras', 'Cameras', 'Which cameras make the picture (key c)', path('M3 8h4l2-3h6l2 3h4v11H3z'), circle(12, 13, 3.5)),
    toggle('figures', 'Figures', 'Frames per second, latency, bytes (key i)', path('M5 20V11M12 20V4M19 20v-6')),
    quality,
    button('share', 'Share', 'Copies a link to exactly this view', path('M12 15V3M8 7l4-4 4 4M5 12v8h14v-8')),
    button('full', 'Full screen', 'The picture alone', path('M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5')),
    button('help', 'Help', 'Gestures and keys (key ?)', circle(12, 12, 9),
      path('M9.5 9.5a2.5 2.5 0 1 1 3.5 2.3c-.7.4-1 .8-1 1.7M12 16.5v.2')));
}

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
