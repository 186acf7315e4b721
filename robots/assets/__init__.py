"""Where robot files come from: the local copy, and the sources that it is filled from."""
