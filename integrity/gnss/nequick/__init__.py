"""The ionosphere of Galileo's single-frequency users: NeQuick-G."""
