"""The track: its map, what is wrong with a map, the path that an antenna takes over it, and a picture of it."""
