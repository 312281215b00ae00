// SPDX-License-Identifier: LGPL-2.1-or-later
// The bearer token: typed in, or of the attribute, or with `share` of the page's address. It never leaves the browser but as
// a header.

export class Token {
  constructor(viewer) {
    this.viewer = viewer;
    this.typed = null;
  }

  get value() { return this.typed ?? this.viewer.given('token') ?? this.remembered ?? ''; }
  get authorization() { return this.value ? { Authorization: `Bearer ${this.value}` } : {}; }

  // One that was typed in. The page of the server, which has `share`, knows it until its tab is closed.
  keep(token) {
    this.typed = token;
    try {
      if (this.viewer.share.on) sessionStorage.setItem(this.key, token);
    } catch { /* the page may have no storage */ }
  }
  get remembered() {
    try {
      return this.viewer.share.on ? sessionStorage.getItem(this.key) : null;
    } catch {
      return null;
    }
  }
  get key() { return `lightfield-token ${this.viewer.stream.endpoint}`; }
}
