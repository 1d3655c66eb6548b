"""One run from request to report: preparation, closed loop, files, and a dm_env environment."""

from fulcrum.sim.run.crosscheck import Bounds, Crosscheck
from fulcrum.sim.run.execute import PACKAGES, Request, Result
from fulcrum.sim.run.files import check_new_folder, claim_folder, finite, write_json
from fulcrum.sim.run.preparation import Preparation, UnholdableError, prepare
from fulcrum.sim.run.trial import confirm
from fulcrum.sim.run.workers import LOCAL, Workers, cluster
