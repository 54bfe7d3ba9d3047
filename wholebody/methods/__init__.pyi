from collections.abc import Mapping

from wholebody.methods.ccd.method import CCD as CCD
from wholebody.methods.damped_least_squares import DampedLeastSquares as DampedLeastSquares
from wholebody.methods.newton.assembly_system import AssemblySolution as AssemblySolution
from wholebody.methods.newton.method import Newton as Newton
from wholebody.methods.newton.own_rows import AssemblyConstraint as AssemblyConstraint
from wholebody.methods.placo.method import Placo as Placo
from wholebody.methods.qp.method import QP as QP

METHODS: Mapping[str, str]
EXTRAS: dict[str, str]

def installed_methods() -> tuple[str, ...]: ...
