// SPDX-License-Identifier: LGPL-2.1-or-later
// The page redraws the latest picture for the requested view, before the picture of this view arrives.
import { join } from 'node:path';
import { writeFile } from 'node:fs/promises';
import { allowSoftware, artefacts, close, closeClean, compare, expect, launchBrowser, makeRig, newPage, openDelayed, openShown,
  picture, rests, runTests, serve, setView, settled, site, source, stateOf, truthsOf } from './harness.mjs';

const size = { width: 640, height: 480 };
const folder = await makeRig('6x6');
const rig = ['--rig', join(folder, 'rig.json'), '--connects', '100'];
const browser = await launchBrowser();

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
    const keep = () => redraw.surfaces.forEach(([surface], timestamp) => all.set(timestamp, surface));
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
  const surface = decodeSurface(message.buffer), { vertices, triangles } = makeMesh(surface);
  expect(surface.camera.width === size.width && surface.levels.length === surface.columns * surface.rows, 'a whole surface');
  expect(Math.max(...triangles) < vertices.length / 5 && vertices.every(Number.isFinite), 'a valid mesh');
  let refused = 0;
  for (let i = 0; i < 2000; i++) {
    const copy = i % 4 ? message.slice() : message.slice(0, i / 4 * message.length / 500);
    if (i % 4) copy[Math.floor(i < 500 ? Math.random() * 16 : Math.random() * copy.length)] ^= 1 << Math.random() * 8;
    try {
      const { columns, rows, levels } = decodeSurface(copy.buffer);
      expect(levels.length === columns * rows && levels.length <= 8192, 'a wrong number of nodes');
    } catch (error) {
      expect(error instanceof RangeError, error.message);
      refused++;
    }
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

// A movement to the right opens a gap on the right of a red bar in front of a white panel, whose edge is close, in front of a
// blue wall. The gap shows the panel.
async function gapsShowWhatIsBehind() {
  const mine = await site({ '/': '<!doctype html><title>gaps</title>' }, join(source, 'web')), page = await newPage(browser, size);
  await page.goto(mine.origin);
  const blue = await page.evaluate(async () => {
    const [{ contextOf, Painter }, { cameraOf }] = await Promise.all(['painter', 'view'].map(name => import(`/src/${name}.js`)));
    const [width, height, step] = [320, 240, 8], columns = width / step, rows = height / step;
    const picture = new OffscreenCanvas(width, height), context = picture.getContext('2d');
    const levels = new Uint8Array(columns * rows);
    for (const [colour, level, left, top, right, bottom] of
      [['#00f', 20, 0, 0, columns, rows], ['#fff', 100, 10, 5, 24, 25], ['#f00', 250, 18, 8, 22, 22]]) {
      context.fillStyle = colour;
      context.fillRect(step * left, step * top, step * (right - left), step * (bottom - top));
      for (let j = top; j < bottom; j++) levels.fill(level, j * columns + left, j * columns + right);
    }
    const camera = x => cameraOf({ x, y: 0, z: 0, yaw: 0, pitch: 0, roll: 0, fov: 44 }, width, height), from = camera(0);
    const gl = contextOf(Object.assign(document.createElement('canvas'), { width, height }), {}, true), painter = new Painter(gl);
    painter.load(picture, 1);
    painter.draw({ camera: from, step, columns, rows, farthest: 0.1, nearest: 1, levels }, from, camera(0.05));
    // The gap, between the new places of the bar and of the panel's edge, without corners.
    const [left, right, bottom, top] = [158, 180, 90, 150], data = new Uint8Array(4 * (right - left) * (top - bottom));
    gl.readPixels(left, bottom, right - left, top - bottom, gl.RGBA, gl.UNSIGNED_BYTE, data);
    let blue = 0;
    for (let i = 0; i < data.length; i += 4) blue += data[i + 2] - data[i + 1] > 60;
    return blue;
  });
  expect(blue === 0, `${blue} pixels show the wall`);
  await page.context().close();
  mine.close();
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
        if (isLast) inside().wrong.push(Math.max(...Object.keys(now).map(name => Math.abs(view[name] - now[name]))));
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

// Some browsers give no RTP timestamps with their pictures, or no callbacks for pictures. The page then uses the timestamp of
// the decoder, or the latest surface belongs to the latest picture.
const withoutTimestamps = {
  'timestamps': () => {
    const { requestVideoFrameCallback } = HTMLVideoElement.prototype;
    globalThis.reportFrame = requestVideoFrameCallback;
    HTMLVideoElement.prototype.requestVideoFrameCallback = function (done) {
      return requestVideoFrameCallback.call(this, (now, { rtpTimestamp, ...frame }) => done(now, frame));
    };
    delete RTCRtpReceiver.prototype.getSynchronizationSources;
  },
  'frame callbacks': () => {
    globalThis.reportFrame = HTMLVideoElement.prototype.requestVideoFrameCallback;
    delete HTMLVideoElement.prototype.requestVideoFrameCallback;
  },
};
async function worksWithoutRtpTimestamps() {
  for (const [what, remove] of Object.entries(withoutTimestamps)) {
    const served = await serve(...rig), page = await newPage(browser, size, { before: allowSoftware });
    await page.addInitScript(remove);
    await page.goto(served.url);
    await page.waitForFunction(() => inside()?.redraw.picture?.surface.levels.length > 100);
    await rests(page);
    const { aperture, ...home } = await stateOf(page), view = { ...home, x: home.x + 0.03 };
    const png = await redrawn(page, { x: view.x }), [truth, last] = await truthsOf([view, home], size);
    const [{ psnr }, { psnr: stale }] = [await compare(page, png, truth), await compare(page, last, truth)];
    console.log(`# without ${what}: redrawn ${psnr.toFixed(1)} dB, stale ${stale.toFixed(1)} dB`);
    expect(psnr > stale + 2, `the redrawn picture is ${psnr} dB from the truth`);
    await rests(page);
    const [shown, paired, right] = await page.evaluate(async () => {
      const { redraw, flight, video } = inside(), counts = [0, 0, 0], { show } = redraw;
      redraw.paint = () => {};  // drawing in software would delay the pictures
      redraw.show = timestamp => {
        show.call(redraw, timestamp);
        counts[0]++;
        counts[1] += redraw.picture.surface.timestamp === timestamp;
      };
      const compare = (now, { rtpTimestamp }) => {
        reportFrame.call(video, compare);
        requestAnimationFrame(() => counts[2] += redraw.timestamp === rtpTimestamp);
      };
      reportFrame.call(video, compare);
      for (let i = 0; i < 60; i++) {
        flight.sendView({ x: 0.03 * Math.sin(i / 10) });
        await new Promise(done => setTimeout(done, 33));
      }
      return counts;
    });
    console.log(`# without ${what}: of ${shown} pictures, ${paired} have their own surface, and ${right} their own timestamp`);
    expect(what === 'timestamps' ? shown > 5 && !paired : Math.min(paired, right) > shown / 2,
      `only ${paired} of ${shown} pictures have a surface, and ${right} the right timestamp`);
    await closeClean(page, served);
  }
}

// The promise of setView() resolves, however slow the network is.
async function viewsAreConfirmedOverSlowNetworks() {
  const served = await serve(...rig);
  const { page, relay } = await openDelayed(browser, served, 1600);
  const [view, time] = await page.evaluate(async () => {
    const began = performance.now(), view = await document.querySelector('lightfield-viewer').setView({ x: 0.03 });
    return [view, performance.now() - began];
  });
  console.log(`# a view is confirmed after ${time.toFixed(0)} ms, over 1600 ms`);
  expect(Math.abs(view.x - 0.03) < 1e-9 && time > 1500, `x is ${view.x} after ${time} ms`);
  relay.close();
  await closeClean(page, served);
}

async function marginsFollowTheSpeed() {
  const { Margin } = await import(join(source, 'web/src/margin.js'));
  for (const [what, shares, latency, expected] of [
    ['at rest', [], 200, 0], ['a single step', [0.1], 200, 0], ['two steps', [0.1, 0.1], 200, 0],
    ['a slow movement', Array(9).fill(0.002), 100, 0.1], ['no latency', Array(9).fill(0.001), 1, 0],
    ['a fast movement', Array(9).fill(0.01), 100, 0.2], ['over a slow network', Array(9).fill(0.01), 250, 0.4],
    ['the largest', Array(9).fill(0.1), 500, 0.5]]) {
    const margin = new Margin();
    shares.forEach((share, i) => margin.moved(1000 + 16 * i, share));
    const got = margin.at(1000 + 16 * shares.length, latency);
    expect(Math.abs(got - expected) < 1e-9, `${what}: a margin of ${got}`);
    expect(margin.at(1200 + 16 * shares.length, latency) === got, `${what}: it stays for a moment`);
    expect(margin.at(1500 + 16 * shares.length, latency) === 0, `${what}: no margin after it`);
  }

  // The server sends wider pictures while the view moves, and the page crops them.
  const served = await serve(...rig);
  const { page, relay } = await openDelayed(browser, served, 200);
  await setView(page, { fov: 15 });  // at home, the cameras see no margin
  const home = await stateOf(page);
  const moving = await page.evaluate(async () => {
    const { flight, redraw, video, picture } = inside(), { x } = flight.state;
    redraw.load();
    redraw.painter.draw = redraw.painter.load = () => {};  // drawing in software would be too slow for a movement
    let margins = 0, cropped = 0, wide = 0;
    for (let i = 0; i < 400 && margins < 40; i++) {
      flight.sendView({ x: x + 0.03 * Math.sin(i / 5) });
      await new Promise(done => requestAnimationFrame(done));
      if (!flight.margin) continue;
      margins++;
      cropped += Number(video.style.scale) === 1 + flight.margin && picture.shown(640, 480)[2] < 640;
      const { camera, surface } = redraw.picture;
      wide += camera === surface.camera && camera.fy < 0.95 * 240 / Math.tan(flight.seen.fov * Math.PI / 360);
    }
    flight.sendView({ x });
    return { margins, cropped, wide };
  });
  console.log(`# while moving: ${JSON.stringify(moving)}`);
  expect(moving.margins === 40 && moving.cropped === 40, 'pictures with a margin are cropped');
  expect(moving.wide > 0, 'surfaces have the lens of the wider picture');
  await page.waitForFunction(() => inside().flight.margin === 0 && inside().redraw.requestedMargin === 0);
  await rests(page);
  const state = await stateOf(page);
  expect(state.fov === home.fov && !('margin' in state), 'the margin is no part of the view');
  expect(await page.evaluate(() => !inside().video.style.scale && inside().redraw.canvas.hidden), 'at rest, the video is shown');
  relay.close();
  await closeClean(page, served);
}

// A paused picture can be looked around in, and the stream continues with that view.
async function pausedPicturesCanBeLookedAroundIn() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 30, { before: allowSoftware });
  await page.waitForFunction(() => inside().redraw.picture?.surface.levels.length > 100);
  const { aperture, ...home } = await stateOf(page);
  await rests(page);
  await page.evaluate(() => document.querySelector('lightfield-viewer').pause());
  const look = async (what, view) => {
    const png = await redrawn(page, view);
    await writeFile(join(artefacts, `paused-${what}.png`), png);
    return png;
  };
  const aside = await look('aside', { x: home.x + 0.03 });
  const [truth, last] = await truthsOf([{ ...home, x: home.x + 0.03 }, home], size);
  const [{ psnr }, { psnr: stale }] = [await compare(page, aside, truth), await compare(page, last, truth)];
  console.log(`# paused: redrawn ${psnr.toFixed(1)} dB, stale ${stale.toFixed(1)} dB`);
  expect(psnr > stale + 2, `the paused picture is ${psnr} dB from the truth`);
  const { mean } = await compare(page, await look('far', { x: home.x + 3 }), truth);
  expect(mean < 2, `beyond the depths, the picture fades: ${mean}`);
  await page.evaluate(({ x }) => inside().flight.sendView({ x }), { x: home.x });
  await page.focus('lightfield-viewer video');
  await page.keyboard.press('d');
  const { x } = await stateOf(page);
  expect(x > home.x + 1e-4, 'keys move the paused picture');
  await page.screenshot({ path: join(artefacts, 'paused.png') });
  await page.evaluate(() => document.querySelector('lightfield-viewer').play());
  await page.waitForFunction(() => inside().stream.isOpen && inside().flight.seen);
  await page.waitForFunction(x => Math.abs(inside().flight.seen.x - x) < 1e-9, x);
  await rests(page);
  await closeClean(page, served);
}

