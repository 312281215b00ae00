// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared code of the browser tests: TAP, a running lf-serve, headless Chromium, and image comparison.
import { execFile, spawn } from 'node:child_process';
import { createSocket } from 'node:dgram';
import { once } from 'node:events';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { extname, join, normalize } from 'node:path';
import { createInterface } from 'node:readline';
import { promisify } from 'node:util';
import { chromium } from 'playwright-core';

const tools = process.env.LF_TOOLS_DIR;
const run = promisify(execFile);
export const patience = 60000;  // milliseconds, for busy machines
export const artefacts = process.env.LF_ARTEFACTS;

process.setMaxListeners(0);  // one exit handler per program

export const source = process.env.LF_SOURCE_ROOT;

// Starts a program in the background and kills it when the tests end. A test failure prints the output.
export function start(program, ...args) {
  const child = spawn(program, args, { stdio: ['ignore', 'pipe', 'pipe'] });
  process.on('exit', () => child.kill('SIGKILL'));
  listen(program, child);
  return child;
}

const heard = [];

// Stores the lines of a program for failure reports and passes each to `take`.
function listen(program, child, take = () => {}) {
  const lines = [];
  heard.push({ program, lines });
  for (const stream of [child.stdout, child.stderr])
    createInterface({ input: stream }).on('line', line => {
      lines.push(line);
      if (lines.length > 40) lines.shift();
      take(line);
    });
}

// Prints the reason of a failure to stderr, which `meson test --print-errorlogs` shows for TAP tests.
function report(error) {
  const said = heard.flatMap(({ program, lines }) => [`${program} said at last:`, ...lines.splice(0)]);
  console.error([String(error.stack ?? error), ...said].join('\n').replace(/^/gm, '# '));
}

export async function runTests(tests) {
  const chosen = process.env.LF_TESTS ? tests.filter(([name]) => name.match(process.env.LF_TESTS)) : tests;
  console.log(`1..${chosen.length}`);
  let failed = 0;
  for (const [i, [name, test]] of chosen.entries()) {
    const began = Date.now();
    try {
      await test();
      console.log(`ok ${i + 1} - ${name}`);
    } catch (error) {
      failed++;
      console.log(`not ok ${i + 1} - ${name}`);
      report(error);
    }
    console.log(`# ${name}: ${((Date.now() - began) / 1000).toFixed(1)} s`);
  }
  process.exit(failed ? 1 : 0);
}

export function expect(condition, what) {
  if (!condition) throw new Error(what);
}

export async function until(condition, what) {
  const deadline = Date.now() + patience;
  while (!await condition()) {
    if (Date.now() > deadline) throw new Error(`never: ${what}`);
    await new Promise(done => setTimeout(done, 100));
  }
}

export async function makeFolder() {
  const folder = await mkdtemp(join(tmpdir(), 'lf_web_'));
  process.on('exit', () => spawn('rm', ['-rf', folder], { detached: true }));
  return folder;
}

// Records JPEG video of the moving built-in scene. Returns the folder, which is removed at the end.
export async function makeFilm(grid) {
  const folder = await makeFolder();
  await run(join(tools, 'lf-scene'), ['--out', folder, '--grid', grid, '--frames', '30']);
  return folder;
}

// Returns the processor time of a process in seconds.
export async function processorTime(pid) {
  const fields = (await readFile(`/proc/${pid}/stat`, 'utf8')).split(') ')[1].split(' ');
  return (Number(fields[11]) + Number(fields[12])) / 100;
}

// The page does not use WebGL in software, but tests may have no GPU.
export function allowSoftware() {
  const { getContext } = HTMLCanvasElement.prototype, { getParameter } = WebGL2RenderingContext.prototype;
  HTMLCanvasElement.prototype.getContext = function (type, options) {
    return getContext.call(this, type, { ...options, failIfMajorPerformanceCaveat: false });
  };
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    const value = getParameter.call(this, name);
    return /SwiftShader|llvmpipe/.test(value) ? 'a GPU' : value;
  };
}

// Creates a rig with still images of the built-in scene. Returns the folder, which is removed at the end.
export async function makeRig(grid) {
  const folder = await makeFolder();
  await run(join(tools, 'lf-scene'), ['--out', folder, '--grid', grid, '--frames', '1', '--format', 'png']);
  const rig = JSON.parse(await readFile(join(folder, 'rig.json')));
  for (const camera of rig.cameras) delete camera.source;
  await writeFile(join(folder, 'rig.json'), JSON.stringify(rig));
  return folder;
}

