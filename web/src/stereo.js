// SPDX-License-Identifier: LGPL-2.1-or-later
// Two eyes. The server sends both pictures, of one moment, side by side in one.

export const kModes = {
  one: 'One eye',
  side: 'Side by side',
  anaglyph: 'Red-cyan',
  headset: 'Headset',
};

// The left eye's red with the right eye's green and blue. What is in focus is at the screen: there the eyes agree. What
// one of them alone would see at the sides is cut away, and as much above and below, so that the picture keeps its shape.
export class Anaglyph {
  constructor(canvas, video) {
    this.canvas = canvas;
    this.video = video;
    this.right = document.createElement('canvas');
  }

  // How much larger than the eyes' pictures it is, for what is cut away.
  get zoom() { return this.rest ? this.video.videoWidth / 2 / this.rest.width : 1; }

  // With every frame of a view, whose eyes are so many metres apart.
  draw(view, eyeDistance) {
    if (this.canvas.hidden || !view) return;
    const width = this.video.videoWidth / 2, height = this.video.videoHeight;
    const focal = height / 2 / Math.tan(view.fov * Math.PI / 360);
    this.shift = Math.min(Math.round(eyeDistance / 2 * focal / view['focus-distance']), width >> 2);
    const kept = width - 2 * this.shift;
    this.rest = { width: kept, height: height * kept / width };  // pixels of each eye's picture
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
