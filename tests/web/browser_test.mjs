// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve and its page in headless Chromium.
import { createServer } from 'node:http';
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, close, closeClean, compare, connectBrowser, expect, half, launchBrowser, launchBrowserServer,
  makeRig, newPage, openPage, openShown, picture, rendered, runTests, serve, setView, shown, start,
  stateOf, throughRelay, until, viewFile, truthsOf } from './harness.mjs';

const size = { width: 640, height: 480 };
const folder = await makeRig('4x4');
const rig = ['--rig', join(folder, 'rig.json'), '--connects', '100', '--focus-mode', 'plane'];
const browser = await launchBrowser();

async function expectTruth(page, state, viewSize, what, side, eyeOffset) {
  const seen = await picture(page, side);
  const { psnr, mean, deviation } = await compare(page, seen, await rendered(folder, state, viewSize, eyeOffset));
  console.log(`# ${what}: ${psnr.toFixed(1)} dB against lf-render`);
  if (psnr < 30) await writeFile(join(artefacts, 'wrong.png'), seen);
  expect(psnr >= 30, `${what}: ${psnr.toFixed(1)} dB`);
  expect(mean > 20 && deviation > 10, `${what}: black, mean ${mean}, deviation ${deviation}`);
  return seen;
}

async function showsAndFlies() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 30);
  await page.screenshot({ path: join(artefacts, 'page.png') });
  const home = await stateOf(page);
  const first = await expectTruth(page, await setView(page, { fov: home.fov }), size, 'home');

  const focused = await setView(page, { 'focus-distance': home['focus-distance'] * 2 });
  const second = await expectTruth(page, focused, size, 'focused farther');
  expect((await compare(page, first, second)).psnr < 35, 'focus changes nothing');

  // A drag to the right moves the scene to the right, so the viewer moves to the left.
  await page.mouse.move(300, 200);
  await page.mouse.down();
  for (let x = 300; x <= 340; x += 10) await page.mouse.move(x, 200);
  await page.waitForTimeout(200);  // a drag that ends at rest has no momentum
  await page.mouse.up();
  await until(async () => (await stateOf(page)).x < home.x - 0.01, 'the drag moves the eye');
  const dragged = await setView(page, { fov: home.fov });
  const third = await expectTruth(page, dragged, size, 'dragged');
  expect((await compare(page, second, third)).psnr < 35, 'the drag changes nothing');

  await page.mouse.move(320, 240);
  await page.mouse.down();
  for (let x = 320; x <= 1600; x += 40) await page.mouse.move(x, 240 + x / 4);
  await page.mouse.up();
  await until(async () => (await stateOf(page)).x < dragged.x - 0.01, 'a long drag moves the eye');
  const border = await setView(page, { fov: home.fov });
  const { mean } = await compare(page, await picture(page), await picture(page));
  expect(mean > 40, `a long drag ends in the dark: ${mean} at ${JSON.stringify(border)}`);

  await page.mouse.move(320, 240);
  await page.mouse.wheel(0, -200);
  await until(async () => (await stateOf(page)).fov < 0.95 * border.fov, 'the wheel zooms in');
  await page.keyboard.press('r');
  await until(async () => Math.abs((await stateOf(page)).x - home.x) < 1e-9, 'r goes home');
  await expectTruth(page, await setView(page, { fov: home.fov }), size, 'home again');
  expect(!page.problems.length, page.problems.join('; '));
  await page.context().close();
  await until(async () => await served.metric('viewers') === 0, 'the viewer is gone');
  await served.stop();
}

async function linkKeyboardNamesAndSize() {
  const served = await serve(...rig);
  const page = await openShown(browser, new URL('#x=0.02&yaw=2&focus-distance=3&nonsense=1', served.url).href, size, 5);
  await until(async () => Math.abs((await stateOf(page)).yaw - 2) < 1e-6, 'the link sets the view');
  const link = await page.evaluate(() => inside().share.link);
  expect(/x=0\.02&/.test(link) && /yaw=2&/.test(link), link);
  await expectTruth(page, await setView(page, { roll: 0 }), size, 'what a link shows');
  const seen = new Set();
  for (let i = 0; i < 13; i++) {
    await page.keyboard.press('Tab');
    seen.add(await page.evaluate(() => {
      const element = inside().root.activeElement;
      return element && `${element.localName} ${element.ariaLabel ?? element.textContent.trim()}`;
    }));
  }
  for (const name of ['video Live', 'input Distance', 'button Home', 'button Figures', 'button Share'])
    expect([...seen].some(text => text?.startsWith(name)), `${name} is not reached: ${[...seen]}`);
  await page.focus('lightfield-viewer input[type=range]');
  const before = (await stateOf(page))['focus-distance'];
  for (let i = 0; i < 20; i++) await page.keyboard.press('ArrowRight');
  await until(async () => (await stateOf(page))['focus-distance'] > before * 1.2, 'the slider focuses');
  await page.focus('lightfield-viewer video');
  const kept = await setView(page, { fov: (await stateOf(page)).fov });
  await page.setViewportSize({ width: 320, height: 240 });
  await page.waitForFunction(() => inside().video.videoWidth === 320);
  const state = await setView(page, { fov: kept.fov });
  expect(state.yaw === kept.yaw && state['focus-distance'] === kept['focus-distance'], 'a new size keeps the view');
  await page.keyboard.press('i');
  await page.waitForFunction(() => inside().root.querySelector('pre.figures').textContent.includes('frames/s'));
  await close(page, served);
}

