"""The static files in memory: the stylesheet in its order, and a name that changes with any of them."""

import gzip
import shutil
from itertools import chain
from pathlib import Path

import pytest

from app.panel.widgets.families import EntryWidget
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.publish import Step
from app.panel.widgets.tour import Tour
from app.system.errors import KindError
from app.system.settings import shipped_path
from app.web.assets import (
    COMMON,
    LATER,
    LAYERS,
    OWN_PAGES,
    SHARED,
    Assets,
    load_assets,
    require_files,
)
from tests.support.parts import ROOT


@pytest.fixture
def static(tmp_path: Path) -> Path:
    folder = tmp_path / "static"
    for part in ("css", "js"):
        (folder / part).mkdir(parents=True)
    for layer in {*LAYERS, *SHARED, *OWN_PAGES, LATER, *chain(*COMMON.values())}:
        style = f".{layer} a :is(b, i) {{\n    top: 0;\n  }}\n"
        (folder / "css" / f"{layer}.css").write_text(f"/* Why. */\n  {style}")
    (folder / "js/main.js").write_text("main();\n")
    (folder / "js/press.js").write_text("press();\n")
    (folder / "js/notes.txt").write_text("no script\n")
    return folder


@pytest.fixture
def templates(tmp_path: Path) -> Path:
    folder = tmp_path / "templates"
    folder.mkdir()
    (folder / "screen.html").write_text("<p>")
    return folder


def loaded(static: Path, templates: Path, mm_per_px: float = 0.25, *kinds: str) -> Assets:
    return load_assets(static, templates, mm_per_px, kinds)


def test_the_stylesheet_is_its_layers_in_order_with_the_millimetre(
    static: Path, templates: Path
) -> None:
    layers = "".join(f"\n.{layer} a :is(b,i){{top:0}}" for layer in LAYERS)
    sent = loaded(static, templates).files["kiosk.css"].content.decode()
    assert sent == f"{layers}:root{{--mm:4.0000px}}"


@pytest.mark.parametrize(
    ("kinds", "needed"),
    [((), False), (("publish", "hold", "readout", "indicator"), False)]
    + [((kind,), True) for kind in ("text", "number", "slider", "select", "toggle", "parameter")],
)
def test_stylesheet_has_the_rules_of_the_panels_widgets(
    static: Path, templates: Path, kinds: tuple[str, ...], needed: bool
) -> None:
    sent = loaded(static, templates, 0.25, *kinds).files["kiosk.css"].content.decode()
    assert (".entries a" in sent) is needed


def test_every_input_has_the_styles_of_entries() -> None:
    for name, kind in KINDS.items():
        if issubclass(kind.model, EntryWidget) and not issubclass(kind.model, Step | Tour):
            assert "entries" in kind.styles, name


def test_the_styles_of_a_kind_are_in_the_stylesheet_of_pages_with_it(
    static: Path, templates: Path
) -> None:
    (static / "css/kinds").mkdir()
    for kind in ("camera", "gauge", "table"):
        (static / f"css/kinds/{kind}.css").write_text(f".{kind} {{}}\n")
    (static / "own.css").write_text("b { top: 1px }\n")
    assets = load_assets(static, templates, 0.25, KINDS, styles=[static / "own.css"])
    without = assets.files[f"{assets.sheet(['hold'])}.css"]
    assert without == assets.files["kiosk.css"]
    assert b".gauge" not in without.content
    sheet = assets.files[f"{assets.sheet(['table', 'hold', 'gauge'])}.css"]
    assert assets.sheet(["gauge", "table"]) == "kiosk-gauge-table"
    assert sheet.content.startswith(assets.layers.content)
    assert sheet.content.endswith(b".gauge{}\n.table{}\nb { top: 1px }\n")
    assert gzip.decompress(sheet.packed) == sheet.content


def test_the_script_of_a_kind_is_a_file_of_its_name_or_shared(static: Path, templates: Path) -> None:
    (static / "js/kinds").mkdir()
    for script in ("gauge", "holds"):
        (static / f"js/kinds/{script}.js").write_text(f"{script}();\n")
    assets = loaded(static, templates, 0.25, "gauge", "hold", "joystick")
    assert assets.files["kinds/gauge.js"].content == b"gauge();\n"
    kinds = ["gauge", "hold", "joystick", "publish"]
    assert assets.modules([], kinds) == ["kinds/gauge", "kinds/holds"]
    assert "gauge" in assets.styles
    assert "publish" not in assets.styles


PART_FILES = {
    "template": "templates/widgets/gauge.html",
    "stylesheet": "static/css/kinds/gauge.css",
    "script": "static/js/kinds/gauge.js",
}


@pytest.fixture
def shipped(tmp_path: Path) -> Path:
    """A copy of the shipped files."""
    for name in ("static", "templates"):
        shutil.copytree(shipped_path(name), tmp_path / "shipped" / name)
    return tmp_path / "shipped"


