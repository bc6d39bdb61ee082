"""The companion's package and container: what is in them, what becomes of a system by them, whom the doctor finds."""
