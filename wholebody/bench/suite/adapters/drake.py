"""drake: `InverseKinematics`, one nonlinear program for the whole posture, solved by SNOPT."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.base.errors import InputError
from wholebody.bench.suite.adapters.base import OneCall, few
from wholebody.bench.suite.adapters.loop import kept_apart, placements, posture_costs
from wholebody.bench.suite.adapters.urdf import axis_of
from wholebody.bench.suite.problem_sets.things import shape_of
from wholebody.methods.differential import TOOL
from wholebody.problem import Problem
from wholebody.tasks.frame import PlacementResidual
from wholebody.tasks.inputs import Place


class Drake(OneCall["_Plant"]):
    """drake's InverseKinematics as a method; its iterations are SNOPT's major ones."""

    name = "drake"
    loose = (*few(10, 20, 50), *((tolerance, None) for tolerance in (1e-2, 1e-3, 1e-4, 1e-5)))
    kinds = (
        wb.tasks.Displacement, wb.Effort, wb.Frame, wb.Freeze, wb.Hold, wb.Orientation, wb.Point, wb.Relative,
        wb.tasks.StepLimit,
    )  # fmt: skip
    way = "by one nonlinear program"
    failure = "SNOPT found no posture that meets goals and constraints"

    def depends_on(self, problem: Problem) -> tuple[Any, ...]:
        """The clearances, and where the pieces are."""
        return problem.clearances, placements(problem).tobytes()

    def build(self, problem: Problem) -> _Plant:
        """Build the plant."""
        return _Plant(problem)

    def found(self, built: _Plant, problem: Problem) -> tuple[Array | None, bool]:
        """The answer of the program."""
        # Goals and holds are asked to a quarter of the tolerance: a box of this half width, and an angle.
        program = _Program(built, problem, 0.25 * self.tolerance)
        iterations = 500 if self.iterations is None else self.iterations  # most of SNOPT's major ones
        return program.solved(problem.scene.figure.clamp(problem.start), iterations)


class _Plant:
    """A MultibodyPlant of a scene: bodies by the index of our joint, and the least distance of its pairs [m]."""

    def __init__(self, problem: Problem) -> None:
        from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
        from pydrake.systems.framework import DiagramBuilder

        builder = DiagramBuilder()
        self.plant, self._graph = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        self._model, self._figure = problem.scene.model, problem.scene.figure
        self.bodies: list[Any] = [self.plant.world_body()]
        self._addresses: list[tuple[str, Any]] = []
        for index in range(1, self._model.njoints):
            self._add_joint(index)
        self.least = problem.clearance + 2e-5  # drake's distances of hulls and ellipsoids are exact to about 2e-5 m
        self._pieces: dict[tuple[int, float], Any] = {}
        pairs = self._paired(problem)
        self.plant.Finalize()
        self._filter(pairs)
        self.paired = bool(pairs)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self._context)

    def theirs(self, q: Array) -> Array:
        """Posture in drake's order, from ours (nq,)."""
        there = np.zeros(self.plant.num_positions())
        if self._figure.root == "free":
            pose = self._model.jointPlacements[1] * pin.XYZQUATToSE3(q[:7])
            x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
            there[:7] = w, x, y, z, *pose.translation
        for name, ours in self._addresses:
            part = q[ours.idx_q : ours.idx_q + ours.nq]
            angle = part[0] if ours.nq == 1 else np.arctan2(part[1], part[0])
            there[self.plant.GetJointByName(name).position_start()] = angle
        return there

    def ours(self, there: Array) -> Array:
        """Our posture (nq,) from drake's."""
        q: Array = pin.neutral(self._model)
        if self._figure.root == "free":
            w, x, y, z = there[:4] / np.linalg.norm(there[:4])
            pose = self._model.jointPlacements[1].inverse() * pin.SE3(pin.Quaternion(w, x, y, z), there[4:7])
            q[:7] = pin.SE3ToXYZQUAT(pose)
        for name, ours in self._addresses:
            angle = there[self.plant.GetJointByName(name).position_start()]
            q[ours.idx_q : ours.idx_q + ours.nq] = angle if ours.nq == 1 else (np.cos(angle), np.sin(angle))
        return q

    def dof(self) -> Array:
        """(nv,) drake's place of each of ours but those of a free root, which has -1."""
        found = np.full(self._model.nv, -1)
        for name, ours in self._addresses:
            found[ours.idx_v] = self.plant.GetJointByName(name).position_start()
        return found

    def _add_joint(self, index: int) -> None:
        from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia

        model, name = self._model, self._model.names[index]
        joint, parent = model.joints[index], self.bodies[model.parents[index]]
        body = self.plant.AddRigidBody(name, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        self.bodies.append(body)
        if joint.nq == 7 and index == 1:
            return  # drake lets a body without a joint float
        known = axis_of(model, index, "drake's plant is made for free roots, turning and sliding ones")
        at = self.plant.AddFrame(
            FixedOffsetFrame(f"{name}, before", parent.body_frame(), _pose(model.jointPlacements[index]))
        )
        lower, upper = (-np.inf, np.inf)
        if joint.nq == 1:
            lower, upper = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        joint_class = PrismaticJoint if known.kind == "prismatic" else RevoluteJoint
        self.plant.AddJoint(joint_class(name, at, body.body_frame(), known.axis, lower, upper))
        self._addresses.append((name, joint))

    def _paired(self, problem: Problem) -> list[tuple[Any, Any]]:
        """Geometries of the pairs that keep the least distance."""
        pieces, pairs = problem.scene.geometry.geometryObjects, []
        for pair in kept_apart(problem, 0.0):
            lower = problem.clearance - pair.clearance
            surface = isinstance(pieces[pair.second].geometry, coal.Halfspace)
            if lower <= 0.0 or surface:
                pairs.append(
                    (
                        self._piece(pieces, pair.first, 0.0),
                        # Pairs that rest may be 4e-5 m nearer: the smooth maximum of two of them is above each.
                        self._piece(pieces, pair.second, lower + 4e-5 if surface and lower > 0.0 else 0.0),
                    )
                )
        return pairs

    def _piece(self, pieces: Any, number: int, lower: float) -> Any:
        from pydrake.multibody.plant import CoulombFriction

        if (number, lower) not in self._pieces:
            ours = pieces[number]
            shape, place = _shape(ours, lower)
            self._pieces[number, lower] = self.plant.RegisterCollisionGeometry(
                self.bodies[ours.parentJoint], _pose(place), shape, f"{number} {lower!r}", CoulombFriction(1.0, 1.0)
            )
        return self._pieces[number, lower]

    def _filter(self, pairs: list[tuple[Any, Any]]) -> None:
        from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

        manager = self._graph.collision_filter_manager()
        manager.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(list(self._pieces.values()))))
        allowed: dict[Any, list[Any]] = {}
        for first, second in pairs:
            allowed.setdefault(first, []).append(second)
        for first, others in allowed.items():
            manager.Apply(CollisionFilterDeclaration().AllowBetween(GeometrySet(first), GeometrySet(others)))


