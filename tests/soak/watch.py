# SPDX-License-Identifier: LGPL-2.1-or-later
"""Collects the data of a soak: memory, descriptors and threads of programs, and the viewers' frames."""

import os
import re
import threading
import time
from collections import namedtuple

Sample = namedtuple('Sample', 'time program pid memory descriptors threads')  # seconds since the start, MiB (PSS)
Picture = namedtuple('Picture', 'time view complete fragments missing latency')  # milliseconds

_VIEW = re.compile(r'lightfield-view, view-id=\(uint\)(\d+), .*complete=\(boolean\)(\w+), fragments=\(uint\)(\d+), '
                   r'missing=\(uint\)(\d+), .*latency-ns=\(guint64\)(\d+)')


def sample_of(seconds, program):
    """Returns None if the process has ended."""
    folder = f'/proc/{program.pid}'
    try:
        with open(folder + '/smaps_rollup', encoding='ascii') as file:
            memory = next(int(line.split()[1]) for line in file if line.startswith('Pss:')) / 1024
        return Sample(seconds, program.name, program.pid, memory, len(os.listdir(folder + '/fd')),
                      len(os.listdir(folder + '/task')))
    except (OSError, StopIteration):
        return None


class Watch:
    """Samples, frames and events with times in seconds since construction."""

    def __init__(self):
        self._begun = time.monotonic()
        self._lock = threading.Lock()
        self.samples, self.pictures, self.events = [], [], []

    def now(self):
        return time.monotonic() - self._begun

    def on_line(self, line, view=None):
        """Stores a program's message about a frame. `view` replaces the view id in the message."""
        found = _VIEW.search(line)
        if found:
            with self._lock:
                self.pictures.append(Picture(self.now(), int(found[1]) if view is None else view, found[2] == 'true', int(found[3]),
                                             int(found[4]), int(found[5]) / 1e6))

    def event(self, what):
        self.events.append((self.now(), what))
        print(f'{self.now():7.1f} s  {what}', flush=True)

    def look(self, programs):
        """Stores and returns samples of the running programs."""
        seen = [sample for program in programs if (sample := sample_of(self.now(), program))]
        self.samples += seen
        return seen

    def least(self, programs, since):
        """Returns {name: last sample since `since`}, with the minimum numbers of descriptors and threads, because
        threads that read films come and go."""
        result = {}
        for program in programs:
            own = [s for s in self.samples if s.pid == program.pid and s.time >= since]
            if own:
                result[program.name] = own[-1]._replace(descriptors=min(s.descriptors for s in own),
                                                        threads=min(s.threads for s in own))
        return result

    def write(self, folder):
        with open(folder + '/samples.csv', 'w', encoding='ascii') as file:
            file.write('seconds,program,pid,pss_mib,descriptors,threads\n')
            for s in self.samples:
                file.write(f'{s.time:.1f},{s.program},{s.pid},{s.memory:.1f},{s.descriptors},{s.threads}\n')
        with open(folder + '/pictures.csv', 'w', encoding='ascii') as file:
            file.write('seconds,view,complete,fragments,missing,latency_ms\n')
            for p in self.pictures:
                file.write(f'{p.time:.2f},{p.view},{p.complete:d},{p.fragments},{p.missing},{p.latency:.1f}\n')
        with open(folder + '/events.csv', 'w', encoding='ascii') as file:
            file.write('seconds,event\n')
            for at, what in self.events:
                file.write(f'{at:.1f},{what}\n')


def percentile(values, percent):
    """`values` must not be empty."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(len(ordered) * percent / 100))]
