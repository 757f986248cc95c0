"""The static files, in memory and packed, under a name that changes with their content.

The stylesheet is the layers of `static/css` in their order, with what families of the panel's widgets
need and its millimetres, and on a page with kinds of widgets that have a stylesheet, with that: one
request for all. What only the log's page, the gallery or a keypad that opens needs is a file by itself.
Scripts keep their names, so that modules find each other, and their lines. Pages with a kind of widgets
load its script, if its row in the table of kinds has one. Comments, what lines are indented by and what
only sets styles apart stay here.
"""

import base64
import gzip
import hashlib
import posixpath
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Final

from markupsafe import Markup

from app.panel.keys import Font, font_format
from app.panel.rules import BrandRules
from app.panel.widgets.kinds import KINDS
from app.system.errors import KindError
from app.system.settings import shipped_path

SHEET: Final = "kiosk"
LAYERS: Final = (
    "guard", "tokens", "base", "grid", "layout", "states", "header", "menu", "control", "frame",
    "widgets", "ask", "keys", "floor",
)  # fmt: skip
SHARED: Final = ("entries", "marks", "facts", "alarm-rows")  # by several kinds of widgets
ALARMS: Final = ("priorities", "alarm-line")  # of panels with alarms
OWN_PAGES: Final = (
    "log", "alarm-rows", "alarms", "alarm-history", "alarm-report", "stops", "oee", "diagnostics",
    "recipes", "help", "overview", "signin", "users", "confirm", "wall",
)  # fmt: skip
# What stylesheets of pages have in common, by the page: it comes before its own.
COMMON: Final = {
    "signin": ("forms", "pad"), "users": ("forms",), "recipes": ("forms",), "confirm": ("pad",),
    "wall": ("priorities",), "alarm-report": ("paper",), "stops": ("paper",), "oee": ("paper",),
}  # fmt: skip
GALLERY: Final = "gallery"  # not in the installed package
EDITOR: Final = "editor"  # the folder of its scripts, style and templates, which no panel has
LATER: Final = "keypad"  # comes with the script that needs it
LEFT_OUT: Final = {
    ".css": re.compile(
        rb"/\*.*?\*/|^\s+|(?<=[:;,{}])\s+|;?\s*(?=\})|\s+(?=\{)", re.DOTALL | re.MULTILINE
    ),
    # A comment beside code goes if no quote follows, which a text would have.
    ".js": re.compile(
        rb"^[ \t]*(//.*|/\*\*$|\*( .*|/)?$)?|/\*\* [^*\n]*\*/ ?|(?<=[;{},)]) // [^\"'`\n]*$",
        re.MULTILINE,
    ),
}
IMPORT: Final = re.compile(r'^(?:import|export)\b[^"();=]*"(\.{1,2}/[^"]+)"', re.MULTILINE)
MEDIA_TYPES: Final = {".css": "text/css", ".js": "text/javascript"}
FONTS: Final = "fonts"
FONT_WEIGHTS: Final = {"regular": "400", "bold": "600 700"}
PICTURES: Final = "pictures"
NO_PICTURES: Final[Mapping[str, Path]] = {}
PICTURE_TYPES: Final = {
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
}


@dataclass(frozen=True)
class Asset:
    """A file that is sent: its `source` without what `left_out` finds. It is made smaller and packed at
    the first request, once; `packs` is False where packing saves nothing."""

    source: bytes
    media_type: str
    packs: bool = True
    left_out: re.Pattern[bytes] | None = None

    @cached_property
    def content(self) -> bytes:
        return self.left_out.sub(b"", self.source) if self.left_out else self.source

    @cached_property
    def packed(self) -> bytes:
        """The content by gzip; empty where that is not smaller."""
        return gzip.compress(self.content, mtime=0) if self.packs else b""


def asset(source: bytes, suffix: str) -> Asset:
    """What is sent of the source of a file with this suffix."""
    return Asset(source, MEDIA_TYPES[suffix], left_out=LEFT_OUT[suffix])


