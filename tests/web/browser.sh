#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs the tests in headless Chromium, with playwright-core from npm: browser.sh BUILD TEST.mjs [PROGRAM]. Prints TAP;
# without Chromium, Node.js or npm's registry the tests are skipped, with the reason. Where they need a PROGRAM they are
# skipped without it, are told which it is, and get a network of their own, with an address beside loopback's.
set -euo pipefail
build=$1 test=$(realpath "$2") needed=${3:-}
source=$(dirname "$test")

skip() {
  printf '1..1\nok 1 - %s # SKIP\n' "$*"  # the name is what reports show
  exit
}
PATH=$PATH:/usr/sbin:/sbin  # of servers
[[ -z $needed ]] || command -v "$needed" >/dev/null || skip "no $needed (tools/setup.sh --tests)"
chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) ||
  skip "no Chromium (Debian: chromium)"
command -v node >/dev/null || skip "no Node.js (Debian: nodejs)"
command -v npm >/dev/null || skip "no npm (Debian: npm)"

# Once, as the lock file has it. Modules are looked for from where the test is, so it is copied there.
work=$build/tests/web
mkdir -p "$work"
if ! cmp -s "$source/package-lock.json" "$work/package-lock.json" || [[ ! -d $work/node_modules/playwright-core ]]; then
  cp "$source/package.json" "$work/"
  rm -f "$work/package-lock.json"
  mkdir -p "$work/install"
  cp "$source"/package{,-lock}.json "$work/install/"
  (cd "$work/install" && timeout 120 npm ci --ignore-scripts --no-audit --no-fund >"$work/npm.log" 2>&1) ||
    skip "npm can't install playwright-core: $(tail -n 1 "$work/npm.log")"
  rm -rf "$work/node_modules"
  mv "$work/install/node_modules" "$work/"
  cp "$source/package-lock.json" "$work/"
fi
cp "$source"/*.mjs "$work/"
export GST_PLUGIN_PATH=$build/gst LF_TOOLS_DIR=$build/tools LF_CHROMIUM=$chromium LF_ARTEFACTS=$work
LF_SOURCE_ROOT=$(cd "$source/../.." && pwd)
export LF_SOURCE_ROOT
run=(node "$work/$(basename "$test")" ${needed:+"$needed"})
[[ -n $needed ]] || exec "${run[@]}"
# Without IPv6 but for loopback's: its addresses come seconds late, and a browser drops what it is loading where one comes.
network='ip link set lo up && sysctl -qw net.ipv6.conf.default.disable_ipv6=1 &&
  ip link add host type veth peer name other && ip addr add 10.77.0.1/24 dev host &&
  ip link set host up && ip link set other up'
unshare --map-root-user --net bash -c "$network" 2>/dev/null || skip "no network namespaces"
exec unshare --map-root-user --net bash -c "$network"' && exec "$@"' bash "${run[@]}"
