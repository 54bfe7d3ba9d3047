from wholebody.dynamics.coupling import Spring as Spring
from wholebody.scene.matter.body import BallJoint as BallJoint, Hinge as Hinge
from wholebody.scene.matter.body import Material as Material
