// SPDX-License-Identifier: LGPL-2.1-or-later
// States of the page without a frame: messages and recovery. Also tests links.
import { readdir, readFile, truncate, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, close, compare, expect, launchBrowser, makeFilm, makeRig, newPage, openPage, openShown,
  picture, runTests, serve, settled, setView, shown, source, stateOf, until } from './harness.mjs';

const { serversIn, serversInLinks } = await import(join(source, 'web/src/connection.js'));
const folder = await makeRig('4x4');
const rig = ['--rig', join(folder, 'rig.json'), '--connects', '100', '--focus-mode', 'plane'];
const browser = await launchBrowser(), size = { width: 640, height: 480 };
const status = page => page.getByRole('status').textContent();
const says = (page, words) => until(async () => words.test(await status(page)), `it says ${words}`);

// Answers offers with the given refusals, one at a time, until null. Returns the requested URLs.
async function refusing(page, refusals) {
  const asked = [];
  await page.route('**/whep*', async route => {
    asked.push(new URL(route.request().url()));
    const refusal = refusals.length > 1 ? refusals.shift() : refusals[0];
    if (!refusal) return route.continue();
    const { after = 1, ...problem } = refusal;
    await route.fulfill({ status: problem.status, contentType: 'application/problem+json',
      headers: { 'Retry-After': String(after) }, body: JSON.stringify(problem) });
  });
  return asked;
}

async function filming() {
  const served = await serve(...rig);
  const page = await newPage(browser, size);
  const film = progress => ({ title: 'the scene is being filmed', status: 503, reason: 'filming', progress });
  const refusals = [film(0.1)];
  await refusing(page, refusals);
  await page.goto(served.url);
  await says(page, /filmed for the first time: 10 %/);
  const bar = page.getByRole('progressbar');
  expect(Math.abs(await bar.evaluate(bar => bar.value) - 0.1) < 1e-9, 'there is a bar');
  refusals.push(film(0.6));
  await says(page, /60 %/);
  refusals.push({ title: 'starting', status: 503, reason: 'starting' });
  await says(page, /cameras are being opened/);
  expect(!await bar.isVisible() && !await page.getByRole('button', { name: 'Try again' }).isVisible(), 'nothing to press');
  refusals.push(null);
  await shown(page, 5);
  expect(!await page.getByRole('status').isVisible(), 'then there is a picture');
  await close(page, served);
}

async function queue() {
  const served = await serve(...rig);
  const page = await newPage(browser, size);
  const full = (place, waiting) => ({ title: 'too many viewers', status: 503, reason: 'full', place, waiting, ticket: 'abc' });
  const refusals = [full(2, 3)];
  const asked = await refusing(page, refusals);
  await page.goto(served.url);
  await says(page, /number 2 of 3/);
  refusals.push(full(1, 4));
  await says(page, /number 1 of 4/);
  expect(asked.at(-1).searchParams.get('ticket') === 'abc', `the ticket is shown: ${asked.at(-1)}`);
  expect(!asked[0].searchParams.has('ticket'), 'the first has none');
  refusals.push(null);
  await shown(page, 5);
  const before = asked.length;
  await page.setViewportSize({ width: 320, height: 240 });
  await until(() => asked.length > before, 'another stream');
  expect(!asked.at(-1).searchParams.has('ticket'), 'another stream has none');
  await close(page, served);
}

async function permanentRefusal() {
  const served = await serve(...rig);
  const page = await newPage(browser, size);
  const asked = await refusing(page, [{ title: 'this origin may not watch', status: 403, reason: 'origin' }]);
  await page.goto(served.url);
  await says(page, /may not show/);
  expect(await page.getByRole('button', { name: 'Try again' }).textContent() === 'Try again', 'it waits for nothing');
  await page.waitForTimeout(1500);
  expect(asked.length === 1, 'and does not ask again');
  await close(page, served);
}

