"""Models of what the bench hasn't got: radios, their chips, hostapd, an autopilot (see README.md)."""
