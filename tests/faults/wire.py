"""`python wire.py IFACE IFACE`: forwards Ethernet frames between two interfaces with delay and loss.

Each line on stdin is `{"delay_s": seconds, "loss": fraction}`; ends when stdin is closed.
"""

import heapq
import json
import random
import select
import socket
import sys
import time
from itertools import count
from typing import Final

ALL_FRAMES: Final = 0x0003  # linux/if_ether.h: ETH_P_ALL
LONGEST_FRAME: Final = 65_536
MOST_UNDER_WAY: Final = 20_000


def opened(interface: str) -> socket.socket:
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ALL_FRAMES))
    end.bind((interface, 0))
    return end


def main(first: str, second: str) -> None:
    near, other = opened(first), opened(second)
    across = {near: other, other: near}
    delay_s, loss = 0.0, 0.0
    order = count()
    under_way: list[tuple[float, int, socket.socket, bytes]] = []
    while True:
        wait = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
        readable, _, _ = select.select([sys.stdin, near, other], [], [], wait)
        for end in readable:
            if not isinstance(end, socket.socket):
                line = sys.stdin.readline()
                if not line:
                    return
                delay_s, loss = json.loads(line)["delay_s"], json.loads(line)["loss"]
                continue
            try:
                frame, about = end.recvfrom(LONGEST_FRAME)
            except OSError:
                continue  # the link is down
            if about[2] == socket.PACKET_OUTGOING or random.random() < loss:
                continue
            if len(under_way) < MOST_UNDER_WAY:
                due = time.monotonic() + delay_s
                heapq.heappush(under_way, (due, next(order), across[end], frame))
        while under_way and under_way[0][0] <= time.monotonic():
            _, _, end, frame = heapq.heappop(under_way)
            try:
                end.send(frame)
            except OSError:
                continue  # the link is down: the frame is lost


if __name__ == "__main__":
    main(*sys.argv[1:])
