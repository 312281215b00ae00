// SPDX-License-Identifier: LGPL-2.1-or-later
// STUN and TURN servers, as attributes and the Link headers of WHEP name them.

// "stun:stun.example.org turn:USER:PASSWORD@turn.example.org:3478?transport=udp", separated by white space; user and
// password percent-encoded.
export function serversIn(text) {
  return (text ?? '').split(/\s+/).filter(Boolean).map(word => {
    const [, scheme, user, password, host] = word.match(/^(stuns?|turns?):(?:([^:@]*):([^@]*)@)?(.+)$/) ?? [];
    if (!scheme) throw new TypeError(`ice-servers: ${word} is not stun:HOST or turn:USER:PASSWORD@HOST`);
    const secret = user && { username: decodeURIComponent(user), credential: decodeURIComponent(password) };
    return { urls: `${scheme}:${host}`, ...secret };
  });
}

// Of a Link header: <turn:turn.example.org>; rel="ice-server"; username="USER"; credential="PASSWORD", ...
export function serversInLinks(header) {
  const servers = [];
  for (const [, urls, parameters] of (header ?? '').matchAll(/<([^>]*)>((?:\s*;\s*[\w-]+\s*=\s*(?:"(?:[^"\\]|\\.)*"|[^\s;,]+))*)/g)) {
    const value = name => {
      const [, quoted, bare] = parameters.match(new RegExp(`;\\s*${name}\\s*=\\s*(?:"((?:[^"\\\\]|\\\\.)*)"|([^\\s;,]+))`)) ?? [];
      return quoted?.replace(/\\(.)/g, '$1') ?? bare;
    };
    if (value('rel') !== 'ice-server' || !/^(stun|turn)s?:/.test(urls)) continue;
    const username = value('username'), credential = value('credential');
    servers.push({ urls, ...username !== undefined && { username, credential } });
  }
  return servers;
}
