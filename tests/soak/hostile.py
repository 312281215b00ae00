# SPDX-License-Identifier: LGPL-2.1-or-later
"""Simulates an attacker on the network: hostile.py PER_SECOND HOST:PORT:KIND...

KIND is `requests` (a node's or compositor's port for requests) or `answers`. Sends packets to the addresses in turn
until killed: noise, empty, truncated and damaged packets, requests for expensive views, and forged answers.
"""

import os
import random
import socket
import struct
import sys
import time

NOW = 0xffffffffffffffff  # the newest frames


def unit(magic, kind, body):
    return b'\x8fLF' + magic + struct.pack('>BBHI', 1, kind, 0, 12 + len(body)) + body


def request(view, width, height, aperture=0.0):
    """Returns a request (lib/wire/spec.md) for a view from the middle of the array."""
    focal = 1.2 * width
    body = struct.pack('>IIQQHHBBBB', view, random.getrandbits(32), NOW, 0, width, height, 0, 0, 0,
                       0x10 if aperture else 0)
    body += struct.pack('>3d4d', 0, 0, 0, 1, 0, 0, 0) + struct.pack('>3d', focal, (width - 1) / 2, (height - 1) / 2)
    body += struct.pack('>4d', 0, 0, -1, 2) + struct.pack('>I', 0)
    if aperture:
        body += struct.pack('>d', aperture)
    return unit(b'Q', 1, body)


def packet(payload):
    return struct.pack('>BBHII', 0x80, 0xe0, random.getrandbits(16), random.getrandbits(32),
                       random.getrandbits(32)) + b'\x10\x00' + payload


def damaged(payload):
    payload = bytearray(payload)
    for _ in range(random.randint(1, 4)):
        payload[random.randrange(len(payload))] ^= 1 << random.randrange(8)
    return bytes(payload)


def noise():
    return os.urandom(random.choice([0, 1, 11, 12, 13, 60, 400, 1400]))


def ordinary():
    return request(random.getrandbits(32), 320, 240)


REQUESTS = [
    noise,
    lambda: packet(noise()),
    lambda: packet(ordinary()[:random.randrange(140)]),
    lambda: damaged(packet(ordinary())),
    lambda: packet(ordinary()),  # from an unknown viewer
    lambda: packet(b''.join(ordinary() for _ in range(9))),
]
# Requests that are expensive for a node.
REQUESTS += [
    lambda: packet(request(random.getrandbits(32), 16384, 16384)),
    lambda: packet(request(random.getrandbits(32), 320, 240, 1e6)),
]
ANSWERS = [
    noise,
    lambda: packet(noise()),
    lambda: packet(unit(b'A', 1, os.urandom(200))),
    lambda: packet(unit(b'A', 5, os.urandom(200))),
    lambda: damaged(packet(unit(b'A', 1, bytes(120)))),
]


def main(per_second, targets):
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    addresses = []
    for target in targets:
        host, port, kind = target.split(':')
        addresses.append(((host, int(port)), REQUESTS if kind == 'requests' else ANSWERS))
    begun, sent = time.monotonic(), 0
    while True:
        address, kinds = addresses[sent % len(addresses)]
        try:
            sender.sendto(random.choice(kinds)(), address)
        except OSError:
            pass  # the program at this address is not running
        sent += 1
        time.sleep(max(0, begun + sent / per_second - time.monotonic()))


if __name__ == '__main__':
    random.seed(1)
    main(float(sys.argv[1]), sys.argv[2:])
