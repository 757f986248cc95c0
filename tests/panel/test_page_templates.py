"""A page's own template: what it may do, and each fault with its line in the template."""

import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest
from markupsafe import Markup

from app.panel import check_panel, load_panel
from app.panel.checks.look import page_parts
from app.system.errors import Fault, PanelError
from tests.support.parts import ROOT

EXAMPLE: Final = ROOT / "docs/examples/plan/panel.toml"
PANEL: Final = """\
title = "Cell"
pictures = "pictures"
[[page]]
id = "plan"
title = "Plan"
template = "plan.html"
[[page.widget]]
id = "speed"
kind = "readout"
label = "Speed"
topic = "/speed"
type = "std_msgs/msg/Float64"
[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/heard"
type = "std_msgs/msg/String"
"""
BOTH: Final = '{{ widget("speed") }}\n{{ widget("heard") }}\n'
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """The panel file, beside its template and a picture."""
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures/cell.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')

    def written(template: str | bytes, panel: str = PANEL) -> Path:
        content = template.encode() if isinstance(template, str) else template
        (tmp_path / "plan.html").write_bytes(content)
        (tmp_path / "cell.toml").write_text(panel)
        return tmp_path / "cell.toml"

    return written


def the_fault(path: Path) -> Fault:
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    (fault,) = caught.value.faults
    assert fault.place.startswith("page[0].")
    return fault


def test_the_example_is_good_and_places_all_its_widgets() -> None:
    checked = check_panel(EXAMPLE)
    assert checked.notes == ()
    assert checked.panel.pages[0].template == EXAMPLE.parent / "plan.html"


@pytest.mark.parametrize(
    ("template", "message"),
    [
        (BOTH + "{% if %}", "plan.html: line 3: Expected an expression, got 'end of statement block'"),
        (BOTH + "{% for a in [1] %}", "plan.html: line 3: Unexpected end of template."),
        (
            BOTH + '<b>{{ widget("sped") }}</b>',
            'plan.html: line 3: no widget "sped" on this page; did you mean "speed"?',
        ),
        (BOTH + '\n{{ widget("speed") }}', 'plan.html: line 4: the widget "speed" is placed twice'),
        (
            BOTH + '{{ picture("plan.svg") }}',
            'plan.html: line 3: no picture "plan.svg"; there is cell.svg',
        ),
        (BOTH + '{{ icon("no such icon") }}', 'plan.html: line 3: no icon "no such icon"; there is '),
        (BOTH + "{{ robot }}", "plan.html: line 3: 'robot' is undefined"),
        (BOTH + "{{ 1 / 0 }}", "plan.html: line 3: ZeroDivisionError: division by zero"),
        (BOTH + '{% include "more.html" %}', "plan.html: line 3: include, import and extends are not "),
        (
            BOTH + "{{ widget.__globals__ }}",
            "plan.html: line 3: access to attribute '__globals__' of 'function' object is unsafe.",
        ),
        (b"\xff", "plan.html: is not UTF-8"),
    ],
)
def test_each_fault_has_its_line_in_the_template(
    write: Write, template: str | bytes, message: str
) -> None:
    fault = the_fault(write(template))
    assert fault.place == "page[0].template"
    assert fault.line == PANEL.splitlines().index('template = "plan.html"') + 1
    assert fault.message.startswith(message)


@pytest.mark.parametrize("key", ["template", "styles"])
def test_a_file_that_is_not_there_is_a_fault_of_its_key(write: Write, key: str) -> None:
    path = write(BOTH, PANEL.replace('template = "plan.html"', f'{key} = "gone.file"'))
    fault = the_fault(path)
    assert fault.place == f"page[0].{key}"
    assert "gone.file is not a file" in fault.message


@pytest.mark.parametrize("key", ["template", "styles"])
@pytest.mark.parametrize("how", ["absolute", "up", "a link", "a link to its folder"])
def test_a_file_out_of_the_panels_folder_is_a_fault(
    write: Write, tmp_path: Path, key: str, how: str
) -> None:
    path = write(BOTH)
    outside = tmp_path.with_name(f"{tmp_path.name}-outside")
    outside.mkdir()
    (outside / "a.file").write_text(BOTH)
    (tmp_path / "a.file").symlink_to(outside / "a.file")
    (tmp_path / "pages").symlink_to(f"../{outside.name}")
    name = {
        "absolute": str(outside / "a.file"),
        "up": f"../{outside.name}/a.file",
        "a link": "a.file",
        "a link to its folder": "pages/a.file",
    }[how]
    path.write_text(PANEL.replace('template = "plan.html"', f'{key} = "{name}"'))
    fault = the_fault(path)
    assert fault.place == f"page[0].{key}"
    assert "a.file is not below the panel file's folder, or is a link" in fault.message
    assert 'name it like "pages/a.file"' in fault.message


def test_a_link_inside_of_the_panels_folder_is_followed(write: Write, tmp_path: Path) -> None:
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages/plan.html").symlink_to(tmp_path / "plan.html")
    path = write(BOTH, PANEL.replace('"plan.html"', '"pages/plan.html"'))
    assert check_panel(path).notes == ()


