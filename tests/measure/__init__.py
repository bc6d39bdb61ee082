"""What the daemon costs, and how regularly it is heard: make bench (see README.md)."""
