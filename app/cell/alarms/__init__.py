"""Alarms after ISA-18.2 and IEC 62682: their states, what raises them, and the acts on them."""
