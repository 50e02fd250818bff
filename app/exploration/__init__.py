"""Where every vehicle goes next. Pure: numpy in, numpy out; random generators are passed in.

``core``, ``motion`` and ``communication`` are what planners share, ``planner`` is what a planner is, ``survey`` the
plan of lines that ``cao`` weighs its moves by, and each other folder a family of planners. ``planners`` has their
names: adding one is a class derived from ``planner.base.PlannerBase`` and a line there.
"""

import app.compiled.index  # noqa: F401 - before anything compiled is imported

DEFAULT_PLANNER = "cao"
"""Of surveys, unless an operator asks for another one."""