class _Program:
    def __init__(self, plant: _Plant, problem: Problem, tolerance: float) -> None:
        from pydrake.multibody.inverse_kinematics import InverseKinematics

        self._plant, self._scene, self._tolerance = plant, problem.scene, tolerance
        with TOOL:
            self._ik = InverseKinematics(plant.plant, plant.context)
            if plant.paired:
                # Pairs nearer than 1 cm beyond the clearance take part: drake's default.
                self._ik.AddMinimumDistanceLowerBoundConstraint(plant.least, 0.01)
        for goal in problem.goals:
            if isinstance(goal, wb.Point):
                place = problem.scene.model.frames[goal.place.frame].placement * pin.SE3(
                    np.eye(3), goal.resolved_offset
                )
                self._position(
                    goal.place.joint, place.translation, 0, pin.SE3(np.eye(3), np.array(goal.resolved_target))
                )
            else:
                self._placement(getattr(goal, "residual"))  # noqa: B009
        for term in problem.constraints:
            if isinstance(term, wb.Hold):
                self._placement(term.residual)
        start, dof = plant.theirs(problem.start), plant.dof()
        program, variables = self._ik.prog(), self._ik.q()
        for bound in problem.bounds:
            if isinstance(bound, wb.Freeze):
                chosen: Any = dof[problem.scene.figure.dofs(bound.joints)]
                chosen = np.arange(7) if (chosen < 0).any() else chosen
                program.AddBoundingBoxConstraint(start[chosen], start[chosen], variables[chosen])
        for cost in posture_costs(problem):
            reference = plant.theirs(cost.reference)
            weights = np.zeros(len(reference))
            weights[dof[dof >= 0]] = cost.weights[dof >= 0]
            if (dof < 0).any():  # a quaternion turns by twice what it changes
                weights[:4], weights[4:7] = 4.0 * cost.weights[3:6].mean(), cost.weights[:3]
            program.AddQuadraticErrorCost(np.diag(weights), reference, variables)

    def solved(self, q: Array, iterations: int) -> tuple[Array, bool]:
        """The posture (nq,) of the program's answer from a start, and whether everything is met."""
        from pydrake.solvers import SnoptSolver, SolverOptions

        options = SolverOptions()
        options.SetOption(SnoptSolver.id(), "Major iterations limit", iterations)
        with TOOL:
            result = SnoptSolver().Solve(self._ik.prog(), self._plant.theirs(q), options)
        there = np.array(result.GetSolution(self._ik.q()))
        found = self._plant.ours(there) if np.isfinite(there).all() else q
        return found, bool(result.is_success())

    def _placement(self, residual: PlacementResidual) -> None:
        """Where a frame is in another, or in the world."""
        place, base, target = self._at(residual.place), self._at(residual.base), residual.placement
        here = base * target  # in the body of the base, where the frame has to be
        if residual.position:
            self._position(residual.place.joint, place.translation, residual.base.joint, here)
        if residual.orientation:
            self._turned(residual, here.rotation, place.rotation)

    def _at(self, place: Place) -> pin.SE3:
        return self._scene.model.frames[place.frame].placement if place.frame else pin.SE3.Identity()

    def _position(self, joint: int, point: Array, base: int, target: pin.SE3) -> None:
        bodies, half = self._plant.bodies, self._tolerance / np.sqrt(3.0)
        self._ik.AddPositionConstraint(
            bodies[joint].body_frame(),
            point,
            bodies[base].body_frame(),
            target.translation - half,
            target.translation + half,
        )

    def _turned(self, residual: PlacementResidual, wanted: Array, own: Array) -> None:
        from pydrake.math import RotationMatrix

        there, here = (self._plant.bodies[at.joint].body_frame() for at in (residual.base, residual.place))
        # Within 0.5 rad, axes at right angles tell an orientation apart from its opposites.
        self._ik.AddOrientationConstraint(there, RotationMatrix(wanted), here, RotationMatrix(own), 0.5)
        for axis in range(3):  # its cosine is flat where it is met: right angles between axes are exact
            right = 0.5 * np.pi
            self._ik.AddAngleBetweenVectorsConstraint(
                there, wanted[:, axis], here, own[:, (axis + 1) % 3], right - self._tolerance, right + self._tolerance
            )


def _pose(place: pin.SE3) -> Any:
    from pydrake.math import RigidTransform

    return RigidTransform(place.homogeneous)


def _shape(piece: Any, lower: float) -> tuple[Any, pin.SE3]:
    """A piece as a shape of drake's, and its placement; a half-space is lowered."""
    import pydrake.geometry as shapes

    place, (kind, lengths) = piece.placement, shape_of(piece.geometry)
    if kind in ("sphere", "capsule", "cylinder", "box", "ellipsoid"):
        return getattr(shapes, kind.capitalize())(*lengths), place
    if kind == "hull":
        points = np.array([piece.geometry.point(k) for k in range(piece.geometry.num_points)])
        return shapes.Convex(points.T.copy(), piece.name.replace("\n", " ")), place
    if kind == "half-space":
        normal, edge = np.array(lengths[:3]), 50.0  # m: of the box that stands for a half-space
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).matrix()
        return shapes.Box(edge, edge, edge), place * pin.SE3(turn, (lengths[3] - lower - 0.5 * edge) * normal)
    raise InputError(f"{piece.name!r} is a {kind}; drake's plant is made for convex shapes")