// Starts lf-serve with these options; stop() ends the server. `said` collects its output.
export async function serve(...options) {
  const port = options.includes('--port') ? [] : ['--port', '0'];
  const child = spawn(join(tools, 'lf-serve'), [...port, ...options], { stdio: ['ignore', 'pipe', 'pipe'] });
  process.on('exit', () => child.kill('SIGKILL'));
  const served = { said: '', pid: child.pid };
  const url = new Promise((resolve, reject) => {
    listen('lf-serve', child, line => {
      served.said += line + '\n';
      const match = line.match(/^serving .* at (http\S+)/);
      if (match) resolve(match[1]);
    });
    child.on('exit', () => reject(new Error(`lf-serve ended:\n${served.said}`)));
  });
  served.url = await url;
  served.metric = async name => {
    const text = await (await fetch(new URL('metrics', served.url))).text();
    return Number(text.match(new RegExp(`^lightfield_${name} (.*)$`, 'm'))?.[1]);
  };
  served.kill = () => {
    child.removeAllListeners('exit');
    child.kill('SIGKILL');
  };
  served.stop = async () => {
    child.removeAllListeners('exit');
    const ended = once(child, 'exit');
    child.kill('SIGTERM');
    const [status] = await ended;
    expect(status === 0, `lf-serve ends with ${status}:\n${served.said}`);
  };
  return served;
}

const launchOptions = {
  executablePath: process.env.LF_CHROMIUM,
  args: ['--allow-loopback-in-peer-connection', '--disable-features=WebRtcHideLocalIpsWithMdns', '--disable-gpu',
    '--enable-unsafe-swiftshader',
    ...(process.getuid() === 0 ? ['--no-sandbox'] : [])],
};
export const launchBrowser = (...args) => chromium.launch({ ...launchOptions, args: [...launchOptions.args, ...args] });
export const launchBrowserServer = () => chromium.launchServer(launchOptions);
export const connectBrowser = server => chromium.connect(server.wsEndpoint());

// Defines inside(), which returns the internals of the first or of a given element.
function showInside() {
  globalThis.inside = (element = document.querySelector('lightfield-viewer')) =>
    element && element[Object.getOwnPropertySymbols(element).find(({ description }) => description === 'inside')];
}

// Opens a page in a separate window, because background tabs are throttled. `page.problems` collects errors.
export async function newPage(browser, size = { width: 640, height: 480 }, { before, ...options } = {}) {
  const context = await browser.newContext({ viewport: size, ...options });
  context.setDefaultTimeout(patience);
  context.setDefaultNavigationTimeout(patience);
  const page = await context.newPage();
  await page.addInitScript(showInside);
  if (before) await page.addInitScript(before);
  page.problems = [];
  page.on('pageerror', error => page.problems.push(error.message));
  return page;
}
export async function openPage(browser, url, size, options) {
  const page = await newPage(browser, size, options);
  await page.goto(url);
  return page;
}

export async function shown(page, frames = 1) {
  await page.waitForFunction(
    n => globalThis.inside?.()?.video.getVideoPlaybackQuality().totalVideoFrames >= n, frames).catch(async error => {
    const status = await page.evaluate(() => inside()?.status.textContent);
    throw new Error(`no picture: ${status}; ${page.problems}; ${error.message}`);
  });
}

export async function openShown(browser, url, size, frames, options) {
  const page = await openPage(browser, url, size, options);
  await shown(page, frames);
  return page;
}

// Calls kill(replica) to end the server of a page, and waits for pictures of another server. Returns the names of both replicas, and
// the times in milliseconds from the last picture of the first server until the page noticed the end, and until it showed
// the next picture.
export async function resumed(page, kill) {
  const replica = () => page.evaluate(() => inside().stream.connection?.session?.pathname.split('/').pop().split('-')[0]);
  const first = await replica();
  await page.evaluate(() => {
    const { host, video } = inside();
    const happens = name => new Promise(done => host.addEventListener(name, done, { once: true }));
    let last = performance.now();
    const follow = now => {
      last = now;
      video.requestVideoFrameCallback(follow);
    };
    video.requestVideoFrameCallback(follow);
    globalThis.times = happens('disconnected').then(async () => {
      const began = last, noticed = performance.now() - began;
      await happens('connected');
      const seen = await new Promise(done => video.requestVideoFrameCallback(done));
      return { noticed, seen: seen - began };
    });
  });
  await kill(first);
  return { ...await page.evaluate(() => globalThis.times), first, second: await replica() };
}

export async function close(page, served) {
  await page.context().close();
  await served.stop();
}
export async function closeClean(page, served) {
  expect(!page.problems.length, page.problems.join('; '));
  await close(page, served);
}

