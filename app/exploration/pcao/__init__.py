"""PCAO18: a controller that was trained beforehand; a step's decision is a product of matrices."""
