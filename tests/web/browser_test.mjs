// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve and its page in headless Chromium.
import { createServer } from 'node:http';
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, compare, connectBrowser, expect, launchBrowser, launchBrowserServer, makeRig, openPage, patience,
  picture, rendered, runTests, serve, setView, shown, source, start, stateOf, until } from './harness.mjs';

const size = { width: 640, height: 480 };
const folder = await makeRig('4x4');
const rig = ['--rig', join(folder, 'rig.json'), '--connects', '100'];
const browser = await launchBrowser();

async function expectTruth(page, state, viewSize, what) {
  const seen = await picture(page);
  const { psnr, mean, deviation } = await compare(page, seen, await rendered(folder, state, viewSize));
  console.log(`# ${what}: ${psnr.toFixed(1)} dB against lf-render`);
  if (psnr < 30) await writeFile(join(artefacts, 'wrong.png'), seen);
  expect(psnr >= 30, `${what}: ${psnr.toFixed(1)} dB`);
  expect(mean > 20 && deviation > 10, `${what}: black, mean ${mean}, deviation ${deviation}`);
  return seen;
}

async function showsAndFlies() {
  const served = await serve(...rig);
  const page = await openPage(browser, served.url, size);
  await shown(page, 30);
  await page.screenshot({ path: join(artefacts, 'page.png') });
  const home = await stateOf(page);
  const first = await expectTruth(page, await setView(page, { fov: home.fov }), size, 'home');

  const focused = await setView(page, { 'focus-distance': home['focus-distance'] * 2 });
  const second = await expectTruth(page, focused, size, 'focused farther');
  expect((await compare(page, first, second)).psnr < 35, 'focus changes nothing');

  // A drag to the right takes the scene along: the eye goes to the left.
  await page.mouse.move(300, 200);
  await page.mouse.down();
  for (let x = 300; x <= 340; x += 10) await page.mouse.move(x, 200);
  await page.mouse.up();
  await until(async () => (await stateOf(page)).x < home.x - 0.01, 'the drag moves the eye');
  const dragged = await setView(page, { fov: home.fov });
  const third = await expectTruth(page, dragged, size, 'dragged');
  expect((await compare(page, second, third)).psnr < 35, 'the drag changes nothing');

  // However far it goes, it does not end in the dark.
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
  await until(async () => (await stateOf(page)).z > border.z + 0.01, 'the wheel moves the eye forwards');
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
  const page = await openPage(browser, new URL('#x=0.02&yaw=2&focus-distance=3&nonsense=1', served.url).href, size);
  await shown(page, 5);
  await until(async () => Math.abs((await stateOf(page)).yaw - 2) < 1e-6, 'the link sets the view');
  const link = await page.evaluate(() => document.querySelector('lightfield-viewer').link);
  expect(/x=0\.02&/.test(link) && /yaw=2&/.test(link), link);
  // Everything is reached with Tab and has a name.
  const seen = new Set();
  for (let i = 0; i < 8; i++) {
    await page.keyboard.press('Tab');
    seen.add(await page.evaluate(() => {
      const element = document.querySelector('lightfield-viewer').shadowRoot.activeElement;
      return element && `${element.localName} ${element.ariaLabel ?? element.textContent.trim()}`;
    }));
  }
  for (const name of ['video Live', 'input Distance', 'button Home', 'button Figures', 'button Share'])
    expect([...seen].some(text => text?.startsWith(name)), `${name} is not reached: ${[...seen]}`);
  await page.focus('lightfield-viewer input');
  const before = (await stateOf(page))['focus-distance'];
  for (let i = 0; i < 20; i++) await page.keyboard.press('ArrowRight');
  await until(async () => (await stateOf(page))['focus-distance'] > before * 1.2, 'the slider focuses');
  await page.focus('lightfield-viewer video');
  const kept = await stateOf(page);
  await page.setViewportSize({ width: 320, height: 240 });
  await page.waitForFunction(() => document.querySelector('lightfield-viewer').video.videoWidth === 320, null,
    { timeout: patience });
  const state = await setView(page, { fov: kept.fov });
  expect(state.yaw === kept.yaw && state['focus-distance'] === kept['focus-distance'], 'a new size keeps the view');
  await page.keyboard.press('i');
  await page.waitForFunction(
    () => document.querySelector('lightfield-viewer').shadowRoot.querySelector('pre.figures').textContent
      .includes('frames/s'));
  await page.context().close();
  await served.stop();
}

