"""Recordings around each press: MCAP files that Foxglove, Lichtblick and rosbag2 open.

A ring keeps what was received lately; a press makes a recording of it, which goes on for a while.
Files are written on a thread of their own, and nothing that happens there holds up a press.
"""

from app.recording.recorder import Recorder
from app.recording.writer import Recordings

__all__ = ["Recorder", "Recordings"]
