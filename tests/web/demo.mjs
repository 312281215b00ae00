// SPDX-License-Identifier: LGPL-2.1-or-later
// Waits for the first picture of lf-serve --demo, which runs at port 8080. LF_SINCE: when the installation began, in
// seconds since 1970.
import { artefacts, launchBrowser, openShown, runTests, until } from './harness.mjs';
import { join } from 'node:path';

const url = 'http://127.0.0.1:8080/';

async function firstPicture() {
  const browser = await launchBrowser();
  await until(() => fetch(url).catch(() => false), 'lf-serve answers');
  const page = await openShown(browser, url, { width: 800, height: 480 }, 1);
  console.log(`# a picture in the browser, ${Math.round(Date.now() / 1000 - process.env.LF_SINCE)} s after the installation began`);
  await page.screenshot({ path: join(artefacts, 'demo.png') });
}

await runTests([['a picture of the demo', firstPicture]]);
