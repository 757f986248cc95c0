"""A rendered page of the panel as a file that stands alone: without scripts, with its styles and the
panel's pictures in it. It requests nothing and sends nothing, whatever is touched.
"""

import base64
import re
from collections.abc import Collection
from typing import Final
from urllib.parse import unquote

from markupsafe import Markup, escape

from app.web.assets import PICTURES, Assets

MOST_PICTURE: Final = 500_000  # bytes of one that is put into the page
STYLE: Final = """
.screen{height:calc(100dvh - 24px)}
.shown-at{position:fixed;inset:auto 0 0;height:24px;margin:0;background:#ffd400;color:#000;
font:bold 15px/24px sans-serif;text-align:center;white-space:nowrap;overflow:hidden}
.not-kept{position:absolute;z-index:2;inset:0 0 auto;margin:4px;font:15px/1.3 sans-serif;
text-align:center}
"""
POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; form-action 'none'"
_GONE: Final = re.compile(
    r"<script\b.*?</script>|<link rel=\"(?:modulepreload|preload|expect)\"[^>]*>"
    r"|<meta http-equiv=\"refresh\"[^>]*>|</?noscript>|<template\b.*?</template>",
    re.DOTALL,
)
_SHEET: Final = re.compile(r'<link rel="stylesheet" href="[^"<>]*/static/[^"/<>]*/([^"<>]{1,300})">')
_PICTURE: Final = re.compile(r'<img\b[^<>]*\ssrc="([^"<>]*)"[^<>]*>')
_SOURCE: Final = re.compile(r'(?<=\ssrc=")[^"<>]*(?=")')
_LINK: Final = re.compile(r'(<a\b[^<>]*?)\shref="([^"<>]*)"')
_FONT: Final = re.compile(r"@font-face\{[^{}]*\}")  # are not sent along
_PAGE: Final = re.compile(r"/pages/([a-z][a-z0-9_]*)$")


def stands_alone(
    html: str, assets: Assets, pages: Collection[str], base: str, mark: str, no_picture: str
) -> str:
    """`pages` are the ids of those that are files beside this one, of the robot whose paths begin with
    `base`. `mark` says when it was shown, `no_picture` stands in the place of a picture that comes from
    a robot."""

    def sheet(link: re.Match[str]) -> str:
        file = assets.files.get(link[1])
        return "" if file is None else f"<style>{_FONT.sub('', file.content.decode())}</style>"

    def picture(image: re.Match[str]) -> str:
        if image[1].startswith("data:"):
            return image[0]
        name = unquote(image[1].partition(f"/{PICTURES}/")[2])
        file = assets.files.get(f"{PICTURES}/{name}") if name else None
        if file is None or len(file.content) > MOST_PICTURE:
            return f'<p class="not-kept">{escape(no_picture)}</p>'
        packed = base64.b64encode(file.content).decode()
        return _SOURCE.sub(lambda _: f"data:{file.media_type};base64,{packed}", image[0], count=1)

    def link(anchor: re.Match[str]) -> str:
        if anchor[2].startswith("#"):
            return anchor[0]
        page = _PAGE.search(anchor[2])
        if page is None or page[1] not in pages or anchor[2] != f"{base}{page[0]}":
            return anchor[1]
        return f'{anchor[1]} href="{page[1]}.html"'

    text = _SHEET.sub(sheet, _GONE.sub("", html))
    text = _LINK.sub(link, _PICTURE.sub(picture, text))
    policy = Markup('<meta http-equiv="Content-Security-Policy" content="{}">').format(POLICY)
    shown = Markup('<p class="shown-at">{}</p>').format(mark)
    text = text.replace("<head>", f"<head>{policy}", 1).replace(
        "</head>", f"<style>{STYLE}</style></head>", 1
    )
    return text.replace("</body>", f"{shown}</body>", 1)