async function showsItsCameras() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 5);
  const { cameras } = JSON.parse(await readFile(join(folder, 'rig.json')));
  const [x, y, z] = cameras[5].position;
  await setView(page, { x: x + 0.01, y: y - 0.02, z: z - 0.4, yaw: 3, pitch: -4, roll: 5 });
  await page.keyboard.press('Tab');
  await page.keyboard.press('c');
  await page.waitForFunction(() => inside().cameras.makers.length);
  const drawn = await page.evaluate(() => {
    const { canvas } = inside().cameras;
    return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.filter(value => value).length;
  });
  expect(drawn > 5000, `the mesh is not drawn: ${drawn}`);
  // At the position of the fifth camera, this camera is the only contributor.
  const at = await page.evaluate(async position => {
    const { axesOf, inView } = await import('/src/view.js');
    const { flight: { seen }, picture } = inside(), { box } = picture.eyes[0];
    const [x, y, z] = inView(seen, axesOf(seen), position), focal = box.height / 2 / Math.tan(seen.fov * Math.PI / 360);
    return [box.x + box.width / 2 + focal * x / z, box.y + box.height / 2 + focal * y / z];
  }, [x, y, z]);
  await page.mouse.move(...at);
  const words = () => page.evaluate(() => inside().root.querySelector('pre.makers').textContent);
  await until(async () => new RegExp(`^${cameras[5].name} (9\\d|100) %`).test(await words()),
    `${cameras[5].name} makes the pixel at ${at}`);
  await page.keyboard.press('i');
  await page.waitForFunction(
    () => /coverage +\d+\.\d %/.test(
      inside().root.querySelector('pre.figures').textContent));
  await page.screenshot({ path: join(artefacts, 'cameras.png') });
  await page.keyboard.press('c');
  expect(await page.evaluate(() => inside().cameras.canvas.hidden), 'c hides it');
  await closeClean(page, served);
}

async function twoEyes() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 5);
  const half = { width: 320, height: 480 };
  const choose = async (mode, width) => {
    await page.getByLabel('Eyes').selectOption(mode);
    await page.waitForFunction(width => inside().video.videoWidth === width, width);
    return setView(page, { x: 0.01, yaw: 2, roll: 3, 'focus-distance': 1.5 });
  };
  const side = await choose('side', 640);
  const left = await expectTruth(page, side, half, 'left eye', 0, -0.0315);
  const right = await expectTruth(page, side, half, 'right eye', 1, 0.0315);
  expect((await compare(page, left, right)).psnr < 30, 'both eyes see the same');
  await page.screenshot({ path: join(artefacts, 'side-by-side.png') });

  const anaglyph = await choose('anaglyph', 1280);
  await expectTruth(page, anaglyph, size, 'left eye of the anaglyph', 0, -0.0315);
  // Red comes from the left eye, green and blue from the right. Both eyes see the same region, so no bar is visible to
  // one eye only. (Frames may differ in their last bits.)
  const wrong = await page.evaluate(() => {
    const viewer = inside(), { canvas } = viewer.anaglyph, { width, height } = canvas;
    viewer.anaglyph.draw(viewer.flight.seen, viewer.eyeDistance);
    const { shift, rest } = viewer.anaglyph;
    const get = context => context.getImageData(0, 0, width, height).data;
    const eye = from => {
      const context = new OffscreenCanvas(width, height).getContext('2d');
      context.drawImage(viewer.video, from, (height - rest.height) / 2, rest.width, rest.height, 0, 0, width, height);
      return get(context);
    };
    const [seen, left, right] = [get(canvas.getContext('2d')), eye(2 * shift), eye(width)];
    return seen.filter((value, i) => i % 4 < 3 && Math.abs(value - (i % 4 ? right : left)[i]) > 10).length;
  });
  expect(wrong < 1000, `${wrong} values of the anaglyph are of the wrong eye`);
  await page.screenshot({ path: join(artefacts, 'anaglyph.png') });
  await closeClean(page, served);
}

