// SPDX-License-Identifier: LGPL-2.1-or-later
// What the element is made of.

import { kModes } from './stereo.js';

export const sheet = new CSSStyleSheet();  // not a <style>, which strict pages forbid
sheet.replaceSync(`
  :host { display: block; position: relative; background: #000; color: #fff; font: 14px/1.4 system-ui, sans-serif;
    min-width: 64px; min-height: 64px; overflow: hidden; container-type: inline-size; }
  video { width: 100%; height: 100%; object-fit: contain; display: block; touch-action: none; cursor: grab;
    outline: none; }
  video:active { cursor: grabbing; }
  canvas { position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none;
    z-index: 1; }
  .bar { z-index: 2; }
  :host(:focus-within) .frame { box-shadow: inset 0 0 0 2px #6cf; }
  .frame { position: absolute; inset: 0; pointer-events: none; }
  .bar { position: absolute; left: 0; right: 0; bottom: 0; display: flex; gap: 8px 12px; align-items: center;
    flex-wrap: wrap; padding: 8px 12px calc(8px + env(safe-area-inset-bottom));
    background: linear-gradient(transparent, rgb(0 0 0 / .7)); }
  label { display: flex; gap: 8px; align-items: center; flex: 1 1 160px; }
  input[type=range] { flex: 1; min-width: 80px; height: 28px; }
  button, select { font: inherit; color: inherit; background: rgb(40 40 40 / .8); border: 1px solid #888; border-radius: 6px;
    padding: 6px 10px; min-height: 36px; }
  button[aria-pressed=true] { background: #246; }
  :focus-visible { outline: 2px solid #6cf; outline-offset: 1px; }
  pre { position: absolute; left: 8px; top: 8px; margin: 0; padding: 6px 8px; background: rgb(0 0 0 / .6);
    font: 12px/1.35 ui-monospace, monospace; pointer-events: none; max-width: calc(100% - 32px); overflow: hidden;
    white-space: pre-wrap; }
  .monitor { position: absolute; right: 8px; top: 8px; padding: 8px; background: rgb(0 0 0 / .7); pointer-events: none;
    max-width: min(380px, calc(100% - 32px)); z-index: 1; }
  .monitor canvas { position: static; display: block; width: auto; height: auto; margin-bottom: 6px; }
  .monitor pre { position: static; padding: 0; background: none; max-width: none; }
  pre.makers { left: 0; top: 0; z-index: 1; }
  .status { position: absolute; inset: 0; display: grid; place-items: center; text-align: center; padding: 16px;
    pointer-events: none; }
  @container (max-width: 720px) { label { flex-basis: 100%; } }
  @container (max-width: 520px) {
    .bar { gap: 6px; }
    button, select { flex: 1; padding: 6px 4px; min-height: 44px; }
    pre { font-size: 10px; }
  }
  canvas.anaglyph { object-fit: contain; z-index: 0; }
  .said { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
  [hidden] { display: none !important; }`);

export const markup = `
  <video autoplay playsinline muted tabindex="0" role="img" aria-describedby="help"
    aria-label="Live picture of the light field, flown by a virtual camera"></video>
  <canvas class="anaglyph" hidden aria-hidden="true"></canvas>
  <canvas class="cameras" hidden aria-hidden="true"></canvas>
  <div class="frame"></div>
  <pre class="makers" hidden aria-label="Cameras that make the pixel at the pointer"></pre>
  <pre class="figures" hidden aria-label="Figures"></pre>
  <div class="monitor" hidden role="group" aria-label="Quality of the cameras"><canvas aria-hidden="true"></canvas>
    <pre></pre></div>
  <div class="said" role="log" aria-label="What happened"></div>
  <div class="status" role="status">connecting</div>
  <div class="bar">
    <label>Focus
      <input type="range" min="-1" max="1" step="0.01" value="0" aria-label="Distance of what is sharp"></label>
    <button class="sweep" aria-pressed="false" title="Moves the focus through the scene and back">Sweep</button>
    <button class="follow" aria-pressed="false" title="Keeps what was clicked last in focus (key f, double click)">Follow</button>
    <button class="home" title="Back to where the flight began (key r)">Home</button>
    <select aria-label="Eyes" title="A picture for one eye, or for two">
      ${Object.entries(kModes).map(([mode, name]) => `<option value="${mode}">${name}</option>`).join('')}
    </select>
    <button class="cameras" aria-pressed="false" title="Which cameras make the picture (key c)">Cameras</button>
    <button class="figures" aria-pressed="false" title="Frames per second, latency, bytes (key i)">Figures</button>
    <button class="quality" aria-pressed="false" title="How well the cameras fit together (key m)">Quality</button>
    <button class="share" title="Copies a link to exactly this view">Share</button>
  </div>
  <span id="help" hidden>A click focuses on what is there, a double click or f keeps it in focus. Arrow keys turn around the scene, w s a d q e fly, plus and minus zoom, square brackets move
    the focus, r goes back to the start, c shows the cameras, m how well they fit together, i shows figures. With shift nothing keeps the scene in
    sight.</span>`;
