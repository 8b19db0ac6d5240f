"""The UBX protocol of u-blox receivers: frames, measurements, navigation words, the receiver's own status."""
