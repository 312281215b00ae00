// SPDX-License-Identifier: LGPL-2.1-or-later
// Redrawn pictures: quality for random movements against ground truth, time from a movement to its picture, and cost on the
// server. tests/bench/reprojection.sh BUILD [MOVEMENTS] runs this program.
import { mkdir, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { allowSoftware, artefacts, expect, launchBrowser, makeRig, newPage, openDelayed, processorTime, rests, runTests, serve,
  setView, settled, shown, stateOf, truthsOf, until } from './harness.mjs';

const kMovements = Number(process.env.LF_MOVEMENTS ?? 200), kSamples = 40, kSeconds = 8, kTurns = 24;
const kPacket = 100;  // bytes of the headers of a message: UDP, DTLS and SCTP
const kStarts = 5, kPosition = 0.1, kAngle = 10;  // metres, degrees
const size = { width: 640, height: 480 }, folder = join(artefacts, 'reprojection');
await mkdir(folder, { recursive: true });

// A generator of random numbers from 0 to 1 that always starts alike (mulberry32).
function randomNumbers(seed) {
  return () => {
    seed = seed + 0x6d2b79f5 | 0;
    let t = Math.imul(seed ^ seed >>> 15, 1 | seed);
    t ^= t + Math.imul(t ^ t >>> 7, 61 | t);
    return ((t ^ t >>> 14) >>> 0) / 2 ** 32;
  };
}
// Three numbers in a random direction, with a random length of up to `most`.
function randomVector(random, most) {
  for (;;) {
    const v = [0, 1, 2].map(() => 2 * random() - 1), length = Math.hypot(...v);
    if (length > 1 || length < 0.01) continue;
    const scale = most * random() / length;
    return v.map(x => x * scale);
  }
}

// Returns resting pictures with their surfaces: at home, and at views beside it. With a margin, the view is narrower, because
// the cameras see no margin around the home view.
async function starts(browser, film, margin) {
  // At a low rate, even a busy machine keeps the full size and all depths.
  const served = await serve('--rig', join(film, 'rig.json'), '--framerate', '10');
  const page = await newPage(browser, size, { before: allowSoftware });
  await page.goto(served.url);
  await shown(page, 30);
  const home = await stateOf(page), random = randomNumbers(1), list = [];
  for (let i = 0; i < kStarts; i++) {
    const [x, y, z] = randomVector(random, i ? 0.05 : 0);
    await setView(page, { x: home.x + x, y: home.y + y, z: home.z + z, fov: margin ? 0.7 * home.fov : home.fov });
    await page.evaluate(margin => inside().flight.sendView({ margin }), margin);
    await settled(page);
    await until(() => page.evaluate(() => inside().video.videoWidth === 640), 'the full size');
    await page.waitForTimeout(3000);  // until the surface has settled
    list.push(await page.evaluate(async () => {
      const { video, stream, flight } = inside(), canvas = document.createElement('canvas');
      const message = await new Promise(done => stream.connection.addEventListener('surface', ({ detail }) => done(detail), { once: true }));
      Object.assign(canvas, { width: video.videoWidth, height: video.videoHeight });
      canvas.getContext('2d').drawImage(video, 0, 0);
      return { state: flight.seen, message: [...new Uint8Array(message)], picture: canvas.toDataURL('image/png') };
    }));
  }
  return { page, served, list };
}

// Prepares the page: redrawn(start, view) returns the stale and the redrawn picture as pixels, psnr() compares.
async function prepare(page, list) {
  await page.evaluate(async list => {
    const [{ contextOf, Painter }, { decodeSurface }, { cameraOf }] =
      await Promise.all(['painter', 'surface', 'view'].map(name => import(`/src/${name}.js`)));
    const canvas = Object.assign(document.createElement('canvas'), { width: 640, height: 480 });
    const gl = contextOf(canvas, { preserveDrawingBuffer: true }), painter = new Painter(gl);
    const imageOf = async url => {
      const image = new Image();
      image.src = url;
      await image.decode();
      return image;
    };
    const pixels = image => {
      const context = new OffscreenCanvas(640, 480).getContext('2d');
      context.drawImage(image, 0, 0, 640, 480);
      return context.getImageData(0, 0, 640, 480).data;
    };
    const psnr = (a, b) => {
      let sum = 0;
      for (let i = 0; i < a.length; i++) if (i % 4 < 3) sum += (a[i] - b[i]) ** 2;
      return 10 * Math.log10(255 ** 2 * a.length * 0.75 / Math.max(sum, 1e-9));
    };
    const all = await Promise.all(list.map(async ({ state, message, picture }) =>
      ({ state, surface: decodeSurface(Uint8Array.from(message).buffer), image: await imageOf(picture) })));
    globalThis.measure = async (index, view, truth) => {
      const { state, surface, image } = all[index];
      painter.load(image, index);
      const began = performance.now(), camera = cameraOf(view, 640, 480);
      painter.draw(surface, surface.camera, camera);
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));  // waits, unlike finish()
      const time = performance.now() - began, redrawn = pixels(canvas), expected = pixels(await imageOf(truth));
      const url = canvas.toDataURL('image/png');
      painter.draw(surface, surface.camera, cameraOf(state, 640, 480));
      const stale = pixels(canvas);  // the crop of the picture that shows the old view
      return { before: psnr(stale, expected), after: psnr(redrawn, expected), time, url };
    };
  }, list);
}

