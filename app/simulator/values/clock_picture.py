"""The picture of a simulated camera: grey, with a bright square that moves, and the time."""

import struct
import time
import zlib
from typing import Final

SIZE: Final = (160, 120)  # pixels
SQUARE: Final = 20
PIXEL: Final = 4  # of the figures
NS_PER_S: Final = 10**9
# Three by five pixels each, a bit for each, rows from the top.
FIGURES: Final = {
    "0": (7, 5, 5, 5, 7),
    "1": (2, 6, 2, 2, 7),
    "2": (7, 1, 7, 4, 7),
    "3": (7, 1, 7, 1, 7),
    "4": (5, 5, 7, 1, 1),
    "5": (7, 4, 7, 1, 7),
    "6": (7, 4, 7, 5, 7),
    "7": (7, 1, 1, 1, 1),
    "8": (7, 5, 7, 5, 7),
    "9": (7, 5, 7, 1, 7),
    ":": (0, 2, 0, 2, 0),
}


def grey_pixels(t: float, wall_ns: int) -> bytes:
    """A byte for each pixel, `t` seconds after the robot's start."""
    width, height = SIZE
    row = bytes(40 + column * 80 // width for column in range(width))
    left = int(t * SQUARE) % (width - SQUARE)
    marked = row[:left] + bytes([200]) * SQUARE + row[left + SQUARE :]
    square = range(height - 2 * SQUARE, height - SQUARE)
    pixels = bytearray(b"".join(marked if y in square else row for y in range(height)))
    clock = time.strftime("%H:%M:%S", time.localtime(wall_ns // NS_PER_S))
    for number, figure in enumerate(clock):
        _draw(pixels, FIGURES[figure], (width - 4 * PIXEL * len(clock)) // 2 + 4 * PIXEL * number)
    return bytes(pixels)


def _draw(pixels: bytearray, figure: tuple[int, ...], left: int) -> None:
    """One figure, near the top."""
    for y, bits in enumerate(figure):
        for x in range(3):
            if bits >> (2 - x) & 1:
                for line in range(PIXEL):
                    at = (3 * PIXEL + y * PIXEL + line) * SIZE[0] + left + x * PIXEL
                    pixels[at : at + PIXEL] = bytes([240]) * PIXEL


def png(grey: bytes) -> bytes:
    """A picture of 8-bit grey as a PNG file (ISO/IEC 15948)."""
    width, height = SIZE

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = b"".join(b"\0" + grey[y * width : (y + 1) * width] for y in range(height))
    about = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", about) + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts
