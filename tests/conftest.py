"""What every test may use: the real input data where it is present, and reproducible random cases."""

from __future__ import annotations

import faulthandler
import gc
import multiprocessing
import os
import signal
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

from wholebody.base import batches, runner
from wholebody.base.compiled import compile_all
from wholebody.base.runner import ONE_THREAD

# Before numpy is loaded, and for workers and child processes too. Threads of linear algebra wait by computing, which
# takes three times the processor's time of the computation itself where workers share two cores.
os.environ.update({name: os.environ.get(name, one) for name, one in ONE_THREAD.items()})

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, settings

from tests.flesh import settle
from wholebody.base.errors import WholebodyError
from wholebody.figures import load, surface
from wholebody.figures.description import Description
from wholebody.figures.figure import Figure
from wholebody.figures.surface import making
from wholebody.figures.surface.fields import Field
from wholebody.figures.surface.nets import Triangles, triangles
from wholebody.scene.scene import Scene
from wholebody.view import browser, screenshot
from wholebody.view.browser import Browser
from wholebody.view.page import picture_page
from wholebody.view.viewer import Viewer

gc.disable()  # until all is collected: looking through what is imported takes a sixth of that time

ROOT = Path(__file__).resolve().parent.parent

# Examples are the same in every run; `--hypothesis-profile random` tries others. A failure says how to repeat it.
settings.register_profile(
    "random", max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.register_profile("repeated", settings.get_profile("random"), derandomize=True, database=None)
# Tests that press Ctrl-C do so as in a terminal; what runs in the background is started with it ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Pieces of meshes are made anew in every run of the tests, by the code under test; workers of one run share them.
if "PYTEST_XDIST_WORKER" not in os.environ:
    _CACHE = tempfile.TemporaryDirectory(prefix="wholebody-cache-")
    os.environ["WHOLEBODY_CACHE"] = _CACHE.name
# Child processes keep the byte code of modules, as those of users do: without it each compiles 150 files again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# The tests' own byte code is kept too: to rewrite their assertions is most of what collecting them takes.
sys.dont_write_bytecode = False

settings.load_profile("repeated")

COAL = {"formula": (0.0, 1e-12), "iterated": (1e-6, 1e-9), "ellipsoid": (1e-6, 1e-5)}
"""Accuracy of coal's distances: metres, and share of the size of both pieces together.

"formula" are pairs of spheres, capsules, boxes with spheres, and all with half-spaces: right to rounding in 100,000
random pairs of 1 cm to 2 m. "iterated" are pairs of boxes and hulls: coal stops at 1e-6 m; measured 9e-11 of the size,
and 4e-8 m inside of small hulls. "ellipsoid" are ellipsoids but with half-spaces: measured 5e-6 of the size, at 1 m as
at 100 m, and 1e-6 m at 1 cm."""


class Backwards(pytest.Dir):
    """A folder that is collected from its last file to its first."""

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        """Yield what is in it."""
        yield from reversed([*super().collect()])


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Let every second worker begin with the last file: of a new clone each compiles half, and reads the others' half.

    To rewrite the assertions of all files takes one worker nine seconds.
    """
    second = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]) % 2
    return Backwards.from_parent(parent, path=path) if second else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the files that take longest, over three seconds each, before the others: workers end together.

    pytest-xdist keeps this order with `--no-loadscope-reorder`; by itself it would begin with the files of most tests.
    All workers must have one order, whichever they collected in.
    """
    longest = ROOT / "tests" / "longest.txt"
    places = {ROOT / "tests" / f"{name}.py": place for place, name in enumerate(longest.read_text().split())}
    if missing := [str(path) for path in places if not path.is_file()]:
        raise pytest.UsageError(f"{longest} names {', '.join(missing)}, which is no file")
    items.sort(key=lambda item: (places.get(item.path, len(places)), item.path))


def pytest_collection_finish() -> None:
    """Leave what was imported and collected out of the garbage collector: it is looked through often, and stays."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)  # what is imported later stays too
    gc.enable()


@pytest.fixture(scope="session")
def coal_slack() -> Callable[..., float]:
    """Return a function: kind of a pair (of `COAL`), sizes of its pieces [m] -> by how much coal may be off [m]."""

    def slack(kind: str, *sizes: float) -> float:
        metres, share = COAL[kind]
        return metres + share * sum(sizes)

    return slack


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the top of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real motions and props; skip the test where it is absent.

    It is named by WHOLEBODY_DATA, or lies in ``../shared/data`` beside the checkout.
    """
    named = os.environ.get("WHOLEBODY_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        if named:
            pytest.fail(f"WHOLEBODY_DATA names {folder}, which is not a folder")
        pytest.skip("no real input data here; WHOLEBODY_DATA names its folder")
    return folder


def _figure(model: pin.Model, geometry: pin.GeometryModel, segments: tuple[str, ...]) -> Figure:
    joints = tuple(name for name in list(model.names)[1:] if name != "root_joint")
    description = Description(
        groups={"all": joints},
        chains={},
        frames=segments,
        segments=segments,
        postures={"neutral": lambda figure: pin.neutral(figure.model)},
    )
    return Figure("test", model, geometry, "own", description)


def _free_bodies(*shapes: Any) -> Figure:
    model, geometry = pin.Model(), pin.GeometryModel()
    for k, shape in enumerate(shapes):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint" if k == 0 else f"free{k}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
        frame = model.addFrame(pin.Frame(f"body{k}", joint, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        for n, piece in enumerate(shape.pieces()):
            made = pin.GeometryObject(f"body{k}:{n}", joint, frame, piece.placement, piece.geometry)
            index = geometry.addGeometryObject(made)
            for other in range(index):
                if geometry.geometryObjects[other].parentJoint != joint:
                    geometry.addCollisionPair(pin.CollisionPair(other, index))
    return _figure(model, geometry, tuple(f"body{k}" for k in range(len(shapes))))


def _planar_arm(lengths: Any, radius: float = 0.02, limit: float = 3.0) -> Figure:
    model, geometry = pin.Model(), pin.GeometryModel()
    joint, at = 0, pin.SE3.Identity()
    for k, length in enumerate(lengths):
        bound = [np.array([value]) for value in (100.0, 10.0, -limit, limit)]
        joint = model.addJoint(joint, pin.JointModelRZ(), at, f"turn{k}", *bound)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        frame = model.addFrame(pin.Frame(f"link{k}", joint, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        along = pin.SE3(pin.utils.rotate("y", np.pi / 2), np.array([length / 2, 0.0, 0.0]))
        geometry.addGeometryObject(pin.GeometryObject(f"link{k}", joint, frame, along, coal.Capsule(radius, length)))
        at = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    model.addFrame(pin.Frame("tip", joint, frame, at, pin.FrameType.OP_FRAME))
    for second in range(2, len(lengths)):
        for first in range(second - 1):
            geometry.addCollisionPair(pin.CollisionPair(first, second))
    figure = _figure(model, geometry, tuple(f"link{k}" for k in range(len(lengths))))
    return figure


@pytest.fixture(scope="session")
def free_bodies() -> Callable[..., Figure]:
    """Return a function: shapes -> a figure of as many free-flying bodies, "body0", "body1", ..., in all pairs."""
    return _free_bodies


@pytest.fixture(scope="session")
def planar_arm() -> Callable[..., Figure]:
    """Return a function: lengths -> a fixed arm in the plane z = 0, joints "turn0", ..., frame "tip"."""
    return _planar_arm


@pytest.fixture(scope="session")
def human() -> Figure:
    """Return the person as it is by default; figures do not change."""
    return load("human")


@pytest.fixture(scope="session")
def hand() -> Figure:
    """Return a right hand."""
    return load("hand")


_LAID: WeakKeyDictionary[Scene, tuple[Any, Any, Any]] = WeakKeyDictionary()
"""Of scenes: the geometry as it was built, and Pinocchio's data of both; to make them takes longer than to use them."""


def _least_distance(scene: Scene, q: Any) -> float:
    """Least signed distance of all pairs, from Pinocchio's own loop over coal, without a guess."""
    built, data, placed = _LAID.get(scene, (None, None, None))
    if built is not scene.built:
        data, placed = scene.model.createData(), pin.GeometryData(scene.geometry)
        for request in placed.distanceRequests:
            request.enable_cached_gjk_guess = False  # else an answer begins where the one before ended
        _LAID[scene] = scene.built, data, placed
    pin.updateGeometryPlacements(scene.model, data, scene.geometry, placed, np.asarray(q))
    settle(scene.geometry, placed)
    nearest = pin.computeDistances(scene.geometry, placed)
    return float(placed.distanceResults[nearest].min_distance) if len(placed.distanceResults) else np.inf


@pytest.fixture(scope="session")
def least_distance() -> Callable[..., float]:
    """Return a function: scene, posture -> least signed distance of all pairs."""
    return _least_distance


@pytest.fixture(autouse=True, scope="module")
def warm_processes(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fork the processes of jobs from that of the tests, which has imported everything: each saves a second.

    A module that is about processes sets ``FROM_SCRATCH = True``: there they are new interpreters, as for users.
    """
    with pytest.MonkeyPatch.context() as patch:
        if not getattr(request.module, "FROM_SCRATCH", False):
            patch.setattr(runner, "start_process", _start_warm)
        yield
        batches.close_children()  # one that is left would have the variables and the patches of this module


@pytest.fixture(autouse=True, scope="module")
def coarse_surfaces(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Draw people with triangles twice as large: to make the surface of one takes 1.5 s of the processor, not 0.5.

    A module that is about surfaces sets ``FINE_SURFACES = True``.
    """
    fine = getattr(request.module, "FINE_SURFACES", False)
    with pytest.MonkeyPatch.context() as patch:
        if fine:
            patch.setenv("WHOLEBODY_CACHE", str(tmp_path_factory.mktemp("cache")))
            surface._kept.cache_clear()
        else:
            patch.setattr(making, "triangles", _coarse_triangles)
        yield
        if fine:
            surface._kept.cache_clear()


def _coarse_triangles(field: Field, low: Any, high: Any, cell: float, cuts: Sequence[Field] = ()) -> Triangles:
    return triangles(field, low, high, 2.0 * cell, cuts)


@pytest.fixture(autouse=True, scope="session")
def charts_as_they_are_laid_out_at_first() -> Iterator[None]:
    """Draw charts without making room for all words, which takes half of the time."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda *_: None)
        yield


@pytest.fixture(autouse=True, scope="module")
def emptied_caches(request: pytest.FixtureRequest) -> Iterator[None]:
    """Forget what a module's own cached functions made: hundreds of scenes make each fork of a process slower."""
    yield
    for value in vars(request.module).values():
        if getattr(value, "__module__", None) == request.module.__name__ and hasattr(value, "cache_clear"):
            value.cache_clear()


def _start_warm(environment: Mapping[str, str]) -> runner.Started:
    """Start a process as `runner.start_process` does, as a fork of this one, which has all loops compiled."""
    compile_all()  # a second to read back, the first time; each fork would need it for itself
    ours, theirs = socket.socketpair()
    output = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
    arguments = (theirs, output.fileno(), environment, os.getpid())
    process: Any = multiprocessing.get_context("fork").Process(target=_serve_warm, args=arguments, daemon=True)
    process.start()
    process.wait = lambda: process.join() or process.exitcode or 0  # as a `subprocess.Popen` has it
    theirs.close()
    return runner.Started(process, Connection(ours.detach()), output)


def _serve_warm(connection: socket.socket, output: int, environment: Mapping[str, str], parent: int) -> None:
    gc.freeze()  # a collection would look through all that the tests hold, and copy its pages
    faulthandler.disable()  # jobs that crash on purpose would write of it into the output of the tests
    os.environ.clear()
    os.environ.update(environment)
    os.dup2(output, 1)
    os.dup2(output, 2)
    sys.stdout, sys.stderr = os.fdopen(1, "w", 1), os.fdopen(2, "w", 1)
    runner.serve(connection.detach(), parent)
    os._exit(0)  # the process must not close resources of the parent


class KeptBrowser(Browser):
    """A browser that is not ended when it is closed but serves the next one who starts one: to start takes seconds."""

    idle: ClassVar[list[KeptBrowser]] = []
    asked = (
        ""  # the page to open before anything else is done: most commands that begin to start a browser draw nothing
    )

    @classmethod
    def start(cls, page: str = "") -> Browser:
        """Return an idle browser, or a new one."""
        if not cls.idle or not browser.find_chromium():
            return cls(page=page)
        kept = cls.idle.pop()
        kept.asked = page
        return kept

    def _call(self, method: str, **params: Any) -> dict[str, Any]:
        self._open_asked()
        return super()._call(method, **params)

    def _begin(self, expression: str) -> Callable[[], Any]:
        self._open_asked()
        return super()._begin(expression)

    def _open_asked(self) -> None:
        page, self.asked = self.asked, ""
        if page:
            self.open_html(page)

    def close(self) -> None:
        """Empty the page, if one was opened, and keep the browser."""
        unopened, self.asked = bool(self.asked), ""
        try:
            if not unopened:
                self.open("about:blank", "true")
        except WholebodyError:
            super().close()
        else:
            self.idle.append(self)


@pytest.fixture(autouse=True, scope="session")
def kept_browsers() -> Iterator[None]:
    """Let pictures be drawn by browsers that were started before, and small ones where no size is stated.

    Their pages compile the shaders that a scene has, and no others beforehand, which takes half of the time of a page.
    """
    warm, cold = picture_page(), picture_page().replace("warm_up(JSON.parse(pane.dataset.still));", "{}")
    assert cold != warm
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(screenshot, "Browser", KeptBrowser.start)
        patch.setattr(screenshot, "picture_page", lambda: cold)
        for drawing in (Viewer.picture, Viewer.begin_picture):
            patch.setattr(drawing, "__defaults__", ((320, 240),))
        os.register_at_fork(after_in_child=KeptBrowser.idle.clear)  # a browser listens to one process
        yield
    for kept in KeptBrowser.idle:
        Browser.close(kept)
    KeptBrowser.idle.clear()
