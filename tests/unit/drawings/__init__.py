"""Tests of cutting patterns as drawings: what is written, what programs make of it, and what is read back."""