// A network that drops all video but no messages: the server confirms the views, and the page redraws the last picture.
async function stalledPicturesCanBeLookedAroundIn() {
  const served = await serve(...rig);
  const { page, relay } = await openDelayed(browser, served, 0);
  const { aperture, ...home } = await stateOf(page);
  await rests(page);
  relay.loss = 1;
  await page.waitForFunction(() => inside().redraw.isStalled);
  const frames = () => page.evaluate(() => inside().redraw.frames), before = await frames();
  const look = async (what, view) => {
    await page.evaluate(view => inside().flight.sendView(view), view);
    await page.waitForFunction(() => inside().redraw.painted && inside().redraw.prediction.isConfirmed);
    const url = await page.evaluate(() => {
      const { redraw, stream } = inside();
      redraw.paint(performance.now());
      return stream.isOpen && !redraw.canvas.hidden && redraw.canvas.toDataURL('image/png');
    });
    expect(url, 'the stream is closed, or its picture is not redrawn');
    const png = Buffer.from(url.split(',')[1], 'base64');
    await writeFile(join(artefacts, `stalled-${what}.png`), png);
    return png;
  };
  for (const [what, x, y] of [['right', 0.03, 0], ['left', -0.02, 0.02], ['back', 0.005, 0]]) {
    const view = { ...home, x: home.x + x, y: home.y + y };
    const png = await look(what, { x: view.x, y: view.y }), [truth, last] = await truthsOf([view, home], size);
    const [{ psnr }, { psnr: stale }] = [await compare(page, png, truth), await compare(page, last, truth)];
    console.log(`# stalled, ${what}: redrawn ${psnr.toFixed(1)} dB, stale ${stale.toFixed(1)} dB`);
    expect(psnr > stale + 2, `the stalled picture is ${psnr} dB from the truth`);
  }
  expect(await frames() === before, 'no picture has come');
  relay.loss = 0;
  await page.waitForFunction(before => inside().redraw.frames > before + 3, before);
  await rests(page);
  relay.close();
  await closeClean(page, served);
}

