"""The real daemon between the models on this machine (see README.md)."""
