// SPDX-License-Identifier: LGPL-2.1-or-later
// A viewer of an lf-serve that another script has started, at LF_URL or at port 8080. LF_SINCE: when the installation
// began, in seconds since 1970. LF_KILL: a command of the shell that kills the replica $1, which the viewer then leaves.
import { execFile } from 'node:child_process';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { artefacts, expect, launchBrowser, openShown, resumed, runTests, shown, until } from './harness.mjs';

const { LF_URL: url = 'http://127.0.0.1:8080/', LF_SINCE: since, LF_KILL: command } = process.env;
let page;

async function firstPicture() {
  const browser = await launchBrowser();
  await until(() => fetch(url).catch(() => false), 'lf-serve answers');
  page = await openShown(browser, url, { width: 800, height: 480 }, 1);
  if (since) console.log(`# a picture in the browser, ${Math.round(Date.now() / 1000 - since)} s after the installation began`);
  await page.screenshot({ path: join(artefacts, 'demo.png') });
}

async function resumes() {
  await shown(page, 10);
  const { noticed, seen, first, second } =
    await resumed(page, replica => promisify(execFile)('sh', ['-c', command, 'sh', replica]));
  console.log(`# noticed ${Math.round(noticed)} ms after the last picture, pictures of another server after ${Math.round(seen)} ms`);
  expect(first !== second, `${first}, then ${second}`);
}

await runTests([['a picture', firstPicture], ...command ? [['pictures of another replica', resumes]] : []]);
