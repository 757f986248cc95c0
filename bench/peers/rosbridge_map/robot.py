"""`robot.py SIDE`: a ROS 2 node with a map of SIDE x SIDE cells, run by the rosbridge's own Python.

It reads lines: "map" publishes the map, "drive" begins to publish a pose ten times a second, "stop"
ends that. Each is answered by a line.
"""

import array
import math
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HZ = 10


def grid(side: int) -> OccupancyGrid:
    """A hall with walls."""
    row = bytes(100 if column % 50 == 0 else 0 for column in range(side))
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.width = message.info.height = side
    message.info.resolution = 0.05
    message.info.origin.orientation.w = 1.0
    message.data = array.array(
        "b", b"".join(bytes([100]) * side if line % 97 == 0 else row for line in range(side))
    )
    return message


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("shuttle")
    maps = node.create_publisher(OccupancyGrid, "/map", LATCHED)
    poses = node.create_publisher(PoseStamped, "/pose", 10)
    message = grid(int(sys.argv[1]))
    drives = threading.Event()

    def move() -> None:
        while True:
            drives.wait()
            at = PoseStamped()
            at.header.frame_id = "map"
            at.header.stamp = node.get_clock().now().to_msg()
            at.pose.position.x, at.pose.position.y = 10 + 5 * math.cos(time.time()), 10.0
            poses.publish(at)
            time.sleep(1 / HZ)

    threading.Thread(target=move, daemon=True).start()
    print("ready", flush=True)
    for line in sys.stdin:
        order = line.strip()
        if order == "map":
            maps.publish(message)
        elif order == "drive":
            drives.set()
        else:
            drives.clear()
        print(order, flush=True)


if __name__ == "__main__":
    main()