async function clickFocuses() {
  const served = await serve(...rig, '--focus', '2');
  const page = await openShown(browser, served.url, size, 20);
  const between = (least, most, what) => until(async () => {
    const distance = (await stateOf(page))['focus-distance'];
    return distance > least && distance < most;
  }, `${what}: between ${least} and ${most} m`);
  const focuses = async (x, y, least, most) => {
    await page.mouse.click(x, y);
    await between(least, most, `a click at ${x}, ${y} focuses`);
  };
  await focuses(140, 330, 0.8, 1.6);
  await focuses(415, 190, 1.9, 2.5);
  await focuses(140, 330, 0.8, 1.6);
  await page.keyboard.press('f');
  await setView(page, { 'focus-distance': 3 });
  await between(0.8, 1.6, 'what is followed is in focus again');
  await focuses(415, 190, 1.9, 2.5);
  await page.getByRole('button', { name: 'Follow' }).press('Enter');
  expect(!await page.evaluate(() => inside().flight.follows), 'it ends');
  await page.getByLabel('Eyes').selectOption('side');
  await page.waitForFunction(() => inside().video.videoWidth === 640);
  await shown(page, 20);
  await setView(page, { 'focus-distance': 3 });
  await focuses(320 + 207, 190, 1.9, 2.5);
  await closeClean(page, served);
}

// A simulated headset with the parts of WebXR that the viewer uses. Its eyes are 60 mm apart, and the displays extend
// farther outwards than inwards.
function pretendHeadset() {
  const turn = angle => ({ x: 0, y: Math.sin(angle / 2), z: 0, w: Math.cos(angle / 2) });
  globalThis.lens = 2.5;  // focal length, relative to half of a display
  globalThis.head = { x: 0.01, y: 0.02, z: -0.03, angle: 0.05 };  // left, up and back, metres
  globalThis.XRWebGLLayer = class {
    constructor(session, gl) { Object.assign(this, { gl, framebuffer: null }); }
    getViewport({ eye }) { return { x: eye === 'left' ? 0 : 320, y: 0, width: 320, height: 320 }; }
  };
  globalThis.XRRigidTransform = class {
    constructor(position, orientation) { Object.assign(this, { position, orientation }); }
  };
  globalThis.XRMediaBinding = class {
    createQuadLayer(video, options) { return globalThis.quad = { video, ...options }; }
  };
  class Session extends EventTarget {
    renderState = {};
    enabledFeatures = globalThis.sessionHasLayers ? ['layers'] : [];
    updateRenderState(state) {
      Object.assign(this.renderState, state);
      if (state.baseLayer) Object.assign(state.baseLayer.gl.canvas, { width: 640, height: 320 });
    }
    async requestReferenceSpace() { return {}; }
    // Calls all callbacks of a frame in the same task, at 90 Hz, so that nothing changes in between.
    requestAnimationFrame(draw) {
      if (this.callbacks?.push(draw)) return;
      this.callbacks = [draw];
      setTimeout(() => {
        const { callbacks } = this;
        this.callbacks = null;
        if (!this.over) callbacks.forEach(call => call(performance.now(), { getViewerPose: pose }));
      }, 11);
    }
    async end() {
      this.over = true;
      this.dispatchEvent(new Event('end'));
    }
  }
  const pose = () => {
    const { x, y, z, angle } = head, orientation = turn(angle);
    const views = ['left', 'right'].map((eye, i) => {
      const along = i ? 0.03 : -0.03, aside = i ? 0.1 : -0.1;
      return { eye, transform: { orientation,
        position: { x: x + along * Math.cos(angle), y, z: z - along * Math.sin(angle) } },
        projectionMatrix: [lens, 0, 0, 0, 0, lens, 0, 0, aside, 0, -1, -1, 0, 0, -0.1, 0] };
    });
    return { transform: { position: { x, y, z }, orientation }, views };
  };
  const xr = { isSessionSupported: async () => true, requestSession: async () => globalThis.session = new Session() };
  Object.defineProperty(navigator, 'xr', { value: xr });
}