// A wrong prediction is corrected within 100 ms, without a jump.
async function correctionsAreBlended() {
  const served = await serve(...rig);
  const { page, relay } = await openDelayed(browser, served, 300);
  const steps = await page.evaluate(async () => {
    const { flight, redraw } = inside(), { x } = flight.state;
    inside().take = () => {};  // the server confirms nothing meanwhile
    flight.sendView({ x: x + 0.02 });
    await new Promise(done => requestAnimationFrame(done));
    redraw.paint(performance.now());
    const { now, base } = redraw.prediction, wrong = x => redraw.confirm({ ...now, x }, Infinity);
    const before = redraw.target().x, out = [];
    wrong(x + 0.03);
    out.push(redraw.target().x - before);
    // A second correction does not extend the first one.
    const began = performance.now();
    for (let i = 0; performance.now() < began + 100; i++) {
      wrong(x + 0.03);
      await new Promise(done => setTimeout(done, 5));
      out.push(redraw.target().x - before);
    }
    return { out, expected: x + 0.03 - before, base };
  });
  const { out, expected } = steps;
  expect(Math.abs(out[0]) < 0.1 * expected, `the view jumps by ${out[0]}`);
  expect(out.every((at, i) => i === 0 || at >= out[i - 1] - 1e-9), 'the view moves in one direction');
  expect(Math.abs(out.at(-1) - expected) < 1e-9, `after 100 ms, the view is ${out.at(-1) - expected} m beside the server's`);
  relay.close();
  await closeClean(page, served);
}

