"""Files that are mutated: small ones of every kind that people give to the package, each right as it stands."""

from __future__ import annotations

import json
from collections.abc import Mapping

CUBE = """\
# a box of 0.2 m
o box
v -0.1 -0.1 -0.1
v 0.1 -0.1 -0.1
v 0.1 0.1 -0.1
v -0.1 0.1 -0.1
v -0.1 -0.1 0.1
v 0.1 -0.1 0.1
v 0.1 0.1 0.1
v -0.1 0.1 0.1
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
"""
STL = """\
solid tetrahedron
facet normal 0 0 -1
outer loop
vertex 0 0 0
vertex 0 0.1 0
vertex 0.1 0 0
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 0
vertex 0.1 0 0
vertex 0 0 0.1
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 0
vertex 0 0 0.1
vertex 0 0.1 0
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 0.1 0 0
vertex 0 0.1 0
vertex 0 0 0.1
endloop
endfacet
endsolid tetrahedron
"""
ROBOT = """\
<?xml version="1.0" encoding="utf-8"?>
<robot name="two joints">
  <link name="base">
    <inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="2.0"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.05"/><geometry><cylinder radius="0.05" length="0.1"/></geometry></collision>
  </link>
  <link name="arm">
    <inertial><mass value="1.0"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0.15" rpy="0 0 0"/><geometry><box size="0.04 0.05 0.26"/></geometry></collision>
  </link>
  <link name="hand">
    <inertial><mass value="0.5"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><mesh filename="part.obj" scale="0.3 0.3 0.3"/></geometry></collision>
    <collision><origin xyz="0 0 0.05"/><geometry><sphere radius="0.02"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 0.12" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2.0" upper="2.0" effort="10" velocity="3"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="arm"/><child link="hand"/><origin xyz="0 0 0.33"/><axis xyz="0 0 1"/>
    <limit lower="0.0" upper="0.1" effort="10" velocity="1"/>
  </joint>
</robot>
"""
TASK = """\
# every kind of thing, goal and constraint, about a small robot
title = "everything"
clearance = 0.004
touching = [["hand", "ball"]]

[figure]
path = "robot.urdf"
root = "fixed"

[start]
posture = "neutral"
joints = { turn = 0.5 }

[[object]]
name = "box"
shape = "box"
size = [0.1, 0.2, 0.3]
at = [2, 0, 0, 0.0, 0.0, 0.7071067811865476, 0.7071067811865476]
color = [1, 0, 0]

[[object]]
name = "ball"
shape = "sphere"
radius = 0.1
at = [3, 0, 0]

[[object]]
name = "rod"
shape = "capsule"
radius = 0.05
length = 0.4
at = [[1, 0, 0, 2], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]]

[[object]]
name = "egg"
shape = "ellipsoid"
semi_axes = [0.1, 0.2, 0.3]
at = [4, 0, 0]

[[object]]
name = "ground"
shape = "halfspace"
offset = -1.0

[[object]]
name = "wedge"
shape = "hull"
points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
at = [5, 0, 0]

[[object]]
name = "part"
shape = "mesh"
path = "part.obj"
scale = 0.5
up = "y"
at = [6, 0, 0]

[[attach]]
name = "tool"
to = "hand"
shape = "box"
size = [0.02, 0.03, 0.04]
at = [0, 0, 0.1]

[[goal]]
type = "point"
frame = "hand"
target = [0.2, 0, 0.4]
offset = [0, 0, 0.05]
weight = 2

[[goal]]
type = "axis"
frame = "hand"
axis = [0, 0, 1]
toward = [3, 0, 0]

[[goal]]
type = "center_of_mass"
target = [0, 0, 0.3]
axes = "xy"

[[constraint]]
type = "hold"
frame = "base"
orientation = false

[[constraint]]
type = "plane"
frame = "arm"
normal = [0, 1, 0]
side = "above"

[[constraint]]
type = "freeze"
joints = ["slide"]

[[measure]]
type = "effort"

[[measure]]
type = "discomfort"
weight = 0.1

[method]
name = "qp"
tolerance = 1e-7
iterations = 50

[view]
eye = [1, 2, 3]
target = [0, 0, 1]
see_through = ["box"]
"""
JOINTS = ("turn", "slide")


def task() -> dict[str, bytes]:
    """A task with what it names."""
    return {"task.toml": TASK.encode(), **robot()}


def robot() -> dict[str, bytes]:
    """A robot with its mesh."""
    return {"robot.urdf": ROBOT.encode(), "part.obj": CUBE.encode()}


def track() -> dict[str, bytes]:
    """A track of the robot."""
    lines = [",".join(("time", *JOINTS))]
    lines += [",".join((repr(frame * 0.05), repr(0.1 * frame), repr(0.01 * frame))) for frame in range(8)]
    return {"track.csv": ("\n".join(lines) + "\n").encode(), **robot()}


def result() -> dict[str, bytes]:
    """A result of the task."""
    said: Mapping[str, object] = {
        "wholebody": "0.0",
        "task": "task.toml",
        "title": "everything",
        "status": "solved",
        "goals": [{"name": "point hand", "distance": 0.0, "angle": None}],
        "assessment": {"goal_error": 0.0, "least_distance": None},
        "joints": {"turn": 0.5, "slide": 0.05},
        "q": [0.5, 0.05],
    }
    return {"result.json": json.dumps(said, indent=2).encode(), **task()}
