// SPDX-License-Identifier: LGPL-2.1-or-later
// <lightfield-viewer> in third-party pages, frames and frameworks, and from npm.
import { execFile } from 'node:child_process';
import { cp, mkdir, readFile, rm, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { gzipSync } from 'node:zlib';
import { artefacts, close, closeClean, compare, expect, launchBrowser, makeFolder, makeRig, newPage, openPage,
  openShown, picture, rendered, runTests, serve, setView, shown, site, source, stateOf, until,
  viewFile } from './harness.mjs';

const run = promisify(execFile);
const folder = await makeRig('4x4');
const rig = ['--rig', join(folder, 'rig.json'), '--connects', '100', '--address-views', '8', '--focus-mode', 'plane', '--origin', '*'];
const browser = await launchBrowser(), size = { width: 640, height: 480 };

const script = served => `<script type="module" src="${served.url}lightfield-viewer.js"></script>`;
const page = body => `<!doctype html><html lang="en"><meta charset="utf-8"><title>mine</title><style>body { margin: 0 }</style>${body}`;
const frames = (page, id) => page.evaluate(
  id => inside(document.getElementById(id)).video.getVideoPlaybackQuality().totalVideoFrames, id);
const goesOn = async (page, id, what) => {
  const before = await frames(page, id);
  await until(async () => await frames(page, id) > before + 3, what);
};

// npm pack, npm install in an empty folder, and the page of the README with only the server's address changed.
async function fromNpm() {
  const fresh = await makeFolder();
  const { stdout } = await run('npm', ['pack', '--json', '--pack-destination', fresh], {
    cwd: join(source, 'web'), env: { ...process.env, PATH: `${join(artefacts, 'node_modules/.bin')}:${process.env.PATH}` } });
  const [{ filename, files }] = JSON.parse(stdout.slice(stdout.indexOf('[\n')));  // after the output of the script prepack
  console.log(`# ${filename}: ${files.map(({ path }) => path).join(' ')}`);
  for (const name of ['LICENSE', 'custom-elements.json']) expect(files.some(({ path }) => path === name), `it has ${name}`);
  await writeFile(join(fresh, 'package.json'), '{ "private": true, "type": "module" }');
  await run('npm', ['install', '--no-audit', '--no-fund', '--offline', join(fresh, filename)], { cwd: fresh });
  const served = await serve(...rig);
  const readme = await readFile(join(fresh, 'node_modules/lightfield-viewer/README.md'), 'utf8');
  const [, html] = readme.match(/```html\n([\s\S]*?)```/), endpoint = 'http://127.0.0.1:8080/whep';
  expect(html.includes(endpoint), 'the page names its server');
  const mine = await site({ '/': html.replace(endpoint, `${served.url}whep`) }, fresh);
  const stranger = await openShown(browser, mine.origin, size, 10);
  await until(async () => Math.abs((await stateOf(stranger)).yaw - 2) < 1e-6, 'its script sets the view');
  await stranger.getByRole('slider').fill('0.9');
  await until(async () => /^\d+\.\d\d m$/.test(await stranger.locator('output').textContent()), 'it tells the focus');
  expect(!stranger.problems.length, stranger.problems.join('; '));
  await stranger.screenshot({ path: join(artefacts, 'readme.png') });
  await stranger.context().close();
  const bundle = await readFile(join(fresh, 'node_modules/lightfield-viewer/lightfield-viewer.min.js')), bytes = gzipSync(bundle).length;
  console.log(`# lightfield-viewer.min.js: ${bytes} bytes compressed`);
  expect(bytes < 40_000, `the file for <script> has at most 40 kB: ${bytes}`);
  const old = await site({ '/': page(`<script src="node_modules/lightfield-viewer/lightfield-viewer.min.js"></script>
    <lightfield-viewer src="${served.url}whep" controls autoplay></lightfield-viewer>`) }, fresh);
  const classic = await openShown(browser, old.origin, size, 10);
  expect(!classic.problems.length, classic.problems.join('; '));
  await classic.context().close();
  old.close();
  await run('node', ['--input-type=module', '-e', 'import { LightfieldViewer } from "lightfield-viewer"; if (!LightfieldViewer) throw 1;'],
    { cwd: fresh });
  await writeFile(join(fresh, 'use.ts'), `import { LightfieldViewer, type LightfieldView } from 'lightfield-viewer';
const viewer: LightfieldViewer = document.createElement('lightfield-viewer');
viewer.addEventListener('view-change', ({ detail }) => { const by: 'person' | 'script' = detail.by; viewer.title = by; });
viewer.addEventListener('error', event => { const after: number = event.detail.retryAfter; viewer.title = String(after); });
viewer.addEventListener('fallback', ({ detail }) => { const path: string | null = detail.path; viewer.title = path ?? viewer.fallback ?? ''; });
viewer.addEventListener('click', event => viewer.focusAt(event.clientX, event.clientY));
viewer.view = { yaw: 3 };
viewer.view = 'yaw=3';
const view: Promise<LightfieldView> = viewer.setView({ focusDistance: 2 });
const blob: Promise<Blob> = viewer.toBlob({ type: 'image/jpeg' });
export { view, blob };
// @ts-expect-error this property is read-only
viewer.interactive = true;
// @ts-expect-error there is no such eye
viewer.eyes = 'three';
// @ts-expect-error nor such a number of a view
viewer.setView({ zoom: 2 });
`);
  await run('node', [join(artefacts, 'node_modules/typescript/bin/tsc'), '--noEmit', '--strict', '--module', 'nodenext',
    '--target', 'es2022', '--lib', 'es2022,dom', 'use.ts'], { cwd: fresh }).catch(error => { throw new Error(error.stdout); });
  await served.stop();
  mine.close();
}

async function twoElements() {
  const served = await serve(...rig), { url } = served;
  const mine = await site({ '/': page(`${script(served)}
    <lightfield-viewer id="a" controls autoplay style="width: 320px; height: 240px" view="yaw=2"></lightfield-viewer>
    <div id="there"></div>
    <lightfield-viewer id="b" src="${url}whep" style="width: 320px; height: 240px"></lightfield-viewer>`) });
  const two = await openPage(browser, `${mine.origin}#x=5&yaw=40&token=mine`, { width: 700, height: 700 });
  await two.evaluate(() => {
    globalThis.written = [];
    new MutationObserver(list => written.push(...list.map(({ attributeName, target }) => `${target.id} ${attributeName}`)))
      .observe(document, { attributes: true, subtree: true });
  });
  await two.waitForFunction(() => inside(a)?.flight.seen && a.loaded);
  const view = id => two.evaluate(id => document.getElementById(id).view, id);
  await until(async () => Math.abs((await view('a')).yaw - 2) < 1e-6, 'the attribute view says where to begin');
  expect(await two.evaluate(() => b.paused && !b.connected && !b.loaded), 'without autoplay it waits');
  expect(await served.metric('viewers') === 1, 'and asks for nothing');
  await two.locator('#b').getByRole('button', { name: 'Watch' }).click();
  await two.waitForFunction(() => b.loaded);
  await two.evaluate(() => a.setView({ yaw: -1 }));
  expect(Math.abs((await view('a')).yaw + 1) < 1e-6 && Math.abs((await view('b')).yaw) < 1e-6, 'each has a view of its own');
  expect(!await two.locator('#b').getByRole('slider').count(), 'without controls there are none');
  expect(await two.evaluate(() => location.hash) === '#x=5&yaw=40&token=mine', 'the page keeps its address');
  expect(!(await two.evaluate(() => written)).length, `attributes are written: ${await two.evaluate(() => written)}`);

  await two.evaluate(() => {
    b.controls = true;
    b.alt = 'A globe';
    b.setAttribute('max-width', 160);
    b.setAttribute('view', 'x=0.02 focus-distance=3');
  });
  // Checks the requested size, because a busy server may send less.
  const asks = width => two.waitForFunction(width => b.connected && inside(b).stream.asked.width === width, width);
  await asks(160);
  await until(async () => Math.abs((await view('b')).x - 0.02) < 1e-6 && (await view('b')).focusDistance === 3, 'view goes there');
  await two.getByRole('application', { name: 'A globe' }).waitFor();
  expect(await two.locator('#b').getByRole('slider').count() === 1, 'controls come');
  await two.evaluate(() => b.eyes = 'side');
  await two.waitForFunction(() => b.connected && inside(b).twoEyes);
  await asks(160);
  await two.evaluate(() => {
    b.eyes = null;
    b.src = '/nowhere';
  });
  await until(async () => /refuses|reached/.test(await two.locator('#b').getByRole('status').textContent()), 'a wrong src is reported');
  await two.evaluate(url => {
    b.src = `${url}whep`;
  }, url);
  await goesOn(two, 'b', 'a right one goes on');

  // Moving does not interrupt the stream; after removal and insertion the view is unchanged.
  const opened = await served.metric('viewers_total');
  await two.evaluate(() => there.append(a));
  await goesOn(two, 'a', 'moved, it goes on');
  expect(await served.metric('viewers_total') === opened, 'with the same stream');
  await two.evaluate(() => (globalThis.kept = a).remove());
  await until(async () => await served.metric('viewers') === 1, 'removed, it leaves its seat');
  await two.evaluate(() => document.body.append(kept));
  await goesOn(two, 'a', 'added again, it goes on');
  expect(Math.abs((await view('a')).yaw + 1) < 1e-6, 'where it was');
  await closeClean(two, served);
  mine.close();
}

// Sets all properties repeatedly, like declarative frameworks.
async function rerendered() {
  const served = await serve(...rig);
  const mine = await site({ '/': page(`<div id="root"></div><script type="module">
    const root = document.getElementById('root');
    let element = null, times = 0;
    globalThis.render = (props, key) => {
      times++;
      if (!element || element.key !== key) {
        const made = Object.assign(document.createElement('lightfield-viewer'), { key });
        element?.replaceWith(made) ?? root.append(made);
        element = made;
      }
      for (const [name, value] of Object.entries(props)) name in element ? element[name] = value : element.setAttribute(name, value);
      return times;
    };
    const props = () => ({ id: 'c', src: '${served.url}whep', controls: true, autoplay: true, view: { yaw: 1 }, alt: 'Mine',
      maxWidth: 320, eyes: 'one', iceServers: null, style: 'width: 320px; height: 240px' });
    render(props(), 1);  // before there is such an element
    import('${served.url}lightfield-viewer.js');
    globalThis.timer = setInterval(() => render(props(), 1), 20);
    globalThis.anew = () => render(props(), 2);
  </script>`) });
  const react = await openPage(browser, mine.origin, size);
  await react.waitForFunction(() => globalThis.c?.loaded);
  const yaw = () => react.evaluate(() => c.view.yaw);
  await until(async () => Math.abs(await yaw() - 1) < 1e-6, 'what was set before the element was defined counts');
  await react.evaluate(() => c.setView({ yaw: -2 }));
  await react.waitForTimeout(500);
  expect(Math.abs(await yaw() + 2) < 1e-6, 'rendering again keeps the view');
  expect(await served.metric('viewers_total') === 1, 'nor is there another stream');
  await react.evaluate(() => {
    clearInterval(timer);
    anew();
  });
  await react.waitForFunction(() => c.key === 2 && c.loaded);
  await until(async () => await served.metric('viewers') === 1, 'the one before has left');
  await closeClean(react, served);
  mine.close();
}

async function framed() {
  const served = await serve(...rig);
  const inner = await site({ '/': page(`${script(served)}
    <lightfield-viewer id="viewer" src="${served.url}whep" controls autoplay></lightfield-viewer>`) });
  const outer = await site({ '/': page(`<p>above</p><iframe src="${inner.origin}" width="640" height="480" title="viewer"></iframe>
    <p style="height: 3000px">below</p>`) }, null, 'localhost');
  const tab = await openPage(browser, outer.origin, { width: 700, height: 600 });
  const frame = tab.frame({ url: `${inner.origin}/` });
  await frame.waitForFunction(() => globalThis.viewer?.loaded);
  expect(await tab.evaluate(() => { try { return frames[0].document, false; } catch { return true; } }), 'of another origin');
  const fov = () => frame.evaluate(() => viewer.view.fov), home = await fov();
  const scrolled = () => tab.evaluate(() => scrollY);
  await tab.mouse.move(300, 250);
  await tab.mouse.wheel(0, 100);
  await until(async () => await scrolled() > 0, 'the wheel scrolls the page');
  expect(Math.abs(await fov() / home - 1) < 1e-9, 'and does not zoom');
  await tab.evaluate(() => scrollTo(0, 0));
  await tab.keyboard.down('Control');
  await tab.mouse.wheel(0, -300);
  await tab.keyboard.up('Control');
  await until(async () => await fov() < 0.95 * home, 'with ctrl it zooms');
  expect(await scrolled() === 0, 'and scrolls nothing');
  await tab.mouse.click(300, 250);
  const before = await fov();
  await tab.mouse.wheel(0, -300);
  await until(async () => await fov() < 0.95 * before, 'after a click it zooms');
  expect(await scrolled() === 0, 'and scrolls nothing');
  await closeClean(tab, served);
  for (const one of [inner, outer]) one.close();
}

async function outOfSight() {
  const served = await serve(...rig);
  const mine = await site({ '/': page(`${script(served)}
    <lightfield-viewer id="v" controls autoplay style="width: 320px; height: 240px"></lightfield-viewer><p style="height: 5000px">`) });
  const long = await openShown(browser, mine.origin, size, 5);
  await setView(long, { yaw: 2 });
  const hide = hidden => long.evaluate(hidden => {
    Object.defineProperty(document, 'hidden', { configurable: true, get: () => hidden });
    document.dispatchEvent(new Event('visibilitychange'));
  }, hidden);
  for (const [what, leave, come] of [['scrolled away', () => long.evaluate(() => scrollTo(0, 3000)), () => scrollTo(0, 0)],
    ['in a hidden tab', () => hide(true), () => {
      Object.defineProperty(document, 'hidden', { configurable: true, get: () => false });
      document.dispatchEvent(new Event('visibilitychange'));
    }]]) {
    await leave();
    await until(async () => await served.metric('viewers') === 0, `${what}, it leaves`);
    const after = await long.evaluate(async come => {
      const began = performance.now();
      (0, eval)(`(${come})`)();
      await new Promise(done => inside().video.requestVideoFrameCallback(done));
      return performance.now() - began;
    }, String(come));
    console.log(`# ${what}: back after ${after.toFixed(0)} ms`);
    await until(async () => Math.abs((await long.evaluate(() => v.view)).yaw - 2) < 1e-6, 'where it was');
  }
  await close(long, served);
  mine.close();
}

async function eventsAndPictures() {
  const served = await serve(...rig);
  const mine = await site({ '/': page(`<script>
    addEventListener('DOMContentLoaded', () => {
      globalThis.told = [];
      for (const name of ['first-frame', 'view-change', 'focus-change', 'connected', 'disconnected', 'error', 'statistics'])
        v.addEventListener(name, ({ detail }) => told.push([name, detail]));
    });</script>
    <lightfield-viewer id="v" controls poster="data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='4' height='3'/>"
      style="width: 640px; height: 480px"><b slot="error">My own words</b></lightfield-viewer>${script(served)}`) });
  const tab = await openPage(browser, mine.origin, size);
  const toldOf = name => tab.evaluate(name => told.filter(([told]) => told === name).map(([, detail]) => detail), name);
  await tab.waitForFunction(() => globalThis.inside?.()?.root.querySelector('.poster img').complete);
  expect(await tab.evaluate(() => inside().root.querySelector('.poster').checkVisibility() && v.paused), 'the poster is shown');
  await tab.evaluate(() => v.toBlob()).then(() => expect(false, 'a picture of nothing'), () => {});
  await tab.evaluate(() => v.play());
  await shown(tab, 10);
  expect(!await tab.evaluate(() => inside().root.querySelector('.poster').checkVisibility()), 'and goes');
  expect(JSON.stringify(await toldOf('first-frame')) === '[{"width":640,"height":480}]', 'the first frame is reported');
  expect((await toldOf('connected')).length === 1, 'connected');
  const view = await tab.evaluate(() => v.setView({ yaw: 2, focusDistance: 3 }));
  expect(view.yaw === 2 && view.focusDistance === 3, `setView ends with the view: ${JSON.stringify(view)}`);
  const last = (await toldOf('view-change')).at(-1);
  expect(last.view.yaw === 2 && last.by === 'script', `of a script: ${JSON.stringify(last)}`);
  expect((await toldOf('focus-change')).at(-1).focusDistance === 3, 'so does the focus');
  for (const wrong of [{ zoom: 2 }, { yaw: NaN }, { yaw: '3' }])
    await tab.evaluate(wrong => v.setView(wrong), wrong).then(() => expect(false, `${JSON.stringify(wrong)} is taken`), () => {});
  await setView(tab, { yaw: 2 });
  const state = await stateOf(tab), truth = await rendered(folder, state, size);
  const blob = await tab.evaluate(async () => [...new Uint8Array(await (await v.toBlob()).arrayBuffer())]);
  const { psnr } = await compare(tab, Buffer.from(blob), truth);
  expect(psnr > 30, `toBlob is the picture: ${psnr}`);
  await tab.evaluate(() => v.focusAt(415, 190));
  await until(async () => {
    const { focusDistance } = (await toldOf('focus-change')).at(-1);
    return focusDistance > 1.9 && focusDistance < 2.5;
  }, 'focusAt focuses on what is there');
  await tab.mouse.move(320, 200);
  await tab.mouse.down();
  for (let x = 320; x <= 360; x += 10) await tab.mouse.move(x, 200);
  await tab.mouse.up();
  await until(async () => (await toldOf('view-change')).at(-1).by === 'person', 'a drag is a person’s');
  await tab.evaluate(() => v.requestFullscreen());
  await tab.waitForFunction(() => document.fullscreenElement === v);
  await tab.evaluate(() => document.exitFullscreen());
  await served.stop();
  await until(async () => (await toldOf('error')).length, 'an error is reported');
  const error = (await toldOf('error'))[0];
  expect((await toldOf('disconnected')).length === 1 && error.retryAfter > 0 && error.message, JSON.stringify(error));
  expect(await tab.evaluate(() => v.querySelector('b').checkVisibility()), 'the slot error is for it');
  expect(!await tab.evaluate(() => inside().root.querySelector('.why').checkVisibility()), 'instead of the element’s own');
  await tab.context().close();
  mine.close();
}

async function genericPlayer() {
  const states = [-2, 2].map((yaw, i) => ({ ...viewFile({ x: 0, y: 0, z: 0, yaw, pitch: 0, roll: 0, fov: 30, 'focus-distance': 2 },
    { width: 320, height: 240 }), name: `at_${i}`, time: i * 0.2 }));
  const tour = join(folder, 'tour.json');
  await writeFile(tour, JSON.stringify({ format: 'lightfield-views', version: 1, views: states }));
  const served = await serve(...rig, '--path', `tour=${tour}`);
  const html = await readFile(join(source, 'examples/whep.html'), 'utf8');
  expect(html.trim().split('\n').length <= 30, 'it is short');
  const mine = await site({ '/': html });
  const bare = await newPage(browser, size);
  await bare.addInitScript(() => globalThis.inside = () => ({ video: document.querySelector('video') }));
  await bare.goto(`${mine.origin}?whep=${encodeURIComponent(`${served.url}whep?path=tour`)}`);
  await shown(bare, 10);
  const first = await picture(bare), { mean, deviation } = await compare(bare, first, first);
  expect(mean > 20 && deviation > 10, `black: mean ${mean}, deviation ${deviation}`);
  await until(async () => (await compare(bare, first, await picture(bare))).psnr < 30, 'the picture flies');
  await bare.goto('about:blank');
  await until(async () => await served.metric('viewers') === 0, 'it leaves');
  await close(bare, served);
  mine.close();
}

// A red square at 1 m in front of a blue wall at 2 m, as lf-render --ply writes it.
function plyFile() {
  const points = [];
  for (let y = -40; y <= 40; y++)
    for (let x = -40; x <= 40; x++) {
      points.push([x / 40, y / 40, 2, 0, 0, 255]);
      if (Math.abs(x) <= 8 && Math.abs(y) <= 8) points.push([x / 40, y / 40, 1, 255, 0, 0]);
    }
  const properties = ['float x', 'float y', 'float z', 'uchar red', 'uchar green', 'uchar blue'];
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${points.length}\n` +
    `${properties.map(property => `property ${property}\n`).join('')}end_header\n`;
  const bytes = Buffer.alloc(header.length + 15 * points.length);
  bytes.write(header, 'latin1');
  for (const [i, point] of points.entries()) {
    const at = header.length + 15 * i;
    for (let k = 0; k < 3; k++) bytes.writeFloatLE(point[k], at + 4 * k);
    bytes.set(point.slice(3), at + 12);
  }
  return bytes;
}

// The share of red and of blue pixels, and the column of the middle of the red ones.
async function coloursOf(page) {
  return await page.evaluate(async url => {
    const image = await createImageBitmap(await (await fetch(url)).blob()), { width, height } = image;
    const context = new OffscreenCanvas(width, height).getContext('2d');
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    let red = 0, blue = 0, columns = 0;
    for (let i = 0; i < data.length; i += 4) {
      if (data[i] > 200 && data[i + 2] < 50) red++, columns += i / 4 % width;
      if (data[i + 2] > 200 && data[i] < 50) blue++;
    }
    return { red: red / width / height, blue: blue / width / height, middle: columns / red };
  }, `data:image/png;base64,${(await page.screenshot()).toString('base64')}`);
}

async function pointCloud() {
  const mine = await site({ '/': await readFile(join(source, 'examples/points.html'), 'utf8'), '/a.ply': plyFile() });
  const page = await newPage(browser, size), said = () => page.locator('span').textContent();
  await page.goto(`${mine.origin}?file=a.ply`);
  await until(async () => await said() === '6850 points', 'it opens the file');
  await until(async () => (await coloursOf(page)).blue > 0.1, 'it draws');
  const before = await coloursOf(page);
  expect(before.red > 0.04 && before.blue > 0.3 && Math.abs(before.middle - 320) < 4, JSON.stringify(before));
  await page.mouse.move(320, 240);
  await page.mouse.down();
  await page.mouse.move(400, 240, { steps: 4 });
  await page.mouse.up();
  await until(async () => Math.abs((await coloursOf(page)).middle - before.middle) > 30, 'the square moves before the wall');
  await page.mouse.wheel(0, -400);
  const turned = await coloursOf(page);
  await until(async () => (await coloursOf(page)).red > 1.5 * before.red, `it zooms: ${JSON.stringify(turned)}`);
  await page.setInputFiles('input', { name: 'b.ply', mimeType: 'model/ply', buffer: Buffer.from('ply\nformat ascii 1.0\n') });
  await until(async () => (await said()).includes('not a point cloud'), 'it says what is wrong');
  await page.goto(`${mine.origin}?file=none.ply`);
  await until(async () => (await said()).includes('cannot be read'), 'a file that is not there');
  await page.context().close();
  mine.close();
}

const work = join(artefacts, 'react');

async function built() {
  await rm(work, { recursive: true, force: true });
  const installed = join(work, 'node_modules/lightfield-viewer');
  await mkdir(installed, { recursive: true });
  const { files } = JSON.parse(await readFile(join(source, 'web/package.json')));
  const sources = files.filter(file => !file.endsWith('.min.js'));  // npm pack makes that one
  for (const file of [...sources, 'package.json']) await cp(join(source, 'web', file), join(installed, file), { recursive: true });
  await cp(join(source, 'tests/web/react_page.tsx'), join(work, 'page.tsx'));
  await writeFile(join(work, 'package.json'), '{ "private": true, "type": "module" }');
  const tool = (path, ...args) => run(join(artefacts, 'node_modules', path), args, { cwd: work })
    .catch(error => { throw new Error(`${path}: ${error.stdout}${error.stderr}`); });
  await tool('typescript/bin/tsc', '--noEmit', '--strict', '--jsx', 'react-jsx', '--module', 'esnext', '--moduleResolution', 'bundler',
    '--target', 'es2022', '--lib', 'es2022,dom', 'page.tsx');
  await tool('esbuild/bin/esbuild', 'page.tsx', '--bundle', '--format=esm', '--jsx=automatic', '--outfile=page.js', '--log-level=warning',
    '--define:process.env.NODE_ENV="development"');
}

async function application() {
  await built();
  const served = await serve(...rig);
  const mine = await site({ '/': `<!doctype html><html lang="en"><meta charset="utf-8"><title>mine</title>
    <div id="root"></div><script type="module" src="page.js"></script>` }, work);
  const page = await openPage(browser, `${mine.origin}?whep=${encodeURIComponent(`${served.url}whep`)}`);
  page.on('console', message => ['error', 'warning'].includes(message.type()) && page.problems.push(message.text()));
  const told = () => page.evaluate(() => app.told), yaw = () => page.evaluate(() => app.element.view.yaw);
  const render = props => page.evaluate(props => app.render(props), props);
  const isAt = (wanted, what) => until(async () => Math.abs(await yaw() - wanted) < 1e-6, what);

  await page.waitForFunction(() => globalThis.app?.element?.loaded)
    .catch(async error => { throw new Error(`no picture: ${await page.evaluate(() => document.body.innerHTML)}; ${page.problems}; ${error.message}`); });
  await isAt(1, 'the prop says where to begin');
  expect((await told()).includes('first 320x240'), `its listeners hear: ${await told()}`);
  await page.getByText(/^Focus: \d/).waitFor();
  await page.getByRole('application', { name: 'Mine' }).waitFor();
  expect(await served.metric('viewers_total') === 1, 'in strict mode there is one stream');

  await page.evaluate(() => app.element.setView({ yaw: -2 }));
  const renders = await page.evaluate(() => app.renders);
  for (let i = 0; i < 10; i++) await render({ src: `${served.url}whep` });
  expect(await page.evaluate(() => app.renders) >= renders + 10, 'it has been rendered');
  await isAt(-2, 'rendered again it stays');
  await render({ yaw: 2, alt: undefined });
  await isAt(2, 'another prop is another view');
  expect((await told()).includes('script 2'), `reported by a script: ${await told()}`);
  expect(await page.evaluate(() => app.element.alt) === null, 'a prop that is gone is an attribute that is gone');

  await render({ last: true });
  expect(await page.evaluate(() => document.querySelector('figure').previousElementSibling.localName === 'h1'), 'it has moved');
  const frames = () => page.evaluate(() => inside(app.element).video.getVideoPlaybackQuality().totalVideoFrames);
  const before = await frames();
  await until(async () => await frames() > before + 3, 'moved it goes on');
  expect(await served.metric('viewers_total') === 1, 'with the same stream');

  await render({ shown: false });
  await until(async () => await served.metric('viewers') === 0, 'unmounted it leaves');
  const gone = await page.evaluate(() => (globalThis.first = app.element).isConnected);
  expect(!gone, 'it is off the page');
  await render({ shown: true, eyes: 'side' });
  await page.waitForFunction(() => app.element !== first && app.element.loaded);
  await isAt(2, 'mounted again it is where the prop says');
  expect(await page.evaluate(() => inside(app.element).twoEyes), 'with two eyes');
  await render({ src: 'http://127.0.0.1:9/whep' });
  await until(async () => (await told()).some(text => /^error \d/.test(text)), 'errors are heard');
  await page.getByText('My own words').waitFor();
  expect(!(await told()).some(text => /NaN|undefined/.test(text)), `details are typed: ${await told()}`);
  const problems = page.problems.filter(text => !/ERR_UNSAFE_PORT|ERR_CONNECTION|Failed to load resource/.test(text));
  expect(!problems.length, problems.join('; '));
  await close(page, served);
  mine.close();
}

await runTests([
  ['npm pack, npm install, the page of the README, types', fromNpm],
  ['two elements, changed, removed, added, moved', twoElements],
  ['rendered again and again', rerendered],
  ['in a frame of another origin, in a page that scrolls', framed],
  ['out of sight', outOfSight],
  ['events, pictures, poster and slots', eventsAndPictures],
  ['a generic WHEP player', genericPlayer],
  ['the page of point clouds', pointCloud],
  ['an application of React', application],
]);