async function phonesTilt() {
  const served = await serve(...rig);
  const phone = { before: allowSoftware, hasTouch: true, isMobile: true, deviceScaleFactor: 1 };
  const page = await openShown(browser, served.url, { width: 390, height: 844 }, 30, phone);
  const { aperture, ...home } = await stateOf(page);
  const tell = angles => page.evaluate(angles => dispatchEvent(new DeviceOrientationEvent('deviceorientation', angles)), angles);
  const moved = async (what, isThere) => {
    await page.waitForFunction(isThere, home);
    await rests(page);
    console.log(`# ${what}: yaw ${(await stateOf(page)).yaw.toFixed(2)}, pitch ${(await stateOf(page)).pitch.toFixed(2)}`);
  };
  await page.evaluate(() => DeviceOrientationEvent.requestPermission = async () => globalThis.answer ?? 'denied');
  await page.getByText('Tilt').click();
  expect(await page.evaluate(() => !inside().tilt.on && /may not/.test(inside().root.querySelector('.said').textContent)), 'refused');
  await page.evaluate(() => globalThis.answer = 'granted');
  await page.getByText('Tilt').click();
  await page.waitForFunction(() => inside().tilt.on);
  await page.screenshot({ path: join(artefacts, 'tilt.png') });
  await tell({ alpha: 10, beta: 60, gamma: 0 });
  // A turn to the left about the vertical of the screen: yaw follows, and the eye moves to the right.
  await tell({ alpha: 10, beta: 60, gamma: 3 });
  await moved('turned', ({ x, yaw }) => Math.abs(inside().flight.seen.yaw - yaw + 3) < 0.01 && inside().flight.seen.x > x + 0.01);
  await tell({ alpha: 10, beta: 62, gamma: 3 });
  await moved('tipped', ({ pitch }) => Math.abs(inside().flight.seen.pitch - pitch - 2) < 0.05);
  await tell({ alpha: 10, beta: 60, gamma: 60 });
  await moved('far', ({ yaw }) => Math.abs(inside().flight.seen.yaw - yaw + 12) < 0.2);
  await tell({ alpha: 10, beta: 60, gamma: 57 });
  await moved('and back at once', ({ yaw }) => Math.abs(inside().flight.seen.yaw - yaw + 9) < 0.2);
  await page.getByText('Tilt').click();
  const { yaw } = await stateOf(page);
  await tell({ alpha: 10, beta: 60, gamma: 0 });
  await page.waitForTimeout(300);
  expect((await stateOf(page)).yaw === yaw, 'the button switches it off');
  await closeClean(page, served);
}

