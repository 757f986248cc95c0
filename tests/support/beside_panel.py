"""Files beside the panel with every kind of widget: a picture, fonts, zones and routes."""

import json
import re
import shutil
from pathlib import Path
from typing import Any, Final

from tests.support.parts import ROOT

FONTS: Final = ROOT / "static/fonts"
NAV2: Final = ROOT / "docs/examples/mobile-robot/interfaces/nav2_msgs"
NODE: Final = {
    "type": "Feature",
    "geometry": {"type": "Point", "coordinates": [0.0, 0.0]},
    "properties": {"id": 1},
}


def put_beside(folder: Path) -> None:
    """Puts the files that everything.toml names, but its own interfaces, into the folder `msgs`."""
    shutil.copytree(NAV2, folder / "msgs/nav2_msgs")
    (folder / "msgs/plan.svg").write_text("<svg/>")
    ring = [[6.0, 0.0], [7.0, 0.0], [7.0, 1.5], [6.0, 0.0]]
    pit = feature("Polygon", [ring], label="Pit", kind="keep_out")
    put_geojson(folder / "msgs/hall.geojson", pit)
    nodes = (feature("Point", [0.5 * name, 0.25], id=name) for name in (1, 2))
    edge = feature("LineString", [], id=1, startid=1, endid=2)
    put_geojson(folder / "msgs/routes.geojson", *nodes, edge)
    put_fonts(folder / "msgs", "letters.woff2", "bold.woff2")


def put_fonts(folder: Path, regular: str, bold: str) -> None:
    """Shipped fonts, by these names."""
    for name, weight in ((regular, 400), (bold, 700)):
        shutil.copy(FONTS / f"ibm-plex-sans-{weight}.woff2", folder / name)


def put_named_files(folder: Path, panel_text: str) -> None:
    """Puts a font, a GeoJSON file or a picture where a panel file names one."""
    for name in re.findall(r'\bfile = "(\w+\.geojson)"', panel_text):
        put_geojson(folder / name, *([NODE] if "graph" in name else []))
    for name in re.findall(r'^pictures = "(\w+)"', panel_text, re.MULTILINE):
        (folder / name).mkdir(exist_ok=True)
        (folder / name / "hall.png").touch()
    for name in re.findall(r'^(?:regular|bold) = "(.+)"', panel_text, re.MULTILINE):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(FONTS / "ibm-plex-sans-400.woff2", folder / name)


def feature(geometry_type: str, coordinates: Any, /, **properties: Any) -> dict[str, Any]:
    """A feature of a GeoJSON file."""
    geometry = {"type": geometry_type, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def put_geojson(file: Path, *features: Any) -> Path:
    """A GeoJSON file, as programs that draw on maps of ROS write it: the CRS is not true."""
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
    whole = {"type": "FeatureCollection", "crs": crs, "features": features}
    file.write_text(json.dumps(whole))
    return file
