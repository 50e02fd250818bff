"""A mission flown ahead, over sea floors that are guessed: what is to be expected of it."""
