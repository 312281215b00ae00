// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks the contract of web/README.md and lightfield-viewer.d.ts: every attribute, property, method and event.
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, closeClean, compare, expect, half, launchBrowser, makeRig, newPage, openShown, picture,
  runTests, serve, shown, site, source, until, viewFile } from './harness.mjs';

const folder = await makeRig('4x4'), rigFile = join(folder, 'rig.json');
const rig = ['--rig', rigFile, '--connects', '100', '--address-views', '8', '--focus-mode', 'plane', '--origin', '*'];
const browser = await launchBrowser(), size = { width: 640, height: 480 };
const kEvents = ['first-frame', 'view-change', 'focus-change', 'connected', 'disconnected', 'error', 'fallback', 'rig', 'statistics'];

const html = (body, script = '') => `<!doctype html><html lang="en"><meta charset="utf-8"><title>mine</title>
  <style>body { margin: 0 } lightfield-viewer { width: 640px; height: 480px }</style>${script}${body}`;

// Opens a page on another site with an element `v` and stores its events in `told`.
async function open(served, attributes, { hash = '', before = '', script, inside: slotted = '', ...options } = {}) {
  const mine = await site({ '/': html(`${before}<lightfield-viewer id="v" ${attributes}>${slotted}</lightfield-viewer>
    <script>globalThis.told = [];
      for (const name of ${JSON.stringify(kEvents)}) v.addEventListener(name, ({ detail }) => told.push([name, detail]));</script>
    <script type="module" src="${served.url}lightfield-viewer.js"></script>`) });
  const page = await newPage(browser, size, { before: script, ...options });
  page.asked = [];
  page.on('request', request => /\/whep(\?|$)/.test(request.url()) && request.method() === 'POST' && page.asked.push(new URL(request.url())));
  page.toldOf = name => page.evaluate(name => told.filter(([told]) => told === name).map(([, detail]) => detail), name);
  page.view = () => page.evaluate(() => v.view);
  page.loads = () => page.waitForFunction(() => globalThis.v?.loaded && v.view);
  page.leaves = async () => {
    expect(!page.problems.length, page.problems.join('; '));
    await page.context().close();
    mine.close();
  };
  await page.goto(mine.origin + hash);
  return page;
}
const isNear = (a, b) => Math.abs(a - b) < 1e-6;
const isAt = (page, wanted, what) => until(async () => {
  const view = await page.view();
  return Object.entries(wanted).every(([name, value]) => isNear(view[name], value));
}, what);
// Returns 'done', or the name of the error of a promise in the page.
const ending = (page, script) => page.evaluate(script => (0, eval)(script).then(() => 'done', error => error.name), script);

