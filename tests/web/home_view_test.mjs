// SPDX-License-Identifier: LGPL-2.1-or-later
// The home view in windows of many shapes: lf-serve's `auto` must not be worse than the viewer's plane, neither at the
// start nor later. LF_SECONDS=60 watches all windows for 60 seconds, with stills and film.
//
// Both modes are compared in a browser: two servers that differ only in --focus-mode, with the same encoder, bit rate
// and decoder, so that video artifacts affect both. The truth is ray-traced. Pixels count if cameras cover them in the
// plane mode, except for a border that video may blur into the dark.
import { writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, closeClean, expect, launchBrowser, makeFilm, makeRig, openPage, rendered, runTests, serve,
  shown, stateOf, truthOf } from './harness.mjs';

const kWindows = [[1280, 720], [800, 480], [480, 640], [360, 640], [640, 360]];
const kFilm = Array.from({ length: 30 }, (_, i) => i / 15);  // times of makeFilm()'s frames, seconds
// Sampling times in seconds; the first sample is after one second. The plane is sampled until it is sharp, a film at
// every frame.
const kStep = 0.5, kPlane = { stills: { seconds: 2, step: 0.5 }, film: { seconds: 5, step: 0.1 } };
const kSlack = 0.1;   // dB
const kGain = 3;      // dB; minimum improvement after the surface has arrived
const kPatience = 60;  // seconds until the improvement, on a busy machine
const chosenSeconds = Number(process.env.LF_SECONDS ?? 0);
const browser = await launchBrowser();

// Connects a page that is not connected and samples the video every `step` seconds, from one second after the first
// frame. Ends after `seconds` when a sample has `enough` dB, but not later than `patience` seconds. Compares each
// sample with the best match `frame` of the truth. Returns the share of compared pixels, the samples, and the last and
// worst images as PNGs.
async function watchVideo({ truths, covered, seconds, step, enough = 0, patience = 0 }) {
  const pixelsOf = async data => {
    const image = await createImageBitmap(new Blob([Uint8Array.from(atob(data), c => c.charCodeAt(0))]));
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  };
  const scenes = [];
  for (const data of truths) scenes.push((await pixelsOf(data)).data);
  const { data: plane, width, height } = await pixelsOf(covered);
  const border = 8, counted = [];
  const isDark = (x, y) => {
    const at = 4 * (y * width + x);
    return x >= 0 && y >= 0 && x < width && y < height && plane[at] + plane[at + 1] + plane[at + 2] === 0;
  };
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++)
      if (![[0, 0], [border, 0], [-border, 0], [0, border], [0, -border]].some(([dx, dy]) => isDark(x + dx, y + dy)))
        counted.push(4 * (y * width + x));
  const some = counted.filter((_, i) => i % 29 === 0);  // these pixels suffice to find the best match
  const errorOf = (data, scene, pixels) => {
    let error = 0;
    for (const i of pixels)
      error += (data[i] - scene[i]) ** 2 + (data[i + 1] - scene[i + 1]) ** 2 + (data[i + 2] - scene[i + 2]) ** 2;
    return error / (3 * pixels.length);
  };
  const contrastOf = data => {
    let sum = 0, square = 0;
    for (const i of counted) {
      const level = data[i] + data[i + 1] + data[i + 2];
      sum += level;
      square += level * level;
    }
    return Math.sqrt(square / counted.length - (sum / counted.length) ** 2);
  };

  const viewer = inside(), { video } = viewer;
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  const context = canvas.getContext('2d', { willReadFrequently: true });
  const nextPicture = () => new Promise(done => video.requestVideoFrameCallback(done));
  const png = () => canvas.toDataURL('image/png').split(',')[1];
  document.querySelector('lightfield-viewer').play();
  await nextPicture();
  const began = performance.now(), looks = [];
  let worst = Infinity, worstPng;
  const isSharp = () => looks.at(-1)?.psnr >= enough;
  for (let second = 1; second <= seconds || (second <= patience && !isSharp()); second += step) {
    await new Promise(done => setTimeout(done, began + 1000 * second - performance.now()));
    await nextPicture();
    const at = (performance.now() - began) / 1000;
    context.drawImage(video, 0, 0, width, height);  // the video is smaller on a bad network
    const { data } = context.getImageData(0, 0, width, height);
    const errors = scenes.map(scene => errorOf(data, scene, some)), frame = errors.indexOf(Math.min(...errors));
    const psnr = 10 * Math.log10(255 ** 2 / Math.max(errorOf(data, scenes[frame], counted), 1e-9));
    const contrast = contrastOf(data) / contrastOf(scenes[frame]);
    looks.push({ at, psnr, frame, contrast, focus: viewer.statistics.focus });
    if (psnr < worst) [worst, worstPng] = [psnr, png()];
  }
  return { part: counted.length / (width * height), looks, last: png(), worst: worstPng };
}