@dataclass(frozen=True, slots=True)
class Assets:
    """`revision` stands in every URL: what a browser keeps under it never changes."""

    files: dict[str, Asset]
    revision: str
    own_fonts: tuple[str, ...] = ()  # the names of the files of the panel's fonts
    layers: Asset = Asset(b"", "text/css")  # the stylesheet without the panel's styles
    panel_styles: tuple[Path, ...] = ()
    _imports: dict[str, tuple[str, ...]] = field(default_factory=dict)
    # The kinds of widgets that have a script, with its name, and those that have a stylesheet.
    scripts: ClassVar[Mapping[str, str]] = {
        name: name if kind.script is True else kind.script
        for name, kind in KINDS.items()
        if kind.script
    }
    styles: ClassVar[frozenset[str]] = frozenset(
        name for name, kind in KINDS.items() if "own" in kind.styles
    )

    def sheet(self, kinds: Collection[str]) -> str:
        """The name of the stylesheet of a page with these kinds of widgets, without ".css"."""
        own = [kind for kind in KINDS if kind in kinds and kind in self.styles]
        name = "-".join([SHEET, *own])
        if f"{name}.css" not in self.files:
            parts = [self.layers, *(self.files[f"kinds/{kind}.css"] for kind in own)]
            content = b"\n".join(part.content for part in parts)
            joined = Asset(content, self.layers.media_type)
            self.files[f"{name}.css"] = _with_styles(joined, self.panel_styles)
        return name

    def modules(self, scripts: Iterable[str], kinds: Iterable[str] = ()) -> list[str]:
        """These scripts, without ".js", those of kinds of widgets, and all that they import, each
        once."""
        of_kinds = (f"kinds/{self.scripts[kind]}" for kind in kinds if kind in self.scripts)
        every = dict.fromkeys(f"{script}.js" for script in (*scripts, *of_kinds))
        waiting = [*every]
        for script in waiting:
            further = [name for name in self.imports(script) if name not in every]
            every |= dict.fromkeys(further)
            waiting += further
        return [script.removesuffix(".js") for script in every]

    def imports(self, script: str) -> tuple[str, ...]:
        """The names of the scripts that a script imports as it starts."""
        if script not in self._imports:
            folder = posixpath.dirname(script)
            names = IMPORT.findall(self.files[script].content.decode()) if script in self.files else ()
            self._imports[script] = tuple(posixpath.normpath(posixpath.join(folder, n)) for n in names)
        return self._imports[script]


def _with_styles(sheet: Asset, styles: Collection[Path]) -> Asset:
    """A stylesheet with others at its end."""
    if not styles:
        return sheet
    content = b"\n".join([sheet.content, *(file.read_bytes() for file in styles)])
    return Asset(content, sheet.media_type)


def picture(file: Path) -> Asset:
    """A picture of the panel."""
    return Asset(file.read_bytes(), PICTURE_TYPES[file.suffix], file.suffix == ".svg")


def font(file: Path) -> Asset:
    """A font of the panel. WOFF2 is packed already."""
    form = font_format(file)
    return Asset(file.read_bytes(), f"font/{form}", form != "woff2")


def font_styles(fonts: Sequence[Font]) -> Iterator[str]:
    """What names the panel's fonts, and puts them before the shipped ones."""
    for number in range(len(fonts)):
        for key, weight in FONT_WEIGHTS.items():
            yield (
                f'@font-face{{font-family:"Own {number}";font-weight:{weight};font-display:optional;'
                f'src:url("{FONTS}/{font_name(number, key)}")}}'
            )
    families = ",".join(f'"Own {number}"' for number in range(len(fonts)))
    yield f":root{{--own-fonts:{families}}}\n" if fonts else ""


def font_name(number: int, key: str) -> str:
    return f"own-{number}-{key}"