// `view` and `focus` define the home view; events name the source of a change.
async function homeView() {
  const served = await serve(...rig);
  const page = await open(served, 'view="x=0.02 yaw=3" focus="3" controls autoplay');
  await page.loads();
  const start = { x: 0.02, yaw: 3, focusDistance: 3 };
  await isAt(page, start, 'it begins at view and focus');
  const { fov } = await page.view();
  // Moves away by script and returns by `how`; all events on the way must name `who`.
  const comesHome = async (how, who, what) => {
    await page.evaluate(() => v.setView({ x: -0.02, yaw: -2, pitch: 1, focusDistance: 2, fov: 20 }));
    expect((await page.toldOf('view-change')).at(-1).by === 'script', `${what}: setView is a script's`);
    await page.evaluate(() => told.length = 0);
    await how();
    await isAt(page, { ...start, pitch: 0, fov }, `${what} goes to view and focus`);
    const changes = await page.toldOf('view-change');
    expect(changes.length && changes.every(({ by }) => by === who), `${what} is a ${who}'s: ${JSON.stringify(changes)}`);
  };
  await comesHome(() => page.evaluate(() => v.goHome()), 'script', 'goHome()');
  const click = async name => {
    await page.mouse.move(300, 100 + Math.random());
    await page.getByRole('button', { name }).click();
  };
  await comesHome(() => click('Home'), 'person', 'the button Home');
  await page.locator('lightfield-viewer video').focus();
  for (const key of ['r', 'Home']) await comesHome(() => page.keyboard.press(key), 'person', `the key ${key}`);
  await comesHome(() => page.mouse.dblclick(320, 150), 'person', 'a double click').catch(async error => {
    throw new Error(`${error.message}: ${JSON.stringify(await page.view())}`);
  });
  await page.evaluate(() => {
    globalThis.pad = { axes: [0, 0, 0, 0], buttons: [{ pressed: false }] };
    navigator.getGamepads = () => [pad];
    dispatchEvent(new Event('gamepadconnected'));
  });
  await comesHome(() => page.evaluate(() => { pad.buttons[0].pressed = true; }), 'person', 'a gamepad');

  await page.evaluate(async () => {
    await v.setView({ yaw: -2 });
    v.goHome();
    await v.setView({ yaw: 1 });
    await new Promise(done => setTimeout(done, 600));
  });
  expect(isNear((await page.view()).yaw, 1), 'a view that is set on the way home stays');

  // The previous movement may still have an event to come.
  const rest = async () => {
    for (let last = ''; ;) {
      const now = JSON.stringify(await page.view());
      if (now === last) return;
      last = now;
      await page.waitForTimeout(300);
    }
  };
  const moves = async (how, who, what, field = 'focusDistance') => {
    await rest();
    const before = await page.view();
    await page.evaluate(() => told.length = 0);
    await how();
    await until(async () => !isNear((await page.view())[field], before[field]), `${what} moves it`);
    await until(async () => (await page.toldOf('view-change')).length, `${what} is reported`);
    const [{ by }] = await page.toldOf('view-change');
    expect(by === who, `${what} is a ${who}'s, not a ${by}'s`);
  };
  const focus = metres => () => page.evaluate(focusDistance => v.setView({ focusDistance }), metres);
  await moves(() => page.getByRole('slider').fill('0.9'), 'person', 'the slider');
  await moves(focus(3), 'script', 'a script just after it');
  await moves(() => click('Sweep'), 'person', 'Sweep');
  await click('Sweep');
  await page.getByRole('button', { name: 'Sweep', pressed: false }).waitFor();
  await page.evaluate(() => v.setView({}));
  await moves(() => page.keyboard.press(']'), 'person', 'a key');
  await moves(() => page.evaluate(() => v.setAttribute('view', 'yaw=5')), 'script', 'the attribute view', 'yaw');
  await page.evaluate(() => v.setView({ yaw: -1 }));
  await page.evaluate(() => v.goHome());
  await isAt(page, { yaw: 5, focusDistance: 3 }, 'another view is another home');
  expect(!isNear((await page.view()).x, 0.02), 'what it does not give is the server\'s');
  await page.evaluate(() => v.view = { yaw: 1.5 });
  await isAt(page, { yaw: 1.5 }, 'the property view goes there');
  await page.evaluate(() => v.setView({ yaw: -1 }));
  await page.evaluate(() => v.goHome());
  await isAt(page, { yaw: 1.5 }, 'and home is there');

  // Without a stream, the next stream starts at the home view.
  await page.evaluate(() => v.setView({ yaw: -1 }));
  await page.evaluate(() => {
    v.pause();
    v.goHome();
    v.play();
  });
  await page.waitForFunction(() => v.connected);
  await isAt(page, { yaw: 1.5 }, 'paused, it goes home, too');
  await page.leaves();
  await served.stop();
}

