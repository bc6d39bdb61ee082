"""How make runs the levels of the tests, what it sums up, and the rules that make check holds."""
