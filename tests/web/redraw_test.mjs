// SPDX-License-Identifier: LGPL-2.1-or-later
// The page redraws the latest picture for the requested view, before the picture of this view arrives.
import { join } from 'node:path';
import { writeFile } from 'node:fs/promises';
import { artefacts, close, closeClean, compare, expect, launchBrowser, makeRig, newPage, openShown, picture, runTests, serve,
  setView, settled, shown, source, stateOf, throughRelay } from './harness.mjs';

const size = { width: 640, height: 480 };
const folder = await makeRig('6x6');
const rig = ['--rig', join(folder, 'rig.json'), '--connects', '100'];
const browser = await launchBrowser();

// The page does not use WebGL in software, but these tests may have no GPU.
function allowSoftware() {
  const { getContext } = HTMLCanvasElement.prototype, { getParameter } = WebGL2RenderingContext.prototype;
  HTMLCanvasElement.prototype.getContext = function (type, options) {
    return getContext.call(this, type, { ...options, failIfMajorPerformanceCaveat: false });
  };
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    const value = getParameter.call(this, name);
    return /SwiftShader|llvmpipe/.test(value) ? 'a GPU' : value;
  };
}

// Opens the page behind a network with this round trip, in milliseconds.
async function openDelayed(served, roundTrip) {
  const page = await newPage(browser, size, { before: allowSoftware });
  const relay = await throughRelay(page);
  await page.goto(served.url);
  await shown(page, 30);
  await page.waitForFunction(() => inside().redraw.picture?.surface.levels.length > 100);
  await page.waitForTimeout(1500);  // until the surface has settled
  relay.delay = roundTrip / 2;
  await page.waitForTimeout(roundTrip + 200);
  return { page, relay };
}

// Waits until nothing is redrawn any more.
const rests = page => page.waitForFunction(() => !inside().redraw.painted && inside().redraw.prediction.isConfirmed);

// Requests a view. Returns the picture that is redrawn for it, as a PNG, before the server can answer.
async function redrawn(page, view) {
  const url = await page.evaluate(view => {
    const { redraw, flight } = inside();
    flight.sendView(view);
    redraw.paint(performance.now());
    return redraw.painted && redraw.canvas.toDataURL('image/png');
  }, view);
  expect(url, 'the picture is not redrawn');
  return Buffer.from(url.split(',')[1], 'base64');
}

async function atRestTheVideoIsShown() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware });
  await page.waitForFunction(() => inside().redraw.latest);
  await setView(page, { x: 0.01 });
  await rests(page);
  const before = await page.evaluate(() => inside().redraw.drawn);
  await page.waitForTimeout(1000);
  expect(await page.evaluate(() => inside().redraw.drawn) === before, 'pictures are redrawn at rest');
  expect(await page.evaluate(() => inside().redraw.canvas.hidden), 'the redrawn picture hides the video at rest');
  await closeClean(page, served);
}

// Each picture has its own surface, or the view rests and the latest surface has the same pose.
async function surfacesBelongToTheirPictures() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware });
  await page.waitForFunction(() => inside().redraw.latest);
  const counts = await page.evaluate(async () => {
    const { redraw, video, flight } = inside(), shown = [], all = new Map(), counts = { paired: 0, fitting: 0, worst: 0 };
    redraw.paint = () => {};  // drawing in software would delay the pictures
    const keep = () => redraw.surfaces.forEach((surface, timestamp) => all.set(timestamp, surface));
    for (let i = 0; i < 40; i++) {
      flight.sendView({ x: 0.03 * Math.sin(i / 10) });
      await new Promise(done => video.requestVideoFrameCallback((now, { rtpTimestamp }) => {
        shown.push([rtpTimestamp, flight.seen.x]);
        keep();
        done();
      }));
    }
    await new Promise(done => setTimeout(done, 500));
    keep();
    for (const [timestamp, x] of shown) {
      const latest = Math.max(...[...all.keys()].filter(at => at <= timestamp));
      const surface = all.get(latest), wrong = surface ? Math.abs(surface.camera.position[0] - x) : Infinity;
      counts.fitting += wrong < 1e-9;
      if (latest !== timestamp) continue;
      counts.paired++;
      counts.worst = Math.max(counts.worst, wrong);
    }
    return { ...counts, pictures: shown.length };
  });
  console.log(`# of ${counts.pictures} pictures, ${counts.paired} have their own surface, and ${counts.fitting} a surface of their pose`);
  // The report of the view may arrive after its picture, so `seen` may be a step of 3 mm late.
  expect(counts.worst < 0.0031, `a surface is ${counts.worst} m beside its picture`);
  expect(counts.paired > 0 && counts.fitting > 0.7 * counts.pictures, `only ${counts.fitting} of ${counts.pictures} pictures fit`);
  const [video, surfaces] = [await served.metric('video_bytes_total'), await served.metric('surface_bytes_total')];
  console.log(`# ${surfaces} bytes of surfaces, ${video} bytes of video`);
  expect(surfaces > 0 && surfaces < 0.15 * video + 10000, `${surfaces} bytes of surfaces for ${video} bytes of video`);
  await closeClean(page, served);
}