async function focusing() {
  const served = await serve(...rig);
  const page = await open(served, 'autoplay');
  await page.loads();
  for (let i = 0; i < 2; i++) {
    await page.evaluate(() => v.focusDistance = 3);
    await isAt(page, { focusDistance: 3 }, `focusDistance is 3, time ${i}`);
    expect(isNear((await page.toldOf('focus-change')).at(-1).focusDistance, 3), 'focus-change tells it');
    await page.evaluate(() => v.setView({ focusDistance: 1 }));
  }
  await page.evaluate(() => v.setAttribute('focus', '2'));
  await isAt(page, { focusDistance: 2 }, 'so does the attribute');
  await page.evaluate(() => v.focusDistance = null);
  expect(await page.evaluate(() => !v.hasAttribute('focus') && v.focusDistance === 2), 'without it the focus stays');
  await page.leaves();
  await served.stop();
}

async function sharing() {
  const served = await serve(...rig);
  const clipboard = { permissions: ['clipboard-read', 'clipboard-write'] };
  const page = await open(served, 'autoplay view="yaw=2"', { hash: '#mine', ...clipboard });
  await page.loads();
  await isAt(page, { yaw: 2 }, 'it is where it begins');
  const before = page.url();
  const link = await page.evaluate(() => v.share());
  expect(page.url() === before && await page.evaluate(() => location.href) === before, 'without share the address stays');
  expect(/[#&]yaw=2(&|$)/.test(link), `the link names the view: ${link}`);
  expect(await page.evaluate(() => navigator.clipboard.readText()) === link, 'and is copied');
  await page.evaluate(() => v.shares = true);
  expect(await page.evaluate(() => v.hasAttribute('share') && v.shares), 'shares is the attribute share');
  const second = await page.evaluate(() => v.share());
  expect(await page.evaluate(() => location.href) === second, 'with share the address is the link');
  await page.evaluate(() => location.hash = '#yaw=-3');
  await isAt(page, { yaw: -3 }, 'another link goes there');
  await page.leaves();
  await served.stop();
}

async function eyes() {
  const served = await serve(...rig);
  const page = await open(served, 'autoplay eyes="side" eye-distance="0"');
  const sides = async () => {
    await page.evaluate(async () => {  // the encoder sharpens a still image over several frames
      await v.setView({ x: 0.01, yaw: 2 });
      for (let i = 0; i < 15; i++) await new Promise(done => inside().video.requestVideoFrameCallback(done));
    });
    const both = await picture(page);
    return compare(page, await half(page, both, 0), await half(page, both, 1));
  };
  await page.loads();
  expect(Number(page.asked[0].searchParams.get('eye-distance')) < 1e-3, `of no distance: ${page.asked[0]}`);
  expect(await page.evaluate(() => v.eyeDistance === 0 && v.eyes === 'side'), 'properties are those of the attributes');
  const same = await sides();
  expect(same.psnr > 35, `both eyes see the same: ${same.psnr}`);
  await page.evaluate(() => v.eyeDistance = 0.1);
  await until(() => page.asked.at(-1).searchParams.get('eye-distance') === '0.1', 'another distance is asked for');
  await page.waitForFunction(() => v.connected);
  const apart = await sides();
  expect(apart.psnr < same.psnr - 5 && apart.psnr < 30, `eyes apart see more: ${apart.psnr}`);
  await page.evaluate(() => v.eyeDistance = null);
  await until(() => page.asked.at(-1).searchParams.get('eye-distance') === '0.063', 'without it 63 mm');
  await page.evaluate(() => v.eyes = 'anaglyph');
  await page.waitForFunction(() => v.connected && inside().anaglyph.canvas.checkVisibility() && inside().twoEyes);
  await page.evaluate(() => v.eyes = 'one');
  await until(() => !page.asked.at(-1).searchParams.has('eye-distance'), 'one eye has none');
  await page.leaves();
  await served.stop();
}

// The server flies a path; calls that move the view must not wait forever.
const tour = ['--path', `tour=${join(folder, 'tour.json')}`];
{
  const state = { x: 0, y: 0, z: 0, yaw: -2, pitch: 0, roll: 0, fov: 30, 'focus-distance': 2 };
  const views = [-2, 2].map((yaw, i) => ({ ...viewFile({ ...state, yaw }, { width: 320, height: 240 }), name: `at_${i}`, time: i * 0.2 }));
  await writeFile(join(folder, 'tour.json'), JSON.stringify({ format: 'lightfield-views', version: 1, views }));
}

async function paths() {
  const served = await serve(...rig, ...tour);
  const page = await open(served, 'autoplay controls path="tour" view="yaw=3"');
  await shown(page, 10);
  expect(page.asked[0].searchParams.get('path') === 'tour' && await page.evaluate(() => v.path) === 'tour', 'the path is asked for');
  const first = await picture(page);
  await until(async () => (await compare(page, first, await picture(page))).psnr < 30, 'the picture flies');
  expect(await ending(page, 'v.setView({ yaw: 1 })') === 'InvalidStateError', 'setView() is refused');
  expect(await page.evaluate(() => v.focusAt(300, 200)) === false, 'so is focusAt()');
  await page.evaluate(() => v.goHome());
  expect(await page.evaluate(() => v.view) === null, 'there is no view');
  await page.evaluate(() => v.path = null);
  await page.waitForFunction(() => v.connected && v.view);
  await isAt(page, { yaw: 3 }, 'without path it begins where view says');
  await page.evaluate(() => Object.assign(v, { path: '', src: '', token: '' }));
  expect(isNear((await page.evaluate(() => v.setView({ yaw: 2 }))).yaw, 2), 'empty attributes are as none');
  const lost = await page.evaluate(() => {
    const view = v.setView({ yaw: 1 }).then(() => 'done', error => error.name);
    v.path = 'tour';
    return view;
  });
  expect(lost === 'AbortError', `what the path has overtaken ends: ${lost}`);
  await page.leaves();
  await served.stop();
}

// Without a free seat, the element shows the server's path until it gets a seat.
async function fallsBack() {
  const served = await serve(...rig, ...tour, '--viewers', '1');
  const first = await open(served, 'autoplay');
  await first.loads();
  const page = await open(served, 'autoplay controls view="yaw=3"');
  const state = () => page.evaluate(() => ({ fallback: v.fallback, interactive: v.interactive, connected: v.connected,
    loaded: v.loaded, view: v.view, status: !v.status.hidden, bar: inside().bar.bar.checkVisibility(),
    line: inside().root.querySelector('.trouble:not([hidden])')?.textContent ?? null, role: inside().video.getAttribute('role') }));
  const line = 'Shared flight. There are too many viewers. You are number 1 of 1 in the queue.';
  const shared = { fallback: 'tour', interactive: false, connected: false, loaded: true, view: null, status: false,
    bar: false, line, role: null };
  const has = (wanted, what) => until(async () => JSON.stringify(await state()) === JSON.stringify(wanted), what)
    .catch(async error => { throw new Error(`${error.message}: ${JSON.stringify(await state())}`); });
  await has(shared, 'the path is shown');
  expect(JSON.stringify(await page.toldOf('fallback')) === '[{"path":"tour"}]', 'and told');
  const [error] = await page.toldOf('error');
  expect(error.reason === 'full' && error.retryAfter === 1, `error: ${JSON.stringify(error)}`);
  const before = await picture(page);
  await until(async () => (await compare(page, before, await picture(page))).psnr < 30, 'the picture flies');
  expect(await page.evaluate(() => v.focusAt(300, 200)) === false, 'there is nothing to focus');
  await page.screenshot({ path: join(artefacts, 'fallback.png') });
  const asked = page.asked.length;
  await until(() => page.asked.length > asked + 2, 'it asks for a seat again');
  expect(page.asked.slice(2).every(url => url.searchParams.has('ticket')), `with its ticket: ${page.asked.join(' ')}`);
  expect(await served.metric('watchers') === 1, 'with one shared flight only');
  await has(shared, 'the path is still shown');

  // A view that is set meanwhile applies to the own view.
  const view = page.evaluate(() => v.setView({ yaw: 1 }));
  await first.leaves();
  expect(isNear((await view).yaw, 1), 'then it has its own view');
  const { line: none, view: seen, ...own } = await state();
  expect(own.fallback === null && own.interactive && own.connected && !none && seen && own.role === 'application', JSON.stringify(own));
  await until(async () => (await state()).bar, 'with its controls');
  await until(async () => await served.metric('watchers') === 0, 'the shared flight is left');
  expect(JSON.stringify(await page.toldOf('fallback')) === '[{"path":"tour"},{"path":null}]', 'and told');

  // The element gives its seat up and returns: the shared flight ends with the stream.
  await page.evaluate(() => v.pause());
  const other = await open(served, 'autoplay');
  await other.loads();
  await page.evaluate(() => v.play());
  await page.waitForFunction(() => v.fallback === 'tour');
  await page.evaluate(() => v.pause());
  await until(async () => await served.metric('watchers') === 0, 'pause() leaves the shared flight');
  expect(await page.evaluate(() => v.fallback) === null, 'and there is none');
  await other.leaves();
  await page.leaves();
  await served.stop();
}

// Servers that only send video: they refuse data channels in the answer or in the offer, or send no messages.
const kPlain = {
  answer: { offer: sdp => sdp.replace(/m=application[^]*/, '').replace(/(BUNDLE \S+).*/, '$1'),
    answer: sdp => `${sdp}m=application 0 UDP/DTLS/SCTP webrtc-datachannel\r\nc=IN IP4 0.0.0.0\r\na=mid:1\r\n` },
  offer: { refuses: sdp => /m=application/.test(sdp) },
  silence: { before: () => Object.defineProperty(RTCDataChannel.prototype, 'onmessage', { set() {} }) },
};
async function plainServers() {
  const served = await serve(...rig, ...tour);
  for (const [kind, { offer = sdp => sdp, answer = sdp => sdp, refuses = () => false, before }] of Object.entries(kPlain)) {
    const page = await open(served, `controls src="${served.url}whep?path=tour"`, { script: before });
    await page.route('**/whep?*', async route => {
      const sdp = route.request().postData();
      if (refuses(sdp)) return route.fulfill({ status: 400, body: 'no data channels', headers: { 'Access-Control-Allow-Origin': '*' } });
      const response = await route.fetch({ postData: offer(sdp) }), { location, ...headers } = response.headers();
      await route.fulfill({ status: 201, headers, body: answer(await response.text()) });
    });
    await page.evaluate(() => v.play());
    await page.waitForFunction(() => v.loaded && v.connected && !v.interactive);
    const frames = await page.evaluate(() => inside().video.getVideoPlaybackQuality().totalVideoFrames);
    await shown(page, frames + 30);
    await page.screenshot({ path: join(artefacts, `plain-${kind}.png`) });
    const state = await page.evaluate(() => ({ view: v.view, fallback: v.fallback, status: !v.status.hidden,
      bar: inside().bar.bar.checkVisibility(), role: inside().video.getAttribute('role') }));
    expect(JSON.stringify(state) === '{"view":null,"fallback":null,"status":false,"bar":false,"role":null}', `${kind}: ${JSON.stringify(state)}`);
    expect(await ending(page, 'v.setView({ yaw: 1 })') === 'InvalidStateError', `${kind}: setView() is refused`);
    expect(await page.evaluate(() => v.focusAt(300, 200)) === false, `${kind}: so is focusAt()`);
    expect(!(await page.toldOf('error')).length && (await page.toldOf('first-frame')).length === 1,
      `${kind}: events: ${JSON.stringify(await page.toldOf('error'))}`);
    expect((await page.toldOf('connected')).length === 1, `${kind}: it stays connected`);
    // With lf-serve, there is a view again.
    await page.unroute('**/whep?*');
    if (!before) await page.evaluate(src => v.src = src, `${served.url}whep`);
    if (!before) await page.loads();
    expect(before || await page.evaluate(() => v.interactive), `${kind}: lf-serve is controlled`);
    await page.leaves();
  }
  await served.stop();
}

// After a change of the server, settings apply to the new server.
async function otherSource() {
  const [one, two] = [await serve(...rig), await serve(...rig)];
  const page = await open(one, `autoplay src="${one.url}whep"`);
  await page.loads();
  const view = await page.evaluate(src => {
    v.src = src;
    return v.setView({ yaw: 2 });
  }, `${two.url}whep`);
  expect(isNear(view.yaw, 2), 'a view that is set after src is shown');
  expect(await two.metric('viewers') === 1 && await page.evaluate(() => v.src) === `${two.url}whep`, 'by the other server');
  await until(async () => await one.metric('viewers') === 0, 'the first one is left');
  await page.leaves();
  await one.stop();
  await two.stop();
}

async function widths() {
  const served = await serve(...rig);
  const page = await open(served, 'autoplay max-width="65"');
  await page.loads();
  const asked = () => page.asked.at(-1).searchParams.get('width');
  expect(await asked() === '64' && await page.evaluate(() => v.maxWidth) === 65, `65 pixels at most: ${await asked()}`);
  for (const [most, width] of [[131, '130'], [130, '130'], [10, '64'], [null, '640']]) {
    await page.evaluate(most => v.maxWidth = most, most);
    await until(async () => await asked() === width, `maxWidth = ${most} asks for ${width}, not ${await asked()}`);
  }
  await page.leaves();
  await served.stop();
}

async function tokens() {
  const file = join(folder, 'token');
  await writeFile(file, 'sesame', { mode: 0o600 });
  const served = await serve(...rig, '--token-file', file);
  const page = await open(served, 'autoplay token="wrong"');
  await until(async () => (await page.toldOf('error')).length, 'a wrong token is an error');
  const [error] = await page.toldOf('error');
  expect(error.status === 401 && error.reason === 'token' && error.message && error.cause && error.retryAfter === Infinity,
    `and reported: ${JSON.stringify(error)}`);
  expect(await page.evaluate(() => v.status instanceof HTMLElement && !v.status.hidden), 'status says it');
  await page.evaluate(() => v.token = 'sesame');
  await page.loads();
  expect(await page.evaluate(() => v.token === 'sesame' && v.status.hidden), 'the right one is let in');
  await page.leaves();
  await served.stop();
}

async function streams() {
  const own = await makeRig('4x4');
  const served = await serve('--rig', join(own, 'rig.json'), ...rig.slice(2), '--watch');
  const page = await open(served, 'controls autofocus');
  const reads = () => page.evaluate(() => ({ loaded: v.loaded, connected: v.connected, paused: v.paused, view: v.view,
    statistics: Object.keys(v.statistics).length > 0, connection: v.connection !== null, autoplay: v.autoplay, controls: v.controls }));
  const first = await page.waitForFunction(() => v.play).then(reads);
  expect(JSON.stringify(first) === JSON.stringify({ loaded: false, connected: false, paused: true, view: null, statistics: false,
    connection: false, autoplay: false, controls: true }), `before play(): ${JSON.stringify(first)}`);
  expect(await page.evaluate(() => v.shadowRoot.activeElement === inside().video), 'autofocus gives it the keyboard');
  await page.evaluate(() => v.play());
  await page.loads();
  await until(async () => (await page.toldOf('statistics')).length, 'statistics come');
  const [told] = await page.toldOf('statistics');
  for (const name of ['pictures', 'incomplete', 'pictureMs', 'bitRate', 'frameRate', 'sizeDivisor', 'loss', 'roundTripMs'])
    expect(Number.isFinite(told[name]), `statistics.${name}: ${told[name]}`);
  const playing = await reads();
  expect(playing.loaded && playing.connected && !playing.paused && playing.statistics && playing.connection, JSON.stringify(playing));
  expect(await page.evaluate(() => v.connection.peer instanceof RTCPeerConnection && v.connection.channel.readyState === 'open'),
    'connection has peer and channel');
  expect((await page.toldOf('connected')).length === 1 && (await page.toldOf('first-frame')).length === 1, 'connected, first-frame');

  await page.evaluate(() => v.setView({ yaw: 2 }));
  const viewers = await served.metric('viewers_total');
  await page.evaluate(() => v.reconnect());
  await until(async () => await served.metric('viewers_total') === viewers + 1, 'reconnect() asks for another stream');
  await page.waitForFunction(() => v.connected && told.filter(([name]) => name === 'connected').length === 2);
  expect((await page.toldOf('disconnected'))[0].reason, 'disconnected says why');
  await isAt(page, { yaw: 2 }, 'where it was');

  const text = JSON.parse(await readFile(join(own, 'rig.json'), 'utf8'));
  text.cameras[0].position[0] += 0.001;
  await writeFile(join(own, 'rig.json'), JSON.stringify(text));
  await until(async () => (await page.toldOf('rig')).length, 'another rig is reported');
  expect(/^[0-9a-f]{16}$/.test((await page.toldOf('rig'))[0].hash), JSON.stringify(await page.toldOf('rig')));
  await isAt(page, { yaw: 2 }, 'the view stays');

  await page.evaluate(() => v.pause());
  await until(async () => await served.metric('viewers') === 0, 'pause() leaves the seat');
  const paused = await reads();
  expect(paused.paused && !paused.connected && paused.loaded && !paused.connection, JSON.stringify(paused));
  await page.evaluate(() => v.autoplay = true);
  await page.waitForFunction(() => v.connected);
  await page.leaves();
  await served.stop();
}

async function iceServers() {
  const served = await serve(...rig);
  const page = await open(served, 'autoplay ice-servers="stun:a.example"', { before: `<script>
    globalThis.gathered = [];
    globalThis.RTCPeerConnection = class extends RTCPeerConnection {
      constructor(configuration) {
        super({ ...configuration, iceServers: [] });
        gathered.push(configuration.iceServers);
      }
    };</script>` });
  await page.loads();
  await page.evaluate(() => v.iceServers = [{ urls: 'stun:b.example' }]);
  await page.waitForFunction(() => gathered.length === 2 && v.connected);
  const gathered = await page.evaluate(() => JSON.stringify([globalThis.gathered, v.iceServers]));
  expect(gathered === '[[[{"urls":"stun:a.example"}],[{"urls":"stun:b.example"}]],[{"urls":"stun:b.example"}]]', gathered);
  await page.leaves();
  await served.stop();
}

async function looks() {
  const served = await serve(...rig);
  const readme = await readFile(join(source, 'web/README.md'), 'utf8');
  const names = [...new Set(readme.match(/--lightfield-[a-z]+/g))];
  const colours = Object.fromEntries(names.map((name, i) => [name, `rgb(${10 * i + 1}, 2, 3)`]));
  const page = await open(served, 'autoplay controls alt="A globe"', { inside: '<div id="own" slot="controls">My bar</div>' });
  await page.loads();
  expect(await page.getByRole('application', { name: 'A globe' }).count() === 1, 'alt names the picture');
  expect(await page.evaluate(() => own.checkVisibility() && !inside().bar.bar.checkVisibility()), 'the slot controls is the bar');
  await page.evaluate(colours => {
    own.remove();
    for (const [name, value] of Object.entries(colours)) v.style.setProperty(name, value);
  }, colours);
  const used = await page.evaluate(() => {
    const { root, bar, slider } = inside(), of = (element, name) => getComputedStyle(element)[name];
    const button = root.querySelector('.bar button.figures'), plain = [of(button, 'backgroundColor'), of(button, 'borderTopColor')];
    button.setAttribute('aria-pressed', 'true');
    return { '--lightfield-background': of(v, 'backgroundColor'), '--lightfield-panel': of(bar.bar, 'backgroundColor'),
      '--lightfield-text': of(bar.bar, 'color'), '--lightfield-button': plain[0], '--lightfield-line': plain[1],
      '--lightfield-pressed': of(button, 'backgroundColor'), '--lightfield-accent': of(slider, 'accentColor') };
  });
  for (const name of names) expect(used[name] === colours[name], `${name}: ${used[name]}, not ${colours[name]}`);
  const parts = readme.match(/Parts: ([\s\S]*?)\n\n/)[1].match(/`[a-z]+`/g).map(part => part.slice(1, -1));
  const there = await page.evaluate(parts => parts.filter(part => !inside().root.querySelector(`[part=${part}]`)), parts);
  expect(parts.length > 8 && !there.length, `parts that are not there: ${there}`);
  await page.leaves();
  await served.stop();
}

async function trustedTypes() {
  const served = await serve(...rig), server = new URL(served.url).origin;
  const policy = `default-src 'none'; script-src ${server}/ 'nonce-mine'; connect-src ${server}/; style-src 'nonce-mine'; base-uri 'none'; ` +
    `require-trusted-types-for 'script'; trusted-types 'none'`;
  const mine = await site({ '/': `<!doctype html><html lang="en"><meta charset="utf-8"><title>mine</title>
    <script nonce="mine">globalThis.violations = [];
      document.addEventListener('securitypolicyviolation', ({ violatedDirective, sample }) => violations.push(violatedDirective + ' ' + sample));
    </script>
    <lightfield-viewer id="v" controls autoplay></lightfield-viewer>
    <script type="module" nonce="mine" src="${served.url}lightfield-viewer.js"></script>` }, null, '127.0.0.1',
  { 'Content-Security-Policy': policy });
  const page = await openShown(browser, mine.origin, { width: 700, height: 500 }, 10);
  expect(await page.evaluate(() => {
    try {
      document.createElement('p').innerHTML = '<b>';
    } catch {
      return violations.splice(0).length === 1 || 'the event comes later';
    }
  }), 'the policy holds');
  await page.waitForFunction(() => v.view);
  await page.locator('lightfield-viewer video').focus();
  for (const [key, part] of [['c', 'canvas.cameras'], ['i', 'pre.figures'], ['?', '.guide']]) {
    await page.keyboard.press(key);
    await page.waitForFunction(part => inside().root.querySelector(part).checkVisibility(), part);
    if (key === '?') await page.screenshot({ path: join(process.env.LF_ARTEFACTS, 'trusted-types.png') });
    await page.keyboard.press(key);
  }
  expect(await page.evaluate(async () => (await v.toBlob({ type: 'image/jpeg' })).size) > 1000, 'its picture can be had');
  const { view } = await page.evaluate(async () => ({ view: await v.setView({ yaw: 2 }) }));
  expect(isNear(view.yaw, 2), 'it flies');
  const violations = (await page.evaluate(() => globalThis.violations)).filter(text => !/<b>/.test(text));
  expect(!violations.length, `the policy is violated: ${violations}`);
  await closeClean(page, served);
  mine.close();
}

await runTests([
  ['goHome() and the source of each movement', homeView],
  ['focus', focusing],
  ['share', sharing],
  ['eyes and their distance', eyes],
  ['a path of the server', paths],
  ['a shared flight while all seats are taken', fallsBack],
  ['a plain WHEP server', plainServers],
  ['another server', otherSource],
  ['max-width', widths],
  ['token', tokens],
  ['play, pause, reconnect, statistics, another rig', streams],
  ['ICE servers', iceServers],
  ['parts, slots and colours', looks],
  ['a strict policy with trusted types', trustedTypes],
]);
