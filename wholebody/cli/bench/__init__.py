"""The command group `wholebody bench`: a file for the commands of each kind."""

from __future__ import annotations

from wholebody.cli.bench.comparing import compare
from wholebody.cli.bench.hard_cases import attack, stability
from wholebody.cli.bench.measuring import files, motion, scaling, step, world
from wholebody.cli.bench.published import answer, export, judge
from wholebody.cli.command import Group

run = Group(
    "bench",
    "measure steps, solves and problem sets, beside other tools where installed",
    """\
Measure what the package does, and write the numbers as CSV, the charts as SVG and PNG, and tables to read. Times depend
on the machine and on what else runs on it: compare ratios of one run. Set OMP_NUM_THREADS=1 for steady ones.""",
    (compare, export, answer, judge, stability, step, scaling, motion, world, files, attack),
    title="what to measure",
)
