"""Proofs that can be rerun in any number: each row of docs/reliability.md is a module here."""
