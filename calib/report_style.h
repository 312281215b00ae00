// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// The style sheet of report_page(): light or dark as the reader's system is, one column on phones, for print without
// colours behind text.
inline constexpr char kReportStyle[] = R"css(
:root { color-scheme: light dark; --bg: #fff; --fg: #1d2024; --dim: #5d6672; --line: #d9dee5; --card: #f5f7f9;
  --accent: #1a64b8; --good: #1b7f4b; --fair: #a15c00; --bad: #c0282d; --paper: #e9edf1; }
@media (prefers-color-scheme: dark) { :root { --bg: #14171b; --fg: #e6e9ed; --dim: #9aa5b1; --line: #323941;
  --card: #1c2025; --accent: #6cb0ff; --good: #53c689; --fair: #e9a545; --bad: #ff7b78; --paper: #262c33; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 72rem; background: var(--bg); color: var(--fg);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1rem; font-weight: 600; color: var(--dim); margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2.5rem 0 .5rem; }
h3 { font-size: 1rem; margin: 0 0 .25rem; }
p { margin: .25rem 0 .75rem; max-width: 46rem; }
.headline { font-size: clamp(1.6rem, 5vw, 2.3rem); line-height: 1.2; font-weight: 700; margin: .35rem 0 .5rem; }
.headline::before { content: ""; display: inline-block; width: .62em; height: .62em; border-radius: 50%;
  margin-right: .4em; background: var(--good); }
.headline.fair::before { background: var(--fair); }
.headline.bad::before { background: var(--bad); }
.facts { display: flex; flex-wrap: wrap; gap: .4rem 1.6rem; margin: 0 0 1rem; padding: 0; list-style: none; }
.facts b { font-weight: 600; }
.facts li, .note { color: var(--dim); }
.facts b { color: var(--fg); }
.note { font-size: .9rem; }
ol.next { padding-left: 1.4rem; max-width: 50rem; }
ol.next li { margin-bottom: .5rem; }
.grid { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); }
.card { background: var(--card); border: 1px solid var(--line); border-radius: .6rem; padding: .9rem 1rem; min-width: 0; }
.wide { grid-column: 1 / -1; }
.scroll { overflow-x: auto; }
.tiles { display: grid; gap: .6rem; grid-template-columns: repeat(auto-fill, minmax(7.5rem, 1fr)); }
.tile { font-size: .8rem; color: var(--dim); overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.tile svg { border-bottom: 3px solid var(--good); }
.tile.fair svg { border-color: var(--fair); }
.tile.bad svg { border-color: var(--bad); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th { font-weight: 600; text-align: right; color: var(--dim); font-size: .85rem; white-space: nowrap; }
td { text-align: right; white-space: nowrap; }
th, td { padding: .35rem .7rem .35rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th:first-child, td:first-child, td.words, th.words { text-align: left; }
td.words { white-space: normal; min-width: 14rem; }
tr.chosen td { font-weight: 600; }
.badge { display: inline-block; min-width: 2.9rem; padding: 0 .5rem; border-radius: 1rem; border: 1px solid;
  font-size: .8rem; font-weight: 600; text-align: center; }
.badge.good { color: var(--good); } .badge.fair { color: var(--fair); } .badge.bad { color: var(--bad); }
.reasons { margin: 0; padding-left: 1.1rem; }
.modes { list-style: none; margin: 0; padding: 0; }
.modes li { display: grid; grid-template-columns: 5rem 1fr; gap: .8rem; padding: .4rem 0; border-bottom: 1px solid var(--line); }
.share { display: block; height: .5rem; margin-top: .5rem; border-radius: .25rem; position: relative; overflow: hidden;
  background: linear-gradient(to right, var(--paper) 50%, var(--line) 50%); }
.share span { display: block; height: 100%; background: var(--good); }
.share .fair { background: var(--fair); }
details summary { cursor: pointer; color: var(--accent); padding: .4rem 0; }
svg { display: block; width: 100%; height: auto; }
svg text { font: 12px system-ui, sans-serif; fill: var(--fg); }
svg .dim { fill: var(--dim); }
svg .bad-text { fill: var(--bad); font-weight: 700; }
svg .mark-text, svg .line-text { paint-order: stroke; stroke: var(--card); stroke-width: 4px; stroke-linejoin: round; }
svg .mark-text { fill: var(--dim); }
svg .line-text { fill: var(--accent); }
svg path { fill: none; }
svg .grid { stroke: var(--line); }
svg .zero { stroke: var(--dim); }
svg .mark { stroke: var(--dim); stroke-dasharray: 4 3; }
svg .whisker { stroke: var(--dim); stroke-width: 1.5; }
svg .band { fill: var(--accent); fill-opacity: .1; }
svg .curve { stroke: var(--accent); stroke-width: 2.5; stroke-linejoin: round; }
svg .second { stroke: var(--dim); stroke-width: 1.5; }
svg .paper { fill: var(--paper); }
svg .seen { fill: var(--accent); }
svg .residual { stroke: var(--fg); stroke-width: .9; stroke-opacity: .75; }
svg .arrow { stroke: var(--fg); stroke-width: 2; stroke-linecap: round; }
svg g.good { fill: var(--good); } svg g.fair { fill: var(--fair); } svg g.bad { fill: var(--bad); }
svg ellipse { fill-opacity: .25; }
@media print { body { max-width: none; } .card { break-inside: avoid; } }
)css";
