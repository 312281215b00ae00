// SPDX-License-Identifier: LGPL-2.1-or-later
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { artefacts, closeClean, expect, launchBrowser, makeRig, openShown, runTests, serve, until } from './harness.mjs';

const kTurned = 6;
const folder = await makeRig('5x5');
const file = join(folder, 'rig.json'), good = await readFile(file, 'utf8');
const browser = await launchBrowser();

const words = page => page.evaluate(() => inside().root.querySelector('.monitor pre').textContent);
const turns = page => page.evaluate(() => inside().monitor.report?.turns ?? 0);

async function open(...options) {
  const served = await serve('--rig', file, '--connects', '100', '--focus', '2.2', ...options);
  const page = await openShown(browser, new URL('#x=0.02&y=0.01', served.url).href, { width: 800, height: 500 }, 5);
  await page.waitForFunction(() => inside().statistics.monitored !== undefined);
  await page.keyboard.press('m');
  return { served, page };
}

async function namesTheMisalignedCamera() {
  const rig = JSON.parse(good), half = 0.25 * Math.PI / 180;
  rig.cameras[kTurned].orientation = [Math.cos(half), 0, Math.sin(half), 0];
  await writeFile(file, JSON.stringify(rig));
  const viewer = await open('--monitor', '1', '--focus-mode', 'auto'), { served, page } = viewer;
  const { name } = rig.cameras[kTurned];
  await until(async () => (await words(page)).includes(`${name}: direction differs`), `${name} stands out`);
  await until(async () => await turns(page) > 75, 'three rounds');
  const said = await words(page);
  console.log(`# ${said.replaceAll('\n', '\n# ')}`);
  expect(said.match(/dB, gain/g).length === 1, `one alone: ${said}`);
  expect(/cameras predicted, \d+\.\d to \d+\.\d dB/.test(said) && /depth search in one of/.test(said), said);
  const report = await (await fetch(new URL('monitor.json', served.url))).json();
  expect(report.cameras[kTurned].fault === 'direction' && report.cameras[0].psnr === null, JSON.stringify(report));
  const metrics = await (await fetch(new URL('metrics', served.url))).text();
  expect(metrics.includes(`lightfield_camera_suspect{camera="${name}",fault="direction"} 1`), metrics);
  expect(/^lightfield_camera_psnr_db\{camera="\w+"\} \d/m.test(metrics), metrics);
  const drawn = await page.evaluate(() => {
    const { canvas } = inside().monitor;
    return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.filter(value => value).length;
  });
  expect(drawn > 20000, `the map is not drawn: ${drawn}`);
  await page.screenshot({ path: join(artefacts, 'monitor.png') });
  await page.keyboard.press('m');
  expect(await page.evaluate(() => inside().monitor.box.hidden), 'm hides it');
  await closeClean(viewer.page, viewer.served);
}

async function goodCamerasAreNotSuspected() {
  await writeFile(file, good);
  const viewer = await open('--monitor', '1', '--focus-mode', 'plane');
  await until(async () => await turns(viewer.page) > 60, 'two rounds');
  const said = await words(viewer.page);
  expect(said.includes('none stands out') && said.includes('the viewer’s plane'), said);
  await closeClean(viewer.page, viewer.served);
}

async function noPanelWithoutMonitor() {
  const viewer = await open(), { page } = viewer;
  await page.waitForFunction(() => inside().statistics.monitored === false);
  expect(!await page.getByRole('button', { name: 'Quality' }).count(), 'a button for nothing');
  await page.keyboard.press('m');
  expect(await page.evaluate(() => inside().monitor.box.hidden), 'a panel of nothing');
  expect(Number.isNaN(await viewer.served.metric('monitor_bytes_total')), 'metrics of what is not done');
  await closeClean(viewer.page, viewer.served);
}

await runTests([
  ['the panel names a misaligned camera', namesTheMisalignedCamera],
  ['good cameras are not suspected', goodCamerasAreNotSuspected],
  ['without --monitor there is no panel', noPanelWithoutMonitor],
]);
