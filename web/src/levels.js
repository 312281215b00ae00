// SPDX-License-Identifier: LGPL-2.1-or-later
// Decodes the levels of a surface (docs/reference/web-interface.md).

const kPrecision = 12, kHalf = 2 ** (kPrecision - 1);  // bits of a probability; one half
const kSlowest = 5;  // shift of the slowest adaptation
const kKinds = 4, kMostBits = 7;

const decisions = count => Array.from({ length: count }, () => ({ ofZero: kHalf, seen: 0 }));

// The adaptive binary range decoder of LZMA. `ofZero` is the probability that a decision is 0, learned from earlier decisions
// of the same kind.
class RangeDecoder {
  constructor(bytes) {
    Object.assign(this, { bytes, read: 0, range: 2 ** 32 - 1, code: 0 });
    for (let i = 0; i < 4; i++) this.shift();
  }
  shift() { this.code = (this.code << 8 | (this.bytes[this.read++] ?? 0)) >>> 0; }
  bit(decision) {
    const { ofZero } = decision, bound = (this.range >>> kPrecision) * ofZero, bit = Number(this.code >= bound);
    if (bit) this.code -= bound;
    this.range = bit ? this.range - bound : bound;
    const shift = Math.min(kSlowest, 31 - Math.clz32(decision.seen++ + 2));
    decision.ofZero += bit ? -(ofZero >> shift) : 2 * kHalf - ofZero >> shift;
    for (; this.range < 2 ** 24; this.range = this.range << 8 >>> 0) this.shift();
    return bit;
  }
}

// Returns the predictor of a node's level: the median of the left node, the node above, and the plane through the
// neighbours.
function predicted(levels, at, i, j, columns) {
  if (j === 0) return i === 0 ? 0 : levels[at - 1];
  const up = levels[at - columns];
  if (i === 0) return up;
  const left = levels[at - 1], plane = left + up - levels[at - columns - 1];
  return Math.max(Math.min(left, up), Math.min(plane, Math.max(left, up)));
}

// Throws an error if the bytes are too few or too many.
export function decodeLevels(bytes, columns, rows, tolerance) {
  const coder = new RangeDecoder(bytes), levels = new Uint8ClampedArray(columns * rows), above = new Uint8Array(columns);
  const differs = decisions(kKinds), [isNegative] = decisions(1), isLonger = differs.map(() => decisions(kMostBits));
  const tails = Array.from({ length: kMostBits + 1 }, () => decisions(2));
  for (let j = 0, at = 0; j < rows; j++)
    for (let i = 0, size = 0; i < columns; i++, at++) {
      const kind = Math.min(size + above[i], kKinds - 1);
      let units = size = 0;
      if (coder.bit(differs[kind])) {
        const sign = coder.bit(isNegative) ? -1 : 1;
        let bits = 0;
        while (bits < kMostBits && coder.bit(isLonger[kind][bits])) bits++;
        size = 1;
        for (let k = bits; k-- > 0;) size = 2 * size + coder.bit(tails[bits][Number(k + 1 === bits)]);
        units = sign * size;
      }
      above[i] = size;
      levels[at] = predicted(levels, at, i, j, columns) + units * (2 * tolerance + 1);
    }
  if (coder.read !== bytes.length) throw new RangeError('the surface has a wrong length');
  return new Uint8Array(levels.buffer);
}
