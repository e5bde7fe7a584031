#!/usr/bin/env python3
"""Measures the workbench against what it must show: times as a user sees them in headless Chromium, page weight, sockets.

    tests/workbench_times.py GREYLAG FLIGHTS

GREYLAG is the program (a release build), FLIGHTS a folder made by `greylag mystery`. Prints one row a figure, with what it
must be. Needs Debian's `chromium` (or $CHROMIUM); no Python package.
"""

import csv
import os
import pathlib
import platform
import sys
import tempfile
import threading
import time
import urllib.request

from report_screenshot import Browser
from workbench_walk import Workbench, click, drop, foreign_sockets, wait

READY = "document.documentElement?.dataset.ready == 'yes'"
rows = []


def row(what, value, unit, must):
    rows.append((what, value, unit, must))
    print(f"{what:66} {value:9.3f} {unit:3} (must {must} {unit})" if must is not None else f"{what:66} {value:9.3f} {unit}", flush=True)


def long_log(flights, file, seconds):
    """One log of so many seconds: the training flights one after another, 5 s apart."""
    logs = sorted(flights.glob("train-*.csv"))
    with open(file, "w", newline="") as out:
        begun = 0.0
        writer = None
        k = 0
        while begun < seconds:
            with open(logs[k % len(logs)], newline="") as read:
                table = csv.reader(read)
                head = next(table)
                if writer is None:
                    writer = csv.writer(out)
                    writer.writerow(head)
                at = head.index("time_s")
                first = None
                for line in table:
                    time_s = float(line[at])
                    first = time_s if first is None else first
                    line[at] = repr(begun + time_s - first)
                    writer.writerow(line)
                begun += time_s - first + 5.0
            k += 1


class Sockets(threading.Thread):
    """Looks twenty times a second for sockets that are not on the loopback."""

    def __init__(self, pid):
        super().__init__(daemon=True)
        self.pid, self.found, self.looks, self.on = pid, set(), 0, True

    def run(self):
        while self.on:
            try:
                self.found.update(foreign_sockets(self.pid))
                self.looks += 1
            except (FileNotFoundError, ProcessLookupError):
                pass
            time.sleep(0.05)


def opened(browser, bench):
    """Opens the page; first contentful paint and the time until everything is drawn, s."""
    browser.call("Page.navigate", url="about:blank")
    begun = time.monotonic()
    browser.call("Page.navigate", url=bench.address)
    wait(browser, READY, 60, "the page")
    whole = time.monotonic() - begun
    # on a fast machine the page is drawn before its paint is on record
    wait(browser, "performance.getEntriesByName('first-contentful-paint').length > 0", 10, "the first paint")
    paint = browser.value("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN")
    return paint / 1000, whole


def weight(bench):
    """Bytes of the page without data."""
    ask = lambda path: urllib.request.urlopen(urllib.request.Request(
        bench.origin + path, headers={"Authorization": f"Bearer {bench.address.split('token=')[1]}"})).read()
    page = ask("/").decode()
    names = {part.split('"')[0] for part in page.split('"/assets/')[1:]}
    seen = set()
    total = len(page)
    while names - seen:
        name = (names - seen).pop()
        seen.add(name)
        text = ask(f"/assets/{name}").decode()
        total += len(text.encode())
        names |= {part.split('"')[0] for part in text.split('from "./')[1:]}
    return total


