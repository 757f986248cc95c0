"""Puts the compiled templates of the pages into the wheel: a hook of Hatchling's build."""

import importlib.util
import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

MODULE = "app/web/pages/compiled_templates.py"


class TemplateHook(BuildHookInterface[Any]):
    """Used for wheels only; an installation of the checkout itself compiles at the first use."""

    PLUGIN_NAME = "custom"
    _folder: Path | None = None

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        root = Path(self.root)
        # By its path: the package's other modules need what the build does not have.
        spec = importlib.util.spec_from_file_location("compiled_templates", root / MODULE)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        self._folder = Path(tempfile.mkdtemp(prefix="templates-"))
        module.compile_all(root / "templates", self._folder)
        build_data["force_include"][str(self._folder)] = f"app/{module.COMPILED}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if self._folder is not None:
            shutil.rmtree(self._folder)