async function openAndLeave(served, window) {
  const page = await openPage(browser, served.url, window);
  await shown(page);
  const state = await stateOf(page);
  const size = await page.evaluate(() => {
    const viewer = inside(), { videoWidth, videoHeight } = viewer.video;
    document.querySelector('lightfield-viewer').pause();
    return { width: videoWidth, height: videoHeight };
  });
  return { page, state, size };
}

// Watches the viewer's plane briefly, then `auto` for these seconds, and compares.
async function homeView(folder, kind, [width, height], seconds) {
  const seen = {};
  let known;
  for (const mode of ['plane', 'auto']) {
    const served = await serve('--rig', join(folder, 'rig.json'), '--focus', '2.2', '--focus-mode', mode);
    const { page, state, size } = await openAndLeave(served, { width, height });
    if (!known) {
      const truths = await truthOf(state, size, kind === 'film' ? kFilm : [0]);
      const covered = await rendered(folder, state, size);
      known = { state, size, truths: truths.map(png => png.toString('base64')), covered: covered.toString('base64') };
    }
    expect(JSON.stringify([state, size]) === JSON.stringify([known.state, known.size]), 'not the same view of all');
    const looksOfAuto = () => ({
      seconds, step: kStep, patience: kPatience, enough: Math.max(...seen.plane.looks.map(({ psnr }) => psnr)) + kGain,
    });
    seen[mode] = await page.evaluate(watchVideo, { ...known, ...mode === 'plane' ? kPlane[kind] : looksOfAuto() });
    await closeClean(page, served);
  }
  const { plane, auto } = seen, name = `${kind} in ${width}x${height}`;
  for (const which of ['last', 'worst'])
    await writeFile(join(artefacts, `home-${kind}-${width}x${height}-${which}.png`),
      Buffer.from(auto[which], 'base64'));
  // The plane's best PSNR; for film, at the nearest scene time.
  const apart = (a, b) => Math.min(Math.abs(a - b), known.truths.length - Math.abs(a - b));
  const planeAt = frame => {
    const nearest = Math.min(...plane.looks.map(look => apart(look.frame, frame)));
    return Math.max(...plane.looks.filter(look => apart(look.frame, frame) === nearest).map(look => look.psnr));
  };
  const rows = auto.looks.map(look => ({ ...look, gain: look.psnr - planeAt(look.frame) }));
  const told = ({ at, psnr, gain }) =>
    `after ${at.toFixed(1)} s ${psnr.toFixed(1)} dB, ${gain.toFixed(2)} more than the plane`;
  const worst = rows.reduce((a, b) => b.gain < a.gain ? b : a);
  const some = rows.filter(({ at }, i) => i === 0 || i === rows.length - 1 || Math.abs(at - 10) < kStep / 2);
  console.log(`# ${name}, ${(100 * auto.part).toFixed(0)} % counted: ${some.map(told).join('; ')}; ` +
    `worst: ${told(worst)}; contrast ${rows.at(-1).contrast.toFixed(3)} of the scene's`);
  expect(auto.part > 0.3, `${name}: only ${(100 * auto.part).toFixed(0)} % of the picture is covered`);
  expect(worst.gain >= -kSlack, `${name}: ${told(worst)}: ${JSON.stringify(worst.focus)}`);
  // Blur reduces the contrast. Full-range levels mistaken for video levels increase it by 1.16.
  const { contrast } = rows.at(-1);
  expect(contrast > 0.85 && contrast < 1.05, `${name}: ${contrast.toFixed(3)} of the scene's contrast`);
  expect(rows.at(-1).gain >= kGain, `${name}: no surface: ${told(rows.at(-1))}`);
}

const stills = await makeRig('8x8');
const film = await makeFilm(chosenSeconds ? '8x8' : '4x4');
const watched = (kind, folder, window, seconds) =>
  [`the home view of ${kind} in ${window.join('x')}`, () => homeView(folder, kind, window, chosenSeconds || seconds)];
await runTests([
  ...kWindows.map((window, i) => watched('stills', stills, window, i ? 1 : 10)),
  ...kWindows.filter((_, i) => chosenSeconds || i === 4).map(window => watched('film', film, window, 4)),
]);