// The overlay of cameras against what the server says of the pixels that it marks.
async function showsItsCameras() {
  const served = await serve(...rig);
  const page = await openPage(browser, served.url, size);
  await shown(page, 5);
  const { cameras } = JSON.parse(await readFile(join(folder, 'rig.json')));
  const [x, y, z] = cameras[5].position;
  await setView(page, { x: x + 0.01, y: y - 0.02, z: z - 0.4, yaw: 3, pitch: -4, roll: 5 });
  await page.keyboard.press('Tab');
  await page.keyboard.press('c');
  await page.waitForFunction(() => document.querySelector('lightfield-viewer').cameras.makers.length, null,
    { timeout: patience });
  const drawn = await page.evaluate(() => {
    const { canvas } = document.querySelector('lightfield-viewer').cameras;
    return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.filter(value => value).length;
  });
  expect(drawn > 5000, `the mesh is not drawn: ${drawn}`);
  // Where the fifth camera is drawn it makes the picture alone.
  const at = await page.evaluate(async position => {
    const { axesOf, inView } = await import('/view.js');
    const viewer = document.querySelector('lightfield-viewer'), { box } = viewer.eyes[0];
    const [x, y, z] = inView(viewer.seen, axesOf(viewer.seen), position);
    const focal = box.height / 2 / Math.tan(viewer.seen.fov * Math.PI / 360);
    return [box.x + box.width / 2 + focal * x / z, box.y + box.height / 2 + focal * y / z];
  }, [x, y, z]);
  await page.mouse.move(...at);
  const words = () => page.evaluate(
    () => document.querySelector('lightfield-viewer').shadowRoot.querySelector('pre.makers').textContent);
  await until(async () => new RegExp(`^${cameras[5].name} (9\\d|100) %`).test(await words()),
    `${cameras[5].name} makes the pixel at ${at}`);
  await page.keyboard.press('i');
  await page.waitForFunction(
    () => /coverage +\d+\.\d %/.test(
      document.querySelector('lightfield-viewer').shadowRoot.querySelector('pre.figures').textContent));
  await page.screenshot({ path: join(artefacts, 'cameras.png') });
  await page.keyboard.press('c');
  expect(await page.evaluate(() => document.querySelector('lightfield-viewer').cameras.canvas.hidden), 'c hides it');
  expect(!page.problems.length, page.problems.join('; '));
  await page.context().close();
  await served.stop();
}

