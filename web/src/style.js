// SPDX-License-Identifier: LGPL-2.1-or-later
// How the element looks, light and dark. Pages change it by the properties --lightfield-... and by parts.

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
  canvas.anaglyph, canvas.last { object-fit: contain; z-index: 0; }
  .fills video, .fills canvas.anaglyph, .fills canvas.last { object-fit: cover; }
  .poster, ::slotted([slot=poster]) { position: absolute; inset: 0; width: 100%; height: 100%; }
  .poster { z-index: 0; }
  .poster img { width: 100%; height: 100%; object-fit: contain; display: block; }
  .told canvas.last, .told .poster { filter: brightness(.5); }
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
    background: var(--panel); font-size: 12px; pointer-events: none; max-width: calc(100% - 32px); }
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