async function measure(film, margin) {
  const browser = await launchBrowser(), { page, served, list } = await starts(browser, film, margin);
  await prepare(page, list);
  await page.evaluate(() => document.querySelector('lightfield-viewer').remove());
  await served.stop();
  const random = randomNumbers(2), rows = [];
  for (const [index, { state }] of list.entries()) {
    const count = Math.floor(kMovements * (index + 1) / kStarts) - Math.floor(kMovements * index / kStarts);
    const views = Array.from({ length: count }, () => {
      const [x, y, z] = randomVector(random, kPosition), [pitch, yaw, roll] = randomVector(random, kAngle);
      return { ...state, x: state.x + x, y: state.y + y, z: state.z + z, pitch: state.pitch + pitch, yaw: state.yaw + yaw,
        roll: state.roll + roll };
    });
    const truths = await truthsOf(views, size);
    for (const [i, view] of views.entries()) {
      const { url, ...row } = await page.evaluate(([...all]) => measure(...all),
        [index, view, `data:image/png;base64,${truths[i].toString('base64')}`]);
      rows.push({ ...row, name: `${index}-${i}` });
      if (i >= 4) continue;
      await writeFile(join(folder, `${margin}-${index}-${i}.png`), Buffer.from(url.split(',')[1], 'base64'));
      await writeFile(join(folder, `${margin}-${index}-${i}-true.png`), truths[i]);
    }
  }
  await browser.close();
  const sorted = values => values.sort((a, b) => a - b), median = values => sorted(values)[values.length >> 1];
  const gains = sorted(rows.map(({ before, after }) => after - before));
  console.log(`# margin ${margin}, ${rows.length} movements: stale ${median(rows.map(row => row.before)).toFixed(1)} dB, redrawn ` +
    `${median(rows.map(row => row.after)).toFixed(1)} dB; gain: median ${median(gains).toFixed(1)} dB, least ${gains[0].toFixed(1)} dB; ` +
    `drawing: median ${median(rows.map(row => row.time)).toFixed(1)} ms`);
  return { median: gains[gains.length >> 1], least: gains[0] };
}

const at = (values, share) => [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(share * values.length))];
const both = values => values.length ? `${at(values, 0.5).toFixed(0)} / ${at(values, 0.95).toFixed(0)} ms` : '-';

// Time from a key press until its redrawn picture is painted, and until the true picture is displayed: with pictures that are
// redrawn, without the time of drawing in software, and with a page that redraws nothing.
async function motionToPainted(film) {
  for (const kind of ['redrawn', 'redrawn without drawing', 'not redrawn'])
    for (const roundTrip of [0, 50, 100, 200]) {
      const served = await serve('--rig', join(film, 'rig.json')), browser = await launchBrowser();
      const { page, relay } = await openDelayed(browser, served, roundTrip), rows = [];
      await page.evaluate(kind => {
        const { redraw } = inside();
        redraw.isImpossible = kind === 'not redrawn';
        if (redraw.load() && kind === 'redrawn without drawing') redraw.painter.load = redraw.painter.draw = () => {};
      }, kind);
      for (let i = 0; i < kSamples; i++) {
        await rests(page);
        rows.push(await page.evaluate(key => new Promise(done => {
          const { redraw, flight, controls } = inside(), { drawn } = redraw, { seen } = flight, began = performance.now();
          const row = {}, { paint } = redraw;
          let frames = 0;  // of the display
          redraw.paint = now => {
            const start = performance.now();
            paint.call(redraw, now);
            redraw.painter?.gl.readPixels(0, 0, 1, 1, WebGL2RenderingContext.RGBA, WebGL2RenderingContext.UNSIGNED_BYTE, new Uint8Array(4));
            row.draw ??= performance.now() - start;
          };
          const look = () => {
            frames++;
            if (row.painted === undefined && redraw.drawn > drawn) [row.painted, row.frames] = [performance.now() - began, frames];
            if (flight.seen === seen) return requestAnimationFrame(look);
            delete redraw.paint;
            done({ ...row, arrived: performance.now() - began });
          };
          controls.key(key);
          requestAnimationFrame(look);
        }), i % 2 ? 'a' : 'd'));
      }
      const of = name => rows.map(row => row[name]).filter(Number.isFinite), frames = of('frames');
      console.log(`# ${kind}, round trip ${roundTrip} ms: painted after ${both(of('painted'))} (${frames.length} of ${rows.length}, in ` +
        `frame ${frames.length ? Math.max(...frames) : '-'} at the latest), true picture after ${both(of('arrived'))} (p50 / p95), ` +
        `drawing ${both(of('draw'))}`);
      await browser.close();
      relay.close();
      await served.stop();
    }
}

