"""What this machine has for the panel's server: its address and port, its data folder and disk."""

import errno
import json
import os
import shutil
import tempfile
from collections.abc import Callable
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any, Final

from app.audit.data_dir import DataDir
from app.diagnose.findings import Report
from app.errors import FolderInUse, SettingsError
from app.panel.model import Panel
from app.process.listen_sockets import check_port_free

ANSWER_S: Final = 2.0  # for a server on this machine
MB: Final = 1_000_000
OTHER_FILES_MB: Final = 50  # definitions, trends, a log of the time in which the other is pruned
ANYWHERE: Final = {"0.0.0.0": "127.0.0.1", "::": "::1", "": "127.0.0.1"}

FreeBytes = Callable[[Path], int]


def free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free


def check_port(report: Report, host: str, port: int) -> bool:
    """Whether a server could listen there. Returns whether a panel server is what listens."""
    where = f"{host} port {port}"
    try:
        check_port_free(host, port)
    except SettingsError as error:
        return _not_free(report, host, port, where, error)
    report.fact(f"{where} is free")
    return False


def _not_free(report: Report, host: str, port: int, where: str, error: SettingsError) -> bool:
    cause = error.__cause__ or error.__context__
    if not isinstance(cause, OSError) or cause.errno != errno.EADDRINUSE:
        detail = (getattr(cause, "strerror", None) or str(cause or error)).lower()
        report.find("address_unusable", where, detail=detail)
        return False
    health = ask_server(host, port, "/healthz")
    if health is None or health[0] != 200 or health[1] != {"status": "ok"}:
        report.find("port_in_use", where)
        return False
    report.find("server_running", where)
    ready = ask_server(host, port, "/readyz")
    if ready is not None and ready[0] != 200:
        said = ready[1] if isinstance(ready[1], dict) else {}
        report.find("server_not_ready", where, detail=said.get("reason") or said.get("code", ""))
    return True


def ask_server(host: str, port: int, path: str) -> tuple[int, Any] | None:
    """(status, JSON or text) of a server on this machine; None where nothing answers by HTTP."""
    connection = HTTPConnection(ANYWHERE.get(host, host), port, timeout=ANSWER_S)
    try:
        connection.request("GET", path, headers={"Host": f"localhost:{port}"})
        answer = connection.getresponse()
        body = answer.read(8 * MB)
    except (OSError, HTTPException):
        return None
    finally:
        connection.close()
    try:
        return answer.status, json.loads(body)
    except ValueError:
        return answer.status, body.decode(errors="replace")


def check_data(
    report: Report, folder: Path, panel: Panel | None, served: bool, free: FreeBytes = free_bytes
) -> None:
    """Whether the server can keep its files. `served`: a server runs, which may have the folder."""
    place = next((parent for parent in (folder, *folder.parents) if os.path.lexists(parent)), folder)
    try:
        with tempfile.TemporaryFile(dir=place):
            pass
    except OSError as error:
        detail = (error.strerror or str(error)).lower()
        report.find("data_unwritable", str(folder), detail=f"{place}: {detail}")
        return
    needed, left = _needed_mb(folder, panel), free(place) // MB
    if left < needed:
        report.find("data_full", str(folder), free_mb=left, needed_mb=needed)
    if not _in_use(report, folder, served):
        report.fact(f"the data folder {folder} can be written, {left} MB are free")


def _needed_mb(folder: Path, panel: Panel | None) -> int:
    """How much the panel's files may still grow."""
    most = float(OTHER_FILES_MB)
    if panel is not None:
        most += panel.log.size_mb if panel.log.enabled else 0
        most += panel.record.max_mb if panel.record is not None else 0
    there = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return max(OTHER_FILES_MB, int(most) - there // MB)


def _in_use(report: Report, folder: Path, served: bool) -> bool:
    """Whether another server has the folder that is not the one at the panel's port."""
    if served or not (folder / "server.lock").exists():
        return False
    data = DataDir(folder)
    try:
        data.claim()
    except FolderInUse as error:
        report.find("data_in_use", str(folder), detail=str(error))
        return True
    except OSError:
        return False
    data.release()
    return False
