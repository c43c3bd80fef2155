"""Validation: closed forms, published numbers, extreme cases, error estimates, comparison of models."""
