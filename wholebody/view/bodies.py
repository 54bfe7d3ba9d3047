"""How bodies are drawn: a surface that bones bend, a robot's own visuals, or convex pieces."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wholebody.base.arrays import Array
from wholebody.figures.figure import Figure
from wholebody.figures.joining import joint_in
from wholebody.figures.link_pieces import drawn_of
from wholebody.figures.surface import Surface, surface_of
from wholebody.geometry.flesh import in_joints
from wholebody.geometry.pieces import box_corners
from wholebody.view import commands, drawing, style
from wholebody.view.scene_graph import Keyframe, SceneGraph, crowds
from wholebody.view.style import LOOK, Color
from wholebody.view.viewed_scene import ViewedAssembly, ViewedScene


class Skinned(NamedTuple):
    """One drawn patch."""

    path: str
    segment: str
    color: Color
    whole: bool = True  # whether all of it takes the colour of a contact; on a surface the page colours a patch


class Skin:
    """A figure's surface, whose bones are found among the figure's joints; some figures lack segments of the body."""

    def __init__(self, surface: Surface, figure: Any, at: Array) -> None:
        """Find the bones of a figure; `at` (4, 4) is where its world is."""
        self.surface = surface  # of the figure
        # places: of each bone the joint that carries it, and its placement (4, 4) there
        self.places = surface.attached(figure, at)
        self.joints = tuple(dict.fromkeys(name for name, _ in self.places))  # names of the joints that carry bones

    def build(self, graph: SceneGraph, root: str, carriers: Mapping[str, str], color: Color | None) -> list[Skinned]:
        """Put the surface at a node, moved by the nodes of its joints; in a colour, or each patch in its own."""
        bones = self.surface.bones
        halves = [
            (*half, *bone.slide, bone.turn.share, bone.turn.twist, *(bone.turn.aside or ()))
            for half in self.surface.halves
            for bone in (bones[half[0]],)
        ]
        places, binds = np.array([offset for _, offset in self.places]), np.array([bone.bind for bone in bones])
        nodes = [carriers[joint] for joint, _ in self.places]
        graph.do(commands.set_skeleton(root, nodes, places, np.linalg.inv(binds), halves))
        drawn = []
        for patch in self.surface.patches:
            shown: Color = (*patch.color, 1.0) if color is None else color
            path = f"{root}/{patch.name}"
            # metres: positions are sent as whole multiples of it, in half of the bytes
            graph.do(commands.set_skin(path, root, patch, shown, 1e-4))
            drawn.append(Skinned(path, patch.segment, shown, whole=False))
        return drawn


class LinkVisuals:
    """The visuals of a figure. A link with a mesh that cannot be read is left out: its pieces are drawn.

    Attributes:
        drawn: the objects.
        links, joints: names of the links that are drawn, and of the joints that carry them.
    """

    def __init__(self, figure: Any, skinned: tuple[str, ...] = ()) -> None:
        """Read the visuals, but for links whose names begin with one of `skinned`: figures that have a surface."""
        self.drawn = [one for one in drawn_of(figure) if not one.link.startswith(skinned)]
        self.links = frozenset(one.link for one in self.drawn)
        self.joints = tuple(dict.fromkeys(one.joint for one in self.drawn))

    def build(self, graph: SceneGraph, carriers: Mapping[str, str], color: Color | None) -> list[Skinned]:
        """Put the visuals below the nodes of their joints; all in one colour if there is one."""
        found = []
        for number, one in enumerate(self.drawn):
            path = f"{carriers[one.joint]}/visual {number}"
            shown = one.color if color is None else color
            if isinstance(one.shape, tuple):
                vertices, faces = one.shape
                graph.put(path, drawing.mesh(vertices, faces, path, shown))
            else:
                graph.put(path, drawing.piece(one.shape, path, shown))
            graph.place(path, one.placement)
            found.append(Skinned(path, one.link, shown))
        return found


@dataclass(frozen=True)
class Body:
    """One drawn piece."""

    carrier: str  # node of its joint
    path: str  # of the piece below that
    joint: int
    thing: str | None  # name of its object; None for a piece of the figure
    color: Color  # without contact
    plate: bool  # whether it is a half-space, which is drawn as a plate
    corners: Array  # (8, 3) of the box around it, in its own axes, metres

    def state_color(self, state: Color) -> Color:
        """Colour in contact: the figure's pieces take this colour, things are tinted, half-spaces keep theirs."""
        if self.plate:
            return self.color
        amount = LOOK.tint if self.thing is not None else 1.0
        return style.tinted(self.color, state, amount)