def measure(browser, greylag, flights, place):
    logs = sorted(flights.glob("train-*.csv"))
    bench = Workbench(greylag, flights / "model.toml", place / "ten")
    ten = place / "ten-minutes.csv"
    long_log(flights, ten, 600)
    opened(browser, bench)
    # a page that has not been drawn takes no drop
    browser.call("Page.captureScreenshot")
    drop(browser, [ten])
    wait(browser, "document.querySelectorAll('.grid button').length > 20", 120, "the grid of ten minutes")
    wait(browser, "document.documentElement.dataset.freeRunMs", 60, "a free run")
    paint, whole = opened(browser, bench)
    row("one log of ten minutes: first contentful paint", paint, "s", 1.0)
    row("one log of ten minutes: everything drawn", whole, "s", None)
    bench.kill()

    bench = Workbench(greylag, flights / "model.toml", place / "three")
    sockets = Sockets(bench.process.pid)
    sockets.start()
    row("page weight without data", weight(bench) / 1000, "kB", 300)
    opened(browser, bench)
    browser.call("Page.captureScreenshot")
    begun = time.monotonic()
    drop(browser, logs)
    wait(browser, f"document.querySelectorAll('.flight').length == {len(logs)}", 60, "the flights")
    row("three logs of 50 s dropped, read and reconstructed", time.monotonic() - begun, "s", None)
    begun = time.monotonic()
    wait(browser, "document.querySelectorAll('.grid button').length > 20", 60, "the failing grid")
    row("failing grid behind them", time.monotonic() - begun, "s", 1.0)
    # all three are fitted for the diagnosis of 150 s
    click(browser, "input[name=role-1][value=fit]")
    wait(browser, "document.querySelector('input[name=role-1][value=fit]').checked && document.documentElement.dataset.freeRunMs", 30, "the role")
    paint, whole = opened(browser, bench)
    row("three logs of 50 s: first contentful paint", paint, "s", 0.5)
    row("three logs of 50 s: everything drawn", whole, "s", None)
    wait(browser, "document.documentElement.dataset.freeRunMs", 30, "a free run")
    runs = []
    for share in (0.2, 0.35, 0.5, 0.65, 0.8):
        box = browser.value("(r => [r.x, r.y, r.width, r.height])(document.querySelector('[data-plot=time] .u-over').getBoundingClientRect())")
        browser.value("delete document.documentElement.dataset.freeRunMs")
        for kind in ("mousePressed", "mouseReleased"):
            browser.call("Input.dispatchMouseEvent", type=kind, x=box[0] + share * box[2], y=box[1] + 0.5 * box[3], button="left", clickCount=1)
        wait(browser, "document.documentElement.dataset.freeRunMs", 10, "a free run from a click")
        runs.append(float(browser.value("document.documentElement.dataset.freeRunMs")))
    row("free run from a click, median of five", sorted(runs)[2] / 1000, "s", 0.1)

    click(browser, "#diagnose")
    begun = time.monotonic()
    wait(browser, "document.querySelector('.first')", 120, "the first ranking")
    row("first ranking of 150 s", time.monotonic() - begun, "s", 2.0)
    wait(browser, "document.querySelector('.suspect')", 300, "the diagnosis")
    row("whole diagnosis of 150 s", time.monotonic() - begun, "s", 8.0)
    wait(browser, "!document.querySelector('#job progress')", 300, "the prior is tuned")
    click(browser, "#diagnose")
    wait(browser, "document.querySelector('.first') || document.querySelector('#job progress')", 60, "another diagnosis")
    time.sleep(0.5)
    begun = time.monotonic()
    click(browser, "#job button")
    wait(browser, "!document.querySelector('#job progress')", 60, "it is cancelled")
    row("cancel a diagnosis", time.monotonic() - begun, "s", 0.1)

    click(browser, "input[name=role-1][value=hold_out]")
    wait(browser, "!document.querySelector('.suspect')", 30, "the diagnosis of the other roles goes")
    click(browser, "#diagnose")
    wait(browser, "document.querySelector('.suspect')", 300, "the diagnosis")
    wait(browser, "!document.querySelector('#job progress')", 300, "the prior is tuned")
    begun = time.monotonic()
    wait(browser, "document.getElementById('ahead')?.textContent.includes('not yet added')", 300, "the error with the effect")
    row("error with the asserted effect, before the tick", time.monotonic() - begun, "s", None)
    click(browser, ".suspect input")
    begun = time.monotonic()
    wait(browser, "document.querySelector('.bars.estimated') || document.querySelector('.bars.amended')", 60, "the estimate")
    row("tick to equation error", time.monotonic() - begun, "s", 0.3)
    wait(browser, "document.querySelector('.bars.amended')", 300, "the fit")
    row("tick to output error", time.monotonic() - begun, "s", 2.0)
    sockets.on = False
    sockets.join()
    row(f"sockets other than loopback, in {sockets.looks} looks at 20 Hz", len(sockets.found), "", 0)
    bench.kill()


def main():
    greylag, flights = (pathlib.Path(a).resolve() for a in sys.argv[1:3])
    model = next((l.split(":")[1].strip() for l in open("/proc/cpuinfo") if l.startswith("model name")), platform.processor())
    print(f"{model}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, {time.strftime('%Y-%m-%d')}, {greylag.parent.name} build")
    with tempfile.TemporaryDirectory() as profile, tempfile.TemporaryDirectory() as place:
        browser = Browser(profile)
        try:
            browser.call("Emulation.setDeviceMetricsOverride", width=1400, height=900, deviceScaleFactor=1, mobile=False)
            measure(browser, greylag, flights, pathlib.Path(place))
        finally:
            browser.close()
    missed = [what for what, value, _, must in rows if must is not None and value > must]
    print("missed: " + ("; ".join(missed) if missed else "none"))


if __name__ == "__main__":
    main()
