// SPDX-License-Identifier: LGPL-2.1-or-later
// The surface that a picture shows: the message from the server, the mesh made from it, and the transformation from one
// camera to another. No function here needs a page.

import { axesOfQuaternion, dot } from './view.js';

const kVersion = 1, kHeaderBytes = 120;
const kMaxBytes = 16384, kMaxNodes = 8192;
// A difference between the inverse depths of neighbouring nodes is an edge if it exceeds both of these: a share of the
// nearer node, and a share of the nearest node of the surface.
const kEdge = 0.08, kEdgeOfNearest = 0.02;
const kBehind = 3;               // nodes: distance over which the surface behind an edge is continued
const kBeyond = 0.35;            // continuation beyond the border of the picture, picture sizes
export const kVertexFloats = 5;  // position in the picture (x, y), inverse depth, and position of the colour (x, y)

// Returns the predictor of a node's level: the median of the left node, the node above, and the plane through the
// neighbours.
function predicted(levels, at, i, j, columns) {
  if (j === 0) return i === 0 ? 0 : levels[at - 1];
  const up = levels[at - columns];
  if (i === 0) return up;
  const left = levels[at - 1], plane = left + up - levels[at - columns - 1];
  return Math.max(Math.min(left, up), Math.min(plane, Math.max(left, up)));
}

async function inflate(bytes, size) {
  const { writable, readable } = new DecompressionStream('deflate'), writer = writable.getWriter(),
                   reader = readable.getReader();
  const out = new Uint8Array(size);
  // Errors also reach the reader.
  writer.write(bytes).catch(() => {});
  writer.close().catch(() => {});
  let at = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (at + value.length > size) throw new RangeError('the surface has too many nodes');
    out.set(value, at);
    at += value.length;
  }
  if (at !== size) throw new RangeError('the surface has too few nodes');
  return out;
}

// Decodes a message of the data channel "surface" (docs/reference/web-interface.md). Throws an error if the message is
// invalid.
export async function decodeSurface(buffer) {
  const data = new DataView(buffer);
  if (buffer.byteLength <= kHeaderBytes || buffer.byteLength > kMaxBytes || data.getUint8(0) !== kVersion)
    throw new RangeError('not a surface of version 1');
  const [step, width, height, columns, rows] = [2, 8, 10, 12, 14].map(at => data.getUint16(at));
  const numbers = Array.from({ length: 13 }, (_, i) => data.getFloat64(16 + 8 * i));
  const [x, y, z, qw, qx, qy, qz, fx, fy, cx, cy, farthest, nearest] = numbers;
  const nodes = columns * rows;
  if (!numbers.every(Number.isFinite) || !(fx > 0 && fy > 0 && farthest >= 0 && nearest >= farthest) || !step ||
      !width || !height || columns !== Math.ceil(width / step) || rows !== Math.ceil(height / step) ||
      nodes > kMaxNodes)
    throw new RangeError('the numbers of the surface do not fit each other');
  const levels = await inflate(new Uint8Array(buffer, kHeaderBytes), nodes);
  for (let j = 0, at = 0; j < rows; j++)
    for (let i = 0; i < columns; i++, at++) levels[at] += predicted(levels, at, i, j, columns);
  return {
    timestamp: data.getUint32(4),
    camera: { position: [x, y, z], axes: axesOfQuaternion(qw, qx, qy, qz), width, height, fx, fy, cx, cy },
    step,
    columns,
    rows,
    farthest,
    nearest,
    levels
  };
}

// Continues the grid of nodes beyond the border of the picture: returns the positions of columns or rows, and for each
// the index of the node that it has its depth from.
function line(count, step, size) {
  const places = [-kBeyond * size], nodes = [0];
  for (let i = 0; i < count; i++) {
    places.push((i + 0.5) * step - 0.5);
    nodes.push(i);
  }
  places.push(Math.max((1 + kBeyond) * size, places.at(-1)));
  nodes.push(count - 1);
  return { places, nodes };
}

// For each node, returns the index of the node that lies behind it: the farthest of the near neighbours if there is an
// edge between both, otherwise the node itself.
function nodesBehind(inverses, columns, rows, isEdge) {
  const pass = (from, count, stride, others, otherStride) => {
    const out = new Int32Array(from.length);
    for (let k = 0; k < others; k++)
      for (let i = 0; i < count; i++) {
        const at = k * otherStride + i * stride;
        let best = from[at];
        for (let n = Math.max(0, i - kBehind); n <= Math.min(count - 1, i + kBehind); n++) {
          const candidate = from[k * otherStride + n * stride];
          if (inverses[candidate] < inverses[best]) best = candidate;
        }
        out[at] = best;
      }
    return out;
  };
  const own = Int32Array.from(inverses, (_, at) => at);
  const farthest = pass(pass(own, columns, 1, rows, columns), rows, columns, columns, 1);
  return farthest.map((node, at) => isEdge(inverses[node], inverses[at]) ? node : at);
}