async function headset() {
  const served = await serve(...rig, '--max-width', '480', '--max-height', '320');
  const page = await openPage(browser, served.url, size, { before: pretendHeadset });
  await shown(page, 5);
  const home = await stateOf(page);
  await page.getByLabel('Eyes').selectOption('headset');
  await page.waitForFunction(() => inside().headset?.painter);
  await page.evaluate(() => inside().headset.draw = () => {});  // slow in software
  await page.waitForFunction(() => {
    const { flight: { seen }, video } = inside();
    return video.videoWidth > video.videoHeight * 1.5 && Math.abs(seen?.yaw + 0.05 * 180 / Math.PI) < 1e-3;
  });
  await page.evaluate(async () => {  // the encoder sharpens a still image over several frames
    const { video } = inside();
    for (let i = 0; i < 30; i++) await new Promise(done => video.requestVideoFrameCallback(done));
  });
  const state = await stateOf(page);
  // In WebXR, y points up and z back.
  for (const [name, by] of [['x', 0.01], ['y', -0.02], ['z', 0.03]])
    expect(Math.abs(state[name] - home[name] - by) < 1e-6, `the head moves ${name}: ${state[name]}`);
  const { width, height } = await page.evaluate(() => {
    const { video } = inside();
    return { width: video.videoWidth / 2, height: video.videoHeight };
  });
  for (const [side, offset] of [[0, -0.03], [1, 0.03]])
    await expectTruth(page, state, { width, height }, `eye ${side} of the headset`, side, offset);
  // The image is at the expected position on the displays, even after the head has turned.
  for (const turned of [0, 0.02]) {
    const url = await page.evaluate(turned => {
      const viewer = inside(), { headset } = viewer, { gl } = headset;
      viewer.flight.sendView = () => 0;
      head.angle = 0.05 + turned;
      return new Promise(done => session.requestAnimationFrame((time, frame) => {
        Object.getPrototypeOf(headset).draw.call(headset, frame.getViewerPose());
        done(gl.canvas.toDataURL('image/png'));
      }));
    }, turned);
    const displays = Buffer.from(url.split(',')[1], 'base64');
    await writeFile(join(artefacts, 'headset.png'), displays);
    for (const [side, cx] of [[0, 175.5], [1, 143.5]]) {
      const truth = await rendered(folder, { ...state, yaw: state.yaw - turned * 180 / Math.PI },
        { width: 320, height: 320, lens: { model: 'PINHOLE', params: [400, 400, cx, 159.5] } }, side ? 0.03 : -0.03);
      const { psnr } = await compare(page, await half(page, displays, side), truth);
      console.log(`# display ${side}, turned by ${turned}: ${psnr.toFixed(1)} dB`);
      expect(psnr > (turned ? 28 : 30), `display ${side}, turned by ${turned}: ${psnr.toFixed(1)} dB`);
    }
  }
  await page.evaluate(() => session.end());
  await page.waitForFunction(() => inside().mode === 'one');
  await closeClean(page, served);
}

// The frames of the headset do not wait for pictures. The head has moved sideways, and no new picture arrives: a frame still
// shows the eyes at their pose. Only this frame is drawn, because drawing in software is slow.
async function eyesAreDrawnAtTheirOwnPose() {
  const served = await serve('--rig', join(folder, 'rig.json'), '--framerate', '10', '--max-width', '480', '--max-height', '320');
  const page = await openPage(browser, served.url, size, { before: pretendHeadset });
  await shown(page, 5);
  await page.evaluate(() => globalThis.lens = 4);  // a view that the cameras cover completely
  await page.getByLabel('Eyes').selectOption('headset');
  await page.waitForFunction(() => inside().headset?.painter);
  await page.evaluate(() => {
    const { headset } = inside();
    headset.frames = 0;
    headset.draw = () => headset.frames++;
  });
  await page.waitForFunction(() => inside().redraw.pictures?.length === 2 &&
    inside().redraw.pictures.every(({ surface }) => surface.levels.length > 100));
  await page.waitForTimeout(2000);  // until the surfaces have settled
  const [url, playing, paused, state] = await page.evaluate(async () => {
    const { headset, redraw, video, flight } = inside(), { gl } = headset;
    const countsOf = async () => {
      const before = [headset.frames, redraw.frames];
      await new Promise(done => setTimeout(done, 1000));
      return [headset.frames, redraw.frames].map((count, k) => count - before[k]);
    };
    const playing = await countsOf();
    video.pause();
    flight.sendView = () => 0;
    await new Promise(done => setTimeout(done, 300));
    const paused = await countsOf();
    head.x += 0.05 * Math.cos(head.angle);
    head.z -= 0.05 * Math.sin(head.angle);
    delete headset.draw;
    return new Promise(done => session.requestAnimationFrame((time, frame) => {
      headset.draw(frame.getViewerPose());
      headset.draw = () => {};  // further frames would occupy the browser, and the next page could not start
      done([gl.canvas.toDataURL('image/png'), playing, paused, flight.seen]);
    }));
  });
  console.log(`# in a second, ${playing[0]} frames of the headset with ${playing[1]} pictures; paused, ${paused[0]} frames`);
  expect(playing[0] > 2 * playing[1] && paused[0] > 5 && paused[1] === 0, `${playing} frames and pictures; paused, ${paused}`);
  const displays = Buffer.from(url.split(',')[1], 'base64'), angle = state.yaw * Math.PI / 180;
  await writeFile(join(artefacts, 'headset-moved.png'), displays);
  for (const [side, cx] of [[0, 175.5], [1, 143.5]]) {
    const lens = { model: 'PINHOLE', params: [640, 640, cx, 159.5] }, offsets = [0.05, 0].map(by => by + (side ? 0.03 : -0.03));
    const [moved, stale] = await truthsOf(offsets.map(offset => ({ ...state, x: state.x + offset * Math.cos(angle),
      z: state.z - offset * Math.sin(angle) })), { width: 320, height: 320, lens });
    const eye = await half(page, displays, side), { psnr } = await compare(page, eye, moved), { psnr: before } = await compare(page, stale, moved);
    console.log(`# display ${side}, moved by 50 mm: ${psnr.toFixed(1)} dB, without the movement ${before.toFixed(1)} dB`);
    expect(psnr > before + 3, `display ${side}: ${psnr.toFixed(1)} dB after a movement, ${before.toFixed(1)} dB without`);
  }
  await page.evaluate(() => session.end());
  await page.waitForFunction(() => inside().mode === 'one');
  await closeClean(page, served);
}

