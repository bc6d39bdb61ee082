"""The appliance in an emulated machine, judged from outside: see README.md."""
