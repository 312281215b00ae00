// SPDX-License-Identifier: LGPL-2.1-or-later
// <lightfield-viewer> in an application of React in strict mode (react_page.tsx), with TypeScript and a bundler.
import { execFile } from 'node:child_process';
import { cp, mkdir, readFile, rm, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { artefacts, expect, launchBrowser, makeRig, openPage, patience, runTests, serve, source, until } from './harness.mjs';
import { site } from './pages.mjs';

const run = promisify(execFile), work = join(artefacts, 'react');

// The application, from the package as it is published.
async function built() {
  await rm(work, { recursive: true, force: true });
  const installed = join(work, 'node_modules/lightfield-viewer');
  await mkdir(installed, { recursive: true });
  const { files } = JSON.parse(await readFile(join(source, 'web/package.json')));
  for (const file of [...files, 'package.json']) await cp(join(source, 'web', file), join(installed, file), { recursive: true });
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
  const served = await serve('--rig', join(await makeRig('4x4'), 'rig.json'), '--connects', '100', '--focus-on', 'plane', '--origin', '*');
  const mine = await site({ '/': `<!doctype html><html lang="en"><meta charset="utf-8"><title>mine</title>
    <div id="root"></div><script type="module" src="page.js"></script>` }, work);
  const page = await openPage(await launchBrowser(), `${mine.origin}?whep=${encodeURIComponent(`${served.url}whep`)}`);
  page.on('console', message => ['error', 'warning'].includes(message.type()) && page.problems.push(message.text()));
  const told = () => page.evaluate(() => app.told), yaw = () => page.evaluate(() => app.element.view.yaw);
  const render = props => page.evaluate(props => app.render(props), props);
  const isAt = (wanted, what) => until(async () => Math.abs(await yaw() - wanted) < 1e-6, what);

  await page.waitForFunction(() => globalThis.app?.element?.loaded, null, { timeout: patience })
    .catch(async error => { throw new Error(`no picture: ${await page.evaluate(() => document.body.innerHTML)}; ${page.problems}; ${error.message}`); });
  await isAt(1, 'the prop says where to begin');
  expect((await told()).includes('first 320x240'), `its listeners hear: ${await told()}`);
  await page.getByText(/^Focus: \d/).waitFor();
  await page.getByRole('application', { name: 'Mine' }).waitFor();
  expect(await served.metric('viewers_total') === 1, 'in strict mode there is one stream');

  // Rendered again: nobody is thrown back. Other props: it goes there.
  await page.evaluate(() => app.element.setView({ yaw: -2 }));
  const renders = await page.evaluate(() => app.renders);
  for (let i = 0; i < 10; i++) await render({ src: `${served.url}whep` });
  expect(await page.evaluate(() => app.renders) >= renders + 10, 'it has been rendered');
  await isAt(-2, 'rendered again it stays');
  await render({ yaw: 2, alt: undefined });
  await isAt(2, 'another prop is another view');
  expect((await told()).includes('script 2'), `told by a script: ${await told()}`);
  expect(await page.evaluate(() => app.element.alt) === null, 'a prop that is gone is an attribute that is gone');

  // Moved it goes on with the same stream.
  await render({ last: true });
  expect(await page.evaluate(() => document.querySelector('figure').previousElementSibling.localName === 'h1'), 'it has moved');
  const frames = () => page.evaluate(() => inside(app.element).video.getVideoPlaybackQuality().totalVideoFrames);
  const before = await frames();
  await until(async () => await frames() > before + 3, 'moved it goes on');
  expect(await served.metric('viewers_total') === 1, 'with the same stream');

  // Taken away it leaves; put there again it is another element, at the prop's view.
  await render({ shown: false });
  await until(async () => await served.metric('viewers') === 0, 'unmounted it leaves');
  const gone = await page.evaluate(() => (globalThis.first = app.element).isConnected);
  expect(!gone, 'it is off the page');
  await render({ shown: true, eyes: 'side' });
  await page.waitForFunction(() => app.element !== first && app.element.loaded, null, { timeout: patience });
  await isAt(2, 'mounted again it is where the prop says');
  expect(await page.evaluate(() => inside(app.element).twoEyes), 'with two eyes');
  await render({ src: 'http://127.0.0.1:9/whep' });
  await until(async () => (await told()).some(text => /^error \d/.test(text)), 'errors are heard');
  await page.getByText('My own words').waitFor();
  expect(!(await told()).some(text => /NaN|undefined/.test(text)), `details are typed: ${await told()}`);
  const problems = page.problems.filter(text => !/ERR_UNSAFE_PORT|ERR_CONNECTION|Failed to load resource/.test(text));
  expect(!problems.length, problems.join('; '));
  await page.context().close();
  await served.stop();
  mine.close();
}

await runTests([['an application of React', application]]);
