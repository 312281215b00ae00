// SPDX-License-Identifier: LGPL-2.1-or-later
// What the element is made of. Its slots and parts are named in the README.

import { help } from './help.js';
import { kModes } from './stereo.js';

const icon = paths => `<svg viewBox="0 0 24 24" aria-hidden="true">${paths}</svg>`;
const button = (name, label, title, paths, toggles = true, more = '') =>
  `<button class="${name}" ${toggles ? 'aria-pressed="false"' : ''} ${more} title="${title}">${icon(paths)}${label}</button>`;

export const markup = `<div class="stage">
  <div class="picture">
    <video part="video" autoplay playsinline muted></video>
    <canvas class="anaglyph" hidden aria-hidden="true"></canvas>
    <canvas class="cameras" hidden aria-hidden="true"></canvas>
    <canvas class="last" hidden aria-hidden="true"></canvas>
    <div class="poster"><slot name="poster"><img part="poster" alt="" hidden></slot></div>
    <div class="frame"></div>
  </div>
  <div class="vignette" part="vignette" aria-hidden="true"></div>
  <button class="start" part="start" aria-label="Watch" hidden>${icon('<path d="M8 5l12 7-12 7z"/>')}</button>
  <div class="hint" part="hint" aria-hidden="true"></div>
  <p class="trouble" part="trouble" hidden aria-hidden="true"></p>
  <pre class="makers" hidden role="group" aria-label="Cameras that make the pixel at the pointer"></pre>
  <pre class="figures" part="figures" hidden role="group" aria-label="Figures"></pre>
  <div class="monitor" part="quality" hidden role="group" aria-label="Quality of the cameras"><canvas aria-hidden="true"></canvas>
    <pre></pre></div>
  <div class="said" role="log" aria-label="What happened"></div>
  <div class="status" role="status" hidden><slot name="error"><div part="notice">
    <p class="why"></p>
    <progress max="1" aria-label="Done" hidden></progress>
    <form hidden><input type="password" name="token" aria-label="Token" placeholder="token" autocomplete="current-password"
      required><button>Watch</button></form>
    <button class="again" hidden>Try again</button>
  </div></slot></div>
  <slot name="controls"><div class="bar" part="controls">
    <label>Focus
      <input type="range" min="0" max="1" step="0.01" value="0.5" aria-label="Distance of what is sharp"><span class="distance" aria-hidden="true"></span></label>
    ${button('sweep', 'Sweep', 'Moves the focus through the scene and back', '<path d="M4 12h16M8 8l-4 4 4 4M16 8l4 4-4 4"/>')}
    ${button('follow', 'Follow', 'Keeps what was clicked last in focus (key f)',
    '<circle cx="12" cy="12" r="6"/><path d="M12 2v5M12 17v5M2 12h5M17 12h5"/>')}
    ${button('home', 'Home', 'Back to where the flight began (key r, double click)',
    '<path d="M4 11l8-7 8 7M6 10v10h12V10"/>', false)}
    <select aria-label="Eyes" title="A picture for one eye, or for two">
      ${Object.entries(kModes).map(([mode, name]) => `<option value="${mode}">${name}</option>`).join('')}
    </select>
    ${button('cameras', 'Cameras', 'Which cameras make the picture (key c)',
    '<path d="M3 8h4l2-3h6l2 3h4v11H3z"/><circle cx="12" cy="13" r="3.5"/>')}
    ${button('figures', 'Figures', 'Frames per second, latency, bytes (key i)', '<path d="M5 20V11M12 20V4M19 20v-6"/>')}
    ${button('quality', 'Quality', 'How well the cameras fit together (key m)', '<path d="M4 13l5 5L20 6"/>', true, 'hidden')}
    ${button('share', 'Share', 'Copies a link to exactly this view',
    '<path d="M12 15V3M8 7l4-4 4 4M5 12v8h14v-8"/>', false)}
    ${button('full', 'Full screen', 'The picture alone', '<path d="M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5"/>', false)}
    ${button('help', 'Help', 'Gestures and keys (key ?)',
    '<circle cx="12" cy="12" r="9"/><path d="M9.5 9.5a2.5 2.5 0 1 1 3.5 2.3c-.7.4-1 .8-1 1.7M12 16.5v.2"/>', false)}
  </div></slot>
  <div class="guide" hidden role="dialog" aria-label="How to fly"><div part="help">${help}</div></div>
  <span id="description" hidden>A click focuses on what is there, a double click goes back to the start, f keeps in focus what was
    clicked. Arrow keys turn around the scene, w s a d q e fly, plus and minus zoom, square brackets move the focus, r goes back to the
    start, c shows the cameras, m how well they fit together, i shows figures, a question mark shows all gestures.</span>
</div>`;