// Returns the levels without outliers: each is the median of its neighbourhood of 3 x 3 nodes.
function smoothed(levels, columns, rows) {
  const out = new Uint8Array(levels.length), near = new Uint8Array(9);
  for (let j = 0, at = 0; j < rows; j++)
    for (let i = 0; i < columns; i++, at++) {
      for (let k = 0; k < 9; k++) {
        const x = Math.min(columns - 1, Math.max(0, i + k % 3 - 1)),
              y = Math.min(rows - 1, Math.max(0, j + Math.floor(k / 3) - 1));
        near[k] = levels[y * columns + x];
      }
      out[at] = near.sort()[4];
    }
  return out;
}

// Makes two meshes of a surface, as vertices and triangles. The mesh in front is cut at edges: there, each corner of a
// cell keeps its own depth up to the middle of the cell. The mesh behind fills the gaps that a movement opens: near an
// edge it has the depth and the colour of the farther side.
export function makeMesh({ camera: { width, height }, step, columns, rows, farthest, nearest, levels }) {
  const inverses =
      Float32Array.from(smoothed(levels, columns, rows), level => farthest + (nearest - farthest) * level / 255);
  const isEdge = (low, high) => high - low > kEdge * high && high - low > kEdgeOfNearest * nearest;
  const behind = nodesBehind(inverses, columns, rows, isEdge);
  const across = line(columns, step, width), along = line(rows, step, height), wide = columns + 2;
  const front = [], back = [], vertices = [], size = wide * (rows + 2);
  const nodeAt = (i, j) => along.nodes[j] * columns + across.nodes[i];
  const add = (x, y, inverse, fromX, fromY) => vertices.push(x, y, inverse, fromX, fromY);
  for (let j = 0; j < rows + 2; j++)
    for (let i = 0; i < wide; i++) {
      const x = across.places[i], y = along.places[j];
      add(x, y, inverses[nodeAt(i, j)], x, y);
    }
  for (let j = 0; j < rows + 2; j++)
    for (let i = 0; i < wide; i++) {
      const own = nodeAt(i, j), other = behind[own], x = across.places[i], y = along.places[j];
      const [dx, dy] = [other % columns - own % columns, Math.floor(other / columns) - Math.floor(own / columns)];
      add(x, y, inverses[other], x + dx * step, y + dy * step);
    }
  let next = 2 * size;
  const quad = (list, a, b, c, d) => list.push(a, b, c, c, b, d);
  for (let j = 0; j <= rows; j++)
    for (let i = 0; i < wide - 1; i++) {
      const a = j * wide + i, b = a + 1, c = a + wide, d = c + 1;
      quad(back, a + size, b + size, c + size, d + size);
      const corners =
          [nodeAt(i, j), nodeAt(i + 1, j), nodeAt(i, j + 1), nodeAt(i + 1, j + 1)].map(node => inverses[node]);
      if (!isEdge(Math.min(...corners), Math.max(...corners))) {
        quad(front, a, b, c, d);
        continue;
      }
      const xs = [across.places[i], (across.places[i] + across.places[i + 1]) / 2, across.places[i + 1]];
      const ys = [along.places[j], (along.places[j] + along.places[j + 1]) / 2, along.places[j + 1]];
      corners.forEach((inverse, corner) => {
        const right = corner & 1, low = corner >> 1;
        for (const y of [ys[low], ys[low + 1]])
          for (const x of [xs[right], xs[right + 1]]) add(x, y, inverse, x, y);
        quad(front, next, next + 1, next + 2, next + 3);
        next += 4;
      });
    }
  return {
    vertices: new Float32Array(vertices),
    triangles: new Uint32Array([...back, ...front]),
    behind: back.length,
    front: front.length
  };
}

// Returns the matrix (by columns) that maps ((x - cx) / fx, (y - cy) / fy, 1, inverse depth) of one camera to the clip
// coordinates of another. Points nearer than `least` (metres) are clipped.
export function clipMatrix(from, to, least) {
  const axes = [to.axes.right, to.axes.down, to.axes.forward];
  const way = from.position.map((at, k) => at - to.position[k]);
  const [x, y, z] = axes.map(
      axis => [dot(axis, from.axes.right), dot(axis, from.axes.down), dot(axis, from.axes.forward), dot(axis, way)]);
  const [sx, ox] = [2 * to.fx / to.width, (2 * to.cx + 1) / to.width - 1];
  const [sy, oy] = [2 * to.fy / to.height, (2 * to.cy + 1) / to.height - 1];
  const out = new Float32Array(16);
  for (let k = 0; k < 4; k++)
    out.set([sx * x[k] + ox * z[k], -(sy * y[k] + oy * z[k]), z[k] - (k === 3 ? 2 * least : 0), z[k]], 4 * k);
  return out;
}

// Returns how far points of the surface move in the picture at most, approximately, if the camera changes: a number of
// pixels.
export function displacement(from, to, nearest) {
  const way = from.position.map((at, k) => at - to.position[k]);
  const turn =
      ['right', 'down', 'forward'].map(name => Math.hypot(...from.axes[name].map((v, k) => v - to.axes[name][k])));
  return from.fy * (Math.hypot(...way) * nearest + Math.max(...turn)) +
      Math.abs(to.fy / from.fy * from.height / to.height - 1) * from.width / 2;
}