async function movementsDoNotWait() {
  const served = await serve(...rig);
  for (const roundTrip of [0, 100, 200]) {
    const { page, relay } = await openDelayed(browser, served, roundTrip);
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
  const { page, relay } = await openDelayed(browser, served, 0);
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
  ['views are confirmed over slow networks', viewsAreConfirmedOverSlowNetworks],
  ['margins follow the speed', marginsFollowTheSpeed],
  ['paused pictures can be looked around in', pausedPicturesCanBeLookedAroundIn],
  ['stalled pictures can be looked around in', stalledPicturesCanBeLookedAroundIn],
  ['corrections are blended', correctionsAreBlended],
  ['phones tilt', phonesTilt],
  ['at rest the video is shown', atRestTheVideoIsShown],
  ['surfaces belong to their pictures', surfacesBelongToTheirPictures],
  ['damaged surfaces are refused', damagedSurfacesAreRefused],
  ['the mesh keeps the picture', meshKeepsThePicture],
  ['gaps show what is behind', gapsShowWhatIsBehind],
  ['predictions are exact', predictionsAreExact],
  ['works without WebGL', worksWithoutWebGl],
  ['works without RTP timestamps or frame callbacks', worksWithoutRtpTimestamps],
  ['movements do not wait for the server', movementsDoNotWait],
  ['redrawn pictures are better than stale ones', redrawnPicturesAreBetterThanStaleOnes],
]);
