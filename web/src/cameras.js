// SPDX-License-Identifier: LGPL-2.1-or-later
// The camera overlay: the mesh over the picture, a front view of the array in a corner, and a text with the cameras
// that contribute to the pixel at the pointer.

import { axesOf, dot, inView } from './view.js';

const kPollInterval = 100;  // milliseconds
const kMapSize = 110;       // longer side, pixels
const kTiny = 1e-6;         // minimum distance from the plane of the eye, metres

export class Cameras {
  constructor(viewer, canvas, words) {
    this.viewer = viewer;
    this.canvas = canvas;
    this.words = words;
    this.asked = 0;
    this.makers = [];
    viewer.video.addEventListener('pointermove', event => this.pointer = viewer.picture.pixelAt(event));
    viewer.video.addEventListener('pointerleave', () => this.pointer = null);
  }

  get shown() { return !this.canvas.hidden; }

  async toggle() {
    this.canvas.hidden = this.words.hidden = this.shown;
    if (this.shown && !this.array) await this.fetch();
    return this.shown;
  }

  async fetch() {
    try {
      this.array = await this.viewer.fetchJson('array.json');
      this.known = null;
    } catch (error) {
      this.words.textContent = `can't load the cameras: ${error.message}`;
    }
  }

  async forget() {
    this.array = null;
    if (this.shown) await this.fetch();
  }

  take({ cameras }) {
    this.makers = cameras;
    const names = cameras.map(({ name, weight, sees }) =>
      `${name} ${(100 * weight).toFixed(0)} %${sees ? '' : ', does not see this point'}`);
    this.words.textContent = names.join('\n') || 'no camera';
  }

  ask(now) {
    const { video } = this.viewer;
    if (now < this.asked + kPollInterval) return;
    this.asked = now;
    const middle = { x: this.viewer.picture.eyeWidth / 2, y: video.videoHeight / 2 };
    this.viewer.requestPixelInfo(this.pointer ?? middle);
    const at = this.viewer.picture.placeOf(this.pointer ?? middle);
    this.words.style.translate = `${at.x + 12}px ${at.y + 12}px`;
  }

  draw(now, view) {
    if (!this.shown || !this.array || !view) return;
    this.ask(now);
    const { canvas } = this, context = canvas.getContext('2d'), scale = devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    Object.assign(canvas, { width: width * scale, height: height * scale });
    context.scale(scale, scale);
    for (const eye of this.viewer.picture.eyes) this.drawMesh(context, view, eye);
    this.drawMap(context, view, width);
  }

  drawMesh(context, view, { box, offset }) {
    const axes = axesOf(view), focal = box.height / 2 / Math.tan(view.fov * Math.PI / 360);
    const points = this.array.cameras.map(camera => inView(view, axes, camera.position, offset));
    // A camera behind the eye is drawn where the line from the camera through the eye crosses the picture.
    const project = ([x, y, z]) => [box.x + box.width / 2 + focal * x / z, box.y + box.height / 2 + focal * y / z];
    context.save();
    context.beginPath();
    context.rect(box.x, box.y, box.width, box.height);
    context.clip();
    context.beginPath();
    for (const [i, j] of this.edges)
      for (const side of [1, -1]) {
        const part = clip(points[i], points[j], side);
        if (!part) continue;
        context.moveTo(...project(part[0]));
        context.lineTo(...project(part[1]));
      }
    stroke(context);
    for (const [i, point] of points.entries())
      if (Math.abs(point[2]) > kTiny) this.dot(context, project(point), this.array.cameras[i].name);
    context.restore();
  }

  drawMap(context, view, width) {
    const { right, down, cameras } = this.array;
    const flat = position => [dot(position, right), dot(position, down)];
    const points = cameras.map(camera => flat(camera.position)), eye = flat([view.x, view.y, view.z]);
    const low = [0, 1].map(k => Math.min(...points.map(point => point[k])));
    const high = [0, 1].map(k => Math.max(...points.map(point => point[k])));
    const scale = kMapSize / Math.max(high[0] - low[0], high[1] - low[1], kTiny);
    const left = width - (high[0] - low[0]) * scale - 16, top = 16;
    const place = ([x, y]) => [left + (x - low[0]) * scale, top + (y - low[1]) * scale];
    context.fillStyle = 'rgb(0 0 0 / .6)';
    context.fillRect(left - 10, top - 10, (high[0] - low[0]) * scale + 20, (high[1] - low[1]) * scale + 20);
    context.beginPath();
    for (const [i, j] of this.edges) {
      context.moveTo(...place(points[i]));
      context.lineTo(...place(points[j]));
    }
    stroke(context);
    for (const [i, point] of points.entries()) this.dot(context, place(point), cameras[i].name);
    const [x, y] = place([0, 1].map(k => Math.min(Math.max(eye[k], low[k]), high[k])));
    context.strokeStyle = '#f66';
    context.lineWidth = 2;
    context.strokeRect(x - 4, y - 4, 8, 8);
  }

  dot(context, [x, y], name) {
    const maker = this.makers.find(camera => camera.name === name);
    context.fillStyle = maker ? maker.sees ? '#fd4' : '#f44' : '#fff';
    context.beginPath();
    context.arc(x, y, maker ? 3 + 5 * maker.weight : 2, 0, 2 * Math.PI);
    context.fill();
  }

  get edges() {
    return this.known ??= [...new Map(this.array.faces.flatMap(face => face.map((i, k) => {
      const j = face[(k + 1) % face.length];
      return [`${Math.min(i, j)} ${Math.max(i, j)}`, [i, j]];
    }))).values()];
  }
}

// Returns the part of the line from a to b in front of the eye (side 1) or behind it (-1), or null if there is none.
function clip(a, b, side) {
  if (side < 0) [a, b] = [a, b].map(point => point.map(value => -value));
  if (a[2] < kTiny && b[2] < kTiny) return null;
  const at = (inside, outside) => {
    const t = (inside[2] - kTiny) / (inside[2] - outside[2]);
    return inside.map((value, k) => value + t * (outside[k] - value));
  };
  return [a[2] < kTiny ? at(b, a) : a, b[2] < kTiny ? at(a, b) : b];
}

function stroke(context) {
  for (const [colour, width] of [['rgb(0 0 0 / .5)', 3], ['rgb(110 220 255 / .9)', 1]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
}
