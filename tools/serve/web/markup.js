// SPDX-License-Identifier: LGPL-2.1-or-later
// What the element is made of.

import { help } from './help.js';
import { kModes } from './stereo.js';

export const sheet = new CSSStyleSheet();  // not a <style>, which strict pages forbid
sheet.replaceSync(`
  :host { display: block; position: relative; background: #000; font: 14px/1.4 system-ui, sans-serif;
    min-width: 64px; min-height: 64px; overflow: hidden; container-type: inline-size; color-scheme: light dark;
    --text: #fff; --panel: rgb(20 22 26 / .84); --button: rgb(58 62 70 / .9); --line: #8a8f98; --on: #14518f;
    --mark: #6cf; color: var(--text); }
  @media (prefers-color-scheme: light) {
    :host { --text: #111; --panel: rgb(250 250 250 / .88); --button: rgb(255 255 255 / .95); --line: #6a6f78;
      --on: #bfe0ff; --mark: #0a5cc2; }
  }
  video { width: 100%; height: 100%; object-fit: contain; display: block; touch-action: none; cursor: grab;
    outline: none; }
  video:active { cursor: grabbing; }
  :host([idle]) video { cursor: none; }
  canvas { position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none; z-index: 1; }
  canvas.anaglyph, canvas.last { object-fit: contain; z-index: 0; }
  canvas.last { filter: brightness(.5); }
  .vignette { position: absolute; inset: 0; pointer-events: none; opacity: 0; transition: opacity .3s;
    box-shadow: inset 0 0 min(18cqw, 160px) min(6cqw, 50px) #000; }
  .frame { position: absolute; inset: 0; pointer-events: none; }
  video:focus-visible ~ .frame { box-shadow: inset 0 0 0 2px var(--mark); }
  .bar { position: absolute; left: 0; right: 0; bottom: 0; z-index: 2; display: flex; gap: 6px 8px; align-items: center;
    flex-wrap: wrap; padding: 8px 12px calc(8px + env(safe-area-inset-bottom)); background: var(--panel);
    transition: opacity .25s, translate .25s; }
  :host([idle]) .bar:not(:focus-within) { opacity: 0; translate: 0 30%; pointer-events: none; }
  :host([waiting]) .bar { display: none; }
  @media (prefers-reduced-motion: reduce) { .bar, .vignette { transition: none; } }
  label { display: flex; gap: 8px; align-items: center; flex: 1 1 200px; white-space: nowrap; }
  .distance { min-width: 6ch; text-align: right; font-variant-numeric: tabular-nums; }
  input[type=range] { flex: 1; min-width: 70px; height: 28px; accent-color: var(--mark); }
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
  .status > div { pointer-events: auto; display: grid; gap: 10px; justify-items: center; text-align: center;
    padding: 14px 20px; margin: 12px; border-radius: 10px; background: var(--panel); max-width: 36ch; }
  .status p { margin: 0; }
  form { display: flex; gap: 6px; flex-wrap: wrap; justify-content: center; }
  .guide { pointer-events: auto; background: rgb(0 0 0 / .4); overflow: auto; }
  .guide > div { padding: 12px 20px 16px; margin: 12px; border-radius: 10px; background: var(--panel);
    width: min(700px, 100cqw - 24px); box-sizing: border-box; display: grid; gap: 10px; justify-items: start; }
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
    .bar button, .bar select { padding: 4px 6px; min-height: 44px; font-size: 12px; }
    .bar button { flex-direction: column; gap: 0; }
    .bar select { width: 84px; }
    label { flex-basis: 150px; }
  }
  @container (max-width: 720px) {
    label { flex-basis: 100%; }
    .bar button, .bar select { flex: 1 0 auto; }
    pre { font-size: 10px; }
  }
  .said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  [hidden] { display: none !important; }`);

const icon = paths => `<svg viewBox="0 0 24 24" aria-hidden="true">${paths}</svg>`;
const button = (name, label, title, paths, toggles = true) =>
  `<button class="${name}" ${toggles ? 'aria-pressed="false"' : ''} title="${title}">${icon(paths)}${label}</button>`;

export const markup = `
  <video autoplay playsinline muted tabindex="0" role="img" aria-describedby="description"
    aria-label="Live picture of the light field, flown by a virtual camera"></video>
  <canvas class="last" hidden aria-hidden="true"></canvas>
  <canvas class="anaglyph" hidden aria-hidden="true"></canvas>
  <canvas class="cameras" hidden aria-hidden="true"></canvas>
  <div class="vignette" aria-hidden="true"></div>
  <div class="frame"></div>
  <pre class="makers" hidden aria-label="Cameras that make the pixel at the pointer"></pre>
  <pre class="figures" hidden aria-label="Figures"></pre>
  <div class="monitor" hidden role="group" aria-label="Quality of the cameras"><canvas aria-hidden="true"></canvas>
    <pre></pre></div>
  <div class="said" role="log" aria-label="What happened"></div>
  <div class="status" role="status"><div part="notice">
    <p class="why">Connecting</p>
    <form hidden><input type="password" name="token" aria-label="Token" placeholder="token" autocomplete="current-password"
      required><button>Watch</button></form>
    <button class="again" hidden>Try again</button>
  </div></div>
  <div class="bar" part="controls">
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
    ${button('quality', 'Quality', 'How well the cameras fit together (key m)', '<path d="M4 13l5 5L20 6"/>')}
    ${button('share', 'Share', 'Copies a link to exactly this view',
    '<path d="M12 15V3M8 7l4-4 4 4M5 12v8h14v-8"/>', false)}
    ${button('full', 'Full screen', 'The picture alone', '<path d="M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5"/>', false)}
    ${button('help', 'Help', 'Gestures and keys (key ?)',
    '<circle cx="12" cy="12" r="9"/><path d="M9.5 9.5a2.5 2.5 0 1 1 3.5 2.3c-.7.4-1 .8-1 1.7M12 16.5v.2"/>', false)}
  </div>
  <div class="guide" hidden role="dialog" aria-label="How to fly"><div part="help">${help}</div></div>
  <span id="description" hidden>A click focuses on what is there, a double click goes back to the start, f keeps in focus what was
    clicked. Arrow keys turn around the scene, w s a d q e fly, plus and minus zoom, square brackets move the focus, r goes back to the
    start, c shows the cameras, m how well they fit together, i shows figures, a question mark shows all gestures.</span>`;
