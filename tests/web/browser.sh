#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Runs tests in headless Chromium, with playwright-core from npm: browser.sh BUILD TEST.mjs [PROGRAM]. Prints TAP. Skips
# the tests, with a reason, without Chromium, Node.js or npm's registry. Tests that need a PROGRAM are skipped without
# this program; otherwise they get its name and run in a separate network with an address besides loopback.
set -euo pipefail
build=$1 test=$(realpath "$2") needed=${3:-}
source=$(dirname "$test")

skip() {
  printf '1..1\nok 1 - %s # SKIP\n' "$*"  # reports show only the name
  exit
}
PATH=$PATH:/usr/sbin:/sbin  # folders of servers
[[ -z $needed ]] || command -v "$needed" >/dev/null || skip "no $needed (tools/setup.sh --tests)"
chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) ||
  skip "no Chromium (Debian: chromium)"
command -v node >/dev/null || skip "no Node.js (Debian: nodejs)"
command -v npm >/dev/null || skip "no npm (Debian: npm)"

# Installs once, from the lock file. Node.js resolves modules from the test's folder, so the test is copied there. Tests
# may run at the same time: one installs, and files that another test reads are not written again.
work=$build/tests/web
mkdir -p "$work"
exec {lock}>"$work/lock"
flock "$lock"
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
for file in "$source"/*.mjs; do
  cmp -s "$file" "$work/${file##*/}" || cp "$file" "$work/"
done
exec {lock}>&-
export GST_PLUGIN_PATH=$build/gst LF_TOOLS_DIR=$build/tools LF_CHROMIUM=$chromium LF_ARTEFACTS=$work
LF_SOURCE_ROOT=$(cd "$source/../.." && pwd)
export LF_SOURCE_ROOT
run=(node "$work/$(basename "$test")" ${needed:+"$needed"})
[[ -n $needed ]] || exec "${run[@]}"
# IPv6 only on loopback: other addresses arrive seconds late, and a browser drops its downloads when an address arrives.
network='ip link set lo up && sysctl -qw net.ipv6.conf.default.disable_ipv6=1 &&
  ip link add host type veth peer name other && ip addr add 10.77.0.1/24 dev host &&
  ip link set host up && ip link set other up'
unshare --map-root-user --net bash -c "$network" 2>/dev/null || skip "no network namespaces"
exec unshare --map-root-user --net bash -c "$network"' && exec "$@"' bash "${run[@]}"
