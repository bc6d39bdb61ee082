"""Buildroot's layer and what makes the disk of it, as far as that can be checked without building."""
