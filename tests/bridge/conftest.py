"""Fixtures of robots on Cyclone DDS, behind bridges of their own."""

from tests.support import cyclone

cyclone_bridge = cyclone.cyclone_bridge
own_cyclone_bridge = cyclone.own_cyclone_bridge
client = cyclone.client
own_client = cyclone.own_client
cyclone_robots = cyclone.cyclone_robots
robot = cyclone.robot
