"""Recordings around each press: MCAP files that Foxglove, Lichtblick and rosbag2 open.

A ring buffer keeps the latest samples. A press starts a recording with them, which continues for a
while. A separate thread writes the files, so that it never delays a press.
"""

from app.recording.recorder import Recorder
from app.recording.writer import Recordings

__all__ = ["Recorder", "Recordings"]
