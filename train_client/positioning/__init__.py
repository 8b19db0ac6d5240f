"""Where the antennas of a train are on its track: memoryless steps on blocks of observations."""
