"""What the satellites say of themselves: orbits, clocks and the ionosphere, from the words of GPS LNAV and Galileo I/NAV."""