def test_a_picture_that_is_a_link_out_of_its_folder_is_a_fault(write: Write, tmp_path: Path) -> None:
    """The server sends pictures to everyone."""
    path = write(BOTH)
    (tmp_path / "pictures/inside.svg").symlink_to("cell.svg")
    (tmp_path / "pictures/notes.txt").symlink_to("/etc/passwd")
    assert list(check_panel(path).panel.picture_files) == ["cell.svg", "inside.svg"]
    (tmp_path / "pictures/key.svg").symlink_to("/etc/passwd")
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    (fault,) = caught.value.faults
    assert fault.place == "pictures"
    assert "key.svg is a link to /etc/passwd, which is not below" in fault.message


def test_a_widget_with_a_faulty_id_is_one_fault(write: Write) -> None:
    fault = the_fault(write(BOTH, PANEL.replace('id = "speed"', 'id = "Speed"')))
    assert fault.place == "page[0].widget[0].id"


def test_a_page_has_groups_or_a_template(write: Write) -> None:
    fault = the_fault(write(BOTH, PANEL + '[[page.group]]\ntitle = "More"\n'))
    assert fault.message.startswith("a page with a template has no groups")


def test_widget_that_is_never_placed_is_a_note(write: Write) -> None:
    notes = check_panel(write('{{ widget("heard") }}')).notes
    assert [note.message for note in notes] == [
        'plan.html never places "speed": no one sees what is not placed'
    ]


# What takes too much, with its line: the last one of these templates.
FOR_EVER: Final = {
    "nested loops": "{% for a in range(99999) %}{% for b in range(99999) %}{% endfor %}{% endfor %}",
    "a loop that calls itself": "{% for a in [[1]] recursive %}{{ loop([[1]]) }}{% endfor %}",
    "a power": "{{ 9**(9**9) }}",
    "a power that is not used": "{% set a = 9**(9**9) %}",
    "a power in a condition": "{% if 7**(7**9) %}{% endif %}",
    "a long text": '{{ "x".center(3000000000) }}',
    "a long text by a filter": '{{ "x"|center(3000000000) }}',
    "a text many times": '{{ "xxxxxxxx" * 99999999 }}',
    "a list many times": "{% set a = [1] * 99999999 %}",
    "a format": '{{ "%9999999999d" % 1 }}',
    "a text that grows": "{% set a = namespace(x='xxxxxxxx') %}{% for b in range(99) %}"
    "{% set a.x = a.x ~ a.x %}{% endfor %}",
    "a long page": "{% for a in range(99999) %}{{ '<p>much text</p>' * 9 }}{% endfor %}",
    "a sorted list": "{% for a in range(9999) %}{% set b = range(99999)|sort|list %}{% endfor %}",
    "lorem ipsum": "{{ lipsum(99999, True, 9999, 99999) }}",
}


TOO_MUCH: Final = (
    r"it takes more than (1 s|50 MB)|it makes more than 1,000,000 characters"
    "|RecursionError|ValueError: width too big|OverflowError"
)


@pytest.mark.long("table")
@pytest.mark.parametrize("name", FOR_EVER)
def test_a_template_that_takes_too_much_is_stopped_and_named_with_its_line(
    write: Write, name: str
) -> None:
    began = time.monotonic()
    fault = the_fault(write(f"{BOTH}<p>more</p>\n{FOR_EVER[name]}\n"))
    assert time.monotonic() - began < 20  # on a busy machine; of the processor it takes a second
    assert fault.message.startswith("plan.html: line 4: ")
    assert re.search(TOO_MUCH, fault.message), fault.message


@pytest.mark.long("detail")
def test_endless_template_expression_is_stopped(write: Write) -> None:
    fault = the_fault(write(BOTH + "{% autoescape 9**(9**9) %}{% endautoescape %}"))
    assert fault.message == "plan.html: line 2: it takes more than 1 s in one expression"


@pytest.mark.parametrize(
    "template", ['{{ widget("speed")|upper }}', '{% set w = widget("speed") %}{{ w }}{{ w }}']
)
def test_altered_widget_output_in_a_template_is_a_fault(write: Write, template: str) -> None:
    fault = the_fault(write(template))
    assert "what widget() and picture() give is placed once, as it is" in fault.message


def test_a_large_file_is_no_template(write: Write) -> None:
    assert "has more than 1,000,000 bytes" in the_fault(write(BOTH + " " * 1_000_000)).message


def test_a_template_runs_once_and_not_in_this_process(
    write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a page shows at run time can't make it run longer: it is not run again."""
    runs: list[object] = []
    begin = subprocess.Popen

    def counted(*command: Any, **options: Any) -> Any:
        runs.append(command)
        return begin(*command, **options)

    monkeypatch.setattr(subprocess, "Popen", counted)
    loop = '{% for c in widget("heard") %}.{% endfor %}'
    path = write('{{ widget("speed") }}<!-- new -->{{ picture("cell.svg") }}' + loop)
    panel = load_panel(path)
    (parts,) = page_parts(panel).values()
    shown = parts.inside("en", lambda name: Markup(f"<b>{name}</b>" * 1000), "/static/1/pictures")
    assert shown.count("<b>speed</b>") == 1000
    assert 'src="/static/1/pictures/cell.svg"' in shown
    assert len(runs) == 1


def test_a_panel_without_templates_needs_nothing_for_them() -> None:
    code = "import sys, app.main; print([m for m in sys.modules if m in OWN])"
    names = ("app.system.page_process", "app.panel.page_template", "jinja2.sandbox")
    done = subprocess.run(
        [sys.executable, "-c", code.replace("OWN", repr(names))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "[]"
