# ruff: noqa: T201
"""A study of 20,000 cases on a dask cluster, with a live table. A run that was killed continues from its folder.

python cluster_study.py --robot arm.urdf                                   # two workers on this machine
python cluster_study.py --robot arm.urdf --cluster tcp://10.0.0.1:8786     # a running scheduler
python cluster_study.py --robot arm.urdf --slurm 40 --queue normal         # dask-jobqueue asks Slurm for 40 workers
"""

from __future__ import annotations

import argparse
import contextlib
import time

import wholebody as wb


def build(figure, target, layout=None):
    """One case: the gripper of an arm to a place."""
    scene = wb.Scene(figure).add(wb.Box((0.3, 0.3, 0.3)), name="box", at=(0.5, 0.0, 0.15))
    return wb.Problem(scene, goals=[wb.Point(list(figure.chains.values())[-1].tip, target)])


class Table:
    """Prints one line every five seconds: cases, share solved, time a case, time left."""

    def __init__(self):
        """Begin to count."""
        self.solved, self.new, self.began, self.told = 0, 0, time.monotonic(), 0.0

    def __call__(self, progress):
        """Take what `wb.study` tells after each case."""
        if progress.record is None:
            print(f"{progress.done} of {progress.total} are done already", flush=True)
            return
        self.new += 1
        self.solved += progress.record.solved
        now = time.monotonic() - self.began
        if now - self.told > 5.0 or progress.done == progress.total:
            self.told, each = now, now / self.new
            left = each * (progress.total - progress.done)
            print(f"{progress.done:6} of {progress.total}  {self.solved / self.new:6.1%} solved  "
                  f"{1e3 * each:6.1f} ms a case  {left:6.0f} s left", flush=True)  # fmt: skip


@contextlib.contextmanager
def workers(options):
    """Yield the address of a scheduler with workers of one thread each."""
    if options.cluster:
        yield options.cluster
    elif options.slurm:
        from dask_jobqueue import SLURMCluster

        with SLURMCluster(queue=options.queue, cores=1, processes=1, memory="2GB", walltime="04:00:00") as cluster:
            cluster.scale(options.slurm)
            yield cluster.scheduler_address
    else:
        from distributed import LocalCluster

        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            yield cluster.scheduler_address


def main():
    """Read the options, run, and say how long the new cases took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", required=True, help="a URDF")
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--folder", default="cluster-study")
    parser.add_argument("--cluster")
    parser.add_argument("--slurm", type=int, default=0)
    parser.add_argument("--queue")
    options = parser.parse_args()
    side = round(options.cases ** (1 / 3) + 0.5)
    grid = [-0.6 + 1.2 * k / (side - 1) for k in range(side)]
    places = [(x, y, z + 0.6) for x in grid for y in grid for z in grid][: options.cases]
    targets = {f"{number:05}": place for number, place in enumerate(places)}
    with workers(options) as address:
        table = Table()
        records = wb.study(
            build, people={"arm": wb.load(options.robot)}, targets=targets,
            cluster=address, folder=options.folder, progress=table,
        )  # fmt: skip
    print(records)
    print(f"{table.new} cases in {time.monotonic() - table.began:.0f} s")


if __name__ == "__main__":
    main()
