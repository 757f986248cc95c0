"""One widget on several pages: `same`."""

from pathlib import Path

import pytest

from app.panel import load_panel
from app.panel.file.load import check_panel, faults_of_text

PAGES = """title = "Cell"
[[page]]
id = "main"
title = "Main"
{main}
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0
max = 3
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
span = 6
topic = "/start"
type = "std_msgs/msg/Bool"
message = {{ data = {data} }}
[[page]]
id = "other"
title = "Other"
{other}
"""
SAME = '[[page.widget]]\nsame = "start"\n'
IN_GROUP = (
    '[[page.group]]\ntitle = "Run"\ncolumns = 3\n[[page.group.widget]]\nsame = "start"\nspan = 2\n'
)


def faults_of(tmp_path: Path, text: str) -> list[tuple[str, str, int]]:
    return [(fault.place, fault.message, fault.line) for fault in faults_of_text(text, tmp_path)]


def test_the_widget_is_one_with_several_places(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(PAGES.format(main="", data="true", other=IN_GROUP))
    panel = load_panel(file)
    assert [widget.id for widget in panel.widgets()] == ["speed", "start"]
    assert [widget.id for widget in panel.commands] == ["start"]
    main, other = panel.pages
    assert [(w.id, w.span) for w in main.widgets] == [("speed", 6), ("start", 6)]
    assert [(w.id, w.span) for w in other.widgets] == [("start", 2)]
    assert all("start" in panel.widgets_by_page[page] for page in ("main", "other"))


def test_the_first_page_may_have_the_copy(tmp_path: Path) -> None:
    text = PAGES.replace('id = "main"', 'id = "first"').format(main="", data="true", other="")
    copy = f'[[page]]\nid = "main"\ntitle = "Main"\n{SAME}'
    file = tmp_path / "cell.toml"
    file.write_text(text.replace("[[page]]", f"{copy}[[page]]", 1))
    panel = load_panel(file)
    assert [(w.id, w.span) for w in panel.pages[0].widgets] == [("start", 6)]


def test_a_mistake_of_the_widget_is_reported_once_at_its_own_table(tmp_path: Path) -> None:
    text = PAGES.format(main="", data="7", other=SAME)
    assert [place for place, _, _ in faults_of(tmp_path, text)] == ["page[0].widget[1].message.data"]
    text = PAGES.format(main="", data="true", other=SAME).replace(
        'topic = "/start"', 'topics = "/start"'
    )
    assert [place for place, _, _ in faults_of(tmp_path, text)] == ["page[0].widget[1].topics"]


def test_an_id_that_is_no_text_is_named_in_place_of_the_copy_that_lacks_its_widget(
    tmp_path: Path,
) -> None:
    text = PAGES.format(main="", data="true", other=SAME).replace('id = "start"', "id = 1979-05-27")
    assert [place for place, _, _ in faults_of(tmp_path, text)] == ["page[0].widget[1].id"]


def test_a_page_that_lacks_the_input_of_the_message_is_named(tmp_path: Path) -> None:
    text = PAGES.format(main="", data='"{speed}"', other=SAME).replace("msg/Bool", "msg/Int8")
    [(place, message, line)] = faults_of(tmp_path, text)
    assert place == "page[1].widget[0].same"
    assert "speed" in message
    assert text.splitlines()[line - 1] == 'same = "start"'


@pytest.mark.parametrize("before", [True, False])
def test_a_page_has_it_once(tmp_path: Path, before: bool) -> None:
    main, other = (SAME, "") if before else ("", SAME + SAME)
    [(place, message, _)] = faults_of(tmp_path, PAGES.format(main=main, data="true", other=other))
    assert place == ("page[0].widget[0].same" if before else "page[1].widget[1].same")
    assert "is on this page already" in message


def test_previews_and_notes_are_those_of_the_widget(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(PAGES.format(main="", data="true", other=SAME))
    assert [remark.place for remark in check_panel(file).previews] == ["page[0].widget[1]"]


def test_what_the_server_adds_is_no_key(tmp_path: Path) -> None:
    text = 'copies = ["page[0].widget[0]"]\n' + PAGES.format(main="", data="true", other=SAME)
    assert [place for place, _, _ in faults_of(tmp_path, text)] == ["copies"]


def test_a_copy_of_a_copy_is_named_with_its_widget(tmp_path: Path) -> None:
    again = SAME.replace("[[page.widget]]", '[[page.widget]]\nid = "again"')
    third = f'[[page]]\nid = "third"\ntitle = "Third"\n{SAME.replace("start", "again")}'
    first, second = faults_of(tmp_path, PAGES.format(main="", data="true", other=again + third))
    assert first[0] == "page[1].widget[0].id"
    assert second[0] == "page[2].widget[0].same"
    assert 'write same = "start"' in second[1]
