"""What the satellites say of themselves: orbits, clocks and the ionosphere, from the words of LNAV, I/NAV, F/NAV, D1, D2 and GLONASS."""
