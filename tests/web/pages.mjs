// SPDX-License-Identifier: LGPL-2.1-or-later
// Other people's sites: pages and files from an origin of their own.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';

const kTypes = { '.js': 'text/javascript', '.html': 'text/html', '.css': 'text/css' };

// `pages`: texts by path. Other paths are files of `root`, if there is one. `host` is another origin than its namesake's.
// `headers` are those of every answer.
export async function site(pages, root, host = '127.0.0.1', headers = {}) {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, 'http://site');
    try {
      const text = pages[pathname] ?? (root && await readFile(join(root, normalize(pathname))));
      if (text === null || text === undefined) throw new Error('not here');
      response.setHeader('Content-Type', kTypes[extname(pathname)] ?? 'text/html');
      for (const [name, value] of Object.entries(headers)) response.setHeader(name, value);
      response.end(text);
    } catch {
      response.statusCode = 404;
      response.end('not here');
    }
  });
  await new Promise(done => server.listen(0, '127.0.0.1', done));
  return { origin: `http://${host}:${server.address().port}`, close: () => server.close() };
}
