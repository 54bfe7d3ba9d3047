from wholebody.studies.accommodation import Accommodation as Accommodation
from wholebody.studies.many import SolveProgress as SolveProgress
from wholebody.studies.reach_result import ReachMap as ReachMap
from wholebody.studies.records import Records as Records, SolveRecord as SolveRecord