// With media layers: checks the image that a compositor would show for the layer's pose.
async function headsetOfLayers() {
  const served = await serve(...rig, '--max-width', '480', '--max-height', '320');
  const page = await openPage(browser, served.url, size, { before: pretendHeadset });
  await shown(page, 5);
  await page.evaluate(() => { globalThis.sessionHasLayers = true; });
  await page.getByLabel('Eyes').selectOption('headset');
  await page.waitForFunction(() => {
    const { flight: { seen }, video } = inside();
    return video.videoWidth > video.videoHeight * 1.5 && Math.abs(seen?.yaw + 0.05 * 180 / Math.PI) < 1e-3 && quad.transform;
  });
  const { layout, isVideo, layers, lines, eye, most } = await page.evaluate(async () => {
    await new Promise(done => session.requestAnimationFrame(done));
    const { headset, flight: { seen }, video } = inside(), { transform: { position: p, orientation: q }, width, height } = quad;
    // Corners of the layer in head coordinates; rotation by a quaternion.
    const turned = ([x, y, z]) => {
      const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
      const u = [q.x, q.y, q.z], t = cross(u, [x, y, z]).map(v => 2 * v), c = cross(u, t);
      return [x + q.w * t[0] + c[0], y + q.w * t[1] + c[1], z + q.w * t[2] + c[2]];
    };
    const lines = [[-1, 1], [1, 1], [1, -1], [-1, -1]].map(([i, j]) => {
      const corner = turned([i * width / 2, j * height / 2, 0]);
      return [corner[0] + p.x, corner[1] + p.y, corner[2] + p.z];
    });
    const most = { y: Math.tan(seen.fov * Math.PI / 360), x: 0 };
    most.x = most.y * video.videoWidth / 2 / video.videoHeight;
    return { layout: quad.layout, isVideo: quad.video === video, layers: session.renderState.layers.length, lines, most, eye: head };
  });
  expect(layout === 'stereo-left-right' && isVideo && layers === 1, 'the video itself is the layer');
  const [c, s] = [Math.cos(eye.angle), Math.sin(eye.angle)];
  for (const [k, [i, j]] of [[-1, 1], [1, 1], [1, -1], [-1, -1]].entries()) {
    const [x, y, z] = [lines[k][0] - eye.x, lines[k][1] - eye.y, lines[k][2] - eye.z];
    const [right, up, back] = [c * x - s * z, y, s * x + c * z];
    expect(back < 0 && Math.abs(-right / back - i * most.x) < 1e-4 && Math.abs(-up / back - j * most.y) < 1e-4,
      `corner ${k} is seen at ${-right / back}, ${-up / back}`);
  }
  await page.evaluate(() => session.end());
  await page.waitForFunction(() => inside().mode === 'one');
  await closeClean(page, served);
}

// A link to a path that the server flies: shows the frames of the file, and no user can change the view.
async function kiosk() {
  const views = join(folder, 'kiosk.json'), state = { x: 0.02, y: -0.01, z: 0, yaw: 2, pitch: 1, roll: 0, fov: 30,
    'focus-distance': 1.2 }, viewSize = { width: 400, height: 300 };
  await writeFile(views, JSON.stringify({ format: 'lightfield-views', version: 1, views: [viewFile(state, viewSize)] }));
  const served = await serve(...rig, '--path', `still=${views}`);
  const page = await openShown(browser, new URL('#path=still', served.url).href, size, 60);
  await page.mouse.move(300, 200);
  await page.mouse.wheel(0, -500);
  await page.keyboard.press('Tab');
  await page.keyboard.press('w');
  await shown(page, 90);
  await expectTruth(page, state, viewSize, 'a path of the server');
  expect(!await page.getByRole('button').count(), 'there is something to press');
  await page.screenshot({ path: join(artefacts, 'kiosk.png') });
  await page.context().close();
  const wrong = await openPage(browser, new URL('#path=none', served.url).href, size);
  await until(async () => /no such path/.test(await wrong.getByRole('status').textContent()), 'an unknown path is reported');
  await close(wrong, served);
}

