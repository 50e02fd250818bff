"""What every planner works with: the problem, its constraints, the bottom, routes, the objective."""
