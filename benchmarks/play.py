"""Cost of the live page of posture.play: real-time factor, frame rate, and CPU use of the server.

    python benchmarks/play.py [--seconds 30] [--visitors 1] [--csv benchmarks/play.csv]

Visitors are headless Chromium windows. They render in software, which costs far more than the server; their CPU time is not
counted. One row per state: the default policy at 0.3 Hz, the default policy in a ramp, and the model-based controller in a
ramp, which replans continuously. CPU is that of the server process, 100 % per core, without the process that computes the
theory.
"""

import argparse
import os
import shutil
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright
from shared import write

from posture.cli import jobs
from posture.config.play import PlayConfig
from posture.play.policies import policy_choices
from posture.play.server import running

ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SETTLE_S = 8.0


def main() -> None:
    """Measure, print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--visitors", type=int, default=1)
    parser.add_argument("--csv", type=Path, default=Path(__file__).with_name("play.csv"))
    arguments = parser.parse_args()
    config = jobs.compose("play", PlayConfig, "port=0", f"visitors={arguments.visitors}")
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("no chromium on this machine")
    rows = []
    with running(config, policy_choices(config.ckpt, config.lqr)) as server, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        windows = [browser.new_page(viewport={"width": 1280, "height": 800}) for _ in range(arguments.visitors)]
        for window in windows:
            window.goto(f"http://127.0.0.1:{server.port}")
        while sum(visitor.frames > 0 for visitor in list(server.visitors.values())) < arguments.visitors:
            windows[0].wait_for_timeout(100)
        visitors = list(server.visitors.values())
        for state in ("held", "ramp", "lqr in a ramp"):
            for visitor in visitors:
                visitor.command(partial(start, visitor.session, state))
            windows[0].wait_for_timeout(1000 * SETTLE_S)
            rows.append({"state": state, "visitors": arguments.visitors} | measure(visitors, windows, arguments.seconds))
            print(rows[-1], flush=True)
        browser.close()
    write(rows, arguments.csv)


def start(session: Any, state: str) -> None:
    """Bring a session into `state`."""
    if state == "lqr in a ramp":
        session.choose("lqr")
    session.set(freq=0.3)
    session.reset()
    session.ramp(0 if state == "held" else 1)


def measure(visitors: list[Any], windows: list[Any], seconds: float) -> dict[str, Any]:
    """One row; with several visitors that of the slowest."""
    count = (
        "new Promise(r => {let n = 0; const t = performance.now(); const f = () => {n++; const d = performance.now() - t; "
    )
    count += f"d > {1000 * seconds} ? r(1000 * n / d) : requestAnimationFrame(f)}}; f()}})"
    before = [(visitor.session.time, visitor.frames) for visitor in visitors]
    wall, own, load = time.monotonic(), time.process_time(), os.getloadavg()[0]
    drawn = windows[0].evaluate(count)
    took = time.monotonic() - wall
    return {
        "real_time_factor": round(min((v.session.time - b[0]) / took for v, b in zip(visitors, before, strict=True)), 3),
        "frames_sent_per_s": round(min((v.frames - b[1]) / took for v, b in zip(visitors, before, strict=True)), 1),
        "frames_drawn_per_s": round(drawn, 1),
        "cpu_percent": round(100 * (time.process_time() - own) / took, 1),
        "falls": sum(visitor.session.falls for visitor in visitors),
        "load_average": round(load, 1),
        "cores": os.cpu_count(),
    }


if __name__ == "__main__":
    main()
