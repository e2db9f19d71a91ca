"""Diagnosis: locate a mismatch between recordings and twin, name the missing physics, prove it helps.

Knows recordings and benches, never a simulator.
"""
