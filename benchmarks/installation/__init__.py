"""Installing as an operator does, on a root file system made of Debian's packages; needs root and mmdebstrap."""
