// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve with another server, given by the argument: haproxy, janus, nginx or turnserver. Runs in a separate network.
import { execFile, spawn } from 'node:child_process';
import { once } from 'node:events';
import { copyFile, mkdir, readFile, writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { promisify } from 'node:util';
import { artefacts, closeClean, compare, expect, launchBrowser, makeRig, newPage, openPage, rendered,
  resumed, runTests, serve, setView, shown, source, start, until, viewFile } from './harness.mjs';

async function janus() {
  const folder = await makeRig('4x4');
  const rig = join(folder, 'rig.json');
  const state = { x: 0.02, y: -0.01, z: 0, yaw: 2, pitch: 1, roll: 0, fov: 30, 'focus-distance': 1.2 };
  const size = { width: 400, height: 300 };
  const publisher = join(source, 'pipelines/publish-janus.sh');

  // Uses the mountpoint from the documentation.
  async function startJanus() {
    const config = join(folder, 'janus');
    await mkdir(config);
    await writeFile(join(config, 'janus.jcfg'), `
    general: { debug_level = 4, admin_secret = "x", session_timeout = 30 }
    media: { rtp_port_range = "20000-20100" }
    plugins: { disable = "libjanus_audiobridge.so,libjanus_duktape.so,libjanus_echotest.so,libjanus_lua.so,\
libjanus_nosip.so,libjanus_recordplay.so,libjanus_sip.so,libjanus_textroom.so,libjanus_videocall.so,\
libjanus_videoroom.so,libjanus_voicemail.so" }
    transports: { disable = "libjanus_mqtt.so,libjanus_nanomsg.so,libjanus_pfunix.so,libjanus_rabbitmq.so,\
libjanus_websockets.so" }`);
    await writeFile(join(config, 'janus.transport.http.jcfg'),
      'general: { json = "compact", base_path = "/janus", http = true, port = 8088, https = false }');
    await copyFile(join(source, 'pipelines/janus/janus.plugin.streaming.jcfg'),
      join(config, 'janus.plugin.streaming.jcfg'));
    start('janus', '--configs-folder', config, '--disable-colors');
    await until(async () => (await fetch('http://localhost:8088/janus/info').catch(() => ({}))).ok, 'Janus runs');
  }

  async function watched() {
    const views = join(folder, 'still.json');
    await writeFile(views, JSON.stringify({ format: 'lightfield-views', version: 1, views: [viewFile(state, size)] }));
    await startJanus();
    const publishing = start(publisher, '--rig', rig, '--set', 'focus=plane', '--path', views);
    const site = createServer(async (request, response) => {
      response.setHeader('Content-Type', 'text/html');
      response.end(await readFile(join(source, 'pipelines/janus/watch.html')));
    });
    await new Promise(done => site.listen(0, '127.0.0.1', done));
    const url = `http://localhost:${site.address().port}/?janus=http://localhost:8088/janus`;
    const browser = await launchBrowser();
    for (const who of ['first', 'second']) {
      const page = await openPage(browser, url, size);
      const frames = () => document.querySelector('video').getVideoPlaybackQuality().totalVideoFrames > 45;
      await page.waitForFunction(frames).catch(async error => {
        throw new Error(`no picture: ${await page.textContent('#status')}; ${page.problems}; ${error.message}`);
      });
      const png = await page.evaluate(() => {
        const video = document.querySelector('video'), canvas = document.createElement('canvas');
        Object.assign(canvas, { width: video.videoWidth, height: video.videoHeight });
        canvas.getContext('2d').drawImage(video, 0, 0);
        return canvas.toDataURL('image/png').split(',')[1];
      });
      const { psnr, mean } = await compare(page, Buffer.from(png, 'base64'), await rendered(folder, state, size));
      console.log(`# the ${who} sees ${psnr.toFixed(1)} dB against lf-render`);
      expect(psnr >= 30 && mean > 20, `the ${who} sees ${psnr.toFixed(1)} dB`);
      await page.screenshot({ path: join(artefacts, 'janus.png') });
      expect(await page.textContent('#status') === '', 'the status is gone');
    }
    const wrong = await openPage(browser, `${url}&id=7`, size);
    await until(async () => /No such mountpoint/.test(await wrong.textContent('#status')), 'a wrong number is reported');
    publishing.kill('SIGTERM');
    site.close();
  }

  async function printed() {
    const views = join(folder, 'short.json');
    await writeFile(views, JSON.stringify({ format: 'lightfield-views', version: 1, views: [viewFile(state, size)] }));
    for (const codec of ['h264', 'vp8']) {
      const text = await new Promise(done => {
        const child = spawn(publisher, ['--rig', rig, '--path', views, '--codec', codec, '--print']);
        let said = '';
        child.stdout.on('data', data => said += data);
        child.on('exit', () => done(said.trim()));
      });
      expect(text.endsWith(`application/x-rtp,media=video,encoding-name=${codec.toUpperCase()},payload=96`), text);
      const status = await new Promise(done =>
        spawn('gst-launch-1.0', ['-q', ...text.split(' '), '!', 'fakesink', 'num-buffers=30'], { stdio: 'inherit' })
          .on('exit', done));
      expect(status === 0, `gst-launch-1.0 ${text} ends with ${status}`);
    }
  }

  return [
    ['a flight published to Janus', watched],
    ['a pipeline for a WHIP client', printed],
  ];
}

// lf-serve behind nginx, configured as in docs/guides/browser.md.
async function nginx() {
  const folder = await makeRig('4x4');
  const guide = await readFile(join(source, 'docs/guides/browser.md'), 'utf8');
  const [, documented] = guide.match(/```nginx\n([\s\S]*?)```/), [, options] = guide.match(/pipelines\/web\.sh (--proxy .*)\n/);
  const name = options.match(/--host (\S+)/)[1], port = documented.match(/proxy_pass \S*:(\d+)/)[1], [, prefix] = documented.match(/location (\S+)/);
  const browser = await launchBrowser(`--host-resolver-rules=MAP ${name} 10.77.0.1`);

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

    const second = await newPage(browser, size);
    await second.setExtraHTTPHeaders({ 'X-Forwarded-For': '192.0.2.1' });
    await second.goto(`http://${name}${prefix}#token=sesame`);
    await until(async () => /at this address/.test(await second.getByRole('status').textContent()), 'its address has no more views');
    expect(/^10\.77\.0\.1: 429/m.test(served.said), `of its address:\n${served.said}`);
    await second.context().close();

    // The session uses the path as well. DTLS, which bypasses nginx, may be faster.
    await page.evaluate(() => document.querySelector('lightfield-viewer').pause());
    await until(async () => /closes: /.test(served.said) && (await nginx.asked()).some(line => line.includes(`"DELETE ${prefix}whep/`)), 'it leaves');
    const elsewhere = (await nginx.asked()).filter(line => line.includes('10.77.0.1') && !line.includes(` ${prefix}`));
    expect(!elsewhere.length, elsewhere.join('\n'));
    await closeClean(page, served);
  }

  return [['under a path of nginx', underItsPath]];
}