async function fourViewers() {
  const served = await serve(...rig);
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

// The cameras on two other hosts; here they are processes.
async function nodes() {
  const port = 20000 + Math.floor(Math.random() * 10000), hosts = [0, 1].map(i =>
    start(join(source, 'pipelines/camera-node.sh'), '--rig', join(folder, 'rig.json'), '--node', String(i), '--cameras',
      i ? '8-15' : '0-7', '--requests', String(port + i), '--answers', `127.0.0.1:${port + 10 + i}`));
  const served = await serve(...rig, '--nodes', [0, 1].map(i => `127.0.0.1:${port + i}:${port + 10 + i}`).join());
  const page = await openPage(browser, served.url, { width: 320, height: 240 });
  await shown(page, 30);
  // A host may take its time to begin.
  await until(async () => await page.evaluate(async () => {
    const viewer = document.querySelector('lightfield-viewer'), before = viewer.figures;
    await new Promise(done => viewer.addEventListener('statistics', done, { once: true }));
    return viewer.figures.pictures - before.pictures > 5 && viewer.figures.incomplete === before.incomplete;
  }), 'all hosts answer');
  await expectTruth(page, await setView(page, { yaw: 1 }), { width: 320, height: 240 }, 'from two hosts');
  for (const host of hosts) host.kill('SIGTERM');
  await page.context().close();
  await served.stop();
}

async function stalledAndKilled() {
  const served = await serve(...rig);
  const page = await openPage(browser, served.url, { width: 320, height: 240 });
  await shown(page, 10);
  const frames = () => page.evaluate(
    () => document.querySelector('lightfield-viewer').video.getVideoPlaybackQuality().totalVideoFrames);
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
  await page.context().close();
  await served.stop();
}

async function comesAndGoes() {
  const cycles = Number(process.env.LF_CYCLES ?? 20);
  const served = await serve(...rig);
  let warm = 0;
  for (let i = 0; i < cycles; i++) {
    if (i === Math.min(10, cycles >> 1)) warm = await served.metric('resident_bytes');
    const page = await openPage(browser, served.url, { width: 320, height: 240 });
    // Some leave before there is a picture.
    if (i % 4 !== 3) await shown(page, 2);
    await page.context().close();
  }
  await until(async () => await served.metric('viewers') === 0, 'all viewers are gone');
  const now = await served.metric('resident_bytes');
  const [before, after] = [warm, now].map(bytes => (bytes / 2 ** 20).toFixed(1));
  console.log(`# ${cycles} cycles: ${before} MiB resident, then ${after} MiB`);
  expect(now < 1.15 * warm + 8 * 2 ** 20, 'memory grows');
  await served.stop();
}

async function refusals() {
  const token = join(folder, 'token');
  await writeFile(token, 'sesame');
  const served = await serve(...rig, '--token-file', token, '--viewers', '1');
  const status = page => page.evaluate(() => document.querySelector('lightfield-viewer').status.textContent);
  const wrong = await openPage(browser, new URL('#token=wrong', served.url).href, size);
  await until(async () => /token/.test(await status(wrong)), 'the page says that the token is wrong');
  const right = await openPage(browser, new URL('#token=sesame', served.url).href, size);
  await shown(right, 2);
  const second = await openPage(browser, new URL('#token=sesame', served.url).href, size);
  await until(async () => /too many viewers/.test(await status(second)), 'the page says that there are too many');
  // A flood of messages is dropped and said once; the viewer and the server go on.
  await right.evaluate(() => {
    const { channel } = document.querySelector('lightfield-viewer').connection;
    for (let i = 0; i < 5000; i++) channel.send('{"id":1,"request":{"type":"navigationEvent"}}');
    channel.send('x'.repeat(60000));
  });
  await until(() => /too many messages/.test(served.said), 'the flood is noticed');
  await new Promise(done => setTimeout(done, 1000));
  await setView(right, { yaw: 1 });
  for (const page of [wrong, right, second]) await page.context().close();
  await served.stop();
}

// The element in somebody else's page.
async function fiveLines() {
  let html = '';
  const site = createServer((request, response) => {
    response.setHeader('Content-Type', 'text/html');
    response.end(html);
  });
  await new Promise(done => site.listen(0, '127.0.0.1', done));
  const origin = `http://127.0.0.1:${site.address().port}`;
  const served = await serve(...rig, '--origin', origin);
  html = `<!doctype html>
<title>mine</title>
<h1>My light field</h1>
<script type="module" src="${served.url}lightfield-viewer.js"></script>
<lightfield-viewer style="width: 320px; height: 240px"></lightfield-viewer>`;
  const page = await openPage(browser, origin, size);
  await shown(page, 5);
  await expectTruth(page, await setView(page, { yaw: 1 }), { width: 320, height: 240 }, 'in another page');
  await page.context().close();
  await served.stop();
  site.close();
}

await runTests([
  ['the page shows the light field and flies', showsAndFlies],
  ['links, keyboard, names and sizes', linkKeyboardNamesAndSize],
  ['the cameras of a pixel', showsItsCameras],
  ['four viewers have their own views', fourViewers],
  ['cameras on other hosts', nodes],
  ['stalled and killed browsers are forgotten, others go on', stalledAndKilled],
  ['viewers come and go', comesAndGoes],
  ['tokens, too many viewers, floods', refusals],
  ['a page of five lines', fiveLines],
]);
