# SPDX-License-Identifier: LGPL-2.1-or-later
"""Runs the whole system under load and failures; started and described by tests/soak.sh."""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import laws
import plot
from hosts import Network
from watch import Watch

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

CAMERAS = ['0-7', '8-15', '16-23', '24-31', '32-47', '48-63']  # per camera host
RATE = '10/1'
LOSS = 0.01  # share of the incoming packets of a host
HOSTILE = 100  # packets per second
SAMPLE_EVERY = 3  # seconds
SETTLE = 12  # seconds until servers forget former clients (browsers: 5 s)
ENDS_WITHIN = 15  # seconds
MOST_ADDRESSES = 6 << 30  # address space of a program, bytes

# Nodes that are killed. All other nodes, the compositor and lf-serve run for the whole soak.
MORTAL = [0, 1, 4]
KILL_EVERY, KILLED_FOR = 40, 6
LOSE_EVERY, LOST_FOR = 35, 8
VIEWER_STAYS, VIEWER_AWAY = (15, 40), (3, 8)


class Soak:
    def __init__(self, build, out, film, has_browser):
        self.build, self.out, self.has_browser = build, out, has_browser
        self.watch = Watch()
        self.random = random.Random(1)
        self.due = []  # (when, what to do)
        self.nodes, self.viewers, self.others, self.failures = {}, {}, {}, []
        self.browser = None
        self.lost = {}  # {path: content} of the files of lost cameras
        self.dead = set()  # processes with a known end
        self.environment = {**os.environ, 'GST_PLUGIN_PATH': build + '/gst',
                            'GST_REGISTRY': build + '/soak/registry.bin', 'LF_TOOLS_DIR': build + '/tools'}
        self.rig = self.own_cameras(film)
        self.network = Network(['c0', 'c1', 'c2', 'c3', 'c4', 'c5', 'compositor', 'v0', 'v1', 'v2', 'serve', 'evil'],
                               LOSS)

    # Copies the film, because lost cameras change their files.
    def own_cameras(self, film):
        folder = self.out + '/cameras'
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(film, folder)
        with open(folder + '/rig.json', encoding='utf-8') as file:
            self.files = [os.path.join(folder, camera['source']) for camera in json.load(file)['cameras']]
        for i in range(3):
            subprocess.run([self.build + '/tools/lf-path', '--rig', folder + '/rig.json', '--out',
                            f'{folder}/views{i}.json', '--frames', str(90 + 17 * i), '--framerate', '10', '--near', '1.2',
                            '--far', '4.5'], check=True, stdout=subprocess.DEVNULL)
        return folder + '/rig.json'

    def start(self, name, host, command, environment=None, view=None):
        return self.network.start(name, host, command, log=f'{self.out}/{name}.log',
                                  environment={**self.environment, **(environment or {})},
                                  on_line=lambda line: self.watch.on_line(line, view))

    # A program with excessive memory use ends and is reported, before the machine runs out of memory.
    def start_limited(self, *arguments, **more):
        name, host, command = arguments
        return self.start(name, host, ['prlimit', f'--as={MOST_ADDRESSES}', *command], **more)

    def at(self, host, port):
        return f'{self.network.address(host)}:{port}'

    # The clients of a node, and the node's port for the requests of each client.
    ASKERS = {'compositor': 6000, 'v2': 6001, 'serve': 6002}

    def start_node(self, i):
        command = ['gst-launch-1.0', '-m', 'lfnodesink', f'rig={self.rig}', f'cameras={CAMERAS[i]}', f'node={i}',
                   'framerate=15/1', 'listen=' + ','.join(str(port) for port in self.ASKERS.values()),
                   'answers=' + ','.join(self.at(asker, 6100 + i) for asker in self.ASKERS)]
        self.nodes[i] = self.start_limited(f'node {i}', f'c{i}', command)

    def nodes_for(self, asker):
        return [f'{self.at(f"c{i}", self.ASKERS[asker])}:{6100 + i}' for i in range(len(CAMERAS))]

    def start_others(self):
        viewers = [self.network.address(f'v{i}') for i in range(2)]
        command = ['gst-launch-1.0', '-m', 'lfviewsrc', 'name=v', f'rig={self.rig}', 'listen=6200', 'post-messages=true',
                   'nodes=' + ','.join(self.nodes_for('compositor')), 'peers=' + ','.join(['127.0.0.1', *viewers])]
        for pad, viewer in zip(['v.src', 'v.src_0'], viewers):
            command += (f'{pad} ! queue ! videoconvert ! video/x-raw,format=I420 ! jpegenc quality=90 ! rtpjpegpay ! '
                        f'udpsink host={viewer} port=6300 sync=false async=false').split()
        self.others['compositor'] = self.start_limited('compositor', 'compositor', command)
        self.others['lf-serve'] = self.start_limited('lf-serve', 'serve', [
            self.build + '/tools/lf-serve', '--rig', self.rig, '--nodes', ','.join(self.nodes_for('serve')), '--framerate',
            '10', '--connects', '10'])
        targets = [f'{self.at(f"c{i}", port)}:requests' for i in range(len(CAMERAS)) for port in self.ASKERS.values()]
        targets += [f'{self.at(asker, 6100 + i)}:answers' for asker in self.ASKERS for i in range(len(CAMERAS))]
        targets.append(f'{self.at("compositor", 6200)}:requests')
        for host in ('evil', 'v2'):
            name = f'hostile {host}'
            self.others[name] = self.start(name, host, [sys.executable, ROOT + '/tests/soak/hostile.py', str(HOSTILE / 2),
                                                        *targets])

    def start_viewer(self, i):
        path = f'{os.path.dirname(self.rig)}/views{i}.json'
        if i < 2:
            compositor = self.network.address('compositor')
            command = (f'gst-launch-1.0 -m lfviewrequest view-id={i} rig={self.rig} location={path} loop=true is-live=true '
                       f'framerate={RATE} capture-delay=100000000 navigation-element=pictures ! rtplfpay ! '
                       f'udpsink host={compositor} port=6200 sync=false async=false '
                       'udpsrc port=6300 caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26 '
                       f'! lfrtpgate peers={compositor} ! rtpjpegdepay ! jpegdec name=pictures ! videoconvert ! '
                       'fakesink sync=false async=false').split()
        else:
            command = ['gst-launch-1.0', '-m', 'lfviewsrc', f'rig={self.rig}', 'nodes=' + ','.join(self.nodes_for('v2')),
                       f'location={path}', 'loop=true', f'framerate={RATE}', 'post-messages=true', '!',
                       'fakesink', 'sync=false', 'async=false']
        # Messages of the compositor host name the view.
        self.viewers[i] = self.start_limited(f'viewer {i}', f'v{i}', command, view=i)

    def start_browser(self):
        if not self.has_browser:
            return
        self.browser = self.start('browser', 'serve', [ROOT + '/tests/web/browser.sh', self.build,
                                                       ROOT + '/tests/web/soak_page.mjs'],
                                  environment={'LF_SOAK_URL': 'http://127.0.0.1:8080/', 'LF_SOAK_STAYS': '25',
                                               'LF_SOAK_AWAY': '5'})

    def later(self, seconds, what):
        self.due.append((self.watch.now() + seconds, what))

    def kill_node(self):
        i = self.random.choice(MORTAL)
        self.watch.event(f'node {i} killed')
        self.dead.add(self.nodes[i].pid)
        self.nodes[i].stop(5, signal.SIGKILL)
        self.later(KILLED_FOR, lambda: self.restart_node(i))
        self.later(KILL_EVERY, self.kill_node)

    def restart_node(self, i):
        self.start_node(i)
        self.watch.event(f'node {i} started')

    def lose_camera(self):
        path = self.random.choice(self.files)
        if path not in self.lost:
            with open(path, 'rb') as file:
                self.lost[path] = file.read()
            os.truncate(path, 0)
            self.watch.event(f'camera {self.files.index(path)} lost')
            self.later(LOST_FOR, lambda: self.find_camera(path))
        self.later(LOSE_EVERY, self.lose_camera)

    def find_camera(self, path):
        with open(path, 'r+b') as file:
            file.write(self.lost.pop(path))
        self.watch.event(f'camera {self.files.index(path)} found')

    def viewer_comes(self, i):
        self.start_viewer(i)
        self.watch.event(f'viewer {i} comes')
        self.later(self.random.uniform(*VIEWER_STAYS), lambda: self.viewer_goes(i))

    def viewer_goes(self, i):
        self.watch.event(f'viewer {i} goes')
        self.end(self.viewers.pop(i))
        self.later(self.random.uniform(*VIEWER_AWAY), lambda: self.viewer_comes(i))

    def end(self, program, number=signal.SIGINT):
        if not program.is_running() and program.pid not in self.dead:
            self.failures.append(f'{program.name} ended by itself')
        elif program.is_running() and not program.stop(ENDS_WITHIN, number):
            self.failures.append(f'{program.name} did not end within {ENDS_WITHIN} s')

    def lasting(self):
        return [*self.nodes.values(), self.others['compositor'], self.others['lf-serve']]

    def pass_time(self, seconds):
        end = self.watch.now() + seconds
        while self.watch.now() < end:
            self.watch.look(self.lasting())
            for program in [*self.lasting(), *self.viewers.values()]:
                if not program.is_running() and program.pid not in self.dead:
                    self.dead.add(program.pid)
                    self.failures.append(f'{program.name} ended by itself')
                    self.watch.event(self.failures[-1])
            next_look = min(end, self.watch.now() + SAMPLE_EVERY)
            while self.watch.now() < next_look:
                for event in sorted([d for d in self.due if d[0] <= self.watch.now()], key=lambda d: d[0]):
                    self.due.remove(event)
                    event[1]()
                time.sleep(0.1)

    # Runs viewers and failures for `seconds`, then restores all nodes and cameras and stops all viewers. Returns the
    # minimum samples of the programs without viewers.
    def busy(self, seconds):
        for i in range(3):
            self.later(2 * i, lambda i=i: self.viewer_comes(i))
        self.start_browser()
        self.later(10, self.kill_node)
        self.later(25, self.lose_camera)
        self.pass_time(seconds)
        self.due.clear()
        for i in MORTAL:
            if not self.nodes[i].is_running():
                self.restart_node(i)
        for path in list(self.lost):
            self.find_camera(path)
        for i in list(self.viewers):
            self.watch.event(f'viewer {i} goes')
            self.end(self.viewers.pop(i))
        if self.browser:
            self.end(self.browser, signal.SIGTERM)
            self.browser = None
        self.watch.event('no viewer watches')
        self.pass_time(SETTLE)
        quiet = self.watch.now()
        self.pass_time(SETTLE)
        return self.watch.least(self.lasting(), quiet)

    def run(self, minutes):
        warm_up = min(90, 60 * minutes / 4)
        for i in range(len(CAMERAS)):
            self.start_node(i)
        self.start_others()
        self.watch.event('begins')
        self.pass_time(3)
        before = self.busy(warm_up)
        warm = self.watch.now()
        after = self.busy(60 * minutes - warm - 2 * SETTLE)
        end = self.watch.now()
        hostile = [program for name, program in self.others.items() if name.startswith('hostile')]
        for program in [*self.nodes.values(), *self.others.values()]:
            self.end(program, signal.SIGTERM if program in (self.others['lf-serve'], *hostile) else signal.SIGINT)
        self.watch.write(self.out)
        return laws.Run(self.watch, before, after, warm, end, self.failures, self.out, self.has_browser)

    def close(self):
        for program in [*self.nodes.values(), *self.viewers.values(), *self.others.values(), self.browser]:
            if program and program.is_running():
                program.stop(0, signal.SIGKILL)
        self.network.close()
        shutil.rmtree(self.out + '/cameras', ignore_errors=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument('--minutes', type=float, required=True)
    parser.add_argument('--build', required=True)
    parser.add_argument('--out', required=True)
    parser.add_argument('--film', required=True)
    parser.add_argument('--no-browser', dest='browser', action='store_false')
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    for name in os.listdir(options.out):
        if name.endswith('.log'):
            os.remove(f'{options.out}/{name}')
    soak = Soak(options.build, options.out, options.film, options.browser)
    try:
        run = soak.run(options.minutes)
    finally:
        soak.close()
    plot.draw(run, options.out + '/soak.svg')
    return 0 if laws.hold(run) else 1


if __name__ == '__main__':
    sys.exit(main())
