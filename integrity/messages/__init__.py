"""The contract in bytes: `wayside.proto`, its generated module, and the conversion to and from the core's own types."""