// Damaged messages are errors, and never a mesh of impossible size.
async function damagedSurfacesAreRefused() {
  const { decodeSurface, makeMesh } = await import(join(source, 'web/src/surface.js'));
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware });
  const message = Uint8Array.from(await page.evaluate(() => new Promise(done => inside().stream.connection.addEventListener(
    'surface', ({ detail }) => done([...new Uint8Array(detail)]), { once: true }))));
  const surface = await decodeSurface(message.buffer), { vertices, triangles } = makeMesh(surface);
  expect(surface.camera.width === size.width && surface.levels.length === surface.columns * surface.rows, 'a whole surface');
  expect(Math.max(...triangles) < vertices.length / 5 && vertices.every(Number.isFinite), 'a valid mesh');
  let refused = 0;
  for (let i = 0; i < 2000; i++) {
    const copy = i % 4 ? message.slice() : message.slice(0, i / 4 * message.length / 500);
    if (i % 4) copy[Math.floor(i < 500 ? Math.random() * 16 : Math.random() * copy.length)] ^= 1 << Math.random() * 8;
    await decodeSurface(copy.buffer).then(({ columns, rows, levels }) =>
      expect(levels.length === columns * rows && levels.length <= 8192, 'a wrong number of nodes'), () => refused++);
  }
  console.log(`# ${refused} of 2000 damaged messages are refused`);
  expect(refused > 1000, `only ${refused} of 2000 damaged messages are refused`);
  await closeClean(page, served);
}

