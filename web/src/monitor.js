// SPDX-License-Identifier: LGPL-2.1-or-later
// The quality panel: a map of the prediction quality of each camera, suspect cameras with their faults, and the cost
// and gain of the focal surface.

import { dot } from './view.js';

const kPollInterval = 1000;  // milliseconds
const kMapSize = 150;    // longer side, pixels
// Quality differences below this many decibels are normal, because cameras at the border overlap less with other
// cameras.
const kNormalDrop = 4;
const kFar = 8;          // the colour scale ends this many decibels lower
const kFaults = { colour: 'colours differ from its neighbours', direction: 'direction differs from the rig',
  picture: 'out of focus, dirty or covered' };

export class MonitorPanel {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;
    this.canvas = box.querySelector('canvas');
    this.words = box.querySelector('pre');
    this.report = null;
  }

  async toggle() {
    this.box.hidden = !this.box.hidden;
    clearInterval(this.timer);
    if (this.box.hidden) return false;
    this.timer = setInterval(() => this.ask(), kPollInterval);
    await this.ask();
    return true;
  }

  async ask() {
    if (!this.viewer.host.isConnected) return clearInterval(this.timer);
    try {
      this.array ??= await this.viewer.fetchJson('array.json');
      this.report = await this.viewer.fetchJson('monitor.json');
      this.draw();
    } catch (error) {
      this.words.textContent = `can't load the camera report: ${error.message}`;
    }
  }

  draw() {
    const { cameras } = this.report;
    this.canvas.hidden = !cameras.length;
    if (cameras.length) this.drawMap(cameras);
    const known = knownOf(cameras);
    const lines = cameras.length
      ? [`${known.length} of ${cameras.length} cameras predicted, ${known[0]?.toFixed(1)} to ` +
        `${known.at(-1)?.toFixed(1)} dB; ${(this.report.bytes / this.report.turns / 1000).toFixed(1)} kB per check`]
      : ['no camera has been checked yet'];
    for (const { name, psnr, gain, shift, fault } of cameras.filter(({ fault }) => fault))
      lines.push(`${name}: ${kFaults[fault] ?? fault} (${psnr?.toFixed(1)} dB, gain ${gain?.toFixed(2)}, ` +
        `off by ${shift?.toFixed(1)})`);
    if (cameras.length && known.length && lines.length === 1) lines.push('All cameras fit together: none stands out.');
    const focus = this.viewer.statistics.focus;
    if (focus) lines.push(...focusLines(focus));
    this.words.textContent = lines.join('\n');
  }

  // Draws a tile for each camera: green near the median quality, yellow far below, red with a frame for a suspect (a
  // camera that is probably faulty), and grey without data.
  drawMap(cameras) {
    const { right, down } = this.array;
    const points = this.array.cameras.map(({ position }) => [dot(position, right), dot(position, down)]);
    const low = [0, 1].map(k => Math.min(...points.map(point => point[k])));
    const high = [0, 1].map(k => Math.max(...points.map(point => point[k])));
    const size = Math.max(high[0] - low[0], high[1] - low[1], 1e-9);
    const field = kMapSize / (Math.sqrt(points.length) + 1), scale = (kMapSize - field) / size;
    const [width, height] = [0, 1].map(k => (high[k] - low[k]) * scale + field);
    const dense = devicePixelRatio || 1;
    Object.assign(this.canvas, { width: width * dense, height: height * dense });
    Object.assign(this.canvas.style, { width: `${width}px`, height: `${height}px` });
    const context = this.canvas.getContext('2d');
    context.scale(dense, dense);
    const known = knownOf(cameras);
    const middle = known[known.length >> 1];
    for (const [i, [x, y]] of points.entries()) {
      const { psnr, fault } = cameras[i] ?? { psnr: null };
      const place = [(x - low[0]) * scale + 1, (y - low[1]) * scale + 1, field - 2, field - 2];
      const behind = Math.max(0, Math.min(1, (middle - kNormalDrop - psnr) / kFar));
      context.fillStyle = fault ? 'hsl(0 75% 45%)' : psnr === null ? '#666' : `hsl(${130 - 75 * behind} 60% 40%)`;
      context.fillRect(...place);
      if (!fault) continue;
      context.strokeStyle = '#fff';
      context.lineWidth = 2;
      context.strokeRect(...place);
    }
  }
}

const knownOf = cameras => cameras.map(({ psnr }) => psnr).filter(psnr => psnr !== null).sort((a, b) => a - b);

function focusLines({ on, rounds, interval, consistencyBytes, residual, gained, flat }) {
  if (on === 'plane') return ['focus on the viewer’s plane'];
  return [`focus on ${flat ? 'one plane, which is sufficient' : 'a surface'} (${on}): the cameras disagree by ` +
    `${residual.toFixed(1)} of 255, the latest round gained ${gained.toFixed(2)}`,
    `depth search in one of ${interval} requests, ${rounds} rounds so far, ` +
    `${rounds ? (consistencyBytes / rounds / 1000).toFixed(1) : 0} kB each`];
}
