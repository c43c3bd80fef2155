"""Readings that arrive one by one: frames on a serial line, their forces, and records of them."""
