"""What keeps vehicles safe on their way: the last check of waypoints, depths of travel, and room in the area.

The limits themselves are the mission's; :mod:`app.exploration.core.constraints` says what breaks them.
"""
