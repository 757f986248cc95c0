"""The application with a page that fails, for `uvicorn tests.support.apps.broken_page:app`."""

from app import main


async def fails() -> None:
    raise RuntimeError("swordfish")


app = main.app
app.add_api_route("/broken", fails)