// A movement without change does not move the picture, and all depths are in front of the viewer.
async function meshKeepsThePicture() {
  const { clipMatrix, displacement, kVertexFloats, makeMesh } = await import(join(source, 'web/src/surface.js'));
  const camera = { position: [1, 2, 3], axes: { right: [0, 0, -1], down: [0, 1, 0], forward: [1, 0, 0] }, width: 96, height: 64,
    fx: 80, fy: 90, cx: 47.5, cy: 31.5 };
  const levels = Uint8Array.from({ length: 24 * 16 }, (_, at) => at % 24 < 9 ? 250 : 10 + at % 3);
  const { vertices, triangles, front, behind } = makeMesh({ camera, step: 4, columns: 24, rows: 16, farthest: 0.1, nearest: 2, levels });
  expect(front + behind === triangles.length && front > behind, 'cells at edges have more triangles');
  const matrix = clipMatrix(camera, camera, 0.01), other = { ...camera, position: [1.05, 2, 2.9] };
  const through = clipMatrix(camera, other, 0.01);
  for (let at = 0; at < vertices.length; at += kVertexFloats) {
    const [x, y, inverse] = vertices.slice(at, at + 3), ray = [(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1, inverse];
    const project = m => [0, 1, 2, 3].map(row => ray.reduce((sum, v, k) => sum + v * m[4 * k + row], 0));
    const [u, v, , w] = project(matrix);
    expect(Math.abs((u / w + 1) * 48 - 0.5 - x) < 1e-3 && Math.abs((1 - v / w) * 32 - 0.5 - y) < 1e-3, `${x}, ${y} moves`);
    // The reference: the point in the world, seen from the other position.
    const depth = 1 / inverse, point = [0, 1, 2].map(k => camera.position[k] +
      depth * (ray[0] * camera.axes.right[k] + ray[1] * camera.axes.down[k] + camera.axes.forward[k]) - other.position[k]);
    const [a, b, , c] = project(through), seen = ['right', 'down', 'forward'].map(name => point.reduce((s, p, k) => s + p * camera.axes[name][k], 0));
    expect(Math.abs((a / c + 1) * 48 - 0.5 - (camera.fx * seen[0] / seen[2] + camera.cx)) < 2e-3, `${x}, ${y} is drawn at a wrong place`);
    expect(Math.abs((1 - b / c) * 32 - 0.5 - (camera.fy * seen[1] / seen[2] + camera.cy)) < 2e-3, `${x}, ${y} is drawn at a wrong place`);
  }
  expect(displacement(camera, camera, 2) === 0 && displacement(camera, other, 2) > 10, 'displacement');
}

// The page predicts the view of the server exactly, where the cameras do not limit the view.
async function predictionsAreExact() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware });
  await page.waitForFunction(() => inside().redraw.prediction.base && inside().flight.home);
  await page.focus('lightfield-viewer video');
  let worst = 0;
  const check = async (what, act) => {
    const { aperture, ...start } = await stateOf(page);
    await setView(page, { fov: 25, x: 0, y: 0, yaw: 1, pitch: -1, roll: 2 });
    await rests(page);
    await page.evaluate(() => {
      const { redraw } = inside(), { confirm } = redraw;
      inside().wrong = [];
      redraw.confirm = function (view, id) {
        const { now } = this.prediction, isLast = id !== undefined && this.prediction.pending.every(entry => entry.id <= id);
        confirm.call(this, view, id);
        if (isLast) inside().wrong.push(Math.max(...Object.keys(view).map(name => Math.abs(view[name] - now[name]))));
      };
    });
    await act();
    await page.waitForFunction(() => inside().wrong.length && inside().redraw.prediction.isConfirmed);
    const wrong = await page.evaluate(() => {
      delete inside().redraw.confirm;
      return Math.max(...inside().wrong);
    });
    expect(wrong < 1e-6, `${what}: the prediction is wrong by ${wrong}`);
    worst = Math.max(worst, wrong);
  };
  for (const key of ['ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown', 'w', 's', 'a', 'd', 'q', 'e', '+', '-', '[', ']'])
    await check(key, () => page.keyboard.press(key));
  const drag = async () => {
    await page.mouse.move(300, 200);
    await page.mouse.down();
    for (let i = 0; i <= 5; i++) await page.mouse.move(300 + 5 * i, 200 + 3 * i);
    await page.waitForTimeout(200);
    await page.mouse.up();
  };
  await check('drag', drag);
  await page.keyboard.down('Shift');
  await check('drag with shift', drag);
  await page.keyboard.up('Shift');
  await check('wheel', async () => {
    await page.mouse.move(400, 150);
    await page.mouse.wheel(0, -100);
  });
  console.log(`# predictions are wrong by ${worst} at most`);
  await closeClean(page, served);
}

// With WebGL in software only, and after the loss of its context, the video is shown.
async function worksWithoutWebGl() {
  const served = await serve(...rig);
  const without = await openShown(browser, served.url, size, 30);
  await without.waitForFunction(() => inside().redraw.latest && inside().redraw.prediction.base);
  await setView(without, { x: 0.02 });
  expect(await without.evaluate(() => inside().redraw.isImpossible && inside().redraw.canvas.hidden), 'pictures are redrawn');
  expect(!without.problems.length, without.problems.join('; '));
  await without.context().close();

  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware });
  await page.waitForFunction(() => inside().redraw.latest && inside().redraw.prediction.base);
  await redrawn(page, { x: 0.02 });
  await page.evaluate(async () => {
    const { redraw } = inside(), context = redraw.painter.gl.getExtension('WEBGL_lose_context');
    const next = name => new Promise(done => redraw.canvas.addEventListener(name, done, { once: true }));
    const lost = next('webglcontextlost'), restored = next('webglcontextrestored');
    context.loseContext();
    await lost;
    if (!redraw.canvas.hidden) throw new Error('the canvas hides the video');
    setTimeout(() => context.restoreContext());
    await restored;
  });
  await rests(page);
  await redrawn(page, { x: -0.02 });
  await closeClean(page, served);
}

