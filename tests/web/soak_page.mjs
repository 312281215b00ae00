// SPDX-License-Identifier: LGPL-2.1-or-later
// A browser for tests/soak.sh: repeatedly opens the page, moves the view and closes the page until the program ends.
// Prints a line for each page that has shown frames, and for each error.
import { launchBrowser, openPage } from './harness.mjs';

const url = process.env.LF_SOAK_URL, stays = 1000 * Number(process.env.LF_SOAK_STAYS), away = 1000 * Number(process.env.LF_SOAK_AWAY);
if (!url) process.exit(0);
const sleep = milliseconds => new Promise(done => setTimeout(done, milliseconds));
process.on('SIGTERM', () => process.exit(0));
const browser = await launchBrowser();
browser.on('disconnected', () => process.exit(0));
for (;;) {
  try {
    const page = await openPage(browser, url, { width: 320, height: 240 });
    const frames = () => page.evaluate(
      () => document.querySelector('lightfield-viewer')?.shadowRoot?.querySelector('video')
        .getVideoPlaybackQuality().totalVideoFrames ?? 0);
    for (let time = 0; time < stays; time += 1000) {
      await page.keyboard.press(['ArrowLeft', 'ArrowRight', '+', '-'][time / 1000 % 4]);
      await sleep(1000);
    }
    console.log(`shown ${await frames()} problems ${page.problems.length} ${page.problems.join('; ')}`);
    await page.context().close();
  } catch (error) {
    console.log(`failed: ${error.message.split('\n')[0]}`);
  }
  await sleep(away);
}
