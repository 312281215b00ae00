// SPDX-License-Identifier: LGPL-2.1-or-later
// The surface that a picture shows: the message from the server, the mesh made from it, and the transformation from one
// camera to another. No function here needs a page.

import { decodeLevels } from './levels.js';
import { axesOfQuaternion, dot } from './view.js';

const kVersion = 2, kHeaderBytes = 77, kMaxEyes = 2;
const kMaxBytes = 16384, kMaxNodes = 8192, kMaxTolerance = 8;
// A difference between the inverse depths of neighbouring nodes is an edge if it exceeds both of these: a share of the
// nearer node, and a share of the nearest node of the surface.
const kEdge = 0.08, kEdgeOfNearest = 0.02;
// Number of cells beside an edge that are also split, and of nodes along each side of a cell's neighbourhood.
export const kRing = 1, kAround = 2 * kRing + 2;
const kBehind = 3;               // nodes: distance over which the surface behind an edge is continued
const kBeyond = 0.35;            // continuation beyond the border of the picture, picture sizes
export const kVertexFloats = 6;  // position in the picture (x, y), inverse depth, position of the colour (x, y), side

// Decodes a message of the data channel "surface" (docs/reference/web-interface.md). Throws an error if the message is
// invalid.
export function decodeSurface(buffer) {
  const data = new DataView(buffer);
  if (buffer.byteLength <= kHeaderBytes || buffer.byteLength > kMaxBytes || data.getUint8(0) !== kVersion ||
      data.getUint8(1) >= kMaxEyes)
    throw new RangeError(`not a surface of version ${kVersion}`);
  const [step, width, height] = [2, 8, 10].map(at => data.getUint16(at)), tolerance = data.getUint8(12);
  const [x, y, z] = [13, 21, 29].map(at => data.getFloat64(at));
  const numbers = Array.from({ length: 10 }, (_, i) => data.getFloat32(37 + 4 * i));
  const [qw, qx, qy, qz, fx, fy, cx, cy, farthest, nearest] = numbers;
  const columns = Math.ceil(width / step), rows = Math.ceil(height / step);
  if (![x, y, z, ...numbers].every(Number.isFinite) || !(fx > 0 && fy > 0 && farthest >= 0 && nearest >= farthest) || !step ||
      !width || !height || columns * rows > kMaxNodes || tolerance > kMaxTolerance)
    throw new RangeError('the numbers of the surface do not fit each other');
  return {
    timestamp: data.getUint32(4),
    eye: data.getUint8(1),
    camera: { position: [x, y, z], axes: axesOfQuaternion(qw, qx, qy, qz), width, height, fx, fy, cx, cy },
    step,
    columns,
    rows,
    farthest,
    nearest,
    levels: decodeLevels(new Uint8Array(buffer, kHeaderBytes), columns, rows, tolerance)
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

// For each node, returns the index of the node that lies behind it: the farthest of the neighbours if there is an edge
// between both, otherwise the node itself. The closest edge counts. A node behind an edge that is as close stays.
function nodesBehind(inverses, columns, rows, isEdge) {
  return Int32Array.from(inverses, (own, at) => {
    const x = at % columns, y = Math.floor(at / columns);
    for (let reach = 1; reach <= kBehind; reach++) {
      const [top, bottom, left, right] =
        [Math.max(0, y - reach), Math.min(rows - 1, y + reach), Math.max(0, x - reach), Math.min(columns - 1, x + reach)];
      let far = at, near = at;
      for (let j = top; j <= bottom; j++)
        for (let node = j * columns + left; node <= j * columns + right; node++) {
          if (inverses[node] < inverses[far]) far = node;
          if (inverses[node] > inverses[near]) near = node;
        }
      if (isEdge(own, inverses[near])) return at;
      if (isEdge(inverses[far], own)) return far;
    }
    return at;
  });
}

const kCorners = [0, 1, kAround, kAround + 1].map(at => at + kRing * (kAround + 1));  // indices of a cell's corners
// Cells at edges overlap by this many pixels on each side, because the depths of neighbouring cells differ at their common
// border, which would show as a crack.
const kOverlap = 1;
const kBeyondCell = [[-1, -1], [1, -1], [-1, 1], [1, 1]].map(corner => corner.map(sign => kOverlap * sign));

// Splits the nodes around a cell at an edge into a far and a near side, at the largest gap between their levels. Returns
// the middle of the gap, and for each side the inverse depths of the four corners. For a corner on the other side, this
// is the mean of the neighbouring nodes on this side.
function sidesOf(levels, inverses, nodesAround) {
  const sorted = Uint8Array.from(nodesAround, node => levels[node]).sort();
  let gap = 1;
  for (let k = 2; k < sorted.length; k++)
    if (sorted[k] - sorted[k - 1] > sorted[gap] - sorted[gap - 1]) gap = k;
  const limit = (sorted[gap] + sorted[gap - 1]) / 2;
  const depths = isNear => kCorners.map(corner => {
    if (levels[nodesAround[corner]] > limit === isNear) return inverses[nodesAround[corner]];
    let sum = 0, weights = 0;
    for (let k = 0; k < nodesAround.length; k++) {
      const node = nodesAround[k];
      if (levels[node] > limit !== isNear) continue;
      const dx = k % kAround - corner % kAround, dy = Math.floor(k / kAround) - Math.floor(corner / kAround);
      const weight = 1 / (dx * dx + dy * dy) ** 2;
      sum += weight * inverses[node];
      weights += weight;
    }
    return sum / weights;
  });
  return { limit, far: depths(false), near: depths(true) };
}

// Marks cells at edges and their neighbours, because silhouettes of the surface are wrong by up to a cell. `inverseAt` is the inverse depth of a node. Returns the marks, by the node at the top left, and their number.
function cellsAtEdges(inverseAt, columns, rows, isEdge) {
  const cut = new Uint8Array(columns * rows);
  let count = 0;
  for (let j = 0; j < rows - 1; j++)
    for (let i = 0; i < columns - 1; i++) {
      const at = j * columns + i, a = inverseAt(at), b = inverseAt(at + 1), c = inverseAt(at + columns), d = inverseAt(at + columns + 1);
      if (!isEdge(Math.min(a, b, c, d), Math.max(a, b, c, d))) continue;
      for (let y = Math.max(0, j - kRing); y <= Math.min(rows - 2, j + kRing); y++)
        for (let x = Math.max(0, i - kRing); x <= Math.min(columns - 2, i + kRing); x++) {
          count += 1 - cut[y * columns + x];
          cut[y * columns + x] = 1;
        }
    }
  return { cut, count };
}

// Makes two meshes of a surface, as vertices and triangles. The front mesh is cut at edges: it contains such a cell twice,
// once with the depths of each side. The renderer selects the side of each pixel. The back mesh fills the gaps that a
// movement opens: near an edge it has the depth and the colour of the farther side.
//
// The last number of a vertex is its side: 0 outside such cells, the limit between the levels of both sides for the near
// side, and the negative limit for the far side.
export function makeMesh({ camera: { width, height }, step, columns, rows, farthest, nearest, levels }) {
  const inverses = Float32Array.from(levels, level => farthest + (nearest - farthest) * level / 255);
  const isEdge = (low, high) => high - low > kEdge * high && high - low > kEdgeOfNearest * nearest;
  const behind = nodesBehind(inverses, columns, rows, isEdge);
  const across = line(columns, step, width), along = line(rows, step, height), wide = columns + 2, size = wide * (rows + 2);
  const nodes = Int32Array.from({ length: size }, (_, at) => along.nodes[Math.floor(at / wide)] * columns + across.nodes[at % wide]);
  const { cut, count } = cellsAtEdges(at => inverses[nodes[at]], wide, rows + 2, isEdge);
  const vertices = new Float32Array(kVertexFloats * (2 * size + 8 * count));
  const back = new Uint32Array(6 * (wide - 1) * (rows + 1)), front = new Uint32Array(back.length + 6 * count);
  let next = 0;
  const add = (at, inverse, dx = 0, dy = 0, side = 0, beyond = [0, 0]) => {
    const x = across.places[at % wide] + beyond[0], y = along.places[Math.floor(at / wide)] + beyond[1], to = kVertexFloats * next++;
    [vertices[to], vertices[to + 1], vertices[to + 2]] = [x, y, inverse];
    [vertices[to + 3], vertices[to + 4], vertices[to + 5]] = [x + dx, y + dy, side];
  };
  for (let at = 0; at < size; at++) add(at, inverses[nodes[at]]);
  for (let at = 0; at < size; at++) {
    const own = nodes[at], other = behind[own], up = Math.floor(other / columns) - Math.floor(own / columns);
    add(at, inverses[other], (other % columns - own % columns) * step, up * step);
  }
  const filled = [0, 0];  // numbers of indices in `back` and `front`
  const quad = (list, k, a, c) => {
    for (const index of [a, a + 1, c, c, a + 1, c + 1]) list[filled[k]++] = index;
  };
  const around = new Int32Array(kAround * kAround);
  for (let j = 0; j <= rows; j++)
    for (let i = 0; i < wide - 1; i++) {
      const a = j * wide + i, c = a + wide;
      quad(back, 0, a + size, c + size);
      if (!cut[a]) {
        quad(front, 1, a, c);
        continue;
      }
      for (let k = 0; k < around.length; k++) {
        const x = Math.min(Math.max(i + k % kAround - kRing, 0), wide - 1);
        const y = Math.min(Math.max(j + Math.floor(k / kAround) - kRing, 0), rows + 1);
        around[k] = nodes[y * wide + x];
      }
      const { limit, far, near } = sidesOf(levels, inverses, around);
      for (const [depths, side] of [[far, -limit], [near, limit]]) {
        const first = next;
        [a, a + 1, c, c + 1].forEach((at, k) => add(at, depths[k], 0, 0, side, kBeyondCell[k]));
        quad(front, 1, first, first + 2);
      }
    }
  const triangles = new Uint32Array(back.length + front.length);
  triangles.set(back);
  triangles.set(front, back.length);
  return { vertices, triangles, behind: back.length, front: front.length };
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
