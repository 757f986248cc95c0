"""What the README shows can be used as it stands there."""

import re
from pathlib import Path

from app.panel import load_panel
from tests.support.parts import ROOT

EXAMPLES = re.findall(
    r"^```toml\n(.*?)^```", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE
)
OWN = '# interfaces = ["cell_msgs"]'
JOG = "float64 speed\nuint32 valid_ms\nuint16 number\n"


def test_the_first_panel_is_good_as_it_is(tmp_path: Path) -> None:
    panel = tmp_path / "cell1.toml"
    panel.write_text(EXAMPLES[0])
    assert load_panel(panel).title == "Robot cell 1"


def test_all_examples_together_are_a_panel(tmp_path: Path) -> None:
    messages = tmp_path / "cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text(JOG)
    whole = "\n".join(EXAMPLES)
    assert OWN in whole
    panel = tmp_path / "cell1.toml"
    panel.write_text(whole.replace(OWN, OWN.removeprefix("# ")))
    kinds = {widget.kind for widget in load_panel(panel).widgets()}
    assert {"text", "publish", "readout", "slider", "call", "action", "parameter", "hold"} <= kinds
