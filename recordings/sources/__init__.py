"""Where the receivers' bytes come from: an address, the link that it opens, and the thread that listens to it."""
