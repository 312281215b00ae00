# SPDX-License-Identifier: LGPL-2.1-or-later
"""Invariants that must hold after a soak."""

import glob
import re
import statistics
from collections import namedtuple

from watch import percentile

Run = namedtuple('Run', 'watch before after warm end failures out has_browser')

# Limits for the growth of memory() in the second half of a soak, in MiB and as a share of the memory; the larger limit
# counts. Heaps need the first half to reach their size.
MOST_GROWTH_MIB, MOST_GROWTH_SHARE = 6, 0.1
MOST_THREADS_MORE = 6  # threads of pools, and of films that start again
HEALS_WITHIN = 6  # seconds; frames in this time are not checked
LEAST_COMPLETE = 0.4  # share of complete frames in undisturbed times, with 1 % packet loss in each direction
LEAST_FRAGMENTS = 0.9  # share of received fragments in these frames
LONGEST_PAUSE = 5  # seconds without a picture


def slope(points):
    """Returns the Theil-Sen slope: the median of the slopes between all pairs of points."""
    return statistics.median((b[1] - a[1]) / (b[0] - a[0])
                             for i, a in enumerate(points) for b in points[i + 1:] if b[0] > a[0])


def disturbed_times(run):
    """Returns (begin, end) of the times with a killed node or lost camera, including the time to recover."""
    spans, open_at = [], {}
    for at, what in run.watch.events:
        name, _, verb = what.rpartition(' ')
        if verb in ('killed', 'lost'):
            open_at[name] = at
        elif verb in ('started', 'found') and name in open_at:
            spans.append((open_at.pop(name) - 0.5, at + HEALS_WITHIN))
    return spans + [(at, run.end) for at in open_at.values()]


def stays(run):
    """Returns the visits of viewers: (view, begin, end)."""
    came, all_stays = {}, []
    for at, what in run.watch.events:
        found = re.fullmatch(r'viewer (\d) (comes|goes)', what)
        if found and found[2] == 'comes':
            came[int(found[1])] = at
        elif found:
            all_stays.append((int(found[1]), came.pop(int(found[1])), at))
    return all_stays


def interior_pictures(run):
    """Returns the frames of undisturbed times, without the start of each visit."""
    spans = disturbed_times(run)
    there = [(view, begin + HEALS_WITHIN, end) for view, begin, end in stays(run)]
    return [p for p in run.watch.pictures if p.time > run.warm
            and any(view == p.view and begin <= p.time <= end for view, begin, end in there)
            and not any(begin <= p.time <= end for begin, end in spans)]


def memory(run):
    """Yields the name and points (seconds, MiB) of each program that ran from the warm-up to the end. Each point is the
    minimum of a minute (less in a short soak) in the second half, because visits add memory temporarily."""
    final = {(s.program, s.pid) for s in run.after.values()}
    first = {(s.program, s.pid) for s in run.before.values()}
    for key in sorted(final & first):
        least, stretch = {}, min(60, (run.end - run.warm) / 16)
        for s in run.watch.samples:
            if (s.program, s.pid) == key and (run.warm + run.end) / 2 <= s.time <= run.end:
                number = int(s.time / stretch)
                least[number] = min(least.get(number, (s.time, s.memory)), (s.time, s.memory), key=lambda p: p[1])
        yield key[0], list(least.values())


def check(run):
    """Yields (True if it holds, text with figures) for each invariant."""
    yield not run.failures, 'programs live until they are ended, and end when they are asked to' + \
        ''.join(f'; {failure}' for failure in run.failures)

    for name, points in memory(run):
        growth = slope(points) * (points[-1][0] - points[0][0])
        level = statistics.median(y for _, y in points)
        most = max(MOST_GROWTH_MIB, MOST_GROWTH_SHARE * level)
        yield growth <= most, f'memory of {name}: {level:.0f} MiB, in the second half {growth:+.1f} (at most {most:.0f})'

    for what, slack in (('descriptors', 0), ('threads', MOST_THREADS_MORE)):
        more = {name: getattr(s, what) - getattr(run.before[name], what) for name, s in run.after.items()
                if name in run.before}
        text = ', '.join(f'{name} {getattr(run.after[name], what)} ({n:+d})' for name, n in sorted(more.items()))
        yield len(more) == len(run.before) and max(more.values()) <= slack, f'{what} return to their base: {text}'

    pictures = interior_pictures(run)
    for view in sorted({p.view for p in run.watch.pictures}):
        own = [p for p in pictures if p.view == view]
        if not own:
            yield False, f'view {view}: no pictures while nothing is lost'
            continue
        complete = sum(p.complete for p in own) / len(own)
        there = 1 - sum(p.missing for p in own) / max(1, sum(p.fragments + p.missing for p in own))
        latency = [p.latency for p in own]
        yield complete >= LEAST_COMPLETE and there >= LEAST_FRAGMENTS, \
            f'view {view}: of {len(own)} pictures {100 * complete:.1f} % are complete, {100 * there:.2f} % of what makes ' \
            f'them is there; request to picture p50 {percentile(latency, 50):.1f} ms, p99 {percentile(latency, 99):.1f} ms'

    pauses = [0.0]
    for view, begin, end in stays(run):
        times = [begin + HEALS_WITHIN, *(p.time for p in run.watch.pictures
                                         if p.view == view and begin + HEALS_WITHIN <= p.time <= end), end]
        pauses += [b - a for a, b in zip(times, times[1:])]
    yield max(pauses) <= LONGEST_PAUSE, f'the longest pause between pictures is {max(pauses):.2f} s, kills and all'

    if run.has_browser:
        with open(run.out + '/browser.log', encoding='utf-8', errors='replace') as file:
            said = file.read()
        shown = [int(n) for n in re.findall(r'^shown (\d+) problems 0', said, re.M)]
        bad = re.findall(r'^(?:failed|shown \d+ problems [1-9]).*', said, re.M)
        yield bool(shown) and min(shown) > 0 and not bad, \
            f'the browser came {len(shown)} times and saw {sum(shown)} pictures' + ''.join(f'; {b}' for b in bad)

    critical = []
    for path in sorted(glob.glob(run.out + '/*.log')):
        with open(path, encoding='utf-8', errors='replace') as file:
            critical += [line.strip() for line in file if 'CRITICAL' in line or 'Caught SIG' in line]
    yield not critical, f'nothing critical in the logs {critical[:3] if critical else ""}'


def hold(run):
    """Prints each invariant with its figures. Returns True if all invariants hold."""
    all_hold = True
    for holds, text in check(run):
        print(('ok      ' if holds else 'BROKEN  ') + text)
        all_hold &= holds
    return all_hold
