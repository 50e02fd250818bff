"""What a planner is: ``base.PlannerBase``, the options operators may set, and the simplest one, random moves."""
