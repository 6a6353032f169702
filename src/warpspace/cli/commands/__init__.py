"""The commands that are made from no analysis, one module a task; `warpspace.cli.main` lists them.

A command imports what it needs when it runs, so that help is instant.
"""
