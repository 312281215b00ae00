// SPDX-License-Identifier: LGPL-2.1-or-later
// Figures over the picture: what the server counts, and what only the browser can know.

const kLatest = 30;  // latencies that the median is of

export class Figures {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;
    this.shown = [];     // times of frames of the latest second
    this.waiting = [];   // [RTP timestamp, time sent] of changes whose picture has not been shown
    this.latencies = []; // milliseconds, from the change to the picture that shows it
  }

  // With every frame.
  frame(now, { rtpTimestamp }) {
    this.shown = [...this.shown.filter(time => time > now - 1000), now];
    if (rtpTimestamp === undefined) return;
    const done = this.waiting.filter(([stamp]) => isShown(stamp, rtpTimestamp));
    this.waiting = this.waiting.filter(entry => !done.includes(entry));
    for (const [, sent] of done) this.latencies = [...this.latencies, now - sent].slice(-kLatest);
  }

  // A change that was sent at `sent` is in the picture with this stamp.
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
      ['request to picture', `${f.pictureMs.toFixed(1)} ms, of this answers ${f.answerMs.toFixed(1)} ms, ` +
        `adding ${f.addMs.toFixed(1)} ms`],
      ['bytes a picture', `${each(f.answerBytes, before.answerBytes)} from the cameras, ` +
        `${(width * height * 1.5 / 1000).toFixed(1)} kB composed, ${each(f.videoBytes, before.videoBytes)} as video`],
      ['bit rate', f.sentRate === undefined ? `${megabits(f.bitRate)} at most` :
        `${megabits(f.sentRate)} of ${megabits(f.bitRate)} aimed at`],
      ...f.shed?.what ? [['left away', shed(f.shed)]] : [],
      ...f.busy === undefined ? [] : [['server', `${(100 * f.busy).toFixed(0)} % busy, ${f.encoder}`]],
      ['network', `${(f.loss * 100).toFixed(1)} % lost, ${f.roundTripMs.toFixed(0)} ms there and back`],
      ['skew', `${f.skewMs.toFixed(1)} ms at most`],
      ['lost', `${f.missing} fragments, in ${f.incomplete} of ${f.pictures} pictures; ` +
        `${f.outOfService} cameras out of service`],
    ];
    this.box.textContent = lines.map(([name, value]) => `${name.padEnd(20)}${value}`).join('\n');
  }
}

const megabits = rate => `${(rate / 1e6).toFixed(1)} Mbit/s`;

// What the server does without, for the sake of whom.
function shed({ what, why, rate, size }) {
  const parts = [what && 'trials of the focus', rate > 1 && `${rate - 1} of ${rate} pictures`, size > 1 && `all but 1/${size} of the size`];
  return `${parts.filter(Boolean).join(', ')}: too much for the ${why}`;
}

// Whether the frame with this stamp is the one asked for, or a later one. Stamps go round at 2^32.
export const isShown = (asked, frame) => ((frame - asked) >>> 0) < 0x80000000;
