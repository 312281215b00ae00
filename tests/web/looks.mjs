// SPDX-License-Identifier: LGPL-2.1-or-later
// Appearance of the page in windows of several shapes, in light and dark mode: screenshots for inspection, and checks.
// `browser.sh BUILD looks.mjs` writes the screenshots to BUILD/tests/web/looks.
import { mkdir, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, close, compare, expect, launchBrowser, makeRig, newPage, openPage, openShown, picture,
  runTests, serve, settled, shown, stateOf, truthOf, until } from './harness.mjs';

const kWindows = [[1280, 720], [800, 480], [390, 844], [844, 390], [320, 480], [2560, 1440]];
const folder = join(artefacts, 'looks');
await mkdir(folder, { recursive: true });
const browser = await launchBrowser();
const film = await makeRig('8x8');
const rig = ['--rig', join(film, 'rig.json')];
const kPsnr = 25;  // minimum PSNR of the home view against the scene, dB
const says = (page, words) => until(async () => words.test(await page.getByRole('status').textContent()), `it says ${words}`);

const darkShare = page => page.evaluate(() => {
  const { video } = inside(), { videoWidth: w, videoHeight: h } = video;
  const context = new OffscreenCanvas(w, h).getContext('2d');
  context.drawImage(video, 0, 0);
  const { data } = context.getImageData(0, 0, w, h);
  let dark = 0;
  for (let i = 0; i < data.length; i += 4) dark += Math.max(data[i], data[i + 1], data[i + 2]) < 12;
  return dark / (w * h);
});
const coverage = page => page.evaluate(() => inside().statistics.coverage);

async function shoot(page, name, what) {
  for (const colorScheme of ['dark', 'light']) {
    await page.emulateMedia({ colorScheme });
    await page.screenshot({ path: join(folder, `${name}-${colorScheme}-${what}.png`) });
  }
}