def load_assets(
    static: Path,
    templates: Path,
    mm_per_px: float,
    kinds: Collection[str],
    pictures: Mapping[str, Path] = NO_PICTURES,
    styles: Collection[Path] = (),
    own_templates: Collection[Path] = (),
    brand: BrandRules | None = None,
    own_fonts: Sequence[Font] = (),
    has_alarms: bool = False,
) -> Assets:
    """Reads `static`, and the templates for the revision only.

    `mm_per_px` (millimetres per CSS pixel) gives the sizes of buttons; `kinds` are those of the panel's
    widgets. `pictures`, `styles` and `own_templates` are the panel's files. Its styles come last, in no
    layer, so that they win, and as they are written. `brand` gives the colour of its
    corner; `has_alarms`: pages have the line of alarms. Pages use `own_fonts` before the shipped ones.
    """
    needed = [name for name in SHARED if any(name in KINDS[kind].styles for kind in kinds)]
    needed += ALARMS if has_alarms else ()
    layers = [(static / "css" / f"{name}.css").read_bytes() for name in (*LAYERS, *needed)]
    own = f"--mm:{1 / mm_per_px:.4f}px"
    if brand is not None and brand.colour:
        own += f";--brand:{brand.colour};--brand-ink:{brand.ink}"
    millimetre = f":root{{{own}}}\n".encode()
    named_fonts = "".join(font_styles(own_fonts)).encode()
    sheet = asset(b"".join([*layers, named_fonts, millimetre]), ".css")
    files = {f"{SHEET}.css": _with_styles(sheet, styles)}
    of_kinds = {f"kinds/{file.stem}": file for file in sorted((static / "css/kinds").glob("*.css"))}
    apart = {name: static / "css" / f"{name}.css" for name in (*OWN_PAGES, LATER)}
    if (gallery := static / "css" / f"{GALLERY}.css").exists():
        apart[GALLERY] = gallery
    for name, file in (apart | of_kinds).items():
        parts = [*(static / "css" / f"{part}.css" for part in COMMON.get(name, ())), file]
        files[f"{name}.css"] = asset(b"".join(part.read_bytes() for part in parts), ".css")
    scripts = static / "js"
    for script in _of_panels(scripts, "*.js"):
        files[script.relative_to(scripts).as_posix()] = asset(script.read_bytes(), ".js")
    files |= {f"{PICTURES}/{name}": picture(file) for name, file in pictures.items()}
    fonts = sorted((static / FONTS).glob("*.woff2"))  # packed already
    files |= {f"{FONTS}/{file.name}": Asset(file.read_bytes(), "font/woff2", False) for file in fonts}
    of_panel = {
        font_name(number, key): font(file)
        for number, own_font in enumerate(own_fonts)
        for key, file in own_font.files.items()
    }
    files |= {f"{FONTS}/{name}": sent for name, sent in of_panel.items()}
    digest = hashlib.sha256()
    for name, sent in sorted(files.items()):
        digest.update(name.encode() + b"\0" + sent.source + b"\0")
    for template in (*_of_panels(templates, "*.html"), *own_templates):
        digest.update(template.read_bytes() + b"\0")
    return Assets(files, digest.hexdigest()[:12], tuple(of_panel), sheet, tuple(styles))


def _of_panels(folder: Path, pattern: str) -> list[Path]:
    """The files below a folder, without those of the editor."""
    return [file for file in sorted(folder.rglob(pattern)) if folder / EDITOR not in file.parents]


def require_files(static: Path, templates: Path) -> None:
    """Checks that each kind of widgets has the files that its row names, and no others: a KindError
    names the kind and the file."""
    for name, kind in KINDS.items():
        parts = {
            "template": (True, templates / f"widgets/{name}.html"),
            "stylesheet": ("own" in kind.styles, static / f"css/kinds/{name}.css"),
            "script": (bool(kind.script), static / f"js/kinds/{Assets.scripts.get(name, name)}.js"),
        }
        for part, (is_named, file) in parts.items():
            if is_named and not file.is_file():
                raise KindError(name, part, f"add {file}")
            if file.is_file() and not is_named:
                raise KindError(name, part, f"name it in the row of KINDS, or remove {file}")


# The script in each page that runs before its modules: it has no file that could be missing.


def _script() -> str:
    """The script of `static/js/guard.js` as it is sent."""
    return asset((shipped_path("static") / "js/guard.js").read_bytes(), ".js").content.decode()


def script_hash(script: str) -> str:
    """The source of a Content-Security-Policy that permits this inline script alone."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


PAGE_GUARD: Final = Markup(_script())
PAGE_GUARD_HASH: Final = script_hash(PAGE_GUARD)
