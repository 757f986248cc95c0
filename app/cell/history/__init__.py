"""Values over time: what trends show, and recordings around each press.

Trends are recorded from each sample, and written to disk. Recordings are MCAP files that Foxglove,
Lichtblick and rosbag2 open. A ring buffer keeps the latest samples. A press starts a recording with
them, which continues for a while. A separate thread writes the files, so that it never delays a press.
"""
