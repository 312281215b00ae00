// SPDX-License-Identifier: LGPL-2.1-or-later
// Cost per viewer and latency of movements: tests/web/browser.sh BUILD tests/web/figures.mjs
import { spawn } from 'node:child_process';
import { once } from 'node:events';
import { createInterface } from 'node:readline';
import { join } from 'node:path';
import { close, launchBrowser, makeFilm, makeRig, newPage, openPage, processorTime, runTests, serve, shown, throughRelay } from './harness.mjs';

const seconds = Number(process.env.LF_SECONDS ?? 10);
const browser = await launchBrowser();

const decoded = page => page.evaluate(async () => {
  const { peer } = inside().stream.connection;
  for (const entry of (await peer.getStats()).values())
    if (entry.type === 'inbound-rtp') return { frames: entry.framesDecoded, time: performance.now() };
});

// Starts viewers in the browser. Returns a function that stops them and returns their frame rates.
async function browsers(served, count, size) {
  const pages = [];
  for (let i = 0; i < count; i++)
    pages.push(await openPage(browser, new URL(`#yaw=${i - count / 2}`, served.url).href, size));
  await Promise.all(pages.map(page => shown(page, 30)));
  const before = await Promise.all(pages.map(decoded));
  return async () => {
    const after = await Promise.all(pages.map(decoded));
    await Promise.all(pages.map(page => page.context().close()));
    return after.map((now, i) => (now.frames - before[i].frames) / (now.time - before[i].time) * 1000);
  };
}

// Like browsers(), without the browser, which uses more processor time than the server.
async function receivers(served, count, { width, height }) {
  const child = spawn(join(process.env.LF_TOOLS_DIR, '../tests/watch'),
    [served.url, count, width, height, seconds], { stdio: ['ignore', 'pipe', 'inherit'] });
  const ended = once(child, 'exit');
  const lines = createInterface({ input: child.stdout })[Symbol.asyncIterator]();
  await lines.next();
  return async () => {
    const { value } = await lines.next();
    await ended;
    return JSON.parse(value).rates;
  };
}

async function sample(served) {
  const metric = async name => await served.metric(name);
  return { processor: await processorTime(served.pid), time: Date.now(),
    pictures: await metric('pictures_total'), incomplete: await metric('incomplete_pictures_total'),
    camera: await metric('camera_bytes_total'), video: await metric('video_bytes_total'),
    resident: await metric('resident_bytes'), shed: await metric('shed_step') };
}

async function viewers(folder, count, size, begin, ...options) {
  const served = await serve('--rig', join(folder, 'rig.json'), '--viewers', '100', '--address-views', '100', '--connects', '100', ...options);
  const end = await begin(served, count, size);
  const a = await sample(served);
  await new Promise(done => setTimeout(done, seconds * 1000));
  const b = await sample(served), rates = await end();
  const time = (b.time - a.time) / 1000, pictures = b.pictures - a.pictures;
  const row = { pictures: pictures / time, bytes: (b.camera - a.camera) / pictures };
  console.log(`# ${count} ${begin.name} of ${size.width}x${size.height}: ` +
    `${rates.map(rate => rate.toFixed(1)).join(' ')} frames/s, server: ` +
    `${((b.processor - a.processor) / time * 100).toFixed(0)} % of a processor, ` +
    `${((b.processor - a.processor) / pictures * 1000).toFixed(1)} ms of it a picture (shedding step ${b.shed}), ` +
    `${(b.resident / 2 ** 20).toFixed(0)} MiB, ${row.bytes.toFixed(0)} bytes of answers a picture, ` +
    `${((b.video - a.video) * 8e-6 / time).toFixed(1)} Mbit/s of video, ` +
    `${b.incomplete - a.incomplete} of ${pictures} pictures incomplete`);
  await served.stop();
  return row;
}

async function growth() {
  const rows = [];
  for (const grid of ['4x4', '8x8', '16x16'])
    rows.push([grid, await viewers(await makeRig(grid), 1, { width: 320, height: 240 }, receivers)]);
  const [[, { bytes: least }]] = rows;
  for (const [grid, { bytes }] of rows)
    console.log(`# ${grid} cameras: ${bytes.toFixed(0)} bytes a picture, ratio ${(bytes / least).toFixed(2)}`);
}