async function touchesAndSticks() {
  const served = await serve(...rig);
  const phone = { width: 360, height: 640 };
  const page = await openPage(browser, served.url, phone, { hasTouch: true, isMobile: true, before: () => {
    globalThis.pad = { axes: [0, 0, 0, 0], buttons: [] };
    navigator.getGamepads = () => [null, pad];
  } });
  await shown(page, 10);
  await page.screenshot({ path: join(artefacts, 'phone.png') });
  const boxes = await page.evaluate(() => [...inside().root
    .querySelectorAll('button, select, label')].filter(part => part.checkVisibility()).map(part => {
    const { left, right, top, bottom } = part.getBoundingClientRect();
    return { name: part.textContent.trim().slice(0, 20), left, right, top, bottom, tall: part.localName !== 'label' };
  }));
  for (const [i, a] of boxes.entries()) {
    expect(a.left >= 0 && a.right <= 360 && a.bottom <= 640, `${a.name} is not on the phone: ${JSON.stringify(a)}`);
    expect(!a.tall || a.bottom - a.top >= 44, `${a.name} is too small for a finger`);
    for (const b of boxes.slice(0, i))
      expect(a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top,
        `${a.name} covers ${b.name}`);
  }

  const devtools = await page.context().newCDPSession(page);
  const touch = (type, ...points) => devtools.send('Input.dispatchTouchEvent',
    { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  const home = await stateOf(page);
  await touch('touchStart', [180, 200]);
  for (let x = 180; x <= 240; x += 10) await touch('touchMove', [x, 200]);
  await touch('touchEnd');
  await until(async () => (await stateOf(page)).x < home.x - 0.005, 'a finger moves the eye');
  const before = await stateOf(page);
  await touch('touchStart', [170, 200], [190, 200]);
  for (let by = 0; by <= 60; by += 10) await touch('touchMove', [170 - by, 200], [190 + by, 200]);
  await touch('touchEnd');
  await until(async () => (await stateOf(page)).fov < 0.9 * before.fov, 'two fingers zoom in');

  const push = async (pad, condition, what) => {
    const from = await stateOf(page);
    await page.evaluate(pushed => Object.assign(pad, pushed), pad);
    await until(async () => condition(await stateOf(page), from), what);
    await page.evaluate(() => Object.assign(pad, { axes: [0, 0, 0, 0], buttons: [] }));
  };
  await page.evaluate(() => dispatchEvent(new Event('gamepadconnected')));
  await push({ axes: [0, 0, 0, 0], buttons: [{ pressed: true }] }, now => now.x === home.x && now.z === home.z,
    'the first button goes home');
  await push({ axes: [-1, 0, 0, 0] }, (now, then) => now.x > then.x + 0.005, 'the left stick orbits');
  await push({ axes: [0, 0, 0.6, 0] }, (now, then) => now['focus-distance'] > then['focus-distance'] * 1.05,
    'the right stick focuses');
  await push({ axes: [0, 0, 0, -0.6] }, (now, then) => now.fov < 0.95 * then.fov, 'the right stick zooms in');
  await closeClean(page, served);
}

async function textAlternatives() {
  const served = await serve(...rig);
  const page = await openPage(browser, 'about:blank', size), asked = [];
  page.on('request', request => asked.push(request.url()));
  const response = await page.goto(served.url);
  expect(/default-src 'self'/.test(response.headers()['content-security-policy']), 'there is a policy');
  expect(!/unsafe/.test(response.headers()['content-security-policy']), 'the policy is strict');
  await shown(page, 5);
  const words = await page.locator('lightfield-viewer').ariaSnapshot();
  for (const part of ['- application "Live picture of the light field', '- slider "Distance in focus"',
    '- button "Sweep"', '- button "Home"', '- combobox "Eyes"', '- button "Cameras"', '- button "Figures"',
    '- button "Share"', '- log "What happened"'])
    expect(words.includes(part), `${part} is not in\n${words}`);
  const described = await page.evaluate(() => {
    const { root, video } = inside();
    return root.getElementById(video.getAttribute('aria-describedby')).textContent;
  });
  expect(/Arrow keys/.test(described), described);
  await page.getByRole('button', { name: 'Sweep' }).press('Space');
  const pressed = page.getByRole('button', { name: 'Sweep', pressed: true });
  await pressed.waitFor();
  const first = (await stateOf(page))['focus-distance'];
  await until(async () => Math.abs((await stateOf(page))['focus-distance'] / first - 1) > 0.2, 'the focus sweeps');
  await pressed.press('Enter');
  await page.getByRole('button', { name: 'Home' }).press('Enter');
  await until(async () => /Back at the start/.test(await page.getByRole('log').textContent()), 'Home is announced');
  await page.getByRole('button', { name: 'Share' }).press('Enter');
  await until(async () => /link/.test(await page.getByRole('log').textContent()), 'Share is announced');
  expect(/focus-distance=/.test(page.url()), 'the address is the link');
  const elsewhere = asked.filter(url => new URL(url).origin !== new URL(served.url).origin && !url.startsWith('data:'));
  expect(asked.length > 5 && !elsewhere.length, `asked elsewhere: ${elsewhere}`);
  await served.stop();
  await until(async () => /\w/.test(await page.getByRole('status').textContent()), 'a lost server is reported');
  await page.context().close();
}

async function fourViewers() {
  const served = await serve(...rig, '--address-views', '4');
  const small = { width: 320, height: 240 };
  const pages = await Promise.all([0, 1, 2, 3].map(() => openPage(browser, served.url, small)));
  await Promise.all(pages.map(page => shown(page, 10)));
  const states = await Promise.all(pages.map((page, i) => setView(page, { yaw: 2 * i - 3 })));
  for (const [i, page] of pages.entries()) {
    expect(Math.abs(states[i].yaw - (2 * i - 3)) < 1e-6, `viewer ${i} has the view of another: ${states[i].yaw}`);
    await expectTruth(page, states[i], small, `viewer ${i}`);
  }
  expect(await served.metric('viewers') === 4, 'four viewers');
  await Promise.all(pages.map(page => page.context().close()));
  await until(async () => await served.metric('viewers') === 0, 'all viewers are gone');
  await served.stop();
}

async function nodes() {
  const key = join(folder, 'lightfield.key');
  await writeFile(key, 'k'.repeat(40), { mode: 0o600 });
  const port = 20000 + Math.floor(Math.random() * 10000), hosts = [0, 1].map(i =>
    start('gst-launch-1.0', 'lfnodesink', `rig=${join(folder, 'rig.json')}`, `node=${i}`, `cameras=${i ? '8-15' : '0-7'}`,
      `listen=${port + i}`, `answers=127.0.0.1:${port + 10 + i}`, `key-file=${key}`));
  const served = await serve(...rig, '--key-file', key, '--nodes', [0, 1].map(i => `127.0.0.1:${port + i}:${port + 10 + i}`).join());
  const page = await openShown(browser, served.url, { width: 320, height: 240 }, 30);
  await until(async () => await page.evaluate(async () => {
    const viewer = document.querySelector('lightfield-viewer'), before = viewer.statistics;
    await new Promise(done => viewer.addEventListener('statistics', done, { once: true }));
    return viewer.statistics.pictures - before.pictures > 5 && viewer.statistics.incomplete === before.incomplete;
  }), 'all hosts answer');
  await expectTruth(page, await setView(page, { yaw: 1 }), { width: 320, height: 240 }, 'from two hosts');
  for (const host of hosts) host.kill('SIGTERM');
  await close(page, served);
}

async function lossyNetwork() {
  const served = await serve(...rig, '--bitrate', '480000');
  const page = await newPage(browser, size);
  const relay = await throughRelay(page);
  await page.goto(served.url);
  await shown(page, 30);
  const figures = () => page.evaluate(() => inside().statistics);
  relay.loss = 0.3;
  await until(async () => (await figures()).frameRate === 15, 'less frames where much is lost');
  await until(async () => (await figures()).sizeDivisor === 2, 'less pixels where much is lost');
  const video = () => page.evaluate(() => inside().video.videoWidth);
  await until(async () => await video() === 320, 'the browser has the smaller picture');
  relay.loss = 0;
  await until(async () => (await figures()).frameRate === 30, 'all comes back');
  await until(async () => await video() === 640, 'the browser has the larger picture');
  await expectTruth(page, await setView(page, { yaw: 1 }), size, 'after a bad time');
  await close(page, served);
  relay.close();
}

async function stalledAndKilled() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, { width: 320, height: 240 }, 10);
  const frames = () => page.evaluate(() => inside().video.getVideoPlaybackQuality().totalVideoFrames);
  for (const signal of ['SIGSTOP', 'SIGKILL']) {
    const server = await launchBrowserServer(), other = await connectBrowser(server);
    await shown(await openPage(other, served.url, { width: 320, height: 240 }), 5);
    expect(await served.metric('viewers') === 2, 'two viewers');
    const group = -server.process().pid;
    const before = await frames();
    process.kill(group, signal);
    const began = Date.now();
    await until(async () => await served.metric('viewers') === 1, `the viewer with ${signal} is gone`);
    console.log(`# ${signal}: gone after ${((Date.now() - began) / 1000).toFixed(1)} s`);
    if (signal === 'SIGSTOP') process.kill(group, 'SIGKILL');
    await until(async () => await frames() > before + 10, 'the other viewer goes on');
  }
  await close(page, served);
}

