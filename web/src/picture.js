// SPDX-License-Identifier: LGPL-2.1-or-later
// Position of the picture in the element, in CSS pixels from the top left corner, and conversion to pixels of the view.

const kSame = 1.02;  // aspect ratios that differ by less count as equal

// Calls take(now, rtpTimestamp) for each picture that a video displays. The timestamp is undefined in browsers without RTP
// timestamps of pictures. Browsers without requestVideoFrameCallback() only have a number of pictures, which is read in each
// frame of the display while the video plays.
export function watchFrames(video, take) {
  if (video.requestVideoFrameCallback) {
    const next = () => video.requestVideoFrameCallback((now, { rtpTimestamp }) => {
      next();
      take(now, rtpTimestamp);
    });
    return next();
  }
  let count = 0, frame = null;
  const look = now => {
    frame = video.paused ? null : requestAnimationFrame(look);
    const { totalVideoFrames } = video.getVideoPlaybackQuality();
    if (totalVideoFrames === count) return;
    count = totalVideoFrames;
    take(now);
  };
  video.addEventListener('playing', () => frame ??= requestAnimationFrame(look));
}

export class Picture {
  constructor(viewer) { this.viewer = viewer; }

  // The picture keeps its aspect ratio. If the ratio of the element is equal except for rounding, the picture fills the
  // element.
  fit() { this.viewer.stage.classList.toggle('fills', this.fills); }
  get fills() { return Math.max(...this.scales) / Math.min(...this.scales) < kSame; }
  get scales() {
    const { clientWidth, clientHeight, videoHeight } = this.viewer.video;
    return [clientWidth / (this.shownWidth || 1), clientHeight / (videoHeight || 1)];
  }
  get shownWidth() { return this.viewer.mode === 'side' ? this.viewer.video.videoWidth : this.eyeWidth; }
  get box() {
    const { viewer, shownWidth } = this, { clientWidth, clientHeight, videoHeight } = viewer.video;
    const scale = ((this.fills ? Math.max : Math.min)(...this.scales) || 1) * (viewer.mode === 'anaglyph' ? viewer.anaglyph.zoom : 1);
    const width = shownWidth * scale, height = videoHeight * scale;
    return { x: (clientWidth - width) / 2, y: (clientHeight - height) / 2, width, height, scale };
  }
  // Returns the part of a picture that shows the view, without the margin: x, y, width and height in its pixels.
  shown(width, height) {
    const scale = 1 / (1 + this.viewer.flight.margin);
    return [width * (1 - scale) / 2, height * (1 - scale) / 2, width * scale, height * scale];
  }
  // Crops the video on the screen to the view.
  crop() {
    const { viewer: { flight: { margin }, video: { style } }, box } = this, share = margin / (1 + margin) / 2;
    style.scale = margin ? 1 + margin : '';
    style.clipPath = margin ? `inset(${box.y + box.height * share}px ${box.x + box.width * share}px)` : '';
  }
  get eyes() {
    const { box } = this;
    if (this.viewer.mode !== 'side') return [{ box, offset: 0 }];
    const width = box.width / 2;
    return [-1, 1].map(side => ({ box: { ...box, width, x: box.x + (side > 0 ? width : 0) },
      offset: side * this.viewer.eyeDistance / 2 }));
  }
  get eyeWidth() { return this.viewer.video.videoWidth / (this.viewer.twoEyes ? 2 : 1); }
  pixelAt({ clientX, clientY }) {
    const frame = this.viewer.stage.getBoundingClientRect(), { box } = this;
    return { x: (clientX - frame.left - box.x) / box.scale, y: (clientY - frame.top - box.y) / box.scale };
  }
  placeOf({ x, y }) {
    const { box } = this;
    return { x: box.x + x * box.scale, y: box.y + y * box.scale };
  }

  toBlob(type, quality) {
    const { viewer } = this, { video } = viewer;
    if (!video.videoWidth) return Promise.reject(new DOMException('there is no picture yet', 'InvalidStateError'));
    const canvas = document.createElement('canvas');
    Object.assign(canvas, { width: viewer.mode === 'side' ? video.videoWidth : this.eyeWidth, height: video.videoHeight });
    const { width, height } = canvas, picture = viewer.mode === 'anaglyph' ? viewer.anaglyph.canvas : video;
    canvas.getContext('2d').drawImage(picture, ...this.shown(width, height), 0, 0, width, height);
    return new Promise((done, failed) => canvas.toBlob(
      blob => blob ? done(blob) : failed(new DOMException(`no ${type}`, 'EncodingError')), type, quality));
  }
}

// The stereo modes, which show the pictures of both eyes. The server sends both pictures side by side in one frame.

export const kModes = {
  one: 'One eye',
  side: 'Side by side',
  anaglyph: 'Red-cyan',
  headset: 'Headset',
};

// Combines the red of the left eye's picture with green and blue of the right eye's. The pictures are shifted so that
// objects at the focus distance appear at the screen. Margins that only one eye sees are cropped, and the height in
// proportion.
export class Anaglyph {
  constructor(canvas, video) {
    this.canvas = canvas;
    this.video = video;
    this.right = document.createElement('canvas');
  }

  get zoom() { return this.rest ? this.video.videoWidth / 2 / this.rest.width : 1; }

  draw(view, eyeDistance) {
    if (this.canvas.hidden || !view) return;
    const width = this.video.videoWidth / 2, height = this.video.videoHeight;
    const focal = height / 2 / Math.tan(view.fov * Math.PI / 360);
    this.shift = Math.min(Math.round(eyeDistance / 2 * focal / view['focus-distance']), width >> 2);
    const kept = width - 2 * this.shift;
    this.rest = { width: kept, height: height * kept / width };
    const half = (canvas, side, colour) => {
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      const context = canvas.getContext('2d');
      context.globalCompositeOperation = 'copy';
      context.drawImage(this.video, side ? width : 2 * this.shift, (height - this.rest.height) / 2, this.rest.width,
        this.rest.height, 0, 0, width, height);
      context.globalCompositeOperation = 'multiply';
      context.fillStyle = colour;
      context.fillRect(0, 0, width, height);
      return context;
    };
    const context = half(this.canvas, 0, '#f00');
    half(this.right, 1, '#0ff');
    context.globalCompositeOperation = 'lighter';
    context.drawImage(this.right, 0, 0);
  }
}