// Measures the latency of single movements at random times between two frames. `received`: arrival of the last packet
// of the frame; `decoded`: output of the decoder; `painted`: display time from the browser.
async function motion(folder, loss = 0) {
  const served = await serve('--rig', join(folder, 'rig.json'));
  const page = await newPage(browser, { width: 640, height: 480 });
  const relay = loss > 0 ? await throughRelay(page) : null;
  if (relay) relay.loss = loss;
  await page.goto(served.url);
  await shown(page, 30);
  const before = await decoded(page);
  const times = await page.evaluate(async count => {
    const viewer = inside(), { panel } = viewer, take = panel.applied.bind(panel);
    let tell = () => {};
    panel.applied = applied => {
      take(applied);
      tell({ stamp: applied.rtpTimestamp, time: performance.now() });
    };
    const [track] = viewer.video.srcObject.getVideoTracks();
    const reader = new MediaStreamTrackProcessor({ track }).readable.getReader();
    const shows = (stamp, rtp) => rtp !== undefined && ((rtp - stamp) >>> 0) < 0x80000000;
    let latest = [], stamps = true;
    (async () => {
      for (;;) {
        const { value } = await reader.read(), rtp = value.metadata().rtpTimestamp;
        stamps = rtp !== undefined;
        latest = [...latest.slice(-8), { time: performance.now(), rtp }];
        value.close();
      }
    })();
    let painted = [];
    const paint = (now, frame) => {
      painted = [...painted.slice(-8), { time: now, rtp: frame.rtpTimestamp, received: frame.receiveTime }];
      viewer.video.requestVideoFrameCallback(paint);
    };
    viewer.video.requestVideoFrameCallback(paint);
    const rows = [];
    for (let i = 0; i < count; i++) {
      await new Promise(done => setTimeout(done, 150 + Math.random() * 100));
      const applied = new Promise(done => tell = done);
      const began = performance.now();
      viewer.flight.setView({ yaw: (i % 7) / 2 });
      const { stamp, time } = await applied;
      const first = async list => {
        for (;;) {
          const found = list().find(({ rtp }) => shows(stamp, rtp));
          if (found) return found;
          await new Promise(done => setTimeout(done, 1));
        }
      };
      const frame = stamps ? await first(() => latest) : { time: NaN }, seen = await first(() => painted);
      rows.push({ asked: time - began, received: seen.received - began, decoded: frame.time - began, painted: seen.time - began });
    }
    return rows.map(row => ({ ...row, picture: viewer.statistics.pictureMs }));
  }, Number(process.env.LF_MOVEMENTS ?? 100));
  for (const [name, what] of [['asked', 'until it is in a request'], ['picture', 'from request to picture (median)'],
    ['received', 'until its last packet is there'], ['decoded', 'until a decoded frame shows it'], ['painted', 'until that is painted']]) {
    const sorted = times.map(row => row[name]).sort((a, b) => a - b);
    const at = p => sorted[Math.ceil(p * sorted.length) - 1];
    console.log(`# motion to photon${loss ? `, ${loss * 100} % lost` : ''}, ${what}: p50 ${at(0.5)?.toFixed(1)} ms, ` +
      `p95 ${at(0.95)?.toFixed(1)} ms, p99 ${at(0.99)?.toFixed(1)} ms`);
  }
  const after = await decoded(page);
  console.log(`# ${((after.frames - before.frames) / (after.time - before.time) * 1000).toFixed(1)} frames/s` +
    (relay ? `, ${relay.lost} of ${relay.lost + relay.passed} packets lost` : ''));
  relay?.close();
  await close(page, served);
}

// Measures the time from the page request to the first visible frame, with a warm server and browser. Also measures the
// time from an element's return to view.
async function firstPicture(folder) {
  const served = await serve('--rig', join(folder, 'rig.json'), '--connects', '100');
  const first = [], again = [];
  for (let i = 0; i < 12; i++) {
    const page = await newPage(browser, { width: 640, height: 480 });
    await page.addInitScript(() => {
      globalThis.painted = new Promise(done => addEventListener('DOMContentLoaded', () =>
        inside().video.requestVideoFrameCallback((now, { expectedDisplayTime }) => done(expectedDisplayTime))));
    });
    await page.goto(served.url);
    const time = await page.evaluate(() => painted);
    await page.waitForTimeout(300);
    const back = await page.evaluate(async () => {
      const { stream, video } = inside();
      stream.see(false);
      await new Promise(done => setTimeout(done, 500));
      const began = performance.now();
      stream.see(true);
      return new Promise(done => video.requestVideoFrameCallback((now, { expectedDisplayTime }) => done(expectedDisplayTime - began)));
    });
    if (i >= 2) first.push(time), again.push(back);
    await page.context().close();
  }
  for (const [what, times] of [['first picture, of a page that is opened', first], ['back in sight', again]]) {
    times.sort((a, b) => a - b);
    console.log(`# ${what}: median ${times[times.length >> 1].toFixed(0)} ms, at most ${times.at(-1).toFixed(0)} ms, of ${times.length}`);
  }
  await served.stop();
}

const film = await makeFilm('8x8'), vga = { width: 640, height: 480 }, small = { width: 320, height: 240 },
  hd = { width: 1280, height: 720 };
await runTests([
  ['motion to photon', () => motion(film)],
  ['first picture', () => firstPicture(film)],
  ['loss', () => motion(film, 0.02)],
  ['4 browsers', () => viewers(film, 4, vga, browsers)],
  ['8 browsers', () => viewers(film, 8, small, browsers)],
  ['4 receivers', () => viewers(film, 4, vga, receivers)],
  ['8 receivers', () => viewers(film, 8, small, receivers)],
  ['4 receivers of 1280x720', () => viewers(film, 4, hd, receivers)],
  ['8 receivers of 640x480', () => viewers(film, 8, vga, receivers)],
  ['bytes over cameras', growth],
]);
