"""Updates of the appliance in the bench's machine (see README.md)."""