function look([width, height]) {
  const name = `${width}x${height}`;
  return [name, async () => {
    const served = await serve(...rig);
    const phone = Math.min(width, height) < 400;
    const page = await openPage(browser, served.url, { width, height },
      phone ? { hasTouch: true, isMobile: true, deviceScaleFactor: 2 } : {});
    const shot = what => shoot(page, name, what);
    await shown(page, 40);
    await until(() => coverage(page), 'figures come');
    await shot('first');
    const { videoWidth, videoHeight } = await page.evaluate(() => {
      const { videoWidth, videoHeight } = inside().video;
      return { videoWidth, videoHeight };
    });
    expect(Math.abs(videoWidth / videoHeight / (width / height) - 1) < 0.05,
      `${videoWidth} x ${videoHeight} is of another shape`);
    const dark = await darkShare(page), home = await stateOf(page);
    const [truth] = await truthOf(home, { width: videoWidth, height: videoHeight });
    const isWhole = () => page.evaluate(width => inside().video.videoWidth === width, videoWidth);
    // The first frame uses a plane; the surface follows when estimated.
    let psnr = 0;
    await until(async () => await isWhole() && ({ psnr } = await compare(page, await picture(page), truth)).psnr > kPsnr, `home is ${kPsnr} dB from the scene`);
    const covered = await coverage(page);
    console.log(`# ${name}: ${videoWidth} x ${videoHeight}, fov ${home.fov.toFixed(1)}, ${(100 * dark).toFixed(2)} % dark, ` +
      `coverage ${(100 * covered).toFixed(2)} %, ${psnr.toFixed(1)} dB against the scene`);
    await shot('home');
    expect(dark < 0.005, `home has a dark border: ${dark}`);
    expect(covered > 0.99, `home is covered to ${covered}`);

    for (const keys of [[], ['Shift']]) {
      for (const key of keys) await page.keyboard.down(key);
      await page.mouse.move(width / 2, height / 3);
      await page.mouse.down();
      for (let x = 0; x <= 100; x += 10) await page.mouse.move(width / 2 + x, height / 3);
      await page.mouse.up();
      for (const key of keys) await page.keyboard.up(key);
      await settled(page);
      const left = await coverage(page);
      console.log(`# ${name}: ${keys}drag leaves ${(100 * left).toFixed(1)} %`);
      expect(left > 0.85, `a drag leaves ${left}`);
      await shot(keys.length ? 'shift-drag' : 'drag');
    }
    await page.mouse.dblclick(width / 2, height / 3);
    await until(async () => Math.abs((await stateOf(page)).x - home.x) < 1e-9, 'a double click goes home');
    // Phones have no wheel.
    await page.mouse.move(width / 2 - 40, height / 3);
    for (let i = 0; i < 6; i++) phone ? await page.keyboard.press('+') : await page.mouse.wheel(0, -100);
    await until(async () => (await stateOf(page)).fov < 0.8 * home.fov, 'the wheel zooms in');
    await settled(page);
    await shot('zoom');
    await page.keyboard.press('r');
    for (const [key, what] of [['[', 'near'], [']', 'far']]) {
      for (let i = 0; i < 8; i++) await page.keyboard.press(key);
      await settled(page);
      await shot(what);
      await page.keyboard.press('r');
    }
    for (const [key, what, part] of [['c', 'cameras', 'pre.makers'], ['i', 'figures', 'pre.figures'], ['?', 'help', '.guide']]) {
      await page.focus('lightfield-viewer video');
      await page.keyboard.press(key);
      await page.waitForFunction(part => inside().root.querySelector(part).checkVisibility() &&
        inside().root.querySelector(part).textContent, part);
      await shot(what);
      await page.keyboard.press(key);
    }
    expect(!page.problems.length, page.problems.join('; '));
    await served.stop();
    await says(page, /can't be reached/);
    await shot('server-gone');
    await page.context().close();
  }];
}

async function errors() {
  const token = join(film, 'token');
  await writeFile(token, 'sesame', { mode: 0o600 });
  const served = await serve(...rig, '--token-file', token, '--viewers', '1', '--monitor', '1');
  const size = { width: 800, height: 480 };
  const page = await openPage(browser, served.url, size);
  await until(() => page.getByLabel('Token').isVisible(), 'a field for the token');
  await shoot(page, 'state', 'token');
  await page.getByLabel('Token').fill('sesame');
  await page.getByLabel('Token').press('Enter');
  await shown(page, 5);
  const second = await openPage(browser, new URL('#token=sesame', served.url).href, size);
  await until(async () => /too many/.test(await second.getByRole('status').textContent()), 'it is full');
  await shoot(second, 'state', 'full');
  await page.waitForFunction(() => inside().statistics.monitored);
  await page.keyboard.press('m');
  await page.waitForFunction(() => inside().monitor.report?.turns > 70);
  await page.getByText(/cameras predicted/).waitFor();
  await shoot(page, 'state', 'quality');
  await page.keyboard.press('m');
  // When a seat becomes free, the page takes it automatically, and the button may be gone.
  await second.getByRole('button', { name: 'Try again' }).click();
  await page.context().close();
  await shown(second, 5);
  await close(second, served);
}

async function waiting() {
  const served = await serve(...rig);
  const page = await newPage(browser, { width: 800, height: 480 });
  let problem = { status: 503, reason: 'filming', progress: 0.4 };
  await page.route('**/whep*', route => route.fulfill({ status: problem.status, contentType: 'application/problem+json',
    headers: { 'Retry-After': '1' }, body: JSON.stringify(problem) }));
  await page.goto(served.url);
  for (const [what, words, next] of [['filming', /filmed/, problem], ['queue', /number 2 of 3/, { status: 503, reason: 'full', place: 2, waiting: 3 }],
    ['starting', /being opened/, { status: 503, reason: 'starting' }]]) {
    problem = next;
    await says(page, words);
    await shoot(page, 'state', what);
  }
  await close(page, served);
}

async function modes() {
  const served = await serve(...rig);
  for (const eyes of ['side', 'anaglyph']) {
    const page = await openShown(browser, new URL(`#eyes=${eyes}`, served.url).href, { width: 800, height: 480 }, 40);
    await page.mouse.move(300, 200);
    await shoot(page, 'state', eyes);
    if (eyes === 'side') await page.evaluate(() => document.querySelector('lightfield-viewer').pause());
    if (eyes === 'side') await shoot(page, 'state', 'paused');
    await page.context().close();
  }
  await served.stop();
}

await runTests([...kWindows.map(look), ['errors', errors], ['waiting', waiting], ['modes', modes]]);
