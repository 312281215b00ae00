// SPDX-License-Identifier: LGPL-2.1-or-later
// Makes elements without innerHTML, which pages with `require-trusted-types-for 'script'` forbid.

const kSvg = new Set(['svg', 'path', 'circle']);

// `attributes`: true is an attribute without a value, false is none. `children`: elements and texts.
export function make(name, attributes = {}, ...children) {
  const element = kSvg.has(name) ? document.createElementNS('http://www.w3.org/2000/svg', name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes))
    if (value !== false) element.setAttribute(key, value === true ? '' : value);
  element.append(...children);
  return element;
}
