"""The picture of the README: the top of RA1's report in a browser. Needs Chromium, playwright and pillow.

python studies/report/picture.py
"""

import io
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

import tolcontact as tc
from tolcontact.report import write_page

HERE = Path(__file__).parent
WIDTH, HEIGHT = 1080, 850


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        page = Path(folder) / "ra1.html"
        with tc.run(HERE.parents[1] / "models" / "ra1.py", samples=10_000, seed=1, solver="daqp") as results:
            write_page(results, tc.summarize(results), page)
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
        )
        opened = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
        opened.goto(page.as_uri())
        opened.wait_for_function("window.viewer !== undefined")
        opened.wait_for_timeout(1000)
        taken = opened.screenshot()
        browser.close()
    Image.open(io.BytesIO(taken)).convert("RGB").save(sys.argv[1] if len(sys.argv) > 1 else HERE / "ra1.png", optimize=True)


if __name__ == "__main__":
    main()
