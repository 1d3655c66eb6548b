"""Planning before a run: problems along the path, robust grip, planned tilts."""

from fulcrum.sim.planning.execution import Execution, Planning, made_plan, planned_tilt
from fulcrum.sim.planning.file import plan_content
from fulcrum.sim.planning.path_problems import PathProblems
from fulcrum.sim.planning.plan import Plan, PlanError
from fulcrum.sim.planning.problem import Margins, own_margins
from fulcrum.sim.planning.robust_grip import borne, plan_grip
