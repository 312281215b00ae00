// SPDX-License-Identifier: LGPL-2.1-or-later
// What a person sees of the page, in windows of several shapes, light and dark: pictures to be looked at, and what can be
// said of them without. `browser.sh BUILD looks.mjs` writes them to BUILD/tests/web/looks.
import { mkdir, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, expect, launchBrowser, makeRig, openPage, runTests, serve, shown, stateOf, until }
  from './harness.mjs';

const kWindows = [[1280, 720], [800, 480], [390, 844], [844, 390], [320, 480], [2560, 1440]];
const folder = join(artefacts, 'looks');
await mkdir(folder, { recursive: true });
const browser = await launchBrowser();
const film = await makeRig('8x8');
const rig = ['--rig', join(film, 'rig.json')];
const rest = ms => new Promise(done => setTimeout(done, ms));

// The share of pixels of the decoded picture that are black.
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

function look([width, height], scheme) {
  const name = `${width}x${height}-${scheme}`;
  return [name, async () => {
    const served = await serve(...rig);
    const phone = Math.min(width, height) < 400;
    const page = await openPage(browser, served.url, { width, height },
      { colorScheme: scheme, ...phone && { hasTouch: true, isMobile: true, deviceScaleFactor: 2 } });
    const shot = what => page.screenshot({ path: join(folder, `${name}-${what}.png`) });
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
    console.log(`# ${name}: ${videoWidth} x ${videoHeight}, fov ${home.fov.toFixed(1)}, ${(100 * dark).toFixed(2)} % dark, ` +
      `coverage ${(100 * await coverage(page)).toFixed(1)} %`);
    expect(dark < 0.005, `home has a dark border: ${dark}`);

    // However far it is dragged.
    for (const keys of [[], ['Shift']]) {
      for (const key of keys) await page.keyboard.down(key);
      await page.mouse.move(width / 2, height / 3);
      await page.mouse.down();
      for (let x = 0; x <= 100; x += 10) await page.mouse.move(width / 2 + x, height / 3);
      await page.mouse.up();
      for (const key of keys) await page.keyboard.up(key);
      await rest(1500);
      const left = await coverage(page);
      console.log(`# ${name}: ${keys}drag leaves ${(100 * left).toFixed(1)} %`);
      expect(left > 0.85, `a drag leaves ${left}`);
      await shot(keys.length ? 'shift-drag' : 'drag');
    }
    await page.mouse.dblclick(width / 2, height / 3);
    await until(async () => Math.abs((await stateOf(page)).x - home.x) < 1e-9, 'a double click goes home');
    // Telephones have no wheel.
    await page.mouse.move(width / 2 - 40, height / 3);
    for (let i = 0; i < 6; i++) phone ? await page.keyboard.press('+') : await page.mouse.wheel(0, -100);
    await until(async () => (await stateOf(page)).fov < 0.8 * home.fov, 'the wheel zooms in');
    await rest(600);
    await shot('zoom');
    await page.keyboard.press('r');
    for (const [key, what] of [['c', 'cameras'], ['i', 'figures'], ['?', 'help']]) {
      await page.focus('lightfield-viewer video');
      await page.keyboard.press(key);
      await rest(400);
      await shot(what);
      await page.keyboard.press(key);
    }
    expect(!page.problems.length, page.problems.join('; '));
    await served.stop();
    await rest(1300);
    await shot('server-gone');
    await page.context().close();
  }];
}

async function errors() {
  const token = join(film, 'token');
  await writeFile(token, 'sesame');
  const served = await serve(...rig, '--token-file', token, '--viewers', '1');
  const size = { width: 800, height: 480 };
  const page = await openPage(browser, served.url, size);
  await until(() => page.getByLabel('Token').isVisible(), 'a field for the token');
  await page.screenshot({ path: join(folder, 'token.png') });
  await page.getByLabel('Token').fill('sesame');
  await page.getByLabel('Token').press('Enter');
  await shown(page, 5);
  const second = await openPage(browser, new URL('#token=sesame', served.url).href, size);
  await until(async () => /too many/.test(await second.getByRole('status').textContent()), 'it is full');
  await second.screenshot({ path: join(folder, 'full.png') });
  await page.context().close();
  await second.getByRole('button', { name: 'Try again' }).click();
  await shown(second, 5);
  await second.context().close();
  await served.stop();
}

await runTests([...kWindows.map((size, i) => look(size, i % 2 ? 'light' : 'dark')), ['errors', errors]]);
