// SPDX-License-Identifier: LGPL-2.1-or-later
// axe-core finds nothing to complain about: the page and each of its overlays and states, light and dark.
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, expect, launchBrowser, makeRig, newPage, runTests, serve, shown, until } from './harness.mjs';

const axe = await readFile(join(artefacts, 'node_modules/axe-core/axe.min.js'), 'utf8');
const folder = await makeRig('4x4');
const token = join(folder, 'token');
await writeFile(token, 'sesame', { mode: 0o600 });
const browser = await launchBrowser();
const kTags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];

async function check(page, what) {
  const { violations, incomplete, passes } = await page.evaluate(tags => axe.run(document, { runOnly: tags }), kTags);
  // Of elements with text axe-core is not sure that a label which their role does not allow is ignored.
  const unsure = incomplete.filter(({ id }) => id === 'aria-prohibited-attr');
  const told = [...violations, ...unsure].map(({ id, nodes }) => `${id}: ${nodes.map(({ target, failureSummary }) => `${target} ${failureSummary}`).join('; ')}`);
  console.log(`# ${what}: ${passes.length} rules pass`);
  expect(passes.length > 10, `${what}: only ${passes.length} rules apply`);
  expect(!told.length, `${what}: ${told.join('\n')}`);
}

async function overlays(colorScheme) {
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

await runTests([['axe-core, dark', () => overlays('dark')], ['axe-core, light', () => overlays('light')]]);