// Bits and processor time of the server for a moving viewer, with and without surfaces, in turns.
async function costOnTheServer(film) {
  // At a low rate, even a busy machine keeps the full size and all depths.
  const served = await serve('--rig', join(film, 'rig.json'), '--connects', '100', '--framerate', '10');
  const browser = await launchBrowser(), turns = { with: [], without: [] };
  for (let turn = 0; turn < kTurns; turn++) {
    const kind = turn % 2 ? 'without' : 'with', page = await newPage(browser, size);
    if (kind === 'without')
      await page.addInitScript(() => {
        const { createDataChannel } = RTCPeerConnection.prototype;
        RTCPeerConnection.prototype.createDataChannel = function (name, options) {
          return name === 'surface' ? {} : createDataChannel.call(this, name, options);
        };
      });
    await page.goto(served.url);
    await shown(page, 30);
    const sample = async () => [await processorTime(served.pid), await served.metric('pictures_total'),
      await served.metric('video_bytes_total'), await served.metric('surface_bytes_total')];
    const before = await sample();
    const messages = await page.evaluate(async seconds => {
      const { flight, stream } = inside(), { x } = flight.state, began = performance.now();
      let messages = 0;
      stream.connection.addEventListener('surface', () => messages++);
      while (performance.now() < began + 1000 * seconds) {
        flight.sendView({ x: x + 0.05 * Math.sin((performance.now() - began) / 500) });
        await new Promise(done => setTimeout(done, 33));
      }
      return messages;
    }, kSeconds);
    const [time, pictures, video, surfaces] = (await sample()).map((value, k) => value - before[k]);
    turns[kind].push([1000 * time, video, surfaces + kPacket * messages].map(value => value / pictures));
    expect(await page.evaluate(width => inside().video.videoWidth === width, size.width), 'the pictures have the full size');
    await page.context().close();
  }
  const means = Object.values(turns).map(rows => rows[0].map((_, k) => rows.reduce((sum, row) => sum + row[k], 0) / rows.length));
  for (const [kind, [time, video, surfaces]] of Object.keys(turns).map((kind, i) => [kind, means[i]])) {
    const times = turns[kind].map(([value]) => value);
    console.log(`# ${kind} surfaces, mean of ${times.length} turns: ${time.toFixed(2)} ms of a processor (${at(times, 0.25).toFixed(2)} to ` +
      `${at(times, 0.75).toFixed(2)} in half of the turns), ${(video / 1000).toFixed(2)} kB of video and ${surfaces.toFixed(0)} bytes of ` +
      `surfaces with their headers a picture`);
  }
  const [[time, video, surfaces], [plain, plainVideo]] = means;
  console.log(`# surfaces cost ${(100 * (time / plain - 1)).toFixed(1)} % of the processor time, and ` +
    `${(100 * surfaces / video).toFixed(1)} % of the bits of the video (${(100 * ((video + surfaces) / plainVideo - 1)).toFixed(1)} % more in all)`);
  await browser.close();
  await served.stop();
}

const film = await makeRig('8x8');
await runTests([
  ...[0, 0.3].map(margin => [`quality with a margin of ${margin}`, async () => {
    const { median, least } = await measure(film, margin);
    expect(median >= 4, `the median gain is ${median} dB`);
    expect(least >= -0.5, `the least gain is ${least} dB`);
  }]),
  ['motion to painted', () => motionToPainted(film)],
  ['cost on the server', () => costOnTheServer(film)],
]);
