"""Moving targets of a mission: filters over ranges, and what operators are shown of them."""
