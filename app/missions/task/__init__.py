"""What a mission's description asks for, as planners take it: limits, planner, swaths and ways.

Everything follows from :class:`app.missions.spec.mission.MissionSpec` alone; the flight, the checklist and the forecast
go by the same. Others use ``constraints.make_constraints``, ``planner.make_planner``, ``swath.swath_task`` and ``way``.
"""
