// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve behind nginx, by the lines of docs/guide-network.md. In a network of its own.
import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { expect, launchBrowser, makeRig, newPage, openPage, runTests, serve, setView, shown, source, start, until } from './harness.mjs';

const folder = await makeRig('4x4');
const guide = await readFile(join(source, 'docs/guide-network.md'), 'utf8');
const [, documented] = guide.match(/```nginx\n([\s\S]*?)```/), [, options] = guide.match(/pipelines\/web\.sh (--proxy .*)\n/);
const name = options.match(/--host (\S+)/)[1], port = documented.match(/proxy_pass \S*:(\d+)/)[1], [, prefix] = documented.match(/location (\S+)/);
const browser = await launchBrowser(`--host-resolver-rules=MAP ${name} 10.77.0.1`);

// Beside somebody else's page, on the port of the web.
async function startNginx() {
  const work = join(folder, 'nginx');
  await mkdir(work);
  const paths = ['client_body', 'proxy', 'fastcgi', 'uwsgi', 'scgi'].map(what => `${what}_temp_path ${work}/${what};`).join('\n');
  await writeFile(join(work, 'nginx.conf'), `
    daemon off; master_process off; user root; pid ${work}/pid; error_log ${work}/errors;
    events {}
    http { access_log ${work}/asked; ${paths}
      server { listen 80; server_name ${name};
        location = / { return 200 'another page'; }
        ${documented} } }`);
  start('nginx', '-p', work, '-e', join(work, 'errors'), '-c', join(work, 'nginx.conf'));
  await until(async () => (await fetch('http://127.0.0.1/').catch(() => ({}))).ok, `nginx runs: ${await readFile(join(work, 'errors'), 'utf8').catch(() => '')}`);
  return { asked: async () => (await readFile(join(work, 'asked'), 'utf8')).trim().split('\n') };
}

async function underItsPath() {
  const nginx = await startNginx(), size = { width: 320, height: 240 };
  const token = join(folder, 'token');
  await writeFile(token, 'sesame', { mode: 0o600 });
  const served = await serve('--rig', join(folder, 'rig.json'), '--port', port, ...options.split(' '), '--token-file', token,
    '--address-views', '1');
  const page = await openPage(browser, `http://${name}${prefix}`, size);
  await page.getByLabel('Token').fill('sesame');
  await page.getByLabel('Token').press('Enter');
  await shown(page, 5);
  await setView(page, { yaw: 2 });
  await page.keyboard.press('c');
  await page.waitForFunction(() => inside().cameras.array);

  // Each address has its own seats: it is told whose browser it is, whatever the browser says.
  const second = await newPage(browser, size);
  await second.setExtraHTTPHeaders({ 'X-Forwarded-For': '192.0.2.1' });
  await second.goto(`http://${name}${prefix}#token=sesame`);
  await until(async () => /at this address/.test(await second.getByRole('status').textContent()), 'its address has no more views');
  expect(/^10\.77\.0\.1: 429/m.test(served.said), `of its address:\n${served.said}`);
  await second.context().close();

  // Its session has the path, too. DTLS, which ends beside nginx, may be faster.
  await page.evaluate(() => document.querySelector('lightfield-viewer').pause());
  await until(async () => /closes: /.test(served.said) && (await nginx.asked()).some(line => line.includes(`"DELETE ${prefix}whep/`)), 'it leaves');
  const elsewhere = (await nginx.asked()).filter(line => line.includes('10.77.0.1') && !line.includes(` ${prefix}`));
  expect(!elsewhere.length, elsewhere.join('\n'));
  expect(!page.problems.length, page.problems.join('; '));
  await page.context().close();
  await served.stop();
}

await runTests([['under a path of nginx', underItsPath]]);
