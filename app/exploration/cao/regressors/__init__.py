"""What CAO's estimator can be linear in."""