async function comesAndGoes() {
  const cycles = Number(process.env.LF_CYCLES ?? 20);
  const served = await serve(...rig);
  let warm = 0;
  for (let i = 0; i < cycles; i++) {
    if (i === Math.min(20, cycles >> 1)) warm = await served.metric('resident_bytes');
    const page = await openPage(browser, served.url, { width: 320, height: 240 });
    if (i % 4 !== 3) await shown(page, 2);
    await page.context().close();
  }
  await until(async () => await served.metric('viewers') === 0, 'all viewers are gone');
  const now = await served.metric('resident_bytes');
  const [before, after] = [warm, now].map(bytes => (bytes / 2 ** 20).toFixed(1));
  console.log(`# ${cycles} cycles: ${before} MiB resident, then ${after} MiB`);
  expect(now < 1.15 * warm, 'memory grows');
  await served.stop();
}

async function refusals() {
  const token = join(folder, 'token');
  await writeFile(token, 'sesame', { mode: 0o600 });
  const served = await serve(...rig, '--token-file', token, '--viewers', '1');
  const status = page => page.evaluate(() => inside().status.textContent);
  const wrong = await openPage(browser, new URL('#token=wrong', served.url).href, size);
  await until(async () => /token/.test(await status(wrong)), 'the page says that the token is wrong');
  const right = await openShown(browser, new URL('#token=sesame', served.url).href, size, 2);
  const second = await openPage(browser, new URL('#token=sesame', served.url).href, size);
  await until(async () => /too many viewers/.test(await status(second)), 'the page says that there are too many');
  await right.evaluate(() => {
    const { channel } = inside().stream.connection;
    for (let i = 0; i < 5000; i++) channel.send('{"id":1,"request":{"type":"navigationEvent"}}');
    channel.send('x'.repeat(60000));
  });
  await right.evaluate(() => inside().stream.connection.channel.send(''));
  await until(() => /sends too many/.test(served.said), 'the flood is noticed');
  await new Promise(done => setTimeout(done, 1000));
  await setView(right, { yaw: 1 });
  for (const page of [wrong, right]) await page.context().close();
  await close(second, served);
}

