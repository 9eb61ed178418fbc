"""Measures the check of folders of trees."""
