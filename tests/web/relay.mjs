// SPDX-License-Identifier: LGPL-2.1-or-later
// A network that is not as good as loopback, between a page and its lf-serve.
import { createSocket } from 'node:dgram';
import { once } from 'node:events';

// Packets of the page's next connection go through a relay that loses `relay.loss` of the media, both ways.
export async function throughRelay(page) {
  const relay = { loss: 0, passed: 0, lost: 0, close: () => sockets.forEach(socket => socket.close()) };
  const sockets = [];
  await page.route('**/whep?*', async route => {
    const response = await route.fetch();
    let body = await response.text();
    const [, port] = body.match(/a=candidate:\S+ 1 UDP \d+ 127\.0\.0\.1 (\d+) typ host/i) ?? [];
    if (port) body = body.replaceAll(`127.0.0.1 ${port} typ`, `127.0.0.1 ${await open(Number(port))} typ`);
    await route.fulfill({ response, body });
  });
  // Two sockets: one that the browser takes for the server, one that the server takes for the browser.
  async function open(server) {
    const [near, far] = [createSocket('udp4'), createSocket('udp4')];
    sockets.push(near, far);
    let browser = 0;
    const lost = packet => {
      const media = packet[0] >= 128 && packet[0] < 192 && Math.random() < relay.loss;  // RFC 7983
      relay[media ? 'lost' : 'passed']++;
      return media;
    };
    near.on('message', (packet, { port }) => {
      browser = port;
      if (!lost(packet)) far.send(packet, server, '127.0.0.1');
    });
    far.on('message', packet => browser && !lost(packet) && near.send(packet, browser, '127.0.0.1'));
    for (const socket of [near, far]) {
      socket.bind(0, '127.0.0.1');
      await once(socket, 'listening');
    }
    return near.address().port;
  }
  return relay;
}
