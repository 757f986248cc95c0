"""The built wheel, installed where nothing of the checkout is."""

import subprocess
import sys
from pathlib import Path

import httpx

from app.settings import PACKAGE
from tests.support.parts import ROOT, Process, Server, free_port, until

SHIPPED = PACKAGE / "panel.toml"


def test_an_installed_wheel_serves_from_any_folder(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True, timeout=120)
    (wheel,) = tmp_path.glob("*.whl")
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True, timeout=120)
    python = venv / "bin/python"
    lock = ROOT / "deploy/requirements.lock"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-compile"]
    pip += ["--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--require-hashes", "-r", str(lock)], check=True, timeout=600)
    subprocess.run([*pip, "--no-deps", str(wheel)], check=True, timeout=120)

    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    mine = Server(elsewhere, python=str(python))
    try:
        until(mine.ready, "ready")
        html = mine.http.get("/").text
        assert "Publish1" in html
        files = [part for part in html.split('"') if part.startswith("/static/")]
        assert len(files) >= 4
        assert {mine.http.get(file).status_code for file in files} == {200}
        assert mine.press("operation", "from a wheel").json()["outcome"] == "published"
    finally:
        mine.end()
    live = Server(elsewhere, python=str(python), KIOSK_MODE="live")
    try:  # by the zenoh.json5 that is in it
        assert "No connection to the robot" in live.widget("operation")["reason"]
    finally:
        live.end()
    check = subprocess.run(
        [str(python), "-m", "app.check"], cwd=elsewhere, capture_output=True, text=True, check=False
    )
    assert check.returncode == 0, check.stderr
    command = str(venv / "bin/operator-panel")
    told = subprocess.run(
        [command, "--version"], cwd=elsewhere, capture_output=True, text=True, check=True
    )
    assert told.stdout.split()[1] == wheel.name.split("-")[1]
    panel, port = elsewhere / "cell1.toml", free_port()
    panel.write_text(SHIPPED.read_text().replace("Publish1", "Pick up"))
    run = [command, "run", panel.name, f"--port={port}", f"--data={tmp_path / 'data'}"]
    served = Process(run, {"PYTHONPATH": ""}, cwd=elsewhere)
    try:
        until(lambda: "the panel is at" in served.text, "it listens", within_s=30)
        assert "Pick up" in httpx.get(f"http://127.0.0.1:{port}/", trust_env=False).text
    finally:
        served.end()
    services = (
        "from app.interfaces import load_interfaces as of; "
        "of('jazzy').service_types('std_srvs/srv/SetBool')"
    )
    subprocess.run([str(python), "-c", services], cwd=elsewhere, check=True, timeout=60)
    # Installed, it needs no file of the checkout: these are its own.
    assert str(ROOT) not in check.stdout
