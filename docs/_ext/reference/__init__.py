"""The pages of the reference that are made from the code when the site is built.

Each module but `directive` returns one as Markdown; `directive` lays it on its page.
"""
