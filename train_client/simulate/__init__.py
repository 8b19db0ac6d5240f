"""A railway that does not exist: a line, a train on it, and what receivers on ground and train send while fault follows fault."""
