"""A page that leads on: where a redirect would be one of another site's, or lead to another site."""

from typing import Final

from fastapi import Request
from fastapi.responses import HTMLResponse
from markupsafe import Markup

from app.i18n import render, say
from app.web.language import language_of

PAGE_ON: Final = Markup(
    '<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{text}</title>'
    '<meta http-equiv="refresh" content="0;url={url}"></head>'
    '<body><p><a href="{url}">{text}</a></p></body></html>'
)


def page_on(request: Request, url: str) -> HTMLResponse:
    """The page that leads to this address."""
    language = language_of(request)
    html = PAGE_ON.format(language=language, url=url, text=render(say("oidc_go_on"), language))
    return HTMLResponse(html, headers={"cache-control": "no-store", "referrer-policy": "no-referrer"})
