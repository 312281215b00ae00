// SPDX-License-Identifier: LGPL-2.1-or-later
// Statistics over the picture, from the server and the browser.

const kLatest = 30;

export class Figures {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;
    this.shown = [];
    this.waiting = [];   // [RTP timestamp, time sent] of changes that are not visible yet
    this.latencies = []; // milliseconds from a change until it is visible
  }

  frame(now, rtpTimestamp) {
    this.shown = [...this.shown.filter(time => time > now - 1000), now];
    if (rtpTimestamp === undefined) return;
    const done = this.waiting.filter(([stamp]) => isShown(stamp, rtpTimestamp));
    this.waiting = this.waiting.filter(entry => !done.includes(entry));
    for (const [, sent] of done) this.latencies = [...this.latencies, now - sent].slice(-kLatest);
  }

  applied({ id, rtpTimestamp }) {
    const sent = this.viewer.stream.connection?.sent.get(id)?.time;
    if (sent === undefined) return;
    this.waiting = [...this.waiting, [rtpTimestamp, sent]].slice(-kLatest);
  }

  get latency() {
    const sorted = [...this.latencies].sort((a, b) => a - b);
    return sorted[sorted.length >> 1];
  }

  toggle() {
    this.box.hidden = !this.box.hidden;
    this.update();
    return !this.box.hidden;
  }

  update() {
    const f = this.viewer.statistics;
    const before = this.before ?? f;
    this.before = f;
    if (this.box.hidden || f.pictures === undefined) return;
    const each = (bytes, old) => f.pictures > before.pictures
      ? `${((bytes - old) / (f.pictures - before.pictures) / 1000).toFixed(1)} kB` : '-';
    const { videoWidth: width, videoHeight: height } = this.viewer.video;
    const lines = [
      ['picture', `${width} x ${height}, ${this.shown.length} frames/s`],
      ['coverage', f.coverage === undefined ? '-' : `${(100 * f.coverage).toFixed(1)} % of the picture`],
      ['motion to picture', this.latency === undefined ? 'move to measure' : `${this.latency.toFixed(0)} ms`],
      ['request to picture', `${f.pictureMs.toFixed(1)} ms, including answers ${f.answerMs.toFixed(1)} ms, ` +
        `compositing ${f.addMs.toFixed(1)} ms`],
      ['bytes per picture', `${each(f.answerBytes, before.answerBytes)} from the cameras, ` +
        `${(width * height * 1.5 / 1000).toFixed(1)} kB composed, ${each(f.videoBytes, before.videoBytes)} as video`],
      ['bit rate', f.sentRate === undefined ? `${megabits(f.bitRate)} at most` :
        `${megabits(f.sentRate)}, target ${megabits(f.bitRate)}`],
      ...f.shed?.what ? [['reduced', shed(f.shed)]] : [],
      ...f.busy === undefined ? [] : [['server', `${(100 * f.busy).toFixed(0)} % busy, ${f.encoder}`]],
      ['network', `${(f.loss * 100).toFixed(1)} % lost, ${f.roundTripMs.toFixed(0)} ms round trip`],
      ['skew', `${f.skewMs.toFixed(1)} ms at most`],
      ['lost', `${f.missing} fragments, in ${f.incomplete} of ${f.pictures} pictures; ` +
        `cameras out of service: ${f.outOfService}`],
    ];
    this.box.textContent = lines.map(([name, value]) => `${name.padEnd(20)}${value}`).join('\n');
  }
}

const megabits = rate => `${(rate / 1e6).toFixed(1)} Mbit/s`;

function shed({ what, why, rate, size }) {
  const parts = [what && 'fewer focus updates', rate > 1 && `1 of ${rate} pictures`, size > 1 && `1/${size} size`];
  return `${parts.filter(Boolean).join(', ')}: the ${why} is too slow`;
}

// Returns true if the timestamp of the frame is the expected one or later. Timestamps wrap at 2^32.
export const isShown = (asked, frame) => ((frame - asked) >>> 0) < 0x80000000;
