// SPDX-License-Identifier: LGPL-2.1-or-later
// Identifying cameras: the pages of lf-rig identify and of lf-serve, in headless Chromium. A blinking
// camera simulates a camera that a user waves at.
import { execFile, spawn } from 'node:child_process';
import { once } from 'node:events';
import { readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { promisify } from 'node:util';
import { artefacts, expect, launchBrowser, makeFolder, patience, runTests, serve, until } from './harness.mjs';

const tool = join(process.env.LF_TOOLS_DIR, 'lf-rig');
const folder = await makeFolder(), file = join(folder, 'rig.json');
const browser = await launchBrowser();
const kQuiet = 'videotestsrc is-live=true pattern=smpte ! video/x-raw,framerate=5/1';
const kWaved = 'videotestsrc is-live=true pattern=blink ! video/x-raw,framerate=5/1';

async function makeRig() {
  await promisify(execFile)(tool, ['new', '--grid', '2x2', '--pitch', '0.1', '--fov', '60', '--width', '64', '--height',
    '48', '--out', file]);
  const rig = JSON.parse(await readFile(file, 'utf8'));
  [kQuiet, kWaved, kQuiet, 'nosuchelement property=1'].forEach((source, i) => { rig.cameras[i].source = source; });
  await writeFile(file, JSON.stringify(rig));
}

const wavedAt = async () =>
  JSON.parse(await readFile(file, 'utf8')).cameras.findIndex(({ source }) => source.includes('blink'));

// Starts an lf-rig command that serves the page until it is stopped or has finished.
async function start(...command) {
  const child = spawn(tool, command, { stdio: ['ignore', 'pipe', 'inherit'] });
  process.on('exit', () => child.kill('SIGKILL'));
  const url = await new Promise((resolve, reject) => {
    createInterface({ input: child.stdout }).on('line', line => {
      const match = line.match(/at (http\S+\/)/);
      if (match) resolve(match[1]);
    });
    child.on('exit', () => reject(new Error(`lf-rig ${command[0]} ended`)));
  });
  const stop = async () => {
    child.removeAllListeners('exit');
    const ended = once(child, 'exit');
    child.kill('SIGTERM');
    const [status] = await ended;
    expect(status === 0, `exit status ${status}`);
  };
  return { url, stop };
}
const identify = () => start('identify', file, '--trust-rig', '--port', '0');

async function open(url) {
  const page = await browser.newPage({ viewport: { width: 800, height: 600 } });
  page.problems = [];
  page.on('pageerror', error => page.problems.push(error.message));
  await page.goto(url);
  await page.locator('.tile').nth(3).waitFor({ timeout: patience });
  return page;
}
const lit = page => page.evaluate(() => [...document.querySelectorAll('.tile.lit')].map(tile => Number(tile.dataset.id)));

async function identifiesAndSwaps() {
  await makeRig();
  const program = await identify(), page = await open(program.url);
  await until(async () => (await lit(page)).join() === '1', 'the camera that is waved at lights up, alone');
  const ill = page.locator('.tile.ill');
  await until(async () => await ill.count() === 1, 'one is ill');
  await until(async () => (await ill.textContent()).includes('nosuchelement'), 'the page says why');
  expect((await page.locator('[data-id="0"]').textContent()).includes('cam_00_00'), 'names');
  await until(async () => /[45]\.\d frames\/s/.test(await page.locator('[data-id="0"]').textContent()), 'rates');
  const coloured = await page.evaluate(() => {
    const canvas = document.querySelector('[data-id="0"] canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value, i) => i % 4 === 0 && Math.abs(value - data[i + 2]) > 100);
  });
  expect(coloured, 'the bars are seen');
  await page.screenshot({ path: join(artefacts, 'identify.png') });

  await page.locator('[data-id="1"]').dragTo(page.locator('[data-id="2"]'));
  await until(async () => await wavedAt() === 2, 'the rig file has it where it was dragged to');
  await until(async () => (await lit(page)).join() === '2', 'and there it lights up');
  for (const id of [2, 0]) {
    await page.locator(`[data-id="${id}"]`).focus();
    await page.keyboard.press('Enter');
  }
  await until(async () => await wavedAt() === 0, 'keys do it, too');
  const rig = JSON.parse(await readFile(file, 'utf8'));
  expect(rig.cameras.map(({ id, name }) => `${id} ${name}`).join() ===
    '0 cam_00_00,1 cam_00_01,2 cam_01_00,3 cam_01_01', 'places keep their names');
  expect(!page.problems.length, page.problems.join('; '));
  await page.close();
  await program.stop();
}

async function rejectsOtherOrigins() {
  await makeRig();
  const program = await identify(), before = await readFile(file, 'utf8');
  const swap = headers =>
    fetch(new URL('swap', program.url), { method: 'POST', headers, body: JSON.stringify({ a: 0, b: 1 }) });
  const json = { 'Content-Type': 'application/json' };
  expect((await swap({ ...json, Origin: 'https://example.org' })).status === 403, 'another site');
  expect((await swap({ 'Content-Type': 'text/plain' })).status === 415, 'a form');
  for (const body of ['{', '{}', '{"a":0}', '{"a":-1,"b":1}', '{"a":0,"b":"1"}', '[]'])
    expect((await fetch(new URL('swap', program.url), { method: 'POST', headers: json, body })).status === 400, body);
  const unknown = await fetch(new URL('swap', program.url),
    { method: 'POST', headers: json, body: '{"a":0,"b":77}' });
  expect(unknown.status === 409 && (await unknown.json()).problem.includes('no camera with this id'), 'an id of no camera');
  expect((await fetch(new URL('nothing', program.url))).status === 404, 'nothing else');
  expect(await readFile(file, 'utf8') === before, 'the rig file is as it was');
  expect((await swap(json)).status === 200 && await wavedAt() === 0, 'its own');
  await program.stop();
}

async function servedBesideTheLightField() {
  await makeRig();
  const served = await serve('--rig', file, '--trust-rig'), page = await open(new URL('cameras.html', served.url).href);
  await until(async () => (await lit(page)).join() === '1', 'the camera that is waved at lights up');
  await until(async () => (await page.locator('.tile.ill').textContent()).includes('nosuchelement'), 'who is ill');
  expect(await page.locator('[data-id="0"]').getAttribute('draggable') === 'false', 'nothing is changed from here');
  expect((await fetch(new URL('swap', served.url), { method: 'POST', body: '{"a":0,"b":1}' })).status === 405, 'no swap');
  expect(!page.problems.length, page.problems.join('; '));
  await page.close();
  await served.stop();
}

async function fitsWindowsOfAllWidths() {
  await promisify(execFile)(tool, ['new', '--grid', '8x8', '--pitch', '0.1', '--fov', '60', '--width', '64', '--height',
    '48', '--out', file]);
  const rig = JSON.parse(await readFile(file, 'utf8'));
  for (const camera of rig.cameras) camera.source = kQuiet;
  rig.cameras[9].source = 'nosuchelement property=1';
  rig.cameras[17].name = 'the_camera_beside_the_entrance';
  await writeFile(file, JSON.stringify(rig));
  const program = await identify(), page = await open(program.url);
  await until(async () => await page.locator('.tile.ill').count() > 0, 'a long reason');
  for (const width of [390, 800, 1280, 1920]) {
    await page.setViewportSize({ width, height: 720 });
    const { cut, overlaps, scrolls } = await page.evaluate(() => {
      const tiles = [...document.querySelectorAll('.tile')], places = tiles.map(tile => tile.getBoundingClientRect());
      const texts = tiles.flatMap(tile => [...tile.querySelectorAll('span')]);
      return {
        cut: texts.filter(text => text.scrollWidth > text.clientWidth).map(text => text.textContent),
        overlaps: places.filter(({ left, top }, i) => i > 0 && left < places[i - 1].right && top < places[i - 1].bottom).length,
        scrolls: document.documentElement.scrollWidth > innerWidth,
      };
    });
    expect(!cut.length && !overlaps && !scrolls,
      `${width} pixels: cut off: ${cut.slice(0, 3).join(', ')}; ${overlaps} tiles overlap; the page scrolls: ${scrolls}`);
  }
  await page.close();
  await program.stop();
}

async function guidesTheLight() {
  const run = promisify(execFile), lights = join(folder, 'lights');
  await run(tool, ['new', '--grid', '2x2', '--pitch', '0.1', '--fov', '45', '--width', '320', '--height', '240', '--out', file]);
  await run(join(process.env.LF_TOOLS_DIR, 'lf-scene'),
    ['lights', '--rig', file, '--out', lights, '--seconds', '6', '--framerate', '15']);
  const filmed = join(lights, 'rig.json'), rig = JSON.parse(await readFile(filmed, 'utf8'));
  rig.cameras[3].source = 'videotestsrc is-live=true pattern=black ! video/x-raw,width=320,height=240,framerate=15/1';
  await writeFile(filmed, JSON.stringify(rig));
  const program = await start('record', filmed, '--out', join(folder, 'films'), '--seconds', '60', '--lights', '2', '--page', '0');
  const page = await open(program.url), said = page.locator('#told');
  await until(async () => (await said.textContent()).startsWith('Left and right refer to the images'), 'how it begins');
  await until(async () => /^The light has covered \d+ % of the images\. Next: /.test(await said.textContent()), 'what is next');
  const health = id => page.locator(`[data-id="${id}"] .health`).textContent();
  await until(async () => /left|right|middle/.test(await health(3)), 'where no light came it is to go');
  const green = id => page.evaluate(id => {
    const canvas = document.querySelector(`[data-id="${id}"] canvas`);
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return data.filter((value, i) => i % 4 === 1 && value > data[i - 1] + 30).length / (data.length / 4);
  }, id);
  await until(async () => await green(0) > 0.1, 'where it came is green');
  expect(await green(3) < 0.01, 'and nowhere else');
  await page.screenshot({ path: join(artefacts, 'record.png') });
  expect((await fetch(new URL('swap', program.url), { method: 'POST', body: '{"a":0,"b":1}' })).status === 405, 'no swap');
  expect(!page.problems.length, page.problems.join('; '));
  await page.close();
  await program.stop();
}

await runTests([
  ['a waved-at camera lights up, and dragging swaps cameras', identifiesAndSwaps],
  ['only the page may change the rig', rejectsOtherOrigins],
  ['lf-serve has the same page', servedBesideTheLightField],
  ['no text of a large array is cut off', fitsWindowsOfAllWidths],
  ['a recording guides the light', guidesTheLight],
]);
