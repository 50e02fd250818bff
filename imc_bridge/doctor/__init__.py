"""What is wrong with a network, by cause and remedy: live, probing, or from a recording."""