async function awayAndBack() {
  let served = await serve(...rig);
  const { port } = new URL(served.url);
  const page = await openShown(browser, served.url, size, 5);
  await setView(page, { yaw: 2, 'focus-distance': 3 });
  const told = page.evaluate(() => new Promise(done => {
    const began = performance.now();
    document.querySelector('lightfield-viewer').addEventListener('error', () => done(performance.now() - began), { once: true });
  }));
  await served.stop();
  console.log(`# reported ${(await told).toFixed(0)} ms after the server began to end`);
  await says(page, /can't be reached/);
  await page.getByRole('button', { name: /Try again \(in \d+ s\)/ }).waitFor();
  served = await serve(...rig, '--port', port);
  await until(async () => await served.metric('viewers') === 1, 'it comes back by itself');
  await page.waitForFunction(() => document.querySelector('lightfield-viewer').connected);
  await until(async () => {
    const { view } = await page.evaluate(() => ({ view: document.querySelector('lightfield-viewer').view }));
    return Math.abs(view.yaw - 2) < 1e-6 && view.focusDistance === 3;
  }, 'with its view');
  await until(async () => !await page.getByRole('status').isVisible(), 'the message goes');
  await close(page, served);
}

async function silentHosts() {
  const ports = [1, 2].map(() => 20000 + Math.floor(Math.random() * 10000));
  const served = await serve(...rig, '--nodes', ports.map(port => `127.0.0.1:${port}:127.0.0.1:${port + 10000}`).join());
  const page = await openPage(browser, served.url, size);
  await says(page, /Camera hosts 1 and 2 of 2 do not answer/);
  await until(() => ports.every(port => served.said.includes(`cameras: 127.0.0.1:${port} does not answer`)), 'the log names them');
  expect(await page.evaluate(() => document.querySelector('lightfield-viewer').connected), 'the server is not at fault');
  await close(page, served);
}

async function noCamera() {
  const film = await makeFilm('2x2'), files = (await readdir(film)).filter(name => name.endsWith('.mkv'));
  const served = await serve('--rig', join(film, 'rig.json'));
  const page = await openShown(browser, served.url, size, 20);
  const films = await Promise.all(files.map(name => readFile(join(film, name))));
  await truncate(join(film, files[0]));
  const told = page.locator('.trouble').getByText('1 of 4 cameras does not work.');
  await until(() => told.isVisible(), 'a lost camera is reported');
  expect(!await page.getByRole('status').isVisible(), 'the picture goes on');
  await page.screenshot({ path: join(process.env.LF_ARTEFACTS, 'one-camera-lost.png') });
  await writeFile(join(film, files[0]), films[0]);
  await until(async () => !await page.locator('.trouble').isVisible(), 'it is back');
  await Promise.all(files.map(name => truncate(join(film, name))));
  await says(page, /No camera works/);
  await page.waitForTimeout(500);
  const [kept, still] = [await picture(page), (await page.waitForTimeout(700), await picture(page))];
  const { mean, deviation } = await compare(page, kept, still);
  expect(mean > 40 && deviation > 10, `there is a picture, not ${mean} +- ${deviation}`);
  expect(served.said.match(/No camera works any more: /g).length === 1, `the log says it once: ${served.said}`);
  await Promise.all(files.map((name, i) => writeFile(join(film, name), films[i])));
  await until(async () => !await page.getByRole('status').isVisible(), 'the message goes');
  await close(page, served);
}

async function linksAndTokens() {
  const token = join(folder, 'token');
  await writeFile(token, 'sesame', { mode: 0o600 });
  const served = await serve(...rig, '--token-file', token);
  const page = await openShown(browser, new URL('#token=sesame&yaw=1', served.url).href, size, 5);
  await until(async () => Math.abs((await stateOf(page)).yaw - 1) < 1e-6, 'the link sets the view');
  await page.evaluate(() => location.hash = '#token=sesame&yaw=-2&x=0.01');
  await until(async () => Math.abs((await stateOf(page)).yaw + 2) < 1e-6, 'so does another one');
  await page.getByRole('button', { name: 'Share' }).press('Enter');
  await until(() => /focus-distance=/.test(page.url()), 'the address is the link');
  expect(new URL(page.url()).hash.includes('token=sesame'), `the token stays: ${page.url()}`);
  await page.reload();
  await shown(page, 5);
  await until(async () => Math.abs((await stateOf(page)).yaw + 2) < 1e-6, 'opened again it is the same');
  await page.context().close();

  const typed = await openPage(browser, served.url, size);
  await typed.getByLabel('Token').fill('sesame');
  await typed.getByLabel('Token').press('Enter');
  await shown(typed, 5);
  await typed.setViewportSize({ width: 320, height: 240 });
  await typed.waitForFunction(() => inside().stream.isOpen && inside().stream.asked.width === 320);
  await typed.reload();
  await shown(typed, 5);
  await typed.getByRole('button', { name: 'Share' }).press('Enter');
  await until(() => /focus-distance=/.test(typed.url()), 'the address is the link');
  expect(!typed.url().includes('sesame'), 'a token that was typed is in no link');
  await close(typed, served);
}

// ICE servers from an attribute or the response. Servers from the response are used only if there is no other route.
async function iceServers() {
  expect(JSON.stringify(serversIn(' stun:a.example  turn:me:se%3Acret@b.example:3478?transport=udp ')) ===
    JSON.stringify([{ urls: 'stun:a.example' },
      { urls: 'turn:b.example:3478?transport=udp', username: 'me', credential: 'se:cret' }]), 'attribute');
  const links = serversInLinks('<stun:a.example>; rel="ice-server", <https://x.example>; rel=next, ' +
    '<turn:b.example?transport=udp>; rel="ice-server"; username="a, \\"b\\""; credential="c;d"; credential-type="password"');
  expect(JSON.stringify(links) === JSON.stringify([{ urls: 'stun:a.example' },
    { urls: 'turn:b.example?transport=udp', username: 'a, "b"', credential: 'c;d' }]), `Link: ${JSON.stringify(links)}`);
  expect(!serversInLinks(null).length && !serversIn(null).length, 'none');

  const served = await serve(...rig);
  const page = await newPage(browser, size, { before: () => {
    globalThis.gathered = [];
    globalThis.RTCPeerConnection = class extends RTCPeerConnection {
      constructor(configuration) {
        super({ ...configuration, iceServers: [] });
        gathered.push(configuration.iceServers);
      }
    };
  } });
  let lost = 1;
  await page.route('**/whep?*', async route => {
    const response = await route.fetch();
    const headers = { ...response.headers(), link: '<stun:a.example>; rel="ice-server"' };
    let body = await response.text();
    if (lost-- > 0) body = body.replace(/(a=candidate:\S+ 1 UDP \d+ 127\.0\.0\.1) \d+/gi, '$1 9');
    await route.fulfill({ response, headers, body });
  });
  await page.goto(served.url);
  await shown(page, 5);
  const gathered = await page.evaluate(() => JSON.stringify(globalThis.gathered));
  expect(gathered === '[[],[{"urls":"stun:a.example"}]]', `with the servers of the answer: ${gathered}`);
  await page.evaluate(() => document.querySelector('lightfield-viewer').setAttribute('ice-servers', 'nonsense'));
  await says(page, /nonsense is not/);
  await page.evaluate(() => document.querySelector('lightfield-viewer').setAttribute('ice-servers', 'stun:b.example'));
  await until(async () => !await page.getByRole('status').isVisible(), 'an attribute that is right');
  expect(/b\.example/.test(await page.evaluate(() => JSON.stringify(globalThis.gathered.at(-1)))), 'is used');
  await close(page, served);
}

// The view gives way at a border and springs back.
async function elastic() {
  const served = await serve(...rig);
  const page = await openShown(browser, served.url, size, 10);
  const home = await stateOf(page), moved = () => page.evaluate(() => inside().elastic.box.style.transform);
  await page.mouse.move(200, 200);
  await page.mouse.down();
  for (let x = 200; x <= 230; x += 2) await page.mouse.move(x, 200);
  const some = await page.evaluate(() => inside().elastic.missing[0]);
  expect(Math.abs(some) < 0.1, `inside, the view goes along: ${some} heights are missing`);
  for (let x = 230; x <= 1400; x += 10) await page.mouse.move(x, 200);
  await until(async () => /translate\(\d/.test(await moved()), 'the picture gives way');
  await page.mouse.up();
  expect(await moved() === '', 'and springs back');
  // A drag that is released while moving continues for a moment.
  await page.evaluate(() => {
    const { controls } = inside(), glide = controls.glide;
    controls.glide = (...drag) => {
      globalThis.glides = true;
      glide.apply(controls, drag);
    };
  });
  // On a busy machine the pointer may rest before the release; in that case the view does not glide.
  let held;
  await until(async () => {
    await page.keyboard.press('r');
    await until(async () => Math.abs((await stateOf(page)).x - home.x) < 1e-9, 'r goes home');
    await settled(page);
    await page.mouse.move(300, 200);
    await page.mouse.down();
    for (let x = 300; x <= 320; x += 2) await page.mouse.move(x, 200);
    held = (await setView(page, {}), await stateOf(page)).x;
    for (let x = 320; x <= 340; x += 2) await page.mouse.move(x, 200);
    await page.mouse.up();
    return page.evaluate(() => globalThis.glides);
  }, 'it glides');
  await settled(page);
  expect((await stateOf(page)).x < held, 'on the way that it was on');
  await close(page, served);
}

// Runs axe-core on the page and on each overlay and state, in light and dark mode.
const axe = await readFile(join(artefacts, 'node_modules/axe-core/axe.min.js'), 'utf8');
const kTags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];

async function check(page, what) {
  const { violations, incomplete, passes } = await page.evaluate(tags => axe.run(document, { runOnly: tags }), kTags);
  // axe-core is uncertain about labels on elements with text whose role does not allow labels.
  const unsure = incomplete.filter(({ id }) => id === 'aria-prohibited-attr');
  const told = [...violations, ...unsure].map(({ id, nodes }) => `${id}: ${nodes.map(({ target, failureSummary }) => `${target} ${failureSummary}`).join('; ')}`);
  console.log(`# ${what}: ${passes.length} rules pass`);
  expect(passes.length > 10, `${what}: only ${passes.length} rules apply`);
  expect(!told.length, `${what}: ${told.join('\n')}`);
}

async function overlays(colorScheme) {
  const token = join(folder, 'token');
  await writeFile(token, 'sesame', { mode: 0o600 });
  const served = await serve('--rig', join(folder, 'rig.json'), '--token-file', token, '--monitor', '1', '--connects', '100');
  for (const size of [{ width: 1280, height: 720 }, { width: 390, height: 844 }]) {
    const page = await newPage(browser, size, { colorScheme, before: axe, bypassCSP: true });
    const name = what => `${what}, ${colorScheme}, ${size.width} x ${size.height}`;
    await page.goto(served.url);
    await page.getByLabel('Token').waitFor();
    await check(page, name('a field for the token'));
    await page.getByLabel('Token').fill('wrong');
    await page.getByLabel('Token').press('Enter');
    await until(async () => /is wrong/.test(await page.getByRole('status').textContent()), 'a wrong token');
    await check(page, name('a wrong token'));
    await page.getByLabel('Token').fill('sesame');
    await page.getByLabel('Token').press('Enter');
    await shown(page, 5);
    await page.mouse.move(200, 200);
    await check(page, name('first look'));
    await page.waitForFunction(() => inside().statistics.monitored);
    for (const [key, what] of [['c', 'cameras'], ['i', 'figures'], ['m', 'quality'], ['?', 'help']]) {
      await page.focus('lightfield-viewer video');
      await page.keyboard.press(key);
      await page.waitForTimeout(300);
      await check(page, name(what));
      if (what === 'help') {
        const link = await page.getByRole('link', { name: 'All cameras, live' }).getAttribute('href');
        expect(link === new URL('cameras.html', served.url).href, `a link to all cameras: ${link}`);
      }
      await page.keyboard.press(key);
    }
    await page.evaluate(() => document.querySelector('lightfield-viewer').pause());
    await check(page, name('paused'));
    await page.evaluate(() => document.querySelector('lightfield-viewer').play());
    await page.route('**/whep?*', route => route.fulfill({ status: 503, contentType: 'application/problem+json',
      headers: { 'Retry-After': '100' }, body: '{"status":503,"reason":"filming","progress":0.3}' }));
    await page.evaluate(() => inside().stream.again());
    await page.getByRole('progressbar').waitFor();
    await check(page, name('filming'));
    await page.unroute('**/whep?*');
    await page.route('**/whep?*', route => route.abort());
    await page.evaluate(() => inside().stream.again());
    await page.getByRole('button', { name: /Try again \(/ }).waitFor();
    await check(page, name('no server'));
    await page.context().close();
  }
  await served.stop();
}

await runTests([
  ['while the scene is filmed', filming],
  ['a place in the queue', queue],
  ['permanent refusal', permanentRefusal],
  ['a server that was away', awayAndBack],
  ['hosts with cameras that do not answer', silentHosts],
  ['no camera that works', noCamera],
  ['links and tokens', linksAndTokens],
  ['ICE servers', iceServers],
  ['borders and glides', elastic],
  ['axe-core, dark', () => overlays('dark')],
  ['axe-core, light', () => overlays('light')],
]);
