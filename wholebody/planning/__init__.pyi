from wholebody.planning.distinct_solutions import Solutions as Solutions, solutions as solutions
from wholebody.planning.planner import Plan as Plan, plan as plan
from wholebody.planning.timing import Pace as Pace