async function turnserver() {
  const run = promisify(execFile);
  // an address and ports that differ from the browser's and the server's
  const kTurn = '10.77.0.2', kRelayed = '20000:20063';

  const iptables = (...words) => run('iptables', words);
  // Allows UDP only to the ICE server, and between its relay ports.
  async function onlyByTurn(...between) {
    await iptables('-F', 'INPUT');
    for (const rule of [['--dport', '3478'], ['--sport', '3478'], ...between])
      await iptables('-A', 'INPUT', '-p', 'udp', ...rule, '-j', 'ACCEPT');
    await iptables('-A', 'INPUT', '-p', 'udp', '-j', 'DROP');
  }

  // Before the browser starts, because a new address makes it drop its downloads.
  await run('ip', ['addr', 'add', `${kTurn}/24`, 'dev', 'host']);
  const folder = await makeRig('4x4'), browser = await launchBrowser();
  const common = ['-n', '--listening-ip', kTurn, '--relay-ip', kTurn, '--min-port', '20000', '--max-port', '20063', '--realm', 'example.org',
    '--no-tls', '--no-dtls', '--no-cli', '--log-file', 'stdout', '--pidfile', join(folder, 'turn.pid')];

  const pair = page => page.evaluate(async () => {
    const stats = [...(await inside().stream.connection.peer.getStats()).values()];
    const { selectedCandidatePairId } = stats.find(({ type }) => type === 'transport');
    const pair = stats.find(({ id }) => id === selectedCandidatePairId), end = id => stats.find(entry => entry.id === id);
    return { local: end(pair.localCandidateId).candidateType, remote: end(pair.remoteCandidateId).candidateType };
  });

  async function watched(ways, credentials, ...options) {
    const file = join(folder, 'credentials'), serverOptions = ['--rig', join(folder, 'rig.json'), '--media-address', 'any', '--ice-server',
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
    const ended = once(turn, 'exit');
    turn.kill('SIGKILL');
    await ended;
  }

  const relayOnly = () => {
    globalThis.RTCPeerConnection = class extends RTCPeerConnection {
      constructor(configuration) { super({ ...configuration, iceTransportPolicy: 'relay' }); }
    };
  };
  const kOneEnd = [['--sport', kRelayed], ['--dport', kRelayed]], kBothEnds = [['--sport', kRelayed, '--dport', kRelayed]];

  return [
    ['a secret; one end or both by TURN', () => watched([[kOneEnd, relayOnly], [kBothEnds]], 'secret', '--use-auth-secret',
      '--static-auth-secret', 'secret')],
    ['user and password', () => watched([[kOneEnd]], 'me pass', '--lt-cred-mech', '--user', 'me:pass')],
  ];
}

// Two lf-serve behind HAProxy with the configuration of pipelines/haproxy. The server of a viewer is killed.
async function haproxy() {
  const folder = await makeRig('4x4'), ports = { r1: 8081, r2: 8082 }, servers = {};
  for (const [replica, port] of Object.entries(ports))
    servers[replica] = await serve('--rig', join(folder, 'rig.json'), '--port', `${port}`, '--replica', replica, '--proxy',
      '127.0.0.1', '--focus-mode', 'plane');
  let text = await readFile(join(source, 'pipelines/haproxy/haproxy.cfg'), 'utf8');
  text = text.replace(/\n  server r[34] .*/g, '').replace(/(server (r.)) \S+:8080/g, (_, server, replica) => `${server} 127.0.0.1:${ports[replica]}`);
  await writeFile(join(folder, 'haproxy.cfg'), text);
  start('haproxy', '-db', '-f', join(folder, 'haproxy.cfg'));
  const url = 'http://127.0.0.1:8080/';
  await until(async () => (await fetch(url).catch(() => ({}))).ok, 'HAProxy runs');

  async function resumes() {
    const page = await openPage(await launchBrowser(), url, { width: 320, height: 240 });
    await shown(page, 30);
    const { noticed, seen, first, second } = await resumed(page, replica => servers[replica].kill());
    console.log(`# noticed ${Math.round(noticed)} ms after the last picture, pictures of another server after ${Math.round(seen)} ms`);
    expect(first !== second, `${first}, then ${second}`);
    await shown(page, 30);
  }

  return [['a viewer of a killed server sees pictures of another server', resumes]];
}

await runTests(await { haproxy, janus, nginx, turnserver }[process.argv[2]]());
