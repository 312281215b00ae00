// SPDX-License-Identifier: LGPL-2.1-or-later
// Figures over the picture: what the server counts, and what only the browser can know.

const kLatest = 30;  // latencies that the median is of

export class Overlay {
  constructor(viewer, box) {
    this.viewer = viewer;
    this.box = box;
    this.shown = [];     // times of frames of the latest second
    this.waiting = [];   // [RTP timestamp, time sent] of changes whose picture has not been shown
    this.latencies = []; // milliseconds, from the change to the picture that shows it
    if (viewer.video.requestVideoFrameCallback) this.watch();
  }

  watch() {
    this.viewer.video.requestVideoFrameCallback((now, frame) => {
      this.shown = [...this.shown.filter(time => time > now - 1000), now];
      const stamp = frame.rtpTimestamp;
      if (stamp !== undefined) {
        // Stamps go round at 2^32.
        const done = this.waiting.filter(([rtp]) => ((stamp - rtp) >>> 0) < 0x80000000);
        this.waiting = this.waiting.filter(entry => !done.includes(entry));
        for (const [, sent] of done) this.latencies = [...this.latencies, now - sent].slice(-kLatest);
      }
      this.watch();
    });
  }

  // A change that was sent at `sent` is in the picture with this stamp.
  applied({ id, rtpTimestamp }) {
    const sent = this.viewer.connection?.times.get(id);
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
    const f = this.viewer.figures;
    const before = this.before ?? f;
    this.before = f;
    if (this.box.hidden || f.pictures === undefined) return;
    const each = (bytes, old) => f.pictures > before.pictures
      ? Math.round((bytes - old) / (f.pictures - before.pictures)) : 0;
    const video = this.viewer.video;
    const lines = [
      ['picture', `${video.videoWidth} x ${video.videoHeight}, ${this.shown.length} frames/s`],
      ['motion to picture', this.latency === undefined ? 'move to measure' : `${this.latency.toFixed(0)} ms`],
      ['request to picture', `${f.pictureMs.toFixed(1)} ms, of this answers ${f.answerMs.toFixed(1)} ms`],
      ['bytes a picture', `${each(f.answerBytes, before.answerBytes)} from the cameras, ` +
        `${each(f.videoBytes, before.videoBytes)} as video`],
      ['bit rate', `${(f.bitRate / 1e6).toFixed(1)} Mbit/s at most`],
      ['network', `${(f.loss * 100).toFixed(1)} % lost, ${f.roundTripMs.toFixed(0)} ms there and back`],
      ['skew', `${f.skewMs.toFixed(1)} ms`],
      ['incomplete', `${f.incomplete} of ${f.pictures} pictures, ${f.missing} fragments missing`],
    ];
    this.box.textContent = lines.map(([name, value]) => `${name.padEnd(20)}${value}`).join('\n');
  }
}
