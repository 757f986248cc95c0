"""The pictures of the README, of the demo robot with docs/examples/palletizer.toml:
`python -m tests.screenshots` writes them to docs/images."""

import time

from playwright.sync_api import Locator, expect, sync_playwright

from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS, ROOT, Server, until

PANEL = ROOT / "docs/examples/palletizer.toml"
IMAGES = ROOT / "docs/images"
CYCLE_MS = 60_000  # the demo robot permits for 20 s and forbids for 8 s
SETTLED_S = 0.8  # a press is acknowledged and its highlight gone


def main() -> None:
    server = Server(ROOT, KIOSK_PANEL=str(PANEL))
    try:
        until(server.ready, "ready")
        take(server.url)
    finally:
        server.end()


def take(url: str) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"{url}/pages/setup")

        def button(name: str) -> Locator:
            return page.get_by_role("button", name=name, exact=True)

        # The beginning of the time in which the robot permits.
        expect(button("Load program")).to_be_disabled(timeout=CYCLE_MS)
        expect(button("Load program")).to_be_enabled(timeout=CYCLE_MS)
        button("Load program").click()
        expect(page.locator("[data-widget=load]")).to_contain_text("/operation2")
        page.goto(url)
        button("Work light on").click()
        expect(page.locator("[data-widget=light_on]")).to_contain_text("the light is on")
        button("Start pallet").click()
        expect(page.locator("[data-widget=pallet]")).to_contain_text("EXECUTING")
        time.sleep(SETTLED_S)
        page.screenshot(path=IMAGES / "production.png")
        page.goto(f"{url}/pages/setup")
        expect(button("Load program")).to_be_disabled(timeout=CYCLE_MS)
        time.sleep(SETTLED_S)
        page.screenshot(path=IMAGES / "locked.png")
        browser.close()


if __name__ == "__main__":
    main()