// Sets the view, waits for a frame with this view, and returns the state.
export async function setView(page, view) {
  return page.evaluate(async view => {
    await document.querySelector('lightfield-viewer').setView(view);
    // The encoder needs a few frames to sharpen a still image.
    const { video, flight } = inside();
    for (let i = 0; i < 15; i++) await new Promise(done => video.requestVideoFrameCallback(done));
    return flight.state;
  }, view);
}

// Waits until a drag has come to rest, a frame shows the requested view, and the statistics match this view.
export async function settled(page) {
  await page.waitForFunction(() => inside().controls.gliding === undefined && !inside().flight.way);
  await page.evaluate(async () => {
    const { flight, host } = inside();
    await new Promise((done, failed) => flight.asked.push([flight.follow(flight.follows), done, failed, {}]));
    await new Promise(done => host.addEventListener('statistics', done, { once: true }));
  });
}

export async function stateOf(page) {
  await page.waitForFunction(() => inside().flight.state);
  return page.evaluate(() => inside().flight.state);
}

// Returns the decoded frame as a PNG; with two eyes, the half of side 0 or 1.
export async function picture(page, side) {
  const url = await page.evaluate(side => {
    const { video } = inside();
    const canvas = document.createElement('canvas');
    Object.assign(canvas, { width: video.videoWidth / (side === undefined ? 1 : 2), height: video.videoHeight });
    canvas.getContext('2d').drawImage(video, -(side ?? 0) * canvas.width, 0);
    return canvas.toDataURL('image/png');
  }, side);
  return Buffer.from(url.split(',')[1], 'base64');
}

// Returns the PSNR in dB between two PNGs of the same size, and the mean and deviation of the first.
export async function compare(page, a, b) {
  return page.evaluate(async ([a, b]) => {
    const pixels = async data => {
      const image = await createImageBitmap(await (new Blob([Uint8Array.from(atob(data), c => c.charCodeAt(0))])));
      const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext('2d');
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    };
    const [p, q] = [await pixels(a), await pixels(b)];
    if (p.width !== q.width || p.height !== q.height)
      throw new Error(`${p.width}x${p.height} against ${q.width}x${q.height}`);
    let n = 0, error = 0, sum = 0, squares = 0;
    for (let i = 0; i < p.data.length; i++) {
      if (i % 4 === 3) continue;
      n++;
      error += (p.data[i] - q.data[i]) ** 2;
      sum += p.data[i];
      squares += p.data[i] ** 2;
    }
    return { psnr: 10 * Math.log10(255 ** 2 * n / Math.max(error, 1e-9)), mean: sum / n,
      deviation: Math.sqrt(Math.max(0, squares / n - (sum / n) ** 2)) };
  }, [a.toString('base64'), b.toString('base64')]);
}

export async function half(page, png, side) {
  const url = await page.evaluate(async ([data, side]) => {
    const image = new Image(), canvas = document.createElement('canvas');
    image.src = data;
    await image.decode();
    Object.assign(canvas, { width: image.width / 2, height: image.height });
    canvas.getContext('2d').drawImage(image, -side * canvas.width, 0);
    return canvas.toDataURL('image/png');
  }, [`data:image/png;base64,${png.toString('base64')}`, side]);
  return Buffer.from(url.split(',')[1], 'base64');
}

// Returns the server's view, or the view of an eye beside it, as views.json.
export function viewFile(state, { width, height, lens }, eyeOffset = 0) {
  const half = degrees => degrees * Math.PI / 360;
  const [[cy, sy], [cp, sp], [cr, sr]] =
    [state.yaw, state.pitch, state.roll].map(angle => [Math.cos(half(angle)), Math.sin(half(angle))]);
  // About y, then x, then z.
  const orientation = [cy * cp * cr + sy * sp * sr, cy * sp * cr + sy * cp * sr, sy * cp * cr - cy * sp * sr,
    cy * cp * sr - sy * sp * cr];
  const [w, x, y, z] = orientation, right = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)];
  const position = [state.x, state.y, state.z].map((at, k) => at + eyeOffset * right[k]);
  return { name: 'view', position, orientation, width, height, ...lens ?? { fov_y: state.fov },
    focus_distance: state['focus-distance'] };
}

export async function rendered(folder, state, size, eyeOffset) {
  const out = await mkdtemp(join(tmpdir(), 'lf_web_view_'));
  await writeFile(join(out, 'views.json'),
    JSON.stringify({ format: 'lightfield-views', version: 1, views: [viewFile(state, size, eyeOffset)] }));
  await run(join(tools, 'lf-render'),
    ['--rig', join(folder, 'rig.json'), '--views', join(out, 'views.json'), '--out', out,
      '--focus', 'plane']);
  const png = await readFile(join(out, 'view.png'));
  await rm(out, { recursive: true });
  return png;
}

