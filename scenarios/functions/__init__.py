"""The commands as functions of Python, and the checked requests that both are made of."""

from fulcrum.scenarios.functions.calls import (
    capacity,
    check,
    explain,
    make_environment,
    place,
    plan,
    run,
    sweep,
)
from fulcrum.scenarios.functions.requests import (
    chosen_control,
    chosen_engine,
    chosen_planning,
    drawn_world,
    prepared_request,
    sweep_design,
)
