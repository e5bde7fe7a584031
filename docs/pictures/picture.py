#!/usr/bin/env python3
"""Keeps a part of a report as a picture for the documentation.

    docs/pictures/picture.py REPORT.html SECTION HEIGHT PICTURE.png

The picture begins with the section of index SECTION and is 1280 CSS px wide and HEIGHT high.
docs/pictures/before-and-after.png is section 2, 1138 px, of the last comparison of the tutorial
docs/tutorials/find-a-missing-effect.md, with --report.
Needs Debian's `chromium` (or $CHROMIUM); no Python package.
"""

import base64
import pathlib
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests"))
from report_screenshot import Browser, open_page  # noqa: E402


def main(page, section, height, picture):
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(profile)
        troubles = open_page(browser, pathlib.Path(page), 1280, "light")
        if troubles:
            sys.exit("\n".join(troubles))
        top = browser.value(
            f"document.getElementById('s{section}').getBoundingClientRect().top + scrollY")
        clip = {"x": 0, "y": top, "width": 1280, "height": int(height), "scale": 0.75}
        shot = browser.call(
            "Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)
        pathlib.Path(picture).write_bytes(base64.b64decode(shot["data"]))
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
