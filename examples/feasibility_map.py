"""The picture of the README: the feasibility map of the demo's trim line.

It shows how to use the parts of kerfpath one by one: read a job and its part, build the layered
graph, plan, and draw. It writes docs/feasibility-map.html for the README and, if Chromium is
installed, the same picture as a PNG.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from importlib.resources import as_file, files
from pathlib import Path

from kerfpath.cad import read as read_drawing
from kerfpath.job import read_job
from kerfpath.planner import layered_graph, plan
from kerfpath.report import feasibility_map

DOCS = Path(__file__).parent.parent / "docs"
SIZE = (1100, 620)
BROWSER = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--hide-scrollbars",
    "--virtual-time-budget=8000",
]


def main() -> None:
    """Plan the trim line with every posture allowed, and draw its map."""
    with as_file(files("kerfpath").joinpath("demo")) as folder:
        job = read_job(folder / "b_pillar.toml")
        part = read_drawing(job.part_file)
    task = next(t for t in job.contours if t.name == "trim")
    nodes = task.sample(part.contour(task.pick))
    graph = layered_graph(
        nodes,
        job.robot,
        tool=job.tool,
        placement=job.placement,
        gamma_step=job.options.gamma_step,
    )
    made = plan(
        nodes,
        job.robot,
        tool=job.tool,
        placement=job.placement,
        speed=task.speed,
        options=job.options,
    )
    figure = feasibility_map(graph, made, s=nodes.s)
    figure.update_layout(width=SIZE[0], height=SIZE[1])
    with tempfile.TemporaryDirectory() as folder_name:
        page = Path(folder_name) / "map.html"
        figure.write_html(page, include_plotlyjs=True, config={"staticPlot": True})
        browser = shutil.which("chromium")
        if browser is None:
            print("no Chromium here: the picture was not drawn")
            return
        picture = DOCS / "feasibility-map.png"
        size = f"--window-size={SIZE[0] + 16},{SIZE[1] + 16}"
        target = f"--screenshot={picture}"
        profile = f"--user-data-dir={folder_name}/profile"
        subprocess.run(
            [browser, *BROWSER, profile, size, target, page.as_uri()],
            check=True,
            capture_output=True,
        )
        print(f"wrote {picture}")


if __name__ == "__main__":
    main()
