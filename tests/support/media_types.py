"""What Schemathesis sends as a body that is neither JSON nor a form. It loads this module by
`SCHEMATHESIS_HOOKS`, as `tests/support/fuzzed.py` starts it."""

import io
import zipfile

import schemathesis
from hypothesis import strategies as st


def zipped(text: str) -> bytes:
    """A zip file with a panel file of this text."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as files:
        files.writestr("panel.toml", text)
    return archive.getvalue()


schemathesis.openapi.media_type("application/zip", st.binary() | st.text(max_size=200).map(zipped))
