// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve over HTTPS, with a certificate from a private authority, as on a server with public access.
import { execFile } from 'node:child_process';
import { createHash, X509Certificate } from 'node:crypto';
import { chmod, readFile, rename, writeFile } from 'node:fs/promises';
import { get } from 'node:https';
import { connect } from 'node:net';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { close, expect, launchBrowser, makeFolder, makeRig, openShown, runTests, serve, setView, until } from './harness.mjs';

const run = promisify(execFile);
const size = { width: 320, height: 240 };
const rig = await makeRig('2x2'), folder = await makeFolder();
const file = name => join(folder, name);
const key = ['-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes'];

await run('openssl', ['req', '-x509', ...key, '-days', '2', '-subj', '/CN=our authority', '-keyout', file('ca.key'), '-out', file('ca.pem'),
  '-addext', 'keyUsage=critical,keyCertSign']);
const authority = await readFile(file('ca.pem'));

async function issue(name, serial) {
  await run('openssl', ['req', ...key, '-subj', '/CN=lf-serve', '-keyout', file(`${name}.key`), '-out', file(`${name}.csr`)]);
  await writeFile(file('names'), 'subjectAltName=IP:127.0.0.1,DNS:localhost\nextendedKeyUsage=serverAuth\n');
  await run('openssl', ['x509', '-req', '-in', file(`${name}.csr`), '-CA', file('ca.pem'), '-CAkey', file('ca.key'), '-days', '1',
    '-set_serial', String(serial), '-extfile', file('names'), '-out', file(`${name}.crt`)]);
  await writeFile(file(`${name}.pem`), Buffer.concat([await readFile(file(`${name}.crt`)), authority]));
  await chmod(file(`${name}.key`), 0o600);
}

await issue('server', 1);
// Makes Chromium trust only certificates signed with this key.
const spki = new X509Certificate(authority).publicKey.export({ type: 'spki', format: 'der' });
const browser = await launchBrowser(`--ignore-certificate-errors-spki-list=${createHash('sha256').update(spki).digest('base64')}`);
const options = ['--rig', join(rig, 'rig.json'), '--tls-certificate', file('server.pem'), '--tls-key', file('server.key')];

function ask(url) {
  return new Promise((resolve, reject) => get(url, { ca: authority, agent: false }, response => {
    const { serialNumber } = response.socket.getPeerCertificate();
    response.resume().on('end', () => resolve({ status: response.statusCode, serial: Number(serialNumber) }));
  }).on('error', reject));
}

async function aPageOverHttps() {
  const served = await serve(...options);
  expect(served.url.startsWith('https://'), served.url);
  const page = await openShown(browser, served.url, size, 10);
  await setView(page, { yaw: 2 });
  expect(await page.evaluate(() => isSecureContext), 'it is a secure context');
  expect(!page.problems.length, page.problems.join('; '));

  // After renewal, current viewers continue and new viewers get the new certificate.
  const health = new URL('healthz', served.url);
  expect((await ask(health)).serial === 1, 'the first certificate');
  await issue('next', 2);
  for (const kind of ['pem', 'key']) await rename(file(`next.${kind}`), file(`server.${kind}`));
  await until(async () => (await ask(health)).serial === 2, `the new certificate:\n${served.said}`);
  await setView(page, { yaw: -2 });
  const second = await openShown(browser, served.url, size, 5);
  await second.context().close();
  await close(page, served);
}

async function stalledHandshakes() {
  const served = await serve(...options);
  const { port } = new URL(served.url);
  const stalled = [];
  for (let i = 0; i < 200; i++) {
    const socket = connect(port, '127.0.0.1', () => i % 2 && socket.write(Buffer.from([0x16, 3, 1, 2])));
    socket.on('error', () => {});
    stalled.push(socket);
  }
  const page = await openShown(browser, served.url, size, 5);
  for (const socket of stalled) socket.destroy();
  await close(page, served);
}

await runTests([['a page over HTTPS', aPageOverHttps], ['stalled handshakes', stalledHandshakes]]);
