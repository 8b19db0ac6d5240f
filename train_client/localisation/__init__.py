"""Where the train is, and what may be believed of it: bytes of antennas and health from the ground in, positions out."""