async function fiveLines() {
  let html = '';
  const site = createServer((request, response) => {
    response.setHeader('Content-Type', 'text/html');
    response.end(html);
  });
  await new Promise(done => site.listen(0, '127.0.0.1', done));
  const origin = `http://127.0.0.1:${site.address().port}`;
  const served = await serve(...rig, '--origin', origin, '--origin', 'null');
  html = `<!doctype html>
<title>mine</title>
<h1>My light field</h1>
<script type="module" src="${served.url}lightfield-viewer.js"></script>
<lightfield-viewer controls autoplay style="width: 320px; height: 240px"></lightfield-viewer>`;
  const page = await openShown(browser, origin, size, 5);
  await expectTruth(page, await setView(page, { yaw: 1 }), { width: 320, height: 240 }, 'in another page');
  await page.getByRole('button', { name: 'Cameras' }).press('Enter');
  await page.waitForFunction(() => inside().cameras.array);
  expect(!page.problems.length, page.problems.join('; '));
  await page.context().close();
  const file = join(folder, 'mine.html');
  await writeFile(file, html.replace('<lightfield-viewer', `<lightfield-viewer src="${served.url}whep"`));
  const local = await openShown(browser, `file://${file}`, size, 5);
  await close(local, served);
  site.close();
}

await runTests([
  ['the page shows the light field and flies', showsAndFlies],
  ['links, keyboard, names and sizes', linkKeyboardNamesAndSize],
  ['the cameras of a pixel', showsItsCameras],
  ['two eyes', twoEyes],
  ['a click focuses', clickFocuses],
  ['a headset', headset],
  ['a headset between two pictures', eyesAreDrawnAtTheirOwnPose],
  ['a headset with media layers', headsetOfLayers],
  ['a path of the server', kiosk],
  ['touches and sticks', touchesAndSticks],
  ['text alternatives, and no outside resources', textAlternatives],
  ['four viewers have their own views', fourViewers],
  ['cameras on other hosts', nodes],
  ['a network that loses packets', lossyNetwork],
  ['stalled and killed browsers are dropped, others continue', stalledAndKilled],
  ['viewers come and go', comesAndGoes],
  ['tokens, too many viewers, floods', refusals],
  ['a page of five lines', fiveLines],
]);
