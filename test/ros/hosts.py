"""
Two hosts with a bad cable between them: network namespaces, and frames that pass through here.

``unshare -Urn python3 hosts.py COMMAND_1 COMMAND_2`` runs a shell command on each host and ends
with the second one.  Frames take DELAY, one in twenty is lost, and all are lost while there is a
file ``cut`` in the working folder.  The kernel's own netem would do the same where it is there.
"""
from __future__ import annotations

from collections import deque
from contextlib import ExitStack
import os
import random
import select
import socket
import subprocess
import sys
import time

DELAY, LOSS = 0.05, 0.05    # s, share of the frames
ALL_PROTOCOLS = 3           # ETH_P_ALL
ADDRESSES = ('10.7.0.1', '10.7.0.2')


class Cable:
    """One direction of the cable between two hosts."""

    def __init__(self, source: str, sink: str) -> None:
        self.source, self.sink = (self._socket(name) for name in (source, sink))
        self.waiting: deque[tuple[float, bytes]] = deque()
        self.random = random.Random(0)

    @staticmethod
    def _socket(interface: str) -> socket.socket:
        result = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_PROTOCOLS))
        result.bind((interface, 0))
        result.setblocking(False)
        return result

    def take(self) -> None:
        """Take a frame in; some are lost."""
        frame, address = self.source.recvfrom(65535)
        if address[2] == socket.PACKET_OUTGOING or self.random.random() < LOSS:
            return
        if not os.path.exists('cut'):
            self.waiting.append((time.monotonic() + DELAY, without_checksum(frame)))

    def deliver(self) -> None:
        """Send what is due."""
        while self.waiting and self.waiting[0][0] <= time.monotonic():
            try:
                self.sink.send(self.waiting.popleft()[1])
            except OSError:
                pass  # lost, too


def without_checksum(frame: bytes) -> bytes:
    """Return an Ethernet frame; without a checksum (0) if it is UDP over IPv4."""
    if frame[12:14] != b'\x08\x00' or frame[23] != socket.IPPROTO_UDP or frame[21] \
            or frame[20] & 0x1f:
        return frame  # among others what follows on the first fragment
    # A virtual interface leaves the checksum to hardware that is not there.
    at = 14 + 4 * (frame[14] & 15) + 6
    return frame[:at] + b'\0\0' + frame[at + 2:]


def run(*command: object) -> None:
    subprocess.run(list(map(str, command)), check=True)


def connect(host: int, process: int) -> str:
    """Add an interface to the namespace of a process; return the name of its other end."""
    here, there = f'here{host}', f'there{host}'
    run('ip', 'link', 'add', 'name', here, 'type', 'veth', 'peer', 'name', there)
    run('ip', 'link', 'set', there, 'netns', process)
    run('ip', 'link', 'set', here, 'up')
    inside = ('nsenter', '-t', process, '-n', 'ip')
    run(*inside, 'link', 'set', 'lo', 'up')
    run(*inside, 'addr', 'add', f'{ADDRESSES[host]}/24', 'dev', there)
    run(*inside, 'link', 'set', there, 'up')
    run(*inside, 'route', 'add', '224.0.0.0/4', 'dev', there)
    return here


def main(commands: list[str]) -> int:
    """Run a command on each host until the second one ends; return its exit code."""
    with ExitStack() as stack:
        hosts = []
        for _ in commands:
            host = subprocess.Popen(['unshare', '-n', 'sleep', 'infinity'])
            stack.callback(host.kill)
            hosts.append(host)
        while len({os.readlink(f'/proc/{host.pid}/ns/net') for host in hosts}
                  - {os.readlink('/proc/self/ns/net')}) < len(hosts):
            time.sleep(0.01)
        ends = [connect(number, host.pid) for number, host in enumerate(hosts)]
        cables = [Cable(*ends), Cable(*reversed(ends))]
        processes = []
        for host, command in zip(hosts, commands):
            process = subprocess.Popen(['nsenter', '-t', str(host.pid), '-n', 'sh', '-c',
                                        f'exec {command}'])
            stack.callback(process.kill)
            processes.append(process)
        while processes[-1].poll() is None:
            ready = select.select([cable.source for cable in cables], [], [], 0.005)[0]
            for cable in cables:
                if cable.source in ready:
                    cable.take()
                cable.deliver()
        return processes[-1].returncode


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
