# SPDX-License-Identifier: LGPL-2.1-or-later
"""Programs on hosts of an Ethernet switch; each host is a network namespace. Also waits for programs."""

import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import threading
import time


def until(condition, what, seconds=120):
    """Waits for a true result of condition(), which it returns. Errors of files, sockets and values mean "not yet"."""
    end, error = time.monotonic() + seconds, None
    while True:
        try:
            if found := condition():
                return found
        except (OSError, ValueError) as caught:
            error = caught
        if time.monotonic() > end:
            raise SystemExit(f'never: {what}' + (f' ({error})' if error else ''))
        time.sleep(0.2)


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(('127.0.0.1', 0))
        return s.getsockname()[1]


def _ip(*arguments):
    return subprocess.run(['ip', *arguments], check=True, capture_output=True, text=True).stdout


def _remove_abandoned_hosts():
    """Removes the hosts of scripts that were killed. Their programs have ended with them."""
    for name in _ip('netns', 'list').split():
        owner = re.match(r'soak(\d+)-', name)
        if owner and not pathlib.Path('/proc', owner[1]).exists():
            subprocess.run(['ip', 'netns', 'del', name], capture_output=True)


class Network:
    """Hosts with the addresses 10.78.0.3, 10.78.0.4 and so on. Each host drops the share `loss` of incoming packets.
    close() ends the programs of the hosts and removes the hosts. SIGTERM does the same, and exits."""

    def __init__(self, hosts, loss):
        _remove_abandoned_hosts()
        self._prefix = f'soak{os.getpid()}-'
        self._hosts = list(hosts)
        self._programs = []
        signal.signal(signal.SIGTERM, self._end)
        self._add_hosts(loss)

    def _end(self, *_):
        """Processes of a test that takes too long have one second until SIGKILL."""
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        self.close()
        sys.exit(1)

    def _add_hosts(self, loss):
        _ip('netns', 'add', self._prefix + 'switch')
        _ip('-n', self._prefix + 'switch', 'link', 'add', 'b0', 'type', 'bridge')
        _ip('-n', self._prefix + 'switch', 'link', 'set', 'b0', 'up')
        for number, host in enumerate(self._hosts):
            space, port = self._prefix + host, f'p{number}'
            _ip('netns', 'add', space)
            _ip('-n', space, 'link', 'add', 'eth0', 'type', 'veth', 'peer', 'name', port, 'netns',
                self._prefix + 'switch')
            _ip('-n', self._prefix + 'switch', 'link', 'set', port, 'master', 'b0', 'up')
            _ip('-n', space, 'addr', 'add', self.address(host) + '/24', 'dev', 'eth0')
            _ip('-n', space, 'link', 'set', 'lo', 'up')
            _ip('-n', space, 'link', 'set', 'eth0', 'up')
            _ip('netns', 'exec', space, 'iptables', '-A', 'INPUT', '-i', 'eth0', '-m', 'statistic', '--mode', 'random',
                '--probability', str(loss), '-j', 'DROP')

    def address(self, host):
        return f'10.78.0.{3 + self._hosts.index(host)}'

    def start(self, name, host, command, **options):
        self._programs.append(Program(name, ['ip', 'netns', 'exec', self._prefix + host, *command], **options))
        return self._programs[-1]

    def close(self):
        for program in self._programs:
            program.send(signal.SIGKILL)
        lines = ''.join(f'netns del {self._prefix}{host}\n' for host in [*self._hosts, 'switch'])
        subprocess.run(['ip', '-force', '-batch', '-'], input=lines, text=True, capture_output=True)


class Program:
    """A program with its output in a log. A separate thread calls `on_line` with each line. The program ends with the
    script, even if the script is killed."""

    def __init__(self, name, command, log, environment=None, on_line=None):
        self.name = name
        self._on_line = on_line
        self._log = open(log, 'ab')
        self._process = subprocess.Popen(['setpriv', '--pdeathsig', 'KILL', *command], stdin=subprocess.DEVNULL,
                                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
                                         env=environment)
        self.pid = self._process.pid  # setpriv, `ip netns exec` and the scripts exec the program
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout:
            # Watch stores the many messages about frames.
            if b'lightfield-view' not in line:
                self._log.write(line)
                self._log.flush()
            if self._on_line:
                self._on_line(line.decode(errors='replace'))

    def is_running(self):
        return self._process.poll() is None

    def send(self, number):
        if self.is_running():
            os.killpg(self.pid, number)

    def stop(self, seconds, number=signal.SIGINT):
        """Sends the signal `number`. Returns True if the program ends within `seconds`; otherwise kills the program."""
        self.send(number)
        try:
            self._process.wait(seconds)
            ended = True
        except subprocess.TimeoutExpired:
            self.send(signal.SIGKILL)
            self._process.wait()
            ended = False
        self._reader.join(5)
        self._log.close()
        return ended
