"""Routes of missions: their life, vehicles, orders, searches, targets, alarms, and the live view."""