async function movementsDoNotWait() {
  const served = await serve(...rig);
  for (const roundTrip of [0, 100, 200]) {
    const { page, relay } = await openDelayed(served, roundTrip);
    const times = { painted: [], true: [] };
    for (let i = 0; i < 10; i++) {
      await rests(page);
      const [painted, arrived, order] = await page.evaluate(key => new Promise(done => {
        const { redraw, flight, controls } = inside(), { drawn } = redraw, { seen } = flight, began = performance.now();
        const found = [];
        const look = now => {
          if (!found[0] && redraw.drawn > drawn) [found[0], found[2]] = [performance.now() - began, flight.seen === seen];
          if (!found[1] && flight.seen !== seen) found[1] = performance.now() - began;
          if (found[1]) return done(found);
          requestAnimationFrame(look);
        };
        controls.key(key);
        requestAnimationFrame(look);
      }), i % 2 ? 'a' : 'd');
      if (roundTrip) expect(painted !== undefined && order, `${roundTrip} ms: the movement waits for the server`);
      if (painted !== undefined) times.painted.push(painted);
      times.true.push(arrived);
    }
    const say = list => list.length ? ((sorted, at) => `${sorted[at(0.5)].toFixed(0)} / ${sorted[at(0.95)].toFixed(0)} ms`)(
      [...list].sort((a, b) => a - b), share => Math.min(list.length - 1, Math.floor(share * list.length))) : '-';
    console.log(`# round trip ${roundTrip} ms: painted after ${say(times.painted)} (p50 / p95), true picture after ${say(times.true)}`);
    await page.context().close();
    relay.close();
  }
  await served.stop();
}

const kMovements = [{ x: 0.05 }, { x: -0.05, y: 0.02 }, { z: 0.15 }, { z: -0.1 }, { yaw: 3 }, { pitch: -2, x: 0.03 }, { roll: 4 },
  { x: 0.08, yaw: -2 }, { y: -0.05, pitch: 1.5 }, { x: 0.02, y: 0.02, z: 0.05, yaw: 1, pitch: 1, roll: 1 }];

async function redrawnPicturesAreBetterThanStaleOnes() {
  const served = await serve(...rig);
  const { page, relay } = await openDelayed(served, 0);
  const { aperture, ...home } = await stateOf(page), gains = [];
  for (const [i, movement] of kMovements.entries()) {
    await setView(page, home);
    await settled(page);
    await rests(page);
    const stale = await picture(page);
    const view = Object.fromEntries(Object.entries(movement).map(([name, by]) => [name, home[name] + by]));
    const early = await redrawn(page, view);
    await setView(page, view);
    await settled(page);
    const truth = await picture(page), before = (await compare(page, stale, truth)).psnr, after = (await compare(page, early, truth)).psnr;
    await writeFile(join(artefacts, `redrawn-${i}.png`), early);
    await writeFile(join(artefacts, `redrawn-${i}-true.png`), truth);
    console.log(`# ${JSON.stringify(movement)}: stale ${before.toFixed(1)} dB, redrawn ${after.toFixed(1)} dB`);
    gains.push(after - before);
  }
  gains.sort((a, b) => a - b);
  console.log(`# gain: median ${gains[gains.length >> 1].toFixed(1)} dB, least ${gains[0].toFixed(1)} dB`);
  expect(gains[gains.length >> 1] >= 4, `the median gain is ${gains[gains.length >> 1]} dB`);
  expect(gains[0] >= -0.5, `the least gain is ${gains[0]} dB`);
  await page.context().close();
  relay.close();
  await served.stop();
}

await runTests([
  ['at rest the video is shown', atRestTheVideoIsShown],
  ['surfaces belong to their pictures', surfacesBelongToTheirPictures],
  ['damaged surfaces are refused', damagedSurfacesAreRefused],
  ['the mesh keeps the picture', meshKeepsThePicture],
  ['predictions are exact', predictionsAreExact],
  ['works without WebGL', worksWithoutWebGl],
  ['movements do not wait for the server', movementsDoNotWait],
  ['redrawn pictures are better than stale ones', redrawnPicturesAreBetterThanStaleOnes],
]);
