# SPDX-License-Identifier: LGPL-2.1-or-later
"""Plots a soak as SVG: memory, descriptors, threads, latency and completeness over time."""

from collections import defaultdict
from html import escape

import laws
from watch import percentile

WIDTH, PANEL, LEFT, RIGHT, TOP, GAP = 1000, 130, 60, 150, 46, 34
COLOURS = ['#0b6fb8', '#d1495b', '#2e8b57', '#8d5fd3', '#c77d0a', '#4a4a4a', '#00989d', '#9c3587', '#7a8b00']
BUCKET_SHARE = 1 / 120  # share of the run's time in one point of latency and completeness


def ticks(most):
    """Returns a few round numbers from 0 to beyond `most`."""
    step = 1
    while most / step > 4:
        step *= 2.5 if str(step).startswith('2') else 2
    return [step * i for i in range(int(most / step) + 2)]


class Svg:
    def __init__(self, title, panels, seconds, bands):
        """`bands`: coloured times behind all panels, (begin, end, colour)."""
        self.seconds = seconds
        self.height = TOP + panels * (PANEL + GAP) + 10
        self.parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {self.height}" '
                      f'font-family="sans-serif" font-size="11"><rect width="100%" height="100%" fill="white"/>'
                      f'<text x="{LEFT}" y="20" font-size="14">{escape(title)}</text>']
        self.top = TOP
        drawn = ''.join(f'<path d="M{self.x(begin):.1f} 0H{self.x(end):.1f}V{PANEL}H{self.x(begin):.1f}" fill="{colour}"/>'
                        for begin, end, colour in bands)
        self.parts.append(f'<defs><g id="bands">{drawn}</g></defs>')

    def x(self, seconds):
        return LEFT + (WIDTH - LEFT - RIGHT) * seconds / self.seconds

    def panel(self, title, series, most=None):
        """`series`: name to points (seconds, value)."""
        top, bottom = self.top, self.top + PANEL
        lines = ticks(most or max((y for points in series.values() for _, y in points), default=1))
        if most:
            lines = [y for y in lines if y <= most]

        def y_of(value):
            return bottom - PANEL * value / lines[-1]
        self.parts.append(f'<use href="#bands" y="{top}"/>')
        for value in lines:
            self.parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y_of(value):.1f}" y2="{y_of(value):.1f}" '
                              f'stroke="#ddd"/><text x="{LEFT - 6}" y="{y_of(value) + 4:.1f}" text-anchor="end">'
                              f'{value:g}</text>')
        for minutes in ticks(self.seconds / 60):
            if minutes * 60 <= self.seconds:
                self.parts.append(f'<text x="{self.x(60 * minutes):.1f}" y="{bottom + 14}" text-anchor="middle">'
                                  f'{minutes:g} min</text>')
        self.parts.append(f'<text x="{LEFT}" y="{top - 5}" font-weight="bold">{escape(title)}</text>')
        for i, (name, points) in enumerate(series.items()):
            colour = COLOURS[i % len(COLOURS)]
            # Gaps in the data interrupt the line.
            path, last = '', None
            for at, value in points:
                far = last is None or at - last > max(10, 3 * BUCKET_SHARE * self.seconds)
                path += f'{"M" if far else "L"}{self.x(at):.0f} {y_of(min(value, lines[-1])):.1f}'
                last = at
            self.parts.append(f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="1.3"/>'
                              f'<text x="{WIDTH - RIGHT + 8}" y="{top + 10 + 13 * i}" fill="{colour}">{escape(name)}</text>')
        self.top = bottom + GAP

    def text(self):
        return ''.join(self.parts) + '</svg>\n'


def of_buckets(pictures, seconds, value):
    """Returns {view: points}, with `value` of the frames of each time interval."""
    length = max(3, seconds * BUCKET_SHARE)
    buckets = defaultdict(lambda: defaultdict(list))
    for picture in pictures:
        buckets[f'view {picture.view}'][int(picture.time / length)].append(picture)
    return {view: [((n + 0.5) * length, value(some)) for n, some in sorted(own.items())]
            for view, own in sorted(buckets.items())}


def peaks(points, seconds):
    """Returns the maximum of each time interval: at most a few hundred points."""
    largest = {}
    for point in points:
        stretch = int(point[0] / max(3, seconds / 250))
        largest[stretch] = max(largest.get(stretch, point), point, key=lambda p: p[1])
    return list(largest.values())


def draw(run, path):
    watch, seconds = run.watch, run.end
    bands = [(begin + 0.5, end - laws.HEALS_WITHIN, '#f3dede') for begin, end in laws.disturbed_times(run)]
    bands.append((0, run.warm, '#eeeeee80'))

    def of_programs(what):
        series = defaultdict(list)
        for s in watch.samples:
            series[s.program].append((s.time, getattr(s, what)))
        return {name: peaks(points, seconds) for name, points in series.items()}
    svg = Svg(f'{len(laws.stays(run))} visits of three viewers, {len(laws.disturbed_times(run))} kills of nodes and losses of '
              f'cameras (red; grey: warm-up)', 6, seconds, bands)
    svg.panel('Memory, MiB (PSS)', of_programs('memory'))
    svg.panel('Descriptors', of_programs('descriptors'))
    svg.panel('Threads', of_programs('threads'))
    svg.panel('Request to picture, p50, ms', of_buckets(watch.pictures, seconds, lambda some: percentile(
        [p.latency for p in some], 50)))
    svg.panel('Request to picture, p99, ms', of_buckets(watch.pictures, seconds, lambda some: percentile(
        [p.latency for p in some], 99)))
    svg.panel('Complete pictures, %', of_buckets(watch.pictures, seconds, lambda some: 100 * sum(
        p.complete for p in some) / len(some)), most=100)
    with open(path, 'w', encoding='utf-8') as file:
        file.write(svg.text())
