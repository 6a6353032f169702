"""Commands that are no analyses, one module per task; `warpspace.cli.main` lists them.

They import the code that they run when they run, so that help is instant.
"""
