"""The maps of a panel on its robot: latched, readable, and with a way to the robot. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from app.cell.robot.maps import Geometry, Grid, NoMap, read_grid
from app.cell.robot.transforms import TF, TF_STATIC, LocatedFrame, TransformTree
from app.panel.widgets.map_view import MapView, PoseTopic
from app.ros.messages import Interfaces
from app.system.errors import DecodeError
from app.system.texts import TextLike, joined
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelNames
from app.tools.doctor.received import ReceivedSamples

FRAME: Final = "header.frame_id"


class MapChecks:
    """The checks of the maps of one robot."""

    def __init__(
        self, report: Report, behind: PanelNames, observed: ReceivedSamples, interfaces: Interfaces
    ) -> None:
        self._report = report
        self._behind = behind
        self._observed = observed
        self._interfaces = interfaces
        self._robot = behind.robot.id
        self._views = [view for view in behind.robot.panel.widgets() if isinstance(view, MapView)]

    def check(self) -> None:
        uses_transforms = any(view.pose is None for view in self._views)
        maps = dict.fromkeys(level.topic for view in self._views for level in view.maps)
        for topic in (*maps, *((TF_STATIC,) if uses_transforms else ())):
            self._check_latched(topic)
        tree = self._transforms() if uses_transforms else TransformTree()
        read = {topic: self._grid(topic) for topic in maps}
        for view in self._views:
            grids = [grid for level in view.maps if (grid := read[level.topic]) is not None]
            self._check_zones(view, read)
            known = [grid.geometry for grid in grids]
            if len(view.maps) == len(known) == 1:
                self._check_way(view, known[0], tree)
            elif known:
                self._check_levels(view, known, tree)

    def _find(self, code: str, about: str, **details: TextLike) -> None:
        self._report.find(code, about, robot=self._robot, **details)

    def _check_latched(self, topic: str) -> None:
        publishers = self._behind.publishers(topic)
        if not all(end.qos.transient_local for end in publishers):
            self._find("map_not_latched", topic)

    def _payloads(self, topic: str) -> Iterator[tuple[bytes, float]]:
        """(bytes, monotonic seconds) of the messages of a topic."""
        for sample in self._observed.samples[self._behind.robot.key(topic)]:
            yield bytes(sample.payload), sample.at

    def _grid(self, topic: str) -> Grid | None:
        """The newest map; None without one, or where its topic has another type."""
        *_, (payload, _) = ((b"", 0.0), *self._payloads(topic))
        wanted = self._behind.robot.panel.listened()[topic]
        if not payload or any(end.type != wanted for end in self._behind.publishers(topic)):
            return None
        try:
            grid = read_grid(self._interfaces, payload)
        except NoMap as error:
            self._find("map_unreadable", topic, detail=error.reason)
            return None
        geometry = grid.geometry
        size = f"{geometry.width} x {geometry.height} cells of {geometry.resolution:g} m"
        self._report.fact(f'map {topic} has {size}, frame "{geometry.frame}"')
        return grid

    def _check_zones(self, view: MapView, read: Mapping[str, Grid | None]) -> None:
        """Whether zones of a version are of a map that is there: else they are out of force."""
        for level in view.maps:
            grid = read[level.topic]
            zones = [
                zone
                for zone in self._behind.robot.panel.zones
                if zone.map_version is not None and zone.level in (None, level.id)
            ]
            versions = {grid.version for other in view.maps if (grid := read[other.topic]) is not None}
            outdated = [zone for zone in zones if zone.map_version not in versions]
            if grid is None or not outdated:
                continue
            labels = joined([zone.label for zone in outdated], "between_names")
            self._find("map_zones_outdated", level.topic, version=grid.version, zones=labels)
            return

    def _transforms(self) -> TransformTree:
        tree = TransformTree()
        for topic in (TF_STATIC, TF):
            for payload, at in self._payloads(topic):
                try:
                    tree.record_bytes(payload, at, is_static=topic == TF_STATIC)
                except DecodeError:  # another type, which is said of the topic
                    break
        return tree

    def _check_way(self, view: MapView, geometry: Geometry, tree: TransformTree) -> None:
        """Whether it is known where the robot is on the map."""
        if view.pose is not None:
            self._check_pose(view.pose, geometry)
            return
        located = tree.locate(view.base_frame, geometry.frame)
        if isinstance(located, LocatedFrame):
            self._report.fact(f"transforms lead from {geometry.frame} to {view.base_frame}")
        else:
            self._find("map_no_transform", view.topic, detail=located)

    def _check_levels(self, view: MapView, maps: Sequence[Geometry], tree: TransformTree) -> None:
        """Whether it is known where the robot is on the map of one of the levels."""
        if view.pose is not None:
            return  # its frame is that of the level on which the robot is
        located = [tree.locate(view.base_frame, geometry.frame) for geometry in maps]
        missing = [each for each in located if not isinstance(each, LocatedFrame)]
        if len(missing) == len(maps):
            self._find("map_no_transform", view.maps[0].topic, detail=missing[0])

    def _check_pose(self, pose: PoseTopic, geometry: Geometry) -> None:
        """Whether the pose is in the frame of the map; nothing is said of one that did not come."""
        reader = self._interfaces.field_reader(pose.type, [FRAME])
        for payload, _ in self._payloads(pose.topic):
            try:
                frame = str(reader.read(payload).get(FRAME)).lstrip("/")
            except DecodeError:  # another type, which is said of the topic
                return
            if frame != geometry.frame:
                self._find("map_pose_frame", pose.topic, theirs=frame, ours=geometry.frame)
                return
