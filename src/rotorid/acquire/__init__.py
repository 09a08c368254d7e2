"""Recorders and emulated instruments that write raw serial logs."""
