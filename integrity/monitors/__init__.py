"""One file per family of checks; each is a pure function over a block of epochs."""