class DrawnFigure(NamedTuple):
    """A figure of which a surface, or the visuals of its file, are drawn in place of pieces."""

    prefix: str  # of its segments among the owners of pieces, and of its joints in the model
    root: str  # node of the surface, below the figure's or a ghost's
    visual: Skin | LinkVisuals  # the surface or the visuals
    nodes: Mapping[str, str]  # node of each joint that carries them
    color: Color | None  # of all of it; each patch's own if None

    def build(self, graph: SceneGraph, root: str = "", color: Color | None = None) -> list[Skinned]:
        """Put it in the scene graph, below the node `root`; in a colour if there is one."""
        nodes = {joint: root + path for joint, path in self.nodes.items()}
        paint = self.color if color is None else color
        if isinstance(self.visual, Skin):
            return self.visual.build(graph, root + self.root, nodes, paint)
        return self.visual.build(graph, nodes, paint)

    def owns(self, owner: str, things: Collection[str]) -> bool:
        """Whether it is drawn in place of the pieces of an owner."""
        if isinstance(self.visual, LinkVisuals):
            return owner.removeprefix(self.prefix) in self.visual.links and owner.startswith(self.prefix)
        return owner.startswith(self.prefix) if self.prefix else owner not in things


class Bodies:
    """The pieces of a scene in the scene graph, in order; some `see_through`, a figure's own with `pieces`."""

    def __init__(self, scene: ViewedScene, see_through: Collection[str], pieces: bool) -> None:
        self.scene = scene
        self.see_through = frozenset(see_through)
        self.revision = scene.revision
        self.all: list[Body] = []
        numbers = {name: number for number, name in enumerate(scene.objects)}
        names = scene.model.names
        for piece, owner in zip(scene.geometry.geometryObjects, scene.piece_owner, strict=True):
            thing = owner if owner in numbers else None
            color = self._thing_color(thing, numbers[thing], piece) if thing is not None else _own_color(piece)
            folder = f"{LOOK.object_node}/{node(thing)}" if thing is not None else LOOK.figure_node
            carrier = f"{folder}/{node(names[piece.parentJoint])}"
            plate = type(piece.geometry).__name__ == "Halfspace"
            path, corners = f"{carrier}/{node(piece.name)}", box_corners(piece.geometry)
            self.all.append(Body(carrier, path, int(piece.parentJoint), thing, color, plate, corners))
        self.carriers = {body.carrier: body.joint for body in self.all}
        self.pieces = pieces
        # the figures of which a surface or visuals are drawn in place of pieces
        self.drawn = () if pieces else tuple(self._drawn_figures())
        self._owned = frozenset(
            owner for owner in scene.piece_owner for figure in self.drawn if figure.owns(owner, numbers)
        )
        self._patches: list[tuple[str, Skinned]] = []
        shown = [index for index, body in enumerate(self.all) if body.thing is not None and not self.hidden(index)]
        colors = [body.color for body in self.all]
        # of a crowd are opaque things that the world carries
        standing = [k for k in shown if self.all[k].joint == 0 and not self.all[k].plate and colors[k][3] == 1.0]
        self._things = shown
        self._crowds = crowds(LOOK.object_node, standing, list(scene.geometry.geometryObjects), colors)
        self._among = {
            index: (crowd.path, k) for crowd in self._crowds for k, index in enumerate(crowd.members.tolist())
        }
        for index in self._among:  # no node of its own
            self.carriers.pop(self.all[index].carrier, None)

    def _drawn_figures(self) -> Iterator[DrawnFigure]:
        """The figures that have a surface or visuals; their joints' nodes join the carriers."""
        scene = self.scene
        skinned: tuple[str, ...] = ()
        members = getattr(scene.figure, "members", {})
        if isinstance(scene, ViewedAssembly):
            figures = scene.figures
        else:
            figures = {name: (one.figure, None) for name, one in members.items() if surface_of(one.figure) is not None}
            skinned = tuple(f"{name}/" for name in figures)
            figures |= {"": (scene.figure, None)}  # what has no surface, where it stands among the others
        for name, (figure, color) in figures.items():
            surface = surface_of(figure)
            visual: Skin | LinkVisuals | None = None
            if surface is not None:
                visual = Skin(surface, figure, members[name].at.homogeneous if name in members else np.eye(4))
            elif isinstance(figure, Figure) and figure.visual is not figure.geometry:
                visual = LinkVisuals(figure, skinned)
            if visual is None:
                continue
            prefix = f"{name}/" if name else ""
            folder = f"{LOOK.figure_node}/{node(name)}" if name else LOOK.figure_node
            nodes = {joint: f"{folder}/{node(joint)}" for joint in visual.joints}
            for joint, path in nodes.items():
                self.carriers[path] = joint_in(scene.model, prefix, joint)
            yield DrawnFigure(prefix, f"{folder}/body", visual, nodes, color)

    def _thing_color(self, thing: str, number: int, piece: Any) -> Color:
        given = getattr(self.scene.objects[thing], "color", None)
        if given is not None:
            color: Color = tuple(float(part) for part in given)  # type: ignore[assignment]
        elif type(piece.geometry).__name__ == "Halfspace":
            upward = float((piece.placement.rotation @ piece.geometry.n)[2]) > 0.9
            color = LOOK.floor if upward else style.with_opacity(style.object_color(number), LOOK.see_through)
        else:
            color = style.object_color(number)
        return style.with_opacity(color, LOOK.see_through) if thing in self.see_through else color

    def build(self, graph: SceneGraph) -> None:
        """Put every piece in the scene graph, in place of earlier ones."""
        graph.remove(LOOK.figure_node)
        graph.remove(LOOK.object_node)
        self._patches = [
            (f"{figure.prefix}{patch.segment}", patch) for figure in self.drawn for patch in figure.build(graph)
        ]
        for index, piece in enumerate(self.scene.geometry.geometryObjects):
            body = self.all[index]
            if self.hidden(index) or index in self._among:
                continue
            graph.put(body.path, drawing.piece(piece.geometry, body.path, body.color))
            graph.place(body.path, piece.placement.homogeneous)
        floor = next(
            (index for index, body in enumerate(self.all) if body.plate and body.color[:3] == LOOK.floor[:3]), None
        )
        graph.set("/Ground", "visible", floor is None)  # a plane for shadows if there is no floor
        grid = np.eye(4)
        if floor is not None:
            piece = self.scene.geometry.geometryObjects[floor]
            top = drawing.plate_placement(np.asarray(piece.geometry.n), float(piece.geometry.d))
            grid = piece.placement.homogeneous @ top
            grid[:3, 3] += grid[:3, 2] * LOOK.plate[2] / 2
        grid[:3, 3] += 0.0015 * grid[:3, 2]  # m: above the floor, otherwise the two flicker
        graph.place("/Grid", grid)

    def hidden(self, index: int) -> bool:
        """Whether a piece is not drawn: the surface of its body is, or it is an outer piece, which has no opacity."""
        body = self.all[index]
        return self.scene.piece_owner[index] in self._owned or (body.thing is None and body.color[3] == 0.0)

    def paint(self, keyframe: Keyframe, index: int, state: Color) -> None:
        """Give a piece the colour of a state, or what is drawn in its place; on a surface the page does it."""
        body = self.all[index]
        if index in self._among:
            path, number = self._among[index]
            keyframe.crowds[path] = keyframe.crowds[path].painted(number, body.state_color(state))
            return
        if not self.hidden(index):
            keyframe.colors[body.path] = body.state_color(state)
            return
        for owner, patch in self._patches:
            if patch.whole and owner == self.scene.piece_owner[index]:
                keyframe.colors[patch.path] = style.tinted(patch.color, state, LOOK.paint)

    def pose(self, keyframe: Keyframe, data: Any) -> None:
        """Place the joints by `data`, and the things at their present placements."""
        for path, joint in self.carriers.items():
            keyframe.transforms[path] = data.oMi[joint].homogeneous
        pieces = self.scene.geometry.geometryObjects
        for index in self._things:
            if index not in self._among:
                keyframe.transforms[self.all[index].path] = pieces[index].placement.homogeneous
        for index, place in in_joints(self.scene.geometry, data.oMi).items() if self.pieces else ():
            keyframe.transforms[self.all[index].path] = place
        for crowd in self._crowds:
            keyframe.crowds[crowd.path] = crowd.at(pieces)
        for index, body in enumerate(self.all):
            if not self.hidden(index) and index not in self._among:
                keyframe.colors[body.path] = body.color
        for _, patch in self._patches:
            keyframe.colors[patch.path] = patch.color

    def ghost(self, graph: SceneGraph, number: int, data: Any, color: Color) -> None:
        """Draw the figure and what it carries once more, transparent, at the posture of `data`."""
        root = f"{LOOK.ghost_node}/{number}"
        for figure in self.drawn:
            figure.build(graph, root, color)
            for path in figure.nodes.values():
                graph.place(f"{root}{path}", data.oMi[self.carriers[path]].homogeneous)
        for index, piece in enumerate(self.scene.geometry.geometryObjects):
            body = self.all[index]
            if (body.joint == 0 and body.thing is not None) or self.hidden(index):
                continue
            path = f"{root}{body.path}"
            graph.put(path, drawing.piece(piece.geometry, path, color))
            graph.place(path, piece.placement.homogeneous)
            graph.place(f"{root}{body.carrier}", data.oMi[body.joint].homogeneous)

    def pose_ghost(self, keyframe: Keyframe, data: Any) -> None:
        """Place the first ghost, which exists, at the posture of `data`."""
        for path, joint in self.carriers.items():
            if joint:
                keyframe.transforms[f"{LOOK.ghost_node}/0{path}"] = data.oMi[joint].homogeneous

    def corners(self, data: Any, *, things: bool) -> Array:
        """Corners (n, 3) in the world of boxes around the figure's pieces, or solid things that are no plates."""
        solid = [
            index
            for index, body in enumerate(self.all)
            if body.thing is None or (not body.plate and body.color[3] == 1.0)
        ]
        chosen = [index for index in solid if (self.all[index].thing is not None) == things]
        return self._boxes(chosen, data).reshape(-1, 3)

    def beyond(self, data: Any, pieces: Sequence[int], start: Array, way: Array) -> float:
        """How far a ray from a point (3,) along a unit vector (3,) is inside of the boxes around pieces, metres."""
        farthest = 0.0
        for index in pieces:
            body = self.all[index]
            place = data.oMi[body.joint] * self.scene.geometry.geometryObjects[index].placement
            along = place.rotation.T @ way
            along[np.abs(along) < 1e-9] = 1e-9
            ends = np.where(along > 0.0, body.corners.max(axis=0), body.corners.min(axis=0)) - place.actInv(start)
            if not body.plate:
                farthest = max(farthest, float((ends / along).min()))
        return farthest

    def tops(self, data: Any) -> dict[str, tuple[str, Array]]:
        """Labels of things: by node, the name and the top middle (3,) of its boxes; no half-spaces."""
        found: dict[str, list[Array]] = {}
        named = [index for index in self._things if not self.all[index].plate]
        for index, box in zip(named, self._boxes(named, data), strict=True):
            found.setdefault(str(self.all[index].thing), []).append(box)
        tops = {}
        for name, boxes in found.items():
            corners = np.concatenate(boxes)
            low, high = corners.min(axis=0), corners.max(axis=0)
            tops[f"{LOOK.name_node}/{node(name)}"] = (name, np.array([*(low + high)[:2] / 2, high[2]]))
        return tops

    def color_segments(self, keyframe: Keyframe, colors: Mapping[str, Color]) -> None:
        """Give the pieces and the surface of segments their colours (segment -> colour)."""
        for index, body in enumerate(self.all):
            owner = self.scene.piece_owner[index] if body.thing is None and colors else ""
            if owner in colors and body.path in keyframe.colors:
                keyframe.colors[body.path] = colors[owner]
        for owner, patch in self._patches:
            if owner in colors:
                keyframe.colors[patch.path] = colors[owner]

    def _boxes(self, indices: Sequence[int], data: Any) -> Array:
        """Corners (k, 8, 3) in the world of the boxes around pieces."""
        pieces = self.scene.geometry.geometryObjects
        places = [data.oMi[self.all[index].joint] * pieces[index].placement for index in indices]
        turns = np.array([place.rotation for place in places]).reshape(-1, 3, 3)
        origins = np.array([place.translation for place in places]).reshape(-1, 1, 3)
        corners = np.array([self.all[index].corners for index in indices]).reshape(-1, 8, 3)
        return np.asarray(corners @ np.swapaxes(turns, 1, 2) + origins)


