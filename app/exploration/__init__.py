"""Where every vehicle goes next. Pure: numpy in, numpy out; random generators are passed in.

``core`` is what all planners share, ``planner`` what a planner is, each other folder a family of planners, and
``planners`` their names: adding one is a class derived from ``planner.base.PlannerBase`` and a line there.
"""

import app.compiled_index  # noqa: F401 - before anything compiled is imported

DEFAULT_PLANNER = "cao"
"""Of surveys, unless an operator asks for another one."""
