// SPDX-License-Identifier: LGPL-2.1-or-later
// A flight that is published to Debian's Janus and watched in headless Chromium. In a network of its own.
import { spawn } from 'node:child_process';
import { copyFile, mkdir, readFile, writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { artefacts, compare, expect, launchBrowser, makeRig, openPage, patience, rendered, runTests, source, start,
  until, viewFile } from './harness.mjs';

const folder = await makeRig('4x4');
const rig = join(folder, 'rig.json');
const state = { x: 0.02, y: -0.01, z: 0, yaw: 2, pitch: 1, roll: 0, fov: 30, 'focus-distance': 1.2 };
const size = { width: 400, height: 300 };
const publisher = join(source, 'pipelines/publish-janus.sh');

// The mountpoint is the one that people are told to use.
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
  // Two that watch, the second when it has long begun, cost the publisher nothing.
  for (const who of ['first', 'second']) {
    const page = await openPage(browser, url, size);
    await page.waitForFunction(() => document.querySelector('video').getVideoPlaybackQuality().totalVideoFrames > 45,
      null, { timeout: patience }).catch(async error => {
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
  await until(async () => /No such mountpoint/.test(await wrong.textContent('#status')), 'a wrong number is told');
  publishing.kill('SIGTERM');
  site.close();
}

// What a WHIP client is given is a pipeline that makes RTP packets.
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

await runTests([
  ['a flight published to Janus', watched],
  ['a pipeline for a WHIP client', printed],
]);