def _own_color(piece: Any) -> Color:
    """The colour that a robot's file gives the link of a piece, and otherwise that of figures."""
    own = piece.overrideMaterial or not piece.meshColor[3] > 0.0
    red, green, blue, alpha = (float(part) for part in (piece.meshColor if own else LOOK.figure))
    return red, green, blue, alpha


def node(name: str) -> str:
    """A name as a node of the page's tree, where a slash would begin a child."""
    return name.replace("/", "|")


def scene_glb(scene: ViewedScene, bodies: Bodies, postures: Array, dt: float, title: str) -> bytes:
    """What `bodies` draw at postures (n, nq), `dt` seconds apart: y up, z forward; nodes `joint NAME`, `piece NAME`."""
    from wholebody.motion.files.gltf import JointTree

    tree = JointTree(scene.model, postures, dt)
    for figure in bodies.drawn:
        if isinstance(figure.visual, Skin):
            name = figure.prefix.strip("/") or str(scene.figure.name)
            tree.skin(name, figure.visual.surface, figure.visual.places, figure.prefix, figure.color)
        else:
            tree.visuals(figure.visual.drawn, figure.prefix, figure.color)
    data = scene.model.createData()
    pin.forwardKinematics(scene.model, data, postures[0])
    flesh = in_joints(scene.geometry, data.oMi)  # it does not spread within a motion there
    for index, (piece, body) in enumerate(zip(scene.geometry.geometryObjects, bodies.all, strict=True)):
        if not bodies.hidden(index):
            at = flesh.get(index, piece.placement.homogeneous)
            tree.piece(f"piece {piece.name}", body.joint, at, piece.geometry, body.color)
    return tree.builder.glb(title)
