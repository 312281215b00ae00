// SPDX-License-Identifier: LGPL-2.1-or-later
// Viewers whom no packet reaches but by coturn, as lf-serve --ice-server names it. In a network of its own.
import { execFile } from 'node:child_process';
import { once } from 'node:events';
import { writeFile } from 'node:fs/promises';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { expect, launchBrowser, makeRig, newPage, runTests, serve, shown, start, until } from './harness.mjs';

const run = promisify(execFile);
const kTurn = '10.77.0.2', kRelayed = '20000:20063';  // an address beside the browser's and the server's, and ports there

const iptables = (...words) => run('iptables', words);
// UDP comes to the ICE server alone: what passes otherwise is between ports that it relays for, at one end or at both.
async function onlyByTurn(...between) {
  await iptables('-F', 'INPUT');
  for (const rule of [['--dport', '3478'], ['--sport', '3478'], ...between])
    await iptables('-A', 'INPUT', '-p', 'udp', ...rule, '-j', 'ACCEPT');
  await iptables('-A', 'INPUT', '-p', 'udp', '-j', 'DROP');
}

// Before the browser starts: it drops what it is loading where an address comes.
await run('ip', ['addr', 'add', `${kTurn}/24`, 'dev', 'host']);
const folder = await makeRig('4x4'), browser = await launchBrowser();
const common = ['-n', '--listening-ip', kTurn, '--relay-ip', kTurn, '--min-port', '20000', '--max-port', '20063', '--realm', 'example.org',
  '--no-tls', '--no-dtls', '--no-cli', '--log-file', 'stdout', '--pidfile', join(folder, 'turn.pid')];

// How the selected pair reaches the server: types of both ends.
const pair = page => page.evaluate(async () => {
  const stats = [...(await inside().stream.connection.peer.getStats()).values()];
  const { selectedCandidatePairId } = stats.find(({ type }) => type === 'transport');
  const pair = stats.find(({ id }) => id === selectedCandidatePairId), end = id => stats.find(entry => entry.id === id);
  return { local: end(pair.localCandidateId).candidateType, remote: end(pair.remoteCandidateId).candidateType };
});

// What people do: a TURN server, the server's options, and a page that is opened.
async function watched(ways, credentials, ...options) {
  const file = join(folder, 'credentials'), serverOptions = ['--rig', join(folder, 'rig.json'), '--media', 'any', '--ice-server',
    `turn:${kTurn}`, '--ice-server', `stun:${kTurn}`, '--ice-credentials', file];
  await writeFile(file, credentials, { mode: 0o600 });
  const turn = start('turnserver', ...common, ...options);
  const served = await serve(...serverOptions);
  for (const [between, before] of ways) {
    await onlyByTurn(...between);
    const page = await newPage(browser, { width: 320, height: 240 }, { before });
    await page.goto(served.url);
    await shown(page, 10);
    const { local, remote } = await pair(page);
    console.log(`# ${local} to ${remote}`);
    expect(local === 'relay' || remote === 'relay', `${local} to ${remote}`);
    await page.context().close();
    await until(async () => await served.metric('viewers') === 0, 'it leaves');
  }
  await served.stop();
  const ended = once(turn, 'exit');  // the next one listens where this one did
  turn.kill('SIGKILL');
  await ended;
}

// Of a page that asks for nothing but relays.
const relayOnly = () => {
  globalThis.RTCPeerConnection = class extends RTCPeerConnection {
    constructor(configuration) { super({ ...configuration, iceTransportPolicy: 'relay' }); }
  };
};
const kOneEnd = [['--sport', kRelayed], ['--dport', kRelayed]], kBothEnds = [['--sport', kRelayed, '--dport', kRelayed]];

await runTests([
  ['a secret; one end or both by TURN', () => watched([[kOneEnd, relayOnly], [kBothEnds]], 'secret', '--use-auth-secret',
    '--static-auth-secret', 'secret')],
  ['user and password', () => watched([[kOneEnd]], 'me pass', '--lt-cred-mech', '--user', 'me:pass')],
]);
