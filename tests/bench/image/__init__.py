"""Builds the disk that the bench boots: python3 -m bench.image (see README.md)."""