def test_each_kind_has_the_files_of_its_row(shipped: Path) -> None:
    require_files(shipped / "static", shipped / "templates")


@pytest.mark.parametrize(("part", "file"), PART_FILES.items())
def test_a_missing_file_of_a_kind_is_named(shipped: Path, part: str, file: str) -> None:
    (shipped / file).unlink()
    with pytest.raises(KindError, match=f'"gauge" has no {part}: add .*/{file}$'):
        require_files(shipped / "static", shipped / "templates")


def test_a_script_that_no_row_names_is_an_error(shipped: Path) -> None:
    (shipped / "static/js/kinds/publish.js").write_text("")
    with pytest.raises(KindError, match='"publish" has no script: name it in the row of KINDS'):
        require_files(shipped / "static", shipped / "templates")


def test_scripts_keep_their_names(static: Path, templates: Path) -> None:
    files = loaded(static, templates).files
    styles = {f"{name}.css" for name in ("kiosk", LATER, *OWN_PAGES)}
    assert set(files) == {*styles, "main.js", "press.js"}
    assert files["main.js"].content == b"main();\n"
    assert files["log.css"].content == b"\n.log a :is(b,i){top:0}"


def test_scripts_go_out_without_comments_on_the_lines_where_they_were_written(
    static: Path, templates: Path
) -> None:
    written = '// Why.\nf("http://a"); // beside\n  // More.\n  g("; // a text");\n'
    (static / "js/main.js").write_text(written)
    sent = loaded(static, templates).files["main.js"].content
    assert sent == b'\nf("http://a");\n\ng("; // a text");\n'


def test_scripts_go_out_without_types(static: Path, templates: Path) -> None:
    typed = "/** @type {A} */\nconst a = /** @type {B} */ (b);\n/**\n * @param {C} c\n */\n  *#d() {}\n"
    (static / "js/main.js").write_text(typed)
    sent = loaded(static, templates).files["main.js"].content
    assert sent == b"\nconst a = (b);\n\n\n\n*#d() {}\n"


def test_no_script_has_a_text_over_several_lines_that_a_comment_could_be_taken_from() -> None:
    for script in (ROOT / "static/js").rglob("*.js"):
        assert all(line.count("`") % 2 == 0 for line in script.read_text().splitlines()), script


def test_each_file_is_packed_once_and_for_all(static: Path, templates: Path) -> None:
    first, again = (loaded(static, templates).files for _ in range(2))
    for name, asset in first.items():
        assert gzip.decompress(asset.packed) == asset.content
        assert asset.packed == again[name].packed


def test_browsers_get_the_type_of_a_file(static: Path, templates: Path) -> None:
    files = loaded(static, templates).files
    assert (files["kiosk.css"].media_type, files["main.js"].media_type) == (
        "text/css",
        "text/javascript",
    )


def test_the_same_files_have_the_same_revision(static: Path, templates: Path) -> None:
    assert loaded(static, templates).revision == loaded(static, templates).revision


@pytest.mark.parametrize("name", ["static/css/base.css", "static/js/press.js", "templates/screen.html"])
def test_every_change_of_a_file_is_a_new_revision(
    static: Path, templates: Path, tmp_path: Path, name: str
) -> None:
    before = loaded(static, templates).revision
    (tmp_path / name).write_text("changed")
    assert loaded(static, templates).revision != before


@pytest.mark.parametrize("name", ["static/js/more.js", "templates/more.html"])
def test_a_new_file_is_a_new_revision(static: Path, templates: Path, tmp_path: Path, name: str) -> None:
    before = loaded(static, templates).revision
    (tmp_path / name).write_text("")
    assert loaded(static, templates).revision != before


def test_another_screen_is_a_new_revision(static: Path, templates: Path) -> None:
    assert loaded(static, templates, 0.25).revision != loaded(static, templates, 0.3).revision


def test_the_shipped_files_are_complete() -> None:
    assets = load_assets(shipped_path("static"), shipped_path("templates"), 0.22, ())
    assert "main.js" in assets.files
    style = assets.files["kiosk.css"].content.decode()
    assert style.index("@layer tokens{") < style.index("@layer base{") < style.index("@layer widgets{")


def test_no_shipped_file_loads_anything_from_elsewhere() -> None:
    assets = load_assets(shipped_path("static"), shipped_path("templates"), 0.22, KINDS)
    for name, asset in assets.files.items():
        content = asset.content.replace(b"http://www.w3.org/2000/svg", b"")  # the name of a namespace
        assert b"http:" not in content, name
        assert b"https:" not in asset.content, name
        assert b"@import" not in asset.content, name


def test_each_script_that_another_imports_is_there() -> None:
    assets = load_assets(shipped_path("static"), shipped_path("templates"), 0.22, KINDS)
    scripts = [name for name in assets.files if name.endswith(".js")]
    imports = {name for script in scripts for name in assets.imports(script)}
    assert len(imports) > 10
    assert {
        name for name in imports if f"js/{name}" not in assets.files and name not in assets.files
    } == set()
