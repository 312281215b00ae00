// SPDX-License-Identifier: LGPL-2.1-or-later
// Films a flight around the built-in scene over a slow network, in the sizes of a phone and of a desktop. The films show
// whether redrawn pictures jump, or have torn silhouettes. tests/bench/flight.sh BUILD [SECONDS [ROUND_TRIP_MS]] runs this
// program.
//
// The film does not depend on the speed of the machine, because it is made picture by picture: the page receives the picture
// that would have arrived by then, with the margin that the page would have requested, and redraws it for the requested view.
// Each film is a folder of numbered pictures. The program names the pictures that differ most from a steady movement.
import { mkdir, rm, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { allowSoftware, artefacts, closeClean, launchBrowser, makeRig, openShown, picture, runTests, serve, source,
  stateOf } from './harness.mjs';

const [{ Margin }, { displacement }, { cameraOf }] =
  await Promise.all(['margin', 'surface', 'view'].map(name => import(join(source, `web/src/${name}.js`))));

const kSeconds = Number(process.env.LF_SECONDS ?? 60), kRoundTrip = Number(process.env.LF_ROUND_TRIP ?? 100);
const kRate = 10, kServer = 100;  // pictures of the film for each second; milliseconds from a request to its answer
const kWorst = 6, kScale = 0.5;   // pixels of the picture for a pixel of the page
const kMessages = 60;             // requests of the page in a second
const rig = await makeRig('6x6');
const browser = await launchBrowser();

// The requested view at a time in seconds: fast and slow movements in all directions, with turns, at up to 0.3 m/s and 16
// degrees/s.
function viewAt(t, home) {
  const phase = 2.5 * (t + 4 * (1 - Math.cos(0.2 * t))), at = (amplitude, rate) => amplitude * Math.sin(rate * phase);
  return { x: home.x + at(0.06, 0.9), y: home.y + at(0.03, 1.3), z: home.z + at(0.08, 0.5), yaw: home.yaw + at(4, 0.7),
    pitch: home.pitch + at(2, 1.1), roll: home.roll, fov: 0.7 * home.fov };
}

// Returns the margins that the page requests during the flight, by the number of the picture. `nearest` is 1/metres.
function marginsOf(home, { width, height }, late, nearest) {
  const margin = new Margin(), margins = [], camera = t => cameraOf(viewAt(t, home), width, height);
  for (let i = 0, k = 0; i < kRate * kSeconds; i++) {
    for (; k / kMessages <= i / kRate - late; k++) {
      const pixels = displacement(camera((k - 1) / kMessages), camera(k / kMessages), nearest);
      margin.moved(1000 * k / kMessages, pixels / width);
      margins[i] = margin.at(1000 * k / kMessages, 1000 * late);
    }
    margins[i] ??= 0;
  }
  return margins;
}

// Requests a view. Returns the picture on the screen before the server can answer.
async function redrawn(page, view) {
  const url = await page.evaluate(view => {
    const { redraw, flight } = inside();
    flight.sendView(view);
    redraw.paint(performance.now());
    return redraw.painted ? redraw.canvas.toDataURL('image/png') : null;
  }, view);
  return url ? Buffer.from(url.split(',')[1], 'base64') : picture(page);
}

// Returns the mean difference between successive pictures, in levels of 255.
async function changesOf(page, pngs) {
  await page.evaluate(() => globalThis.last = null);
  const changes = [];
  for (const png of pngs)
    changes.push(await page.evaluate(async data => {
      const image = await createImageBitmap(new Blob([Uint8Array.from(atob(data), c => c.charCodeAt(0))]));
      const width = image.width >> 1, height = image.height >> 1;
      const context = new OffscreenCanvas(width, height).getContext('2d');
      context.drawImage(image, 0, 0, width, height);
      const { data: now } = context.getImageData(0, 0, width, height), before = globalThis.last;
      globalThis.last = now;
      if (before?.length !== now.length) return 0;
      let sum = 0;
      for (let i = 0; i < now.length; i++) sum += Math.abs(now[i] - before[i]);
      return sum / (0.75 * now.length);
    }, png.toString('base64')));
  return changes;
}

async function film(name, size, options) {
  const folder = join(artefacts, 'flight', name);
  await rm(folder, { recursive: true, force: true });
  await mkdir(folder, { recursive: true });
  // At a low rate, even a busy machine keeps the full size and all depths.
  const served = await serve('--rig', join(rig, 'rig.json'), '--connects', '100', '--framerate', '8');
  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware, deviceScaleFactor: kScale, ...options });
  await page.waitForFunction(() => inside().redraw.picture?.surface.levels.length > 100);
  const nearest = await page.evaluate(() => {
    const { redraw } = inside();
    redraw.requestMargin = redraw.wake = () => {};  // redrawn() paints
    return redraw.picture.surface.nearest;
  });
  const { aperture, ...home } = await stateOf(page), late = (kRoundTrip + kServer) / 1000, pngs = [];
  const margins = marginsOf(home, size, late, nearest);
  let reduced = 0;
  for (let i = 0; i < kRate * kSeconds; i++) {
    const t = i / kRate;
    reduced += await page.evaluate(async ({ view, margin }) => {
      inside().flight.sendView({ margin });
      await document.querySelector('lightfield-viewer').setView(view);
      for (let k = 0; k < 3; k++) await new Promise(done => inside().video.requestVideoFrameCallback(done));  // sharper
      return Boolean(inside().statistics.shed?.what);
    }, { view: viewAt(t - late, home), margin: margins[i] });
    await page.waitForFunction(() => inside().redraw.prediction.isConfirmed);
    pngs.push(await redrawn(page, viewAt(t, home)));
    await writeFile(join(folder, `${String(i).padStart(5, '0')}.png`), pngs[i]);
  }
  const changes = await changesOf(page, pngs), sorted = changes.slice(1).sort((a, b) => a - b);
  // A steady movement changes the picture as much as before and after. A jump changes it much more.
  const jump = i => changes[i] - Math.max(changes[i - 1], changes[i + 1]);
  const worst = changes.map((_, i) => i).slice(2, -1).sort((a, b) => jump(b) - jump(a)).slice(0, kWorst);
  console.log(`# ${name}: ${pngs.length} pictures, each ${1000 * late} ms late. From one to the next, the median change is ` +
    `${sorted[sorted.length >> 1].toFixed(1)} of 255. The margin is ${Math.min(...margins)} to ${Math.max(...margins)}. The server ` +
    `was overloaded in ${reduced} pictures`);
  console.log(`# ${name}: more than before and after: ${worst.map(i => `picture ${i} by ${jump(i).toFixed(1)}`).join(', ')}`);
  await closeClean(page, served);
}

await runTests([
  ['desktop', () => film('desktop', { width: 1280, height: 720 })],
  ['phone', () => film('phone', { width: 390, height: 844 }, { hasTouch: true })],
]);
