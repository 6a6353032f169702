"""Diagnosis: causes of readings and symptoms, ranked by their posterior probability."""
