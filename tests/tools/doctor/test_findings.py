"""The findings are complete: each has its sentences, is made somewhere, and is in the documentation."""

import re
from string import Formatter
from typing import Final

import pytest

from app.ros.dialects.peer_traits import EVERY_SENTENCES
from app.ros.zenoh.sample import Sample
from app.system.settings import PACKAGE
from app.system.texts import ENGLISH, render, say, sentences
from app.tools.cli.doctor import as_text
from app.tools.doctor.findings import KINDS, MOST_ALIKE, MOST_TEXT, Finding, Report
from app.tools.doctor.received import copies
from tests.support.parts import TESTS

pytestmark = pytest.mark.promise("doctor")

SOURCES: Final = {path.name: path.read_text() for path in (PACKAGE / "tools/doctor").glob("*.py")}
CODE: Final = "".join(text for name, text in SOURCES.items() if name != "wording.py")
TESTED: Final = "".join(path.read_text() for path in (TESTS / "tools/doctor").glob("*.py"))


@pytest.mark.parametrize("code", KINDS)
def test_each_finding_is_made_by_a_check(code: str) -> None:
    made = set(re.findall(r'"([a-z_]+)"', CODE)) | {"service_type", "service_absent"}
    made |= {"action_type", "action_absent"}  # of f"{what}_type" and f"{what}_absent"
    made |= {code for own in EVERY_SENTENCES for code in (own.absent, own.silent, own.unqueryable)}
    assert code in made


@pytest.mark.parametrize("code", KINDS)
def test_each_finding_is_named_in_a_test(code: str) -> None:
    assert f'"{code}"' in TESTED


@pytest.mark.parametrize("code", KINDS)
def test_each_finding_is_a_full_sentence_with_a_remedy(code: str) -> None:
    kind = KINDS[code]
    assert re.search(r"[.?)}]$", kind.sentence)
    assert kind.do.endswith((".", "?"))
    assert kind.sentence[0] in "{ABCDEFGHIJKLMNOPQRSTUVWXYZ"


OF_LINKS: Final = [
    "link_no_bridge",
    "link_bridge_silent",
    "link_no_peer",
    "link_no_ros_node",
    "link_router_silent",
    "link_router_no_admin",
]


@pytest.mark.parametrize("code", OF_LINKS)
def test_findings_about_links_are_the_sentences_of_the_page(code: str) -> None:
    every = EVERY_SENTENCES
    assert code in {code for own in every for code in (own.absent, own.silent, own.unqueryable)}
    assert KINDS[code].sentence == sentences(ENGLISH)[code]
    assert Finding(code, "tcp/robot:7447").sentence == render(say(code))
    report = Report()
    report.find(code, "tcp/robot:7447")
    assert f"{render(say(code))} (tcp/robot:7447)\n" in as_text(report)


def test_a_code_that_is_none_is_refused() -> None:
    with pytest.raises(KeyError, match="on_fire"):
        Report().find("on_fire")


def test_the_same_is_found_once_and_notes_do_not_count() -> None:
    report = Report()
    for _ in range(2):
        report.find("server_running", "here")
    assert report.codes() == ["server_running"]
    assert report.is_well
    report.find("no_router", "there")
    assert not report.is_well


def test_of_many_alike_some_are_listed_and_the_others_are_counted() -> None:
    report = Report()
    for number in range(1000):
        report.find("link_bridge_silent", f"b{number}")
        report.fact(f"checked b{number}")
    report.find("no_router", "there")
    lines = as_text(report).splitlines()
    assert sum(line.startswith("error    link_bridge_silent") for line in lines) == MOST_ALIKE
    assert lines[MOST_ALIKE] == f"         … and {1000 - MOST_ALIKE} more"
    assert lines[-1] == "Something is wrong: 1001 errors, 1000 checks were passed."
    assert len(report.facts) < 1000


def test_a_text_of_a_robot_makes_no_line_and_has_a_limit() -> None:
    report = Report()
    report.find("bridge_namespace", theirs="/x\nerror    forged: by a robot\t", ours="y" * 10_000)
    (line, *_) = as_text(report).splitlines()
    assert line.startswith("error    bridge_namespace: The bridge has the namespace")
    assert "/x\\u000aerror    forged: by a robot\\u0009" in line
    assert len(line) < 2 * MOST_TEXT


def test_text_of_a_robot_is_made_printable() -> None:
    report = Report()
    report.find("topic_type", "/a", found="\x1b[31mBool\x1b[0m\u202e", wanted="{about}")
    assert (
        report.findings[0].sentence == "/a is Bool\\u202e on the robot and {about} in the panel file."
    )


@pytest.mark.parametrize("code", KINDS)
def test_placeholders_are_names(code: str) -> None:
    kind = KINDS[code]
    names = {
        name for text in (kind.sentence, kind.do) for _, name, _, _ in Formatter().parse(text) if name
    }
    assert all(name.isidentifier() for name in names)


def sample(at: float, payload: bytes = b"x", source: str = "a") -> Sample:
    return Sample(payload, 0, at, at, source)


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        ([], 1),
        ([0.0, 0.001], 1),  # one message only: it may have been published twice
        ([0.0, 0.5, 1.0], 1),
        ([0.0, 0.001, 0.5, 0.501, 1.0, 1.002], 2),
        ([0.0, 0.001, 0.5, 1.0, 1.002], 1),
        ([0.0, 0.01, 0.02, 0.03, 0.04, 0.05], 1),  # 100 Hz
    ],
)
def test_a_fast_publisher_is_not_taken_for_copies(times: list[float], expected: int) -> None:
    assert copies([sample(at) for at in times]) == expected


def test_equal_samples_of_two_bridges_are_not_duplicates() -> None:
    both = [
        sample(at + late, source=source) for at in (0.0, 0.5) for late, source in ((0, "a"), (0, "b"))
    ]
    assert copies(both) == 1


def test_others_close_by_are_no_copies() -> None:
    assert copies([sample(at + i / 1000, bytes([i])) for at in (0.0, 0.5) for i in range(3)]) == 1
