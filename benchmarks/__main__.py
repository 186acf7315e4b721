"""``python -m benchmarks COMMAND``."""

from __future__ import annotations

from benchmarks.agreement import agreement
from benchmarks.bench.run import bench, tables
from benchmarks.cells import cells
from benchmarks.collisions import collisions
from benchmarks.conversions import conversions
from benchmarks.datasets import datasets
from benchmarks.device import device
from benchmarks.engines import engines
from benchmarks.experts import experts
from benchmarks.gallery.pages import gallery
from benchmarks.ladder import ladder
from benchmarks.learned import imitation, reinforcement
from benchmarks.manifest import manifest
from benchmarks.objects import objects
from benchmarks.packaged import packaged
from benchmarks.placing import placing
from benchmarks.planning import planning
from benchmarks.processors import processors
from benchmarks.robots.survey import mjcfs, robots
from benchmarks.site.pictures import pictures
from benchmarks.skills import skills
from benchmarks.soak import soak
from benchmarks.teleop import teleop
from robot_layouts.core.cli import Command, Program
from robot_layouts.core.commands import MEANINGLESS, start

PROGRAM = Program(
    "python -m benchmarks",
    {
        # 1 says that something differs, 2 that it could not be tried
        function.__name__.replace("_", "-"): Command(function, MEANINGLESS)
        for function in (
            bench,
            tables,
            gallery,
            pictures,
            soak,
            robots,
            mjcfs,
            cells,
            collisions,
            planning,
            placing,
            packaged,
            objects,
            datasets,
            engines,
            device,
            agreement,
            experts,
            skills,
            conversions,
            processors,
            imitation,
            reinforcement,
            ladder,
            teleop,
            manifest,
        )
    },
)
main = PROGRAM.main

if __name__ == "__main__":
    start(main)