export const truthOf = (state, size, times = [0]) => truthsOf(times.map(time => ({ ...state, time })), size);

// Returns pictures of the built-in scene, by ray tracing, for views with an optional time.
export async function truthsOf(states, size) {
  const out = await mkdtemp(join(tmpdir(), 'lf_web_truth_'));
  const views = states.map((state, i) => ({ ...viewFile(state, size), name: `at_${i}`, time: state.time ?? 0 }));
  await writeFile(join(out, 'views.json'), JSON.stringify({ format: 'lightfield-views', version: 1, views }));
  // lf-scene requires a grid even for the truth.
  await run(join(tools, 'lf-scene'), ['--out', out, '--grid', '1x1', '--width', '64',
    '--height', '48', '--frames', '1', '--format', 'png', '--truth', join(out, 'views.json')]);
  const truths = await Promise.all(views.map(({ name }) => readFile(join(out, 'truth', `${name}.png`))));
  await rm(out, { recursive: true });
  return truths;
}

// Serves third-party sites: pages and files with a separate origin.
const kTypes = { '.js': 'text/javascript', '.html': 'text/html', '.css': 'text/css' };

// `pages`: texts by path. Other paths are files of `root`, if given. `host` selects the origin. `headers` are added to
// every response.
export async function site(pages, root, host = '127.0.0.1', headers = {}) {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, 'http://site');
    try {
      const text = pages[pathname] ?? (root && await readFile(join(root, normalize(pathname))));
      if (text === null || text === undefined) throw new Error('not here');
      response.setHeader('Content-Type', kTypes[extname(pathname)] ?? 'text/html');
      for (const [name, value] of Object.entries(headers)) response.setHeader(name, value);
      response.end(text);
    } catch {
      response.statusCode = 404;
      response.end('not here');
    }
  });
  await new Promise(done => server.listen(0, '127.0.0.1', done));
  return { origin: `http://${host}:${server.address().port}`, close: () => server.close() };
}

// Simulates a bad network between a page and its lf-serve. The page's next connection uses a relay that drops
// `relay.loss` of the media packets in both directions, and delays all packets by `relay.delay` milliseconds.
export async function throughRelay(page) {
  const relay = { loss: 0, delay: 0, passed: 0, lost: 0, close: () => sockets.splice(0).forEach(socket => socket.close()) };
  const sockets = [];
  await page.route('**/whep?*', async route => {
    const response = await route.fetch();
    let body = await response.text();
    const [, port] = body.match(/a=candidate:\S+ 1 UDP \d+ 127\.0\.0\.1 (\d+) typ host/i) ?? [];
    if (port) body = body.replaceAll(`127.0.0.1 ${port} typ`, `127.0.0.1 ${await open(Number(port))} typ`);
    await route.fulfill({ response, body });
  });
  // Two sockets: one represents the server, the other represents the browser.
  async function open(server) {
    const [near, far] = [createSocket('udp4'), createSocket('udp4')];
    sockets.push(near, far);
    let browser = 0;
    const lost = packet => {
      const media = packet[0] >= 128 && packet[0] < 192 && Math.random() < relay.loss;  // RFC 7983
      relay[media ? 'lost' : 'passed']++;
      return media;
    };
    const later = send => relay.delay > 0 ? setTimeout(() => sockets.length && send(), relay.delay) : send();
    near.on('message', (packet, { port }) => {
      browser = port;
      if (!lost(packet)) later(() => far.send(packet, server, '127.0.0.1'));
    });
    far.on('message', packet => browser && !lost(packet) && later(() => near.send(packet, browser, '127.0.0.1')));
    for (const socket of [near, far]) {
      socket.bind(0, '127.0.0.1');
      await once(socket, 'listening');
    }
    return near.address().port;
  }
  return relay;
}

// Opens the page, which redraws pictures, behind a network with this round trip, in milliseconds.
export async function openDelayed(browser, served, roundTrip) {
  const page = await newPage(browser, undefined, { before: allowSoftware });
  const relay = await throughRelay(page);
  await page.goto(served.url);
  await shown(page, 30);
  await page.waitForFunction(() => inside().redraw.picture?.surface.levels.length > 100);
  await page.waitForTimeout(1500);  // until the surface has settled
  relay.delay = roundTrip / 2;
  await page.waitForTimeout(roundTrip + 200);
  return { page, relay };
}

// Waits until no picture is redrawn any more.
export const rests = page => page.waitForFunction(() => !inside().redraw.painted && inside().redraw.prediction.isConfirmed);
