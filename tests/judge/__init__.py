"""An independent receiver of Direct Remote ID: it listens, decodes and judges.

It shares no code with the transmitter: its decoder is written from the
published layout (ASTM F3411 / ASD-STAN EN 4709-002, as the open references
describe it).  ``python3 -m judge --help`` says how to use it.
"""
